"""Outlines with their edges moved, and drawn anew along walls where edges cannot be."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from shapely import Polygon

from tasks.layout.extraction.model import LineFrame
from tasks.layout.placement.known_walls import CORRIDOR, KNOWN
from tasks.layout.placement.moves import WallKey
from tasks.layout.placement.outline import edges_of, moved
from tasks.layout.placement.redrawn import Face, redrawn
from tasks.layout.placement.storey import Storey

JOG_M = 0.15
"""Jogs this deep go with a wall that is drawn anew, metres."""
STAYS_M = 1e-6
"""An edge that moves less stays where it is, metres."""


def with_known_walls(
    polygon: Polygon,
    by_m: NDArray[np.float64],
    ends: NDArray[np.float64],
    keys: Sequence[set[WallKey]],
    storey: Storey,
) -> Polygon | None:
    """Return an outline with its edges moved, but drawn anew along the walls that are known.

    What lies before such a wall between two edges on it is furniture, and no wall of its own.

    Parameters
    ----------
    by_m : (e, 2) float
        How far the ends of each of its edges move, outwards.
    ends : (e, 2, 2) float
    keys : of each edge the walls it moves for
    """
    walls: dict[int, list[int]] = {}
    for edge, of_edge in enumerate(keys):
        for key in of_edge:
            if key.kind in KNOWN and _same_way(ends[edge], storey.known.ends[key.row]):
                walls.setdefault(key.row, []).append(edge)
    kinds = storey.known.kind
    for anew in ([w for w in walls if kinds[w] == CORRIDOR], list(walls)):
        stay = np.isin(np.arange(len(ends)), [edge for wall in anew for edge in walls[wall]])
        found = moved(polygon, np.where(stay[:, None], 0.0, by_m))
        if found is not None:
            break
    if found is None or not walls:
        return found
    edges = edges_of([found]).ends
    faces = [_face(wall, some, by_m, ends, edges, storey) for wall, some in walls.items()]
    return redrawn(found, faces)


def _same_way(edge: NDArray[np.float64], wall: NDArray[np.float64]) -> bool:
    """Return whether an edge is on the wall's face, not one on its other side that moves along."""
    return bool((edge[1] - edge[0]) @ (wall[1] - wall[0]) > 0)


def _face(
    wall: int,
    some: list[int],
    by_m: NDArray[np.float64],
    ends: NDArray[np.float64],
    edges: NDArray[np.float64],
    storey: Storey,
) -> Face:
    """Return the face of a known wall where its place and the measured edges agree, together."""
    corridor = storey.known.kind[wall] == CORRIDOR
    before, behind = storey.params.hidden_m, storey.params.beyond_m
    if corridor:  # behind its walls are doorways
        behind = max(before, behind)
    frame = LineFrame.between(*storey.known.ends[wall])
    lengths = np.linalg.norm(ends[some, 1] - ends[some, 0], axis=1)
    place = -frame.local(ends[some])[..., 1] + by_m[some]
    face = storey.known.ends[wall] - float(np.average(place.mean(axis=1), weights=lengths)) * (
        frame.left
    )
    left, x = frame.local(edges)[..., 1], frame.local(edges)[..., 0]
    on = ((left <= before) & (left >= -behind)).all(axis=1)
    on &= (x.max(axis=1) > 0) & (x.min(axis=1) < frame.length)
    return Face(face, edges[on], before, behind, corridor)


def all_redrawn(
    polygon: Polygon,
    by_m: NDArray[np.float64],
    ends: NDArray[np.float64],
    keys: Sequence[set[WallKey]],
    storey: Storey,
) -> Polygon | None:
    """Return an outline drawn anew along all walls that move."""
    walls: dict[WallKey, list[int]] = {}
    for edge, of_edge in enumerate(keys):
        if of_edge and np.abs(by_m[edge]).max() > STAYS_M:
            walls.setdefault(min(of_edge), []).append(edge)
    faces = []
    for some in walls.values():
        longest = some[int(np.argmax(np.linalg.norm(ends[some, 1] - ends[some, 0], axis=1)))]
        start, end = ends[longest]
        along = (end - start) / np.linalg.norm(end - start)
        outward = np.array([along[1], -along[0]])
        target = ends[longest] + by_m[longest][:, None] * outward
        # edges of one wall may lie on either side of where it is to be
        off = (target.mean(axis=0) - ends[some]) @ outward
        before, behind = max(float(off.max()), 0.0), max(-float(off.min()), 0.0)
        faces.append(Face(target, ends[some], before + JOG_M, behind + JOG_M))
    if not faces:
        return None
    moving = {edge for some in walls.values() for edge in some}
    faces += [Face(ends[e], ends[[e]], 0.0, 0.0) for e in range(len(ends)) if e not in moving]
    around = max(face.behind_m for face in faces)
    return redrawn(polygon, [face._replace(around_m=around) for face in faces])
