"""The demo: a small simulated storey, scanned, mapped, and compared with its truth."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from flows.campaign import Site, record_scans
from storage.detections import IOU
from storage.plan import Plan, PlanRoom
from storage.plan_geojson import write_plan
from tasks.evaluation.detections import EvaluationParams, detect
from tasks.evaluation.rooms import ious, match
from tasks.simulation.campaign import CampaignParams
from tasks.simulation.mesh import storey_mesh
from tasks.simulation.plan import StoreyParams, make_storey
from tasks.simulation.sensor import SensorParams
from tasks.simulation.volunteers import VolunteerParams

BUILDING, STOREY = "demo", "0"
AGAIN = 3
"""Rooms of the demo that a second volunteer scans too."""


COMPARED = ("door", "window", "table", "chair")
"""The objects of the demo that are compared."""


@dataclass(frozen=True)
class RoomMatch:
    """A simulated room and what was mapped of it."""

    room: str
    name: str
    truth_m2: float
    mapped_m2: float | None
    """None if it is matched with no mapped room"""
    iou: float
    """area of the intersection over that of the union; 0 if not mapped"""

    def as_json(self) -> dict[str, str | float | None]:
        """Return it for a summary."""
        return asdict(self)


def simulate(folder: Path, seed: int, told: Callable[[str], None]) -> tuple[Plan, tuple[Path, ...]]:
    """Simulate a furnished storey and its scans into a folder; return the truth and the scans."""
    truth = make_storey(StoreyParams(seed=seed), BUILDING, STOREY)
    write_plan(truth, folder / "truth.geojson")
    site = Site(truth, storey_mesh(truth))
    params = small_campaign(seed, len(truth.rooms) + AGAIN)
    return truth, tuple(path for path, _ in record_scans(site, folder / "scans", params, told))


def small_campaign(seed: int, scans: int) -> CampaignParams:
    """Return scans by skilled volunteers, of fewer and sparser snapshots than Tango's."""
    return CampaignParams(
        seed=seed,
        scans=scans,
        skill=0.9,
        skill_spread=0.1,
        sensor=SensorParams(rays=12_000),
        volunteer=VolunteerParams(interval_s=1.0),
    )


def compare_rooms(truth: Plan, mapped: Plan) -> list[RoomMatch]:
    """Return what was mapped of each true room, matched one to one at the greatest IoU in all."""
    overlap = ious([r.polygon for r in mapped.rooms], [r.polygon for r in truth.rooms])
    return [
        _missed(room) if j < 0 else _match(room, mapped.rooms[j], float(overlap[j, i]))
        for i, (room, j) in enumerate(zip(truth.rooms, match(overlap), strict=True))
    ]


def compare_objects(truth: Plan, mapped: Plan) -> list[dict[str, str | int]]:
    """Return how many doors, windows, tables and chairs there are, were found, and are both.

    Doors and windows by an IoU over 0.5 on the wall, furniture by one over 0.25 of the footprints.
    """
    found = detect(mapped, truth, EvaluationParams(opening_iou=(0.5,), footprint_iou=(0.25,)))
    counts: list[dict[str, str | int]] = []
    for class_ in COMPARED:
        asked = (found.classes == class_) & (found.metrics == IOU)
        true, ours = found.true_ids[asked] != "", found.found_ids[asked] != ""
        numbers = {"true": int(true.sum()), "found": int(ours.sum())}
        counts.append({"object": class_, **numbers, "matched": int((true & ours).sum())})
    return counts


def _match(room: PlanRoom, found: PlanRoom, iou: float) -> RoomMatch:
    mapped_m2 = round(found.polygon.area, 2)
    return replace(_missed(room), mapped_m2=mapped_m2, iou=round(iou, 3))


def _missed(room: PlanRoom) -> RoomMatch:
    return RoomMatch(room.id, room.name or room.id, round(room.polygon.area, 2), None, 0.0)
