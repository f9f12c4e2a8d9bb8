"""Map one storey: from its scans to its plan, top to bottom as in Fig. 2."""

from collections.abc import Iterable
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import Any

from prefect import flow
from prefect.futures import PrefectFuture
from prefect.states import Failed

from flows import progress, stages
from flows.correction import correct
from flows.disturbance import disturbed
from flows.ended import why_ended
from flows.model import Made, final_plan, initial_plan, with_furniture, with_openings
from flows.objects import Objects, find_objects
from flows.request import StoreyRequest
from flows.results import (
    Corrected,
    Mapped,
    Skipped,
    UsedScan,
    summarise,
    write_results,
    write_summary,
)
from flows.runner import threads
from storage.artifacts import Ref, read
from storage.coverage import COVERAGE
from storage.errors import StoreError
from storage.furniture import FURNITURE
from storage.layout_rooms import LAYOUT_ROOMS
from storage.layout_walls import LAYOUT_WALLS
from storage.openings import OPENINGS
from storage.quality import QUALITY
from storage.rooms import ROOMS
from storage.runs import FAILED, recorded
from storage.scans import SCANS
from storage.snapshots import SNAPSHOTS
from storage.sources import Source
from storage.stages import forget, reason
from storage.walls import WALLS
from tasks.scans.sources import find_sources


@flow(
    name="storey",
    flow_run_name="{request.building}/{request.storey}",
    task_runner=threads(),
)
def map_storey(request: StoreyRequest) -> Any:
    """Map one storey and return the summary; failed only if there is no plan at all."""
    run = request.begun(request.verb, request.storey)
    with recorded(request.store, run) as record:
        try:
            summary = _run(request, run.started_at)
        except Exception as error:
            # no summary of an earlier run may speak for this one
            with suppress(StoreError):
                write_summary(request, summarise(request, None, [], reason(error), run.started_at))
            raise
        record.end(summary["state"], summary["message"])
    forget(request.place())
    return Failed(message=summary["message"]) if summary["state"] == FAILED else summary


def _run(request: StoreyRequest, started_at: datetime) -> dict[str, Any]:
    """Map the storey, write what was found, and return its summary."""
    sources, errors = find_sources([Path(path) for path in request.scans])
    skipped = [Skipped(error.path, reason(error)) for error in errors]
    mapped = None
    if sources:
        progress.expect(request.place(), stages.of_mapping(len(sources), request.params))
        mapped = map_scans(request, sources, skipped)
    if mapped is not None:
        write_results(request, mapped)
    message = ending(len(sources) + len(errors), skipped, mapped)
    summary = summarise(request, mapped, skipped, message, started_at)
    write_summary(request, summary)
    return summary


def map_scans(
    request: StoreyRequest, sources: list[Source], skipped: list[Skipped]
) -> Mapped | None:
    """Map the storey from the scans that can be used; None if there is none.

    Every stage is the flow's task runner's: storeys that are mapped at once share its workers.

    Parameters
    ----------
    skipped : list of Skipped
        Scans that could not be used are added, each with its reason.
    """
    place, params = request.place(), request.params
    at = {source.name: place.of_scan(source.name) for source in sources}

    # one stage after the other over all scans: a worker that takes a task finds its inputs made
    # on the device: registered snapshots, the quality gate, voxels, the octree stream (Sec. 3)
    clouds = {s.name: stages.clouds.submit(at[s.name], s, params.scans) for s in sources}
    quality = {n: stages.quality.submit(at[n], clouds[n], params.quality) for n in at}
    rated = {n: clouds[n] for n in at if _is_used(n, (clouds[n], quality[n]), skipped)}
    rejected = _rejected(request, {n: quality[n].result() for n in rated})
    sent = {n: cloud for n, cloud in rated.items() if n not in rejected}
    voxels = {n: stages.voxels.submit(at[n], sent[n], params.voxels) for n in sent}
    streams = {n: stages.streams.submit(at[n], voxels[n], params.codec) for n in sent}

    # on the server: what was decoded becomes planes, segments, and the initial model (Sec. 4.1)
    points = {n: stages.decoded.submit(at[n], streams[n]) for n in sent}
    planes = {n: stages.planes.submit(at[n], points[n], params.hough) for n in sent}
    segments = {
        n: stages.segments.submit(at[n], points[n], sent[n], planes[n], planes[n], params.filter)
        for n in sent
    }
    occupancy = {n: stages.occupancy.submit(at[n], points[n], params.occupancy) for n in sent}
    each = (voxels, streams, points, planes, segments, occupancy)
    used = [n for n in sent if _is_used(n, [future[n] for future in each], skipped)]
    if not used:
        skipped += [Skipped(n, why) for n, why in rejected.items()]
        return None
    segmented = [segments[n].result() for n in used]
    faces = stages.faces.submit(place, segmented, params.label).result()
    space = [occupancy[n].result() for n in used]
    rooms = stages.rooms.submit(place, faces, faces, space, params.intersect).result()

    faces, rooms = disturbed(place, params, faces, rooms)
    # the grammar corrects it: observations along reference lines, an HMM's rooms (Sec. 4.2)
    corrected = correct(place, params, faces, rooms, segmented)
    # what stands in its walls and rooms: doors and windows (Sec. 5), furniture (Sec. 6)
    decoded = [points[n].result() for n in used]
    eyes = [ref for n in used for ref in sent[n].result() if ref.table == SNAPSHOTS.table]
    objects = find_objects(place, params, corrected.made or rooms, decoded, eyes)

    made: list[Ref] = [*faces, *rooms, *space, *corrected.made, *objects.made]
    for n in used:
        made += [*sent[n].result(), quality[n].result(), streams[n].result()]
        made += [*planes[n].result(), segments[n].result()]
    scans = tuple(UsedScan(n, points[n].result(), segments[n].result()) for n in used)
    return _mapped(request, scans, made, corrected, objects, skipped, rejected)


