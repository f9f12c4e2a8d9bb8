"""One attempt at the final plan, with some corrections refused, and what is wrong with it."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from tasks.layout.placement.cutting import cut
from tasks.layout.placement.facing import facing_edges
from tasks.layout.placement.moved_rooms import all_redrawn, with_known_walls
from tasks.layout.placement.moves import WallKey, agreed, without
from tasks.layout.placement.outline import Edges, edges_of
from tasks.layout.placement.shapes import Shape, make_shapes
from tasks.layout.placement.storey import Storey
from tasks.layout.placement.validity import overlaps, walls_at_fault
from tasks.layout.placement.wishes import Boundaries, wishes_of

BESIDE_M = 0.1
"""Walls this near to where two rooms overlap are what made them overlap, metres."""


@dataclass(frozen=True)
class Refused:
    """Corrections that were taken back: walls that stay, rooms neither joined nor cut."""

    walls: frozenset[WallKey] = field(default=frozenset())
    rooms: frozenset[int] = field(default=frozenset())

    def __or__(self, other: "Refused") -> "Refused":
        return Refused(self.walls | other.walls, self.rooms | other.rooms)

    def concerns(self, shape: Shape, walls: set[WallKey]) -> bool:
        """Return whether a correction of an outline that these walls move was refused."""
        return bool(self.walls & walls) or not self.rooms.isdisjoint(shape.sources)


@dataclass(frozen=True, eq=False)
class Plan:
    """Outlines and the final rooms they became."""

    shapes: list[Shape]
    pieces: list[list[Polygon]]
    """per outline its final rooms"""
    boundaries: Boundaries
    walls: list[set[WallKey]]
    """per outline the walls it would be moved for, refused ones too"""
    faults: Refused
    """what to refuse so that the plan becomes valid; nothing more: it is"""


def corrected(storey: Storey, refused: Refused) -> Plan:
    """Return the plan with all corrections but the refused ones."""
    params = storey.params
    shapes = make_shapes(storey, refused.rooms)
    edges = edges_of([shape.polygon for shape in shapes])
    facing = facing_edges(edges, params.thickest_m)
    boundaries, wishes = wishes_of(storey, shapes, edges, facing)
    _, asked = agreed(wishes, facing, edges.length_m)
    by_m, keys = agreed(without(wishes, refused.walls), facing, edges.length_m)

    bad = walls_at_fault(facing, by_m, params.thinnest_m, params.thickest_m)
    faults = Refused(walls=_of(np.union1d(facing.a[bad], facing.b[bad]), keys))
    pieces = []
    for i, shape in enumerate(shapes):
        own = np.flatnonzero(edges.shape == i)
        polygon = _moved(shape.polygon, own, by_m, edges, keys, storey)
        if polygon is None:
            walls_of = _of(own, keys)
            ends = frozenset(key for key in walls_of if key.kind in ("front", "back"))
            faults |= Refused(walls=ends or walls_of)
            polygon = shape.polygon
        rooms = _cut(polygon, shape, boundaries, storey)
        if rooms is None:
            faults |= Refused(rooms=frozenset(shape.sources))
            rooms = [polygon]
        pieces.append(rooms)
    if faults == Refused():
        faults = _overlapping(shapes, pieces, edges, keys, storey.overlap_m2)
    walls: list[set[WallKey]] = [set() for _ in shapes]
    for edge, of_edge in asked.items():
        walls[edges.shape[edge]] |= of_edge
    return Plan(shapes, pieces, boundaries, walls, faults)


def _moved(
    polygon: Polygon,
    own: NDArray[np.int64],
    by_m: NDArray[np.float64],
    edges: Edges,
    keys: Mapping[int, set[WallKey]],
    storey: Storey,
) -> Polygon | None:
    """Return an outline with its edges moved; along walls where that is impossible drawn anew."""
    parts = by_m[own], edges.ends[own], [keys.get(edge, set()) for edge in own.tolist()]
    found = with_known_walls(polygon, *parts, storey)
    return found or all_redrawn(polygon, *parts, storey)


def _of(edges: Iterable[int], keys: Mapping[int, set[WallKey]]) -> frozenset[WallKey]:
    """Return the walls that some edges move for."""
    return frozenset(key for edge in edges for key in keys.get(int(edge), ()))


def _cut(
    polygon: Polygon, shape: Shape, boundaries: Boundaries, storey: Storey
) -> list[Polygon] | None:
    """Return the decoded rooms of one outline; None where it cannot be cut into them.

    A wall nobody saw is put in only between rooms that rules explain.
    """
    if len(shape.decoded) < 2:
        return [polygon]
    if not boundaries.explained[shape.row][shape.all_decoded].all():
        return None
    # a boundary is numbered as the room after it
    between = [after[0] for after in shape.decoded[1:]]
    return cut(
        polygon,
        storey.rows[shape.row].frame,
        boundaries.fused[shape.row].position_m[between],
        boundaries.thickness_m[shape.row][between],
        storey.params.least_room_m2,
    )


def _overlapping(
    shapes: Sequence[Shape],
    pieces: list[list[Polygon]],
    edges: Edges,
    keys: Mapping[int, set[WallKey]],
    initial_m2: NDArray[np.float64],
) -> Refused:
    """Return what to refuse so that rooms no longer overlap.

    First the walls beside the overlap, then all of both outlines, then how they were joined or cut.
    """
    before = np.array(
        [[initial_m2[np.ix_(a.sources, b.sources)].sum() for b in shapes] for a in shapes]
    )
    owner = np.repeat(np.arange(len(shapes)), [len(p) for p in pieces])
    refused = Refused()
    for a, b, where in overlaps([p for some in pieces for p in some], owner, before):
        own = np.flatnonzero((edges.shape == a) | (edges.shape == b))
        beside = own[shapely.dwithin(shapely.linestrings(edges.ends[own]), where, BESIDE_M)]
        walls = _of(beside, keys) or _of(own, keys)
        sources = frozenset(shapes[a].sources + shapes[b].sources)
        refused |= Refused(walls) if walls else Refused(rooms=sources)
    return refused
