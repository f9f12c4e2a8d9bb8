"""A simulated campaign: volunteers of different skill scan the rooms of a storey."""

import zlib
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import shapely
from pydantic import Field, PositiveInt

from storage.plan import Plan, PlanRoom
from storage.points import PointCloud
from storage.snapshots import Snapshots
from tasks.params import Params
from tasks.simulation.drift import DriftParams, believed
from tasks.simulation.heights import known
from tasks.simulation.mesh import storey_mesh
from tasks.simulation.sensor import Scene, SensorParams, capture
from tasks.simulation.volunteers import VolunteerParams, Walk, walk

TALL_M = 1.2
"""Furniture higher than this over the floor is kept off like a wall. Assumption."""


class CampaignParams(Params):
    """Who scans what, with which sensor. Simulated: not in the paper unless it is named."""

    seed: int = Field(default=0, ge=0)
    """Seed of everything drawn; each scan has its own stream."""
    volunteers: PositiveInt = 6
    """People who scan (Sec. 7.1: six)."""
    scans: PositiveInt | None = None
    """Scans of the storey; None = one of each room. (Sec. 7.1: 105 of two storeys.)"""
    skill: float = Field(default=0.7, ge=0, le=1)
    """Mean skill of the volunteers. Assumption."""
    skill_spread: float = Field(default=0.3, ge=0)
    """From the mean skill to the best and to the worst volunteer. Assumption."""
    skill_day: float = Field(default=0.1, ge=0)
    """How much one volunteer's scans differ in skill (standard deviation). Assumption."""
    sensor: SensorParams = SensorParams()
    """The depth sensor."""
    volunteer: VolunteerParams = VolunteerParams()
    """The volunteers' habits."""
    drift: DriftParams = DriftParams()
    """The errors of the poses."""


@dataclass(frozen=True, eq=False)
class Recording:
    """One scan as a device reports it, and the truth about it."""

    name: str
    """`s03v2` is the second volunteer's scan of the plan's fourth room, `s03v2n2` their second"""
    room: str
    """id of the room"""
    volunteer: int
    """from 1"""
    skill: float
    """of this scan, 0 to 1"""
    cloud: PointCloud
    """points in the device frame of their snapshot, to be registered by its pose"""
    snapshots: Snapshots
    """with the poses the device believes"""
    truth: Walk
    """the true poses"""

    @property
    def duration_s(self) -> float:
        """How long the scan took, seconds."""
        return float(self.truth.times[-1])


def simulate_scans(
    plan: Plan, params: CampaignParams, scene: Scene | None = None
) -> Iterator[Recording]:
    """Yield one simulated scan after the other, so that only one is in memory.

    Every room is scanned once, in the plan's order, then all again in another order by another
    volunteer, and so on. Scans differ by storey and index alone: more scans change none before.

    Parameters
    ----------
    scene : Scene, optional
        What is scanned; None: the plan's own mesh.

    Raises
    ------
    MapSenseError
        If a height or a thickness the simulation needs is unknown.
    """
    scene = scene or Scene(storey_mesh(plan))
    for index in range(_count(plan, params)):
        yield simulate_scan(scene, plan, index, params)


def simulate_scan(scene: Scene, plan: Plan, index: int, params: CampaignParams) -> Recording:
    """Return the scan of a campaign by its index; `scene` is of the plan's mesh."""
    number, volunteer, turn = _assignment(plan, index, params)
    room = plan.rooms[number]
    rng = _stream(plan, params, "scan", index)
    skill = skills(params)[volunteer] + rng.normal(0, params.skill_day)
    skill = float(np.clip(skill, 0, 1))
    floor, low, floor_m = _standing(plan, room)
    truth = walk(floor, low, floor_m, skill, params.volunteer, rng)
    returns = capture(scene, truth.views, params.sensor, rng)
    poses = believed(truth.times, truth.views, params.drift, rng)
    seen = np.bincount(returns.snapshot, minlength=len(truth))
    again = f"n{turn + 1}" if turn else ""
    return Recording(
        name=f"s{number:02d}v{volunteer + 1}{again}",
        room=room.id,
        volunteer=volunteer + 1,
        skill=skill,
        cloud=PointCloud(returns.points, np.zeros(3), returns.snapshot),
        snapshots=Snapshots(truth.times, poses.positions, poses.rotations, seen),
        truth=truth,
    )


def skills(params: CampaignParams) -> np.ndarray:
    """Return the skill of each volunteer: evenly spread, in an order drawn by the seed."""
    n = params.volunteers
    even = np.linspace(-1, 1, n) if n > 1 else np.zeros(1)
    drawn = np.random.default_rng(params.seed).permutation(even)
    return np.clip(params.skill + params.skill_spread * drawn, 0, 1)


def shares(scans: int, plans: tuple[Plan, ...]) -> tuple[int, ...]:
    """Return how many of a campaign's scans fall to each storey, by its rooms."""
    rooms = np.array([len(plan.rooms) for plan in plans])
    until = np.rint(np.cumsum(rooms) * scans / max(rooms.sum(), 1)).astype(int)
    return tuple(np.diff(until, prepend=0).tolist())


def _count(plan: Plan, params: CampaignParams) -> int:
    if not plan.rooms:
        return 0
    return len(plan.rooms) if params.scans is None else params.scans


def _assignment(plan: Plan, index: int, params: CampaignParams) -> tuple[int, int, int]:
    """Return the room and the volunteer of a scan, and how often they scanned it before."""
    turn, place = divmod(index, len(plan.rooms))
    if turn:
        place = int(_stream(plan, params, "order", turn).permutation(len(plan.rooms))[place])
    first = _stream(plan, params, "first", 0).permutation(len(plan.rooms))[place]
    return place, int(first + turn) % params.volunteers, turn // params.volunteers


def _stream(plan: Plan, params: CampaignParams, what: str, index: int) -> np.random.Generator:
    """Return the stream of one thing drawn for one storey."""
    key = zlib.crc32(f"{plan.building}/{plan.storey}/{what}".encode())
    return np.random.default_rng((params.seed, key, index))


def _standing(
    plan: Plan, room: PlanRoom
) -> tuple[shapely.Polygon, tuple[shapely.Polygon, ...], float]:
    """Return the room without its tall furniture, the other furniture, and the floor's height."""
    floor_m = known(room.floor_m, f"room '{room.id}'", "floor_m")
    # by place, as plans from elsewhere need not say which room a piece stands in
    pieces = [piece for piece in plan.furniture if piece.footprint.intersects(room.polygon)]
    tall = {
        piece.id
        for piece in pieces
        if known(piece.top_m, f"furniture '{piece.id}'", "top_m") - floor_m > TALL_M
    }
    solid = shapely.union_all([piece.footprint for piece in pieces if piece.id in tall])
    low = tuple(piece.footprint for piece in pieces if piece.id not in tall)
    return room.polygon.difference(solid), low, floor_m
