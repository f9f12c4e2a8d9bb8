"""What no ray reached of each true door, by rays at the walls of the true plan."""

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from storage.plan import Plan, PlanOpening
from storage.points import PointCloud
from storage.rooms import Rooms
from storage.snapshots import Snapshots
from storage.wall_images import EMPTY, OCCUPIED, WallImages
from storage.walls import Walls
from tasks.doors.trace import TraceParams, trace_walls


def hidden_shares(
    truth: Plan, points: list[PointCloud], snapshots: list[Snapshots]
) -> NDArray[np.float64]:
    """Return the share of each true door's rectangle that no ray reached, (doors,).

    Rays are cast at the true walls as at found ones: it says what the scans show of a door,
    whatever was made of its wall. Of a door's two faces the one seen better counts.
    """
    images = trace_walls(true_rooms(truth), true_walls(truth), points, snapshots, TraceParams())
    numbers = {wall.id: i for i, wall in enumerate(truth.walls)}
    return np.array([_hidden(door, numbers[str(door.wall)], images) for door in truth.doors])


def true_rooms(truth: Plan) -> Rooms:
    """Return the rooms of a plan as a stage takes them."""
    n = len(truth.rooms)
    return Rooms(
        polygons=np.array([room.polygon for room in truth.rooms], object),
        floor_m=_known([room.floor_m for room in truth.rooms]),
        ceiling_m=_known([room.ceiling_m for room in truth.rooms]),
        seen=np.ones(n),
        walled=np.ones(n),
        scans=((),) * n,
    )


def true_walls(truth: Plan) -> Walls:
    """Return the walls of a plan as a stage takes them."""
    number = {room.id: i for i, room in enumerate(truth.rooms)}
    rooms = np.full((len(truth.walls), 2), -1, np.int32)
    for i, wall in enumerate(truth.walls):
        rooms[i, : len(wall.rooms)] = [number[room] for room in wall.rooms]
    lines = [shapely.get_coordinates(wall.line)[[0, -1]] for wall in truth.walls]
    return Walls(
        lines=np.array(lines).reshape(-1, 2, 2),
        thickness_m=_known([wall.thickness_m for wall in truth.walls]),
        base_m=_known([wall.base_m for wall in truth.walls]),
        top_m=_known([wall.top_m for wall in truth.walls]),
        rooms=rooms,
        seen=np.ones(len(truth.walls)),
    )


def _hidden(door: PlanOpening, wall: int, images: WallImages) -> float:
    ends = shapely.get_coordinates(door.line)[[0, -1]]
    shares = [1.0]
    for face in np.flatnonzero(images.walls == wall):
        along = np.sort((ends - images.origins[face]) @ images.axes[face])
        up = np.array([door.sill_m, door.head_m], float) - images.base_m[face]
        i, j = (np.rint(m / images.pixel_m).astype(int).clip(0) for m in (along, up))
        seen = images.labels[face][i[0] : i[1], j[0] : j[1]]
        if seen.size:
            shares.append(float(1 - np.isin(seen, (OCCUPIED, EMPTY)).mean()))
    return min(shares)


def _known(values: Sequence[float | None]) -> NDArray[np.float64]:
    return np.array([np.nan if value is None else value for value in values], float)
