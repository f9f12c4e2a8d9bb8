"""The triangle mesh of a furnished storey: what a depth sensor would see of a plan.

Walls are solid between their openings, with a lintel above and a sill wall below. Openings are
holes: doors stand open, and the infrared light of a depth sensor goes through window glass.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from storage.errors import MapSenseError
from storage.plan import Plan, PlanFurniture, PlanOpening, PlanRoom, PlanWall

SEAT_M = 0.45
"""Height of a chair's seat: seats lie at 0.40 to 0.48 m. Assumption."""
SLAB_M, LEG_M = 0.03, 0.04
"""Thickness of table tops and seats, side of a leg. Assumption."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """t triangles over v vertices."""

    vertices: NDArray[np.float32]
    """(v, 3), metres, building frame"""
    triangles: NDArray[np.uint32]
    """(t, 3), indices of vertices"""


Quad = NDArray[np.float64]
"""(4, 2), corners of a rectangle in order, metres"""
Solid = tuple[NDArray[np.float64], NDArray[np.int64]]
"""(v, 3) vertices, metres, and (t, 3) triangles over them"""

BOX = np.array(
    [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]]  # bottom, top
    + [[i, (i + 1) % 4, 4 + (i + 1) % 4] for i in range(4)]
    + [[i, 4 + (i + 1) % 4, 4 + i] for i in range(4)]
)


def storey_mesh(plan: Plan) -> Mesh:
    """Return the mesh of a plan's rooms, walls with their openings, and furniture.

    Raises
    ------
    MapSenseError
        If a height or a thickness the mesh needs is unknown.
    """
    solids = [*_surfaces(plan.rooms), *_walls(plan), *_furniture(plan.furniture)]
    if not solids:
        return Mesh(np.empty((0, 3), np.float32), np.empty((0, 3), np.uint32))
    starts = np.cumsum([0] + [len(vertices) for vertices, _ in solids[:-1]])
    triangles = [part + start for (_, part), start in zip(solids, starts, strict=True)]
    return Mesh(
        np.concatenate([vertices for vertices, _ in solids]).astype(np.float32),
        np.concatenate(triangles).astype(np.uint32),
    )


def known(value: float | None, owner: str, name: str) -> float:
    """Return a number of the plan that a simulation cannot do without."""
    if value is None:
        raise MapSenseError(f"{owner}: '{name}' is unknown; a simulation needs it, set it")
    return value


def _surfaces(rooms: Iterable[PlanRoom]) -> Iterator[Solid]:
    """Yield the floor and the ceiling of each room."""
    for room in rooms:
        parts = shapely.get_parts(shapely.constrained_delaunay_triangles(room.polygon))
        corners = np.array([shapely.get_coordinates(part)[:3] for part in parts])
        xy = corners.reshape(-1, 2)
        triangles = np.arange(len(xy)).reshape(-1, 3)
        for name, height in (("floor_m", room.floor_m), ("ceiling_m", room.ceiling_m)):
            z = known(height, f"room '{room.id}'", name)
            yield np.column_stack((xy, np.full(len(xy), z))), triangles


def _walls(plan: Plan) -> Iterator[Solid]:
    openings = (*plan.doors, *plan.windows)
    for wall in plan.walls:
        yield from _wall(wall, [opening for opening in openings if opening.wall == wall.id])


def _wall(wall: PlanWall, openings: list[PlanOpening]) -> Iterator[Solid]:
    owner = f"wall '{wall.id}'"
    base, top = known(wall.base_m, owner, "base_m"), known(wall.top_m, owner, "top_m")
    thickness = known(wall.thickness_m, owner, "thickness_m")
    if len(wall.line.coords) != 2:
        raise MapSenseError(f"{owner}: is not straight; split it at its bends")
    # half the thickness past both ends, so that corners close
    position, end = -thickness / 2, wall.line.length + thickness / 2
    for start, stop, sill, head in sorted(_span(wall, opening) for opening in openings):
        if start > position:  # openings of a plan someone else drew may touch
            yield _box(_strip(wall, thickness, position, start), base, top)
        gap = _strip(wall, thickness, start, stop)
        # a door's sill wall has no height: it is the threshold between two floors
        yield _box(gap, base, max(sill, base))
        yield _box(gap, head, top)
        position = max(position, stop)
    yield _box(_strip(wall, thickness, position, end), base, top)


def _span(wall: PlanWall, opening: PlanOpening) -> tuple[float, float, float, float]:
    """Return start and stop along the wall, sill and head of an opening, metres."""
    owner = f"opening '{opening.id}'"
    ends = sorted(wall.line.project(shapely.Point(xy)) for xy in opening.line.coords)
    sill, head = known(opening.sill_m, owner, "sill_m"), known(opening.head_m, owner, "head_m")
    return ends[0], ends[-1], sill, head


def _strip(wall: PlanWall, thickness_m: float, start_m: float, stop_m: float) -> Quad:
    """Return the footprint of the wall between two positions along it."""
    first, last = shapely.get_coordinates(wall.line)
    along = (last - first) / wall.line.length
    across = np.array((-along[1], along[0])) * thickness_m / 2
    a, b = first + start_m * along, first + stop_m * along
    return np.array((a - across, b - across, b + across, a + across))


def _box(footprint: Quad, low_m: float, high_m: float) -> Solid:
    heights = np.repeat((low_m, high_m), 4)
    return np.column_stack((np.vstack((footprint, footprint)), heights)), BOX


def _furniture(pieces: tuple[PlanFurniture, ...]) -> Iterator[Solid]:
    tables = shapely.union_all([piece.footprint for piece in pieces if piece.class_ == "table"])
    for piece in pieces:
        owner = f"furniture '{piece.id}'"
        base, top = known(piece.base_m, owner, "base_m"), known(piece.top_m, owner, "top_m")
        quad = shapely.get_coordinates(shapely.oriented_envelope(piece.footprint).exterior)[:4]
        match piece.class_:
            case "table":
                yield from _on_legs(quad, base, top)
            case "chair":
                yield from _on_legs(quad, base, min(base + SEAT_M, top))
                yield _box(_back(quad, tables), min(base + SEAT_M, top), top)
            case _:
                yield _box(quad, base, top)


def _on_legs(quad: Quad, base_m: float, top_m: float) -> Iterator[Solid]:
    """Yield a slab and the four legs under it."""
    yield _box(quad, top_m - SLAB_M, top_m)
    for i in range(4):
        yield _box(_inset(quad, i, LEG_M, LEG_M), base_m, top_m - SLAB_M)


def _back(quad: Quad, tables: shapely.Geometry) -> Quad:
    """Return the footprint of a chair's back, on the side farthest from the tables."""
    sides = [shapely.LineString((quad[i], quad[(i + 1) % 4])) for i in range(4)]
    far = 0 if tables.is_empty else int(np.argmax([s.centroid.distance(tables) for s in sides]))
    return _inset(quad, far, sides[far].length, SLAB_M)


def _inset(quad: Quad, corner: int, along_m: float, inwards_m: float) -> Quad:
    """Return the rectangle of a given size in one corner of a rectangle."""
    at, following, before = quad[corner], quad[(corner + 1) % 4], quad[corner - 1]
    u = (following - at) / np.linalg.norm(following - at) * along_m
    v = (before - at) / np.linalg.norm(before - at) * inwards_m
    return np.array((at, at + u, at + u + v, at + v))
