"""A simulated campaign: one scan per room, some rooms scanned by a second volunteer."""

from collections.abc import Iterator

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field, NonNegativeInt

from storage.plan import Plan, PlanRoom
from storage.points import PointCloud
from storage.snapshots import Snapshots
from tasks.params import Params
from tasks.simulation.mesh import known, storey_mesh
from tasks.simulation.rotations import about, matrices, product
from tasks.simulation.sensor import Scene, SensorParams, capture
from tasks.simulation.volunteers import VolunteerParams, Walk, walk

TALL_M = 1.2
"""Furniture higher than this over the floor is kept off like a wall. Assumption."""


class CampaignParams(Params):
    """Who scans what, with which sensor. Simulated: not in the paper."""

    seed: int = Field(default=0, ge=0)
    """Seed of everything drawn; each scan has its own stream."""
    second_scans: NonNegativeInt = 3
    """Rooms that a second volunteer scans too."""
    pose_m: float = Field(default=0.01, ge=0)
    """Error of a scan's place in the building frame, metres (standard deviation per axis): one to
    two centimetres in all. Assumption."""
    pose_rad: float = Field(default=np.deg2rad(0.3), ge=0)
    """Error of a scan's heading, radians (standard deviation). Assumption."""
    sensor: SensorParams = SensorParams()
    """The depth sensor."""
    volunteer: VolunteerParams = VolunteerParams()
    """The volunteers' habits."""


def simulate_scans(
    plan: Plan, params: CampaignParams
) -> Iterator[tuple[str, PointCloud, Snapshots]]:
    """Yield the name, the points and the snapshots of one simulated scan after the other.

    Scan `s03v2` is the second volunteer's scan of the plan's fourth room. Points and poses are
    those the device believes: both carry the scan's constant pose error.

    Raises
    ------
    MapSenseError
        If a height or a thickness the simulation needs is unknown.
    """
    scene = Scene(storey_mesh(plan))
    for index, volunteer in _assignments(len(plan.rooms), params):
        rng = np.random.default_rng((params.seed, index, volunteer))
        cloud, snapshots = _scan(scene, plan, plan.rooms[index], params, rng)
        yield f"s{index:02d}v{volunteer}", cloud, snapshots


def _assignments(n_rooms: int, params: CampaignParams) -> list[tuple[int, int]]:
    """Return (room, volunteer) of every scan: the first volunteer's, then the second's."""
    again = np.random.default_rng(params.seed).permutation(n_rooms)[: params.second_scans]
    return [(i, 1) for i in range(n_rooms)] + [(i, 2) for i in sorted(again.tolist())]


def _scan(
    scene: Scene, plan: Plan, room: PlanRoom, params: CampaignParams, rng: np.random.Generator
) -> tuple[PointCloud, Snapshots]:
    floor = known(room.floor_m, f"room '{room.id}'", "floor_m")
    pieces = [piece for piece in plan.furniture if piece.room == room.id]
    tall = {p.id for p in pieces if known(p.top_m, f"furniture '{p.id}'", "top_m") - floor > TALL_M}
    area = room.polygon.difference(shapely.union_all([p.footprint for p in pieces if p.id in tall]))
    low = tuple(p.footprint for p in pieces if p.id not in tall)
    true = walk(area, low, floor, params.volunteer, rng)
    returns = capture(scene, true.positions, true.rotations, params.sensor, rng)
    points, believed = _misplaced(returns.points, true, params, rng)
    cloud = PointCloud(points.astype(np.float32), np.zeros(3), returns.snapshot)
    seen = np.bincount(returns.snapshot, minlength=len(believed.times))
    return cloud, Snapshots(believed.times, believed.positions, believed.rotations, seen)


def _misplaced(
    points: NDArray[np.float64], true: Walk, params: CampaignParams, rng: np.random.Generator
) -> tuple[NDArray[np.float64], Walk]:
    """Return points and poses as localised: turned about the scan's start, and shifted."""
    start = true.positions[0]
    shift = rng.normal(0, params.pose_m, 3)
    turn = about("z", rng.normal(0, params.pose_rad))
    matrix = matrices(turn)
    place = start + shift
    believed = Walk(
        times=true.times,
        positions=(true.positions - start) @ matrix.T + place,
        rotations=product(turn, true.rotations),
    )
    return (points - start) @ matrix.T + place, believed
