"""Walls between rooms: two outlines that run back to back are the faces of one wall."""

import numpy as np
import shapely
from numpy.typing import NDArray

from storage.faces import Faces
from storage.rooms import Rooms
from storage.walls import Walls
from tasks.surfaces.outline_edges import OutlineEdges, outline_edges, seen_along

SHORTEST = 0.1
"""Wall pieces shorter than this are corners, metres."""
PARALLEL_COS = np.cos(np.radians(5))


def pair_walls(rooms: Rooms, faces: Faces, thinnest: float, thickest: float) -> Walls:
    """Return the rooms' walls.

    Where two rooms' outlines run back to back, no further than `thickest` apart, there is one
    wall with a thickness; elsewhere the wall is known by the one face its room sees.
    """
    edges = outline_edges(rooms, faces)
    seen = seen_along(edges.ends, edges.face, faces)
    near = shapely.linestrings(edges.ends) if len(edges.ends) else np.empty(0, object)
    tree = shapely.STRtree(near)
    pieces: list[tuple[NDArray[np.float64], float, int, int, float]] = []
    for e in range(len(edges.room)):
        others = np.sort(tree.query(near[e], "dwithin", thickest))
        pieces += _pieces_of(e, others, edges, seen, thinnest, thickest)
    return _walls(pieces, rooms)


def _pieces_of(
    e: int,
    others: NDArray[np.int64],
    edges: OutlineEdges,
    seen: NDArray[np.float64],
    thinnest: float,
    thickest: float,
) -> list[tuple[NDArray[np.float64], float, int, int, float]]:
    """Return edge e's wall pieces (line, thickness, room, other room, seen share)."""
    start, end = edges.ends[e]
    length = float(np.linalg.norm(end - start))
    along = (end - start) / max(length, 1e-9)
    taken: list[tuple[float, float]] = []
    pieces = []
    for f in others:
        if edges.outward[e] @ edges.outward[f] > -PARALLEL_COS:
            continue
        depth = float((edges.ends[f].mean(axis=0) - start) @ edges.outward[e])
        a, b = np.sort((edges.ends[f] - start) @ along)
        a, b = max(float(a), 0.0), min(float(b), length)
        if b - a < SHORTEST or not -thinnest < depth <= thickest:
            continue
        taken.append((a, b))
        if e < f:  # the other edge would only say the same again
            middle = start + edges.outward[e] * depth / 2
            line = np.array([middle + a * along, middle + b * along])
            thickness = depth if depth >= thinnest else np.nan
            share = max(seen[e], seen[f])
            pieces.append((line, thickness, int(edges.room[e]), int(edges.room[f]), share))
    for a, b in _rest(length, taken):
        line = np.array([start + a * along, start + b * along])
        pieces.append((line, np.nan, int(edges.room[e]), -1, float(seen[e])))
    return pieces


def _rest(length: float, taken: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the parts of [0, length] that no interval takes."""
    rest, at = [], 0.0
    for a, b in sorted(taken):
        if a - at >= SHORTEST:
            rest.append((at, a))
        at = max(at, b)
    if length - at >= SHORTEST:
        rest.append((at, length))
    return rest


def _walls(pieces: list[tuple[NDArray[np.float64], float, int, int, float]], rooms: Rooms) -> Walls:
    pairs = np.array([(p[2], p[3]) for p in pieces], np.int32).reshape(-1, 2)
    return Walls(
        lines=np.array([p[0] for p in pieces]).reshape(-1, 2, 2),
        thickness_m=np.array([p[1] for p in pieces], float),
        base_m=_extreme(np.fmin, rooms.floor_m, pairs),
        top_m=_extreme(np.fmax, rooms.ceiling_m, pairs),
        rooms=pairs,
        seen=np.array([p[4] for p in pieces], float),
    )


def _extreme(
    of: np.ufunc, heights: NDArray[np.float64], pairs: NDArray[np.int32]
) -> NDArray[np.float64]:
    """Return the lowest or highest of the heights of a wall's two rooms, unknown ones aside."""
    with_none = np.append(heights, np.nan)  # index -1: no room
    return of(with_none[pairs[:, 0]], with_none[pairs[:, 1]])
