"""Run what the command line asks for: the store checked, Prefect served, progress shown."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from flows import progress
from flows.building import map_building, with_jobs
from flows.request import StoreyRequest
from flows.server import wait_until_up
from storage.errors import MapSenseError
from storage.runs import COMPLETED, Run, read_runs


def run_storey(request: StoreyRequest, jobs: int, show: bool) -> dict[str, Any]:
    """Map a storey; return its summary, or raise MapSenseError with why there is none."""
    with _engine(show):
        state = with_jobs(jobs)(request, return_state=True)
    return _outcome(request, state)


def run_buildings(requests: list[StoreyRequest], jobs: int, show: bool) -> list[dict[str, Any]]:
    """Map storeys of one or more buildings; return a summary of each, failed ones too."""
    by_building: dict[str, list[StoreyRequest]] = {}
    for request in requests:
        by_building.setdefault(request.building, []).append(request)
    with _engine(show):
        for building, storeys in by_building.items():
            map_building(building, storeys, jobs, return_state=True)
    return [_summary(request) for request in requests]


def is_done(summary: dict[str, Any]) -> bool:
    """Return whether all that was asked for was done."""
    return bool(summary["state"] == COMPLETED)


@contextmanager
def _engine(show: bool) -> Iterator[None]:
    from prefect.settings import PREFECT_FLOWS_HEARTBEAT_FREQUENCY, temporary_settings

    wait_until_up()
    # the heartbeat's thread sleeps a second before a flow may end
    with (
        temporary_settings({PREFECT_FLOWS_HEARTBEAT_FREQUENCY: None}),
        progress.shown(show),
    ):
        yield


def _outcome(request: StoreyRequest, state: Any) -> dict[str, Any]:
    if state.is_completed():
        return _summary(request)
    error = state.result(raise_on_failure=False)
    if isinstance(error, Exception) and not _recorded(request):
        raise error
    run = _recorded(request)
    message = run.message if run is not None else state.message
    failure = MapSenseError(f"{request.building}/{request.storey}: {message}")
    raise failure from (error if isinstance(error, BaseException) else None)


def _summary(request: StoreyRequest) -> dict[str, Any]:
    """Return a run's summary, or what the store knows of one that ended without."""
    run = _recorded(request)
    path = request.folder() / "summary.json"
    if path.is_file():
        summary: dict[str, Any] = json.loads(path.read_text("utf-8"))
        if summary["run"] == request.run:
            return summary
    return {
        "building": request.building,
        "storey": request.storey,
        "state": run.state if run is not None else "failed",
        "message": run.message if run is not None else "it could not be started",
        "run": request.run,
    }


def _recorded(request: StoreyRequest) -> Run | None:
    runs = read_runs(request.store, request.building, request.storey)
    return next((run for run in runs if run.id == request.run), None)
