"""Run what the command line asks for: the store checked, Prefect served, progress shown."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from flows import logs, progress
from flows.building import map_building, with_jobs
from flows.energy import EnergyRequest, measure_energy
from flows.evaluation import EvaluationRequest, evaluate_storey
from flows.experiment import ExperimentRequest, run_experiment
from flows.outcomes import Outcome, RepeatsFailed
from flows.request import StoreyRequest
from flows.runner import task_runner
from flows.server import wait_until_up
from flows.settings import load_settings
from flows.summaries import read_summary
from flows.training import TrainRequest, train
from storage.catalog import Catalog
from storage.energy import STOREY
from storage.errors import MapSenseError
from storage.runs import COMPLETED, Run, read_runs
from storage.stages import reason

ENERGY_ANSWERS = {
    "simulated joules, one query a room": "energy_per_method",
    "saved by MapSense (simulated)": "energy_savings",
    "how far each assumption moves the saving": "energy_sensitivity",
    "what would bring the saving wanted": "energy_targets",
    "the quality gate by volunteer": "quality_by_volunteer",
    "the quality gate over T_q": "gate_curve",
}
"""The named queries that answer what a campaign costs, by title."""

SCORES = {
    "area of rooms": "area_error",
    "found and true": "recall_precision",
    "faces of walls": "wall_quality",
}
"""The named queries that answer how good a plan is, by title."""


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


def run_energy(request: EnergyRequest, jobs: int, show: bool) -> dict[str, pa.Table]:
    """Charge the methods for a campaign; return the answers people ask for, by title."""
    with _engine(show):
        charging: Any = measure_energy.with_options(task_runner=task_runner(jobs))
        state = charging(request, return_state=True)
    _raise_failure(state, request.building)
    of_rooms = {"building": request.building, "series": STOREY}  # not the accumulated ones
    return _answers(request.store, ENERGY_ANSWERS, of_rooms)


def left_out(request: EnergyRequest) -> list[str]:
    """Return for each storey of which scans were left out which ones."""
    runs = [r for r in read_runs(request.store, request.building) if r.id == request.run]
    return [f"{r.building}/{r.storey}: {r.message}" for r in runs if r.state != COMPLETED]


def run_evaluation(request: EvaluationRequest, show: bool) -> dict[str, pa.Table]:
    """Score a plan against its truth; return the answers people ask for, by title."""
    with _engine(show):
        state = evaluate_storey(request, return_state=True)
    _raise_failure(state, f"{request.building}/{request.storey}")
    place = {"building": request.building, "storey": request.storey}
    answers = _answers(request.store, SCORES, place)
    # a storey's plan is of no single scan
    return {title: answer.drop_columns(["scan"]) for title, answer in answers.items()}


def run_repeats(request: ExperimentRequest, jobs: int, show: bool) -> list[Outcome]:
    """Run an experiment; return what came of each repeat, failed ones too."""
    with _engine(show):
        at_once: Any = run_experiment.with_options(task_runner=task_runner(jobs))
        state = at_once(request, jobs, return_state=True)
    made = state.result(raise_on_failure=False)
    if isinstance(made, RepeatsFailed):
        return made.outcomes
    _raise_failure(state, request.name)
    outcomes: list[Outcome] = made
    return outcomes


def run_training(request: TrainRequest, show: bool) -> dict[str, Any]:
    """Train a classifier; return what came of it."""
    with _engine(show):
        state = train(request, return_state=True)
    _raise_failure(state, f"training of {request.kind}")
    summary: dict[str, Any] = state.result()
    return summary


def _raise_failure(state: Any, what: str) -> None:
    """Raise what stopped a flow, if it did not end well."""
    if state.is_completed():
        return
    error = state.result(raise_on_failure=False)
    raise error if isinstance(error, Exception) else MapSenseError(f"{what}: {state.message}")


def _answers(store: str, queries: dict[str, str], only: dict[str, str]) -> dict[str, pa.Table]:
    """Return the answers to named queries by title: rows of the values asked for, without these."""
    catalog = Catalog(store)
    answers = {}
    for title, name in queries.items():
        answer = catalog.query(name)
        for column in only.keys() & set(answer.column_names):
            answer = answer.filter(pc.equal(answer[column], only[column])).drop_columns([column])
        answers[title] = answer
    return answers


def is_done(summary: dict[str, Any]) -> bool:
    """Return whether all that was asked for was done."""
    return bool(summary["state"] == COMPLETED)


@contextmanager
def _engine(show: bool) -> Iterator[None]:
    from httpx import TransportError
    from prefect.settings import PREFECT_FLOWS_HEARTBEAT_FREQUENCY, temporary_settings

    wait_until_up()
    # the heartbeat's thread sleeps a second before a flow may end
    with (
        temporary_settings({PREFECT_FLOWS_HEARTBEAT_FREQUENCY: None}),
        progress.shown(show),
        logs.written(load_settings().log),
    ):
        try:
            yield
        except TransportError as error:
            raise MapSenseError(
                f"{os.environ['PREFECT_API_URL']}: Prefect's API does not answer any more "
                f"({error}); run again, what was computed is kept"
            ) from error


def _outcome(request: StoreyRequest, state: Any) -> dict[str, Any]:
    if state.is_completed():
        # not the file: another run of the storey may have written its own there since
        summary: dict[str, Any] = state.result()
        return summary
    error = state.result(raise_on_failure=False)
    if isinstance(error, Exception) and not _recorded(request):
        raise error
    run = _recorded(request)
    # of a run whose end could not be written, as on a full disk, the record knows nothing
    message = run.message if run is not None else ""
    message = message or (reason(error) if isinstance(error, Exception) else state.message)
    failure = MapSenseError(f"{request.building}/{request.storey}: {message}")
    raise failure from (error if isinstance(error, BaseException) else None)


def _summary(request: StoreyRequest) -> dict[str, Any]:
    """Return a run's summary, or what the store knows of one that ended without."""
    run = _recorded(request)
    summary = read_summary(request.folder(), request.run)
    return summary or {
        "building": request.building,
        "storey": request.storey,
        "state": run.state if run is not None else "failed",
        "message": run.message if run is not None else "it could not be started",
        "run": request.run,
    }


def _recorded(request: StoreyRequest) -> Run | None:
    runs = read_runs(request.store, request.building, request.storey)
    return next((run for run in runs if run.id == request.run), None)