def _rejected(request: StoreyRequest, rated: dict[str, Ref]) -> dict[str, str]:
    """Return the scans the quality gate keeps on their devices (Eq. 4), and why."""
    qualities = {n: read(QUALITY, ref, request.store) for n, ref in rated.items()}
    return {
        n: f"rejected on the device: P_sum {q.p_sum:.2f} > T_q {q.t_q:.2f}, {q.reason} "
        f"(quality.t_q sets what is asked for)"
        for n, q in qualities.items()
        if q.accepted is False
    }


def _is_used(name: str, futures: Iterable[PrefectFuture[Any]], skipped: list[Skipped]) -> bool:
    """Wait for a scan's stages; note why it is skipped if one of them failed."""
    for future in futures:
        future.wait()
        if not future.state.is_completed():
            skipped.append(Skipped(name, why_ended(future)))
            return False
    return True


def _mapped(
    request: StoreyRequest,
    used: tuple[UsedScan, ...],
    made: list[Ref],
    corrected: Corrected,
    objects: Objects,
    skipped: list[Skipped],
    rejected: dict[str, str],
) -> Mapped:
    refs: dict[str, list[Ref]] = {}
    for ref in made:
        refs.setdefault(ref.table, []).append(ref)
    store = request.store
    scans = tuple(read(SCANS, ref, store) for ref in refs["scans"])
    simulated = any(scan.simulated for scan in scans)
    notes = ["made from simulated scans"] if simulated else []
    if skipped or rejected:
        notes.append(f"made from {len(used)} of {len(used) + len(skipped) + len(rejected)} scans")
    rooms = read(ROOMS, refs["rooms"][0], store)
    walls = read(WALLS, refs["walls"][0], store)
    about = Made(request.building, request.storey, [s.name for s in used], simulated, notes)
    initial = final = initial_plan(rooms, walls, about)
    if corrected.made:
        *_, placed, around = corrected.made
        final = final_plan(
            read(LAYOUT_ROOMS, placed, store), read(LAYOUT_WALLS, around, store), about
        )
    for ref in objects.made:
        if ref.table == OPENINGS.table:
            final = with_openings(final, read(OPENINGS, ref, store))
        elif ref.table == FURNITURE.table:
            final = with_furniture(final, read(FURNITURE, ref, store))
    return Mapped(
        initial,
        final,
        corrected,
        objects.problems,
        read(COVERAGE, refs["coverage"][0], store),
        scans,
        tuple(read(QUALITY, ref, store) for ref in refs["quality"]),
        tuple(Skipped(scan, why) for scan, why in rejected.items()),
        {table: sum(ref.rows for ref in of_table) for table, of_table in refs.items()},
        used,
    )


def ending(asked: int, skipped: list[Skipped], mapped: Mapped | None) -> str:
    """Return what a person should know of how the run ended."""
    noted = (*mapped.problems, mapped.corrected.note) if mapped else ()
    ends = (_ending(asked, skipped, mapped), *noted)
    return "; ".join(end for end in ends if end)


def _ending(asked: int, skipped: list[Skipped], mapped: Mapped | None) -> str:
    reasons = "; ".join(f"{s.scan}: {_without(s.reason, s.scan)}" for s in skipped)
    if mapped is None:
        return f"none of {asked} scans could be used: {reasons}"
    if skipped:
        return f"{len(skipped)} of {asked} scans skipped: {reasons}"
    if mapped.rejected:
        return f"{len(mapped.rejected)} of {asked} scans rejected by the quality gate"
    return "" if mapped.plan.rooms else "no room was found: see the drawing for what was seen"


def _without(reason: str, scan: str) -> str:
    return reason.removeprefix(f"{scan}: ")
