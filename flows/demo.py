"""The demo: a small simulated storey, scanned, mapped, and compared with its truth."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

from storage.plan import Plan
from storage.plan_geojson import write_plan
from tasks.scans.bundle import write_bundle
from tasks.simulation.campaign import CampaignParams, simulate_scans
from tasks.simulation.plan import StoreyParams, make_storey
from tasks.simulation.sensor import SensorParams
from tasks.simulation.volunteers import VolunteerParams

BUILDING, STOREY = "demo", "0"
AGAIN = 3
"""Rooms of the demo that a second volunteer scans too."""


@dataclass(frozen=True)
class RoomMatch:
    """A simulated room and what was mapped of it."""

    room: str
    name: str
    truth_m2: float
    mapped_m2: float | None
    """None if no mapped room overlaps it most"""
    iou: float
    """area of the intersection over that of the union; 0 if not mapped"""

    def as_json(self) -> dict[str, str | float | None]:
        """Return it for a summary."""
        return asdict(self)


def simulate(folder: Path, seed: int, told: Callable[[str], None]) -> tuple[Plan, tuple[Path, ...]]:
    """Simulate a furnished storey and its scans into a folder; return the truth and the scans."""
    truth = make_storey(StoreyParams(seed=seed), BUILDING, STOREY)
    write_plan(truth, folder / "truth.geojson")
    scans = []
    for scan in simulate_scans(truth, _small_campaign(seed, len(truth.rooms) + AGAIN)):
        scans.append(folder / "scans" / f"{scan.name}.scan")
        write_bundle(scans[-1], scan.cloud, scan.snapshots, frame="device")
        told(f"simulated scan {scan.name}: {len(scan.cloud):,} points")
    return truth, tuple(scans)


def _small_campaign(seed: int, scans: int) -> CampaignParams:
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
    """Match each true room with the mapped room that shares most area with it, each once."""
    shared = sorted(
        (
            (true.polygon.intersection(found.polygon).area, i, j)
            for i, true in enumerate(truth.rooms)
            for j, found in enumerate(mapped.rooms)
        ),
        reverse=True,
    )
    partner: dict[int, tuple[int, float]] = {}
    taken: set[int] = set()
    for area, i, j in shared:
        if area > 0 and i not in partner and j not in taken:
            partner[i] = (j, area)
            taken.add(j)
    return [_match(truth, mapped, i, partner.get(i)) for i in range(len(truth.rooms))]


def _match(truth: Plan, mapped: Plan, i: int, partner: tuple[int, float] | None) -> RoomMatch:
    room = truth.rooms[i]
    area = room.polygon.area
    if partner is None:
        return RoomMatch(room.id, room.name or room.id, round(area, 2), None, 0.0)
    j, shared = partner
    found = mapped.rooms[j].polygon.area
    iou = shared / (area + found - shared)
    return RoomMatch(room.id, room.name or room.id, round(area, 2), round(found, 2), round(iou, 3))
