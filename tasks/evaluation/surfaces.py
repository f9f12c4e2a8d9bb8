"""The surfaces a scan of a true plan would see: floors, ceilings and the faces of walls."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import LineString, Polygon

from storage.plan import Plan, PlanOpening, PlanRoom
from tasks.evaluation.corners import STRAIGHT_RAD

WALL, FLOOR, CEILING = "wall", "floor", "ceiling"


@dataclass(frozen=True, eq=False)
class Surface:
    """A bounded plane in 3D: a point p of it lies at `origin + a * u + b * v`, (a, b) in `area`."""

    id: str
    class_: str
    origin: NDArray[np.float64]
    """(3,), metres, building frame"""
    u: NDArray[np.float64]
    """(3,), unit: along a wall, or x"""
    v: NDArray[np.float64]
    """(3,), unit: up, or y"""
    normal: NDArray[np.float64]
    """(3,), unit, into the room"""
    area: Polygon
    """metres along u and v, openings cut out"""

    def flattened(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a and b of points, (n, 3) -> (n, 2), by their feet on the plane."""
        away = points - self.origin
        return np.column_stack([away @ self.u, away @ self.v])

    def at(self, ab: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the point, (3,), at a and b, (2,)."""
        place: NDArray[np.float64] = self.origin + ab[0] * self.u + ab[1] * self.v
        return place


def true_surfaces(plan: Plan, least_m2: float, off_wall_m: float) -> tuple[Surface, ...]:
    """Return the surfaces of a plan's rooms that have at least some area.

    Parameters
    ----------
    least_m2 : smaller surfaces are left out, openings cut out before
    off_wall_m : greatest distance of an opening's line from the edge of a room it is cut from

    Notes
    -----
    A room gives its floor, its ceiling, and the face of a wall for each edge of its outline, holes
    too; consecutive edges that go straight on give one. What the plan does not say (a room without
    a ceiling has no wall faces either) is left out. Outer faces are none: nobody scans them.
    """
    openings = [o for o in (*plan.doors, *plan.windows) if None not in (o.sill_m, o.head_m)]
    lines = np.array([opening.line for opening in openings], object)
    surfaces = (
        surface
        for room in plan.rooms
        # what is further from the room than that lies in none of its walls
        for surface in _of_room(
            room,
            [
                openings[i]
                for i in np.flatnonzero(shapely.dwithin(lines, room.polygon, off_wall_m * 1.01))
            ],
            off_wall_m,
        )
    )
    return tuple(surface for surface in surfaces if surface.area.area >= least_m2)


def _of_room(
    room: PlanRoom, openings: Sequence[PlanOpening], off_wall_m: float
) -> Iterator[Surface]:
    x, y, z = np.eye(3)
    for class_, height, normal in ((FLOOR, room.floor_m, z), (CEILING, room.ceiling_m, -z)):
        if height is not None:
            yield Surface(f"{room.id}/{class_}", class_, height * z, x, y, normal, room.polygon)
    if room.floor_m is None or room.ceiling_m is None:
        return
    for number, (start, stop) in enumerate(_edges(room.polygon)):
        along, length = (stop - start) / np.hypot(*(stop - start)), float(np.hypot(*(stop - start)))
        face = shapely.box(0.0, room.floor_m, length, room.ceiling_m)
        for opening in openings:
            face = face.difference(_hole(opening, start, along, off_wall_m))
        yield Surface(
            id=f"{room.id}/{WALL}-{number}",
            class_=WALL,
            origin=np.array((*start, 0.0)),
            u=np.array((*along, 0.0)),
            v=z,
            # the room lies to the left of its outline
            normal=np.array((-along[1], along[0], 0.0)),
            area=face,
        )


def _edges(polygon: Polygon) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Yield the ends of each straight edge, the inside to its left."""
    oriented = shapely.orient_polygons(polygon)
    for ring in (oriented.exterior, *oriented.interiors):
        xy = shapely.get_coordinates(ring)[:-1]
        before, after = xy - np.roll(xy, 1, axis=0), np.roll(xy, -1, axis=0) - xy
        turn = np.abs(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0])
        lengths = np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
        xy = xy[turn > STRAIGHT_RAD * lengths]
        yield from zip(xy, np.roll(xy, -1, axis=0), strict=True)


def _hole(
    opening: PlanOpening,
    start: NDArray[np.float64],
    along: NDArray[np.float64],
    off_wall_m: float,
) -> Polygon:
    """Return what an opening cuts from the face of an edge; nothing if it lies in another wall."""
    ends = _ends(opening.line) - start
    across = np.abs(ends @ np.array((-along[1], along[0])))
    low, high = np.sort(ends @ along)
    if across.max() > off_wall_m:
        return Polygon()
    assert opening.sill_m is not None
    assert opening.head_m is not None
    return shapely.box(low, opening.sill_m, high, opening.head_m)


def _ends(line: LineString) -> NDArray[np.float64]:
    return shapely.get_coordinates(line)[[0, -1]]
