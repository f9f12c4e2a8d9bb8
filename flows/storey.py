"""Map one storey: from its scans to its plan, top to bottom as in Fig. 2."""

from collections.abc import Iterable
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from prefect import flow
from prefect.futures import PrefectFuture
from prefect.states import Failed
from prefect.task_runners import ThreadPoolTaskRunner

from flows import progress, stages
from flows.initial_model import initial_plan
from flows.request import StoreyRequest
from flows.results import (
    Mapped,
    Skipped,
    summarise,
    write_results,
    write_summary,
)
from flows.settings import default_jobs
from storage.artifacts import Ref, read
from storage.coverage import COVERAGE
from storage.errors import StoreError
from storage.rooms import ROOMS
from storage.runs import FAILED, Run, recorded
from storage.scans import SCANS
from storage.sources import Source
from storage.stages import forget, reason
from storage.walls import WALLS
from tasks.scans.sources import find_sources


def threads(jobs: int | None = None) -> Any:
    """Return a task runner of a number of threads; None: one per processor."""
    return ThreadPoolTaskRunner(max_workers=jobs or default_jobs())


@flow(
    name="storey",
    flow_run_name="{request.building}/{request.storey}",
    task_runner=threads(),
)
def map_storey(request: StoreyRequest) -> Any:
    """Map one storey and return the summary; failed only if there is no plan at all."""
    started_at = datetime.now(UTC)
    run = Run(
        id=request.run,
        verb=request.verb,
        building=request.building,
        storey=request.storey,
        asked=request.model_dump_json(),
        started_at=started_at,
    )
    with recorded(request.store, run) as record:
        try:
            summary = _run(request, started_at)
        except Exception as error:
            # no summary of an earlier run may speak for this one
            with suppress(StoreError):
                write_summary(request, summarise(request, None, [], reason(error), started_at))
            raise
        record.end(summary["state"], summary["message"])
    forget(request.place())
    return Failed(message=summary["message"]) if summary["state"] == FAILED else summary


def _run(request: StoreyRequest, started_at: datetime) -> dict[str, Any]:
    """Map the storey, write what was found, and return its summary."""
    sources, errors = find_sources([Path(path) for path in request.scans])
    skipped = [Skipped(error.path, reason(error)) for error in errors]
    mapped = _map(request, sources, skipped) if sources else None
    if mapped is not None:
        write_results(request, mapped)
    message = _message(len(sources) + len(errors), skipped, mapped)
    summary = summarise(request, mapped, skipped, message, started_at)
    write_summary(request, summary)
    return summary


def _map(request: StoreyRequest, sources: list[Source], skipped: list[Skipped]) -> Mapped | None:
    """Map the storey from the scans that can be used; None if there is none."""
    place, params = request.place(), request.params
    scans = {source.name: place.of_scan(source.name) for source in sources}
    progress.expect(place, len(stages.PER_SCAN) * len(scans) + len(stages.PER_STOREY))

    # one stage after the other over all scans: a worker that takes a task finds its inputs made
    clouds = {s.name: stages.clouds.submit(scans[s.name], s, params.scans) for s in sources}
    planes = {n: stages.planes.submit(scans[n], clouds[n], params.hough) for n in scans}
    segments = {
        n: stages.segments.submit(
            scans[n], clouds[n], clouds[n], planes[n], planes[n], params.filter
        )
        for n in scans
    }
    occupancy = {n: stages.occupancy.submit(scans[n], clouds[n], params.occupancy) for n in scans}
    made_of = {n: (clouds[n], planes[n], segments[n], occupancy[n]) for n in scans}
    used = [n for n in scans if _is_used(n, made_of[n], skipped)]
    if not used:
        return None

    faces = stages.faces(place, [segments[n].result() for n in used], params.label)
    space = [occupancy[n].result() for n in used]
    rooms = stages.rooms(place, faces, faces, space, params.intersect)
    made: list[Ref] = [*faces, *rooms, *space]
    for n in used:
        made += [*clouds[n].result(), *planes[n].result(), segments[n].result()]
    return _mapped(request, used, made, _notes(request, used, skipped))


def _is_used(name: str, futures: Iterable[PrefectFuture[Any]], skipped: list[Skipped]) -> bool:
    """Wait for a scan's stages; note why it is skipped if one of them failed."""
    for future in futures:
        future.wait()
        if not future.state.is_completed():
            error = future.state.result(raise_on_failure=False)
            why = reason(error) if isinstance(error, BaseException) else future.state.message
            skipped.append(Skipped(name, why or future.state.name or "unknown"))
            return False
    return True


def _mapped(request: StoreyRequest, used: list[str], made: list[Ref], notes: list[str]) -> Mapped:
    refs: dict[str, list[Ref]] = {}
    for ref in made:
        refs.setdefault(ref.table, []).append(ref)
    store = request.store
    plan = initial_plan(
        request.building,
        request.storey,
        read(ROOMS, refs["rooms"][0], store),
        read(WALLS, refs["walls"][0], store),
        used,
        simulated=request.simulated,
        notes=notes,
    )
    return Mapped(
        plan,
        read(COVERAGE, refs["coverage"][0], store),
        tuple(read(SCANS, ref, store) for ref in refs["scans"]),
        {table: sum(ref.rows for ref in of_table) for table, of_table in refs.items()},
    )


def _notes(request: StoreyRequest, used: list[str], skipped: list[Skipped]) -> list[str]:
    notes = ["made from simulated scans"] if request.simulated else []
    if skipped:
        notes.append(f"made from {len(used)} of {len(used) + len(skipped)} scans")
    return notes


def _message(asked: int, skipped: list[Skipped], mapped: Mapped | None) -> str:
    """Return what a person should know of how the run ended."""
    reasons = "; ".join(f"{s.scan}: {_without(s.reason, s.scan)}" for s in skipped)
    if mapped is None:
        return f"none of {asked} scans could be used: {reasons}"
    if skipped:
        return f"{len(skipped)} of {asked} scans skipped: {reasons}"
    return "" if mapped.plan.rooms else "no room was found: see the drawing for what was seen"


def _without(reason: str, scan: str) -> str:
    return reason.removeprefix(f"{scan}: ")
