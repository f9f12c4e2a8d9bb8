"""What a campaign costs its devices: MapSense, GraMap and No Processing on the same scans."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from prefect import flow
from prefect.futures import PrefectFuture

from flows import progress, stages
from flows.plans import plan_source
from flows.request import Request
from flows.runner import threads
from storage.artifacts import Place, read
from storage.campaign import FILE, CampaignScan, CampaignStorey, read_campaign
from storage.errors import InputError
from storage.plan_geojson import read_plan
from storage.quality import QUALITY
from storage.room_errors import ROOM_ERRORS
from storage.runs import COMPLETED, ENERGY, PARTIAL, recorded
from storage.sources import Source
from storage.streams import STREAMS
from tasks.device.codec import CodecParams
from tasks.device.work import Tally
from tasks.evaluation.rooms import EvaluateParams
from tasks.scans.sources import find_sources

GRAMAP = CodecParams(profile="low")
"""GraMap compresses all points at the low profile."""
PER_SCAN = 12
"""Stages of one scan: its device side, its mapping alone, and the comparison with the truth."""
WHOLE = "campaign"
"""Stands for a storey where all of them together are meant."""


class EnergyRequest(Request):
    """Charge the methods for the scans of a campaign.

    Its results are kept under a building's name of their own: each scan is mapped alone here.
    """

    folder: str
    """Folder of the campaign."""


@flow(name=ENERGY, flow_run_name="{request.building}", task_runner=threads())
def measure_energy(request: EnergyRequest) -> None:
    """Count each scan's work and bytes, map each alone, and charge the methods (Fig. 19)."""
    campaign = read_campaign(Path(request.folder))
    params = request.params
    if WHOLE in {storey.storey for storey in campaign.storeys}:
        problem = f"a storey is called '{WHOLE}', which stands for all of them"
        raise InputError(Path(request.folder) / FILE, problem, "give the storey another name")
    tallies = [row for storey in campaign.storeys for row in _storey(request, storey)]
    place = request.place_of(WHOLE)
    with recorded(request.store, request.begun(ENERGY, WHOLE)) as record:
        work = stages.scan_work(place, params.work.model_copy(update={"scans": tuple(tallies)}))
        energy = stages.energy(place, work, params.energy)
        stages.savings(place, energy)
        stages.energy_sweep(place, work, params.energy, params.sweep)
        stages.energy_targets(place, work, params.energy, params.targets)
        record.end(COMPLETED, "")


def _storey(request: EnergyRequest, storey: CampaignStorey) -> list[Tally]:
    """Return what was counted of each scan of a storey; one that cannot be read is left out."""
    folder = Path(request.folder)
    scans = {scan.scan: scan for scan in storey.scans}
    sources, errors = find_sources([folder / scan.path for scan in storey.scans])
    truth = _truth(folder, storey)
    place = request.place_of(storey.storey)
    progress.expect(place, PER_SCAN * len(sources))
    with recorded(request.store, request.begun(ENERGY, storey.storey)) as record:
        made = {s.name: _submit(request, place.of_scan(s.name), s, truth, scans) for s in sources}
        tallies, failed = [], [error.path for error in errors]
        for name, futures in made.items():
            tally = _tally(request, storey.storey, scans[name], futures)
            tallies += [tally] if tally else []
            failed += [] if tally else [name]
        record.end(PARTIAL if failed else COMPLETED, _left_out(failed))
    return tallies


def _submit(
    request: EnergyRequest,
    place: Place,
    source: Source,
    truth: Source,
    scans: dict[str, CampaignScan],
) -> dict[str, PrefectFuture[Any]]:
    """Hand one scan's stages to the task runner: its device side, and its mapping alone."""
    p = request.params
    clouds = stages.clouds.submit(place, source, p.scans)
    quality = stages.quality.submit(place, clouds, p.quality)
    voxels = stages.voxels.submit(place, clouds, p.voxels)
    streams = stages.streams.submit(place, voxels, p.codec)
    gramap = stages.streams.submit(place, clouds, GRAMAP)
    points = stages.decoded.submit(place, streams)
    planes = stages.planes.submit(place, points, p.hough)
    segments = stages.segments.submit(place, points, clouds, planes, planes, p.filter)
    space = stages.occupancy.submit(place, points, p.occupancy)
    faces = stages.faces.submit(place, [segments], p.label)
    rooms = stages.rooms.submit(place, faces, faces, [space], p.intersect)
    asked = EvaluateParams(rooms=(scans[source.name].room,))
    errors = stages.room_errors.submit(place, rooms, truth, asked)
    return {"quality": quality, "streams": streams, "gramap": gramap, "errors": errors}


def _tally(
    request: EnergyRequest, storey: str, scan: CampaignScan, futures: dict[str, PrefectFuture[Any]]
) -> Tally | None:
    """Return what was counted of a scan; None if its device side failed."""
    done = {name for name, future in futures.items() if _is_done(future)}
    if not done >= {"quality", "streams", "gramap"}:
        return None
    store = request.store
    quality = read(QUALITY, futures["quality"].result(), store)
    stream = read(STREAMS, futures["streams"].result(), store)
    gramap = read(STREAMS, futures["gramap"].result(), store)
    iou = 0.0  # what cannot be mapped at all is of no use
    if "errors" in done:
        iou = float(read(ROOM_ERRORS, futures["errors"].result(), store).iou[0])
    return Tally(
        storey=storey,
        room=scan.room,
        scan=scan.scan,
        volunteer=scan.volunteer,
        skill=scan.skill,
        duration_s=scan.duration_s,
        raw_points=scan.points,
        voxel_points=stream.points,
        snapshots=quality.snapshots,
        p_sum=quality.p_sum,
        bytes_mapsense=len(stream.data),
        bytes_gramap=len(gramap.data),
        iou=iou,
    )


def _is_done(future: PrefectFuture[Any]) -> bool:
    future.wait()
    return future.state.is_completed()


def _left_out(failed: Iterable[str]) -> str:
    names = ", ".join(failed)
    return f"left out, their device side failed: {names}" if names else ""


def _truth(folder: Path, storey: CampaignStorey) -> Source:
    """Return the true plan as a stage's input, once it is known to have every room asked for."""
    path = folder / storey.truth
    known = {room.id for room in read_plan(path).rooms}
    if unknown := [scan for scan in storey.scans if scan.room not in known]:
        problem = f"has no room '{unknown[0].room}', which scan '{unknown[0].scan}' is of"
        raise InputError(path, problem, "simulate the campaign again")
    return plan_source(path)
