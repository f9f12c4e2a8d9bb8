"""Corners of rooms by Cramer's rule (Eq. 8)."""

import numpy as np
from numpy.typing import NDArray

from storage.corners import Corners
from storage.faces import Faces
from storage.rooms import Rooms
from tasks.geometry import intersect_planes
from tasks.surfaces.outline_edges import OutlineEdges, outline_edges

PLAUSIBLE = 0.5
"""A corner further from the room's own than this comes of nearly parallel planes, metres."""


def room_corners(rooms: Rooms, faces: Faces) -> Corners:
    """Intersect each two neighbouring walls of a room with its floor and its ceiling.

    The walls are taken as they were measured, leaning or not: a corner's foot and its top differ.
    """
    edges = outline_edges(rooms, faces)
    normals, offsets = _wall_planes(edges, faces)
    before = _previous(edges.ring)
    lower = _meet(edges, normals, offsets, before, rooms.floor_m)
    upper = _meet(edges, normals, offsets, before, rooms.ceiling_m)
    return Corners(edges.room, lower, upper)


def _wall_planes(
    edges: OutlineEdges, faces: Faces
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return each edge's wall plane: the seen face's, or the upright one through the edge."""
    normals = np.column_stack((edges.outward, np.zeros(len(edges.outward))))
    offsets = np.einsum("ex,ex->e", edges.outward, edges.ends[:, 0])
    on = edges.face >= 0
    if on.any():
        normals[on] = faces.normals[edges.face[on]]
        offsets[on] = faces.offsets[edges.face[on]]
    return normals, offsets


def _previous(ring: NDArray[np.int32]) -> NDArray[np.int64]:
    """Return for each edge the one before it in its ring."""
    before = np.arange(len(ring)) - 1
    for number in np.unique(ring):
        own = np.flatnonzero(ring == number)
        before[own[0]] = own[-1]
    return before


def _meet(
    edges: OutlineEdges,
    normals: NDArray[np.float64],
    offsets: NDArray[np.float64],
    before: NDArray[np.int64],
    heights: NDArray[np.float64],
) -> NDArray[np.float64]:
    level = np.broadcast_to([0.0, 0.0, 1.0], normals.shape)
    at = heights[edges.room] if len(edges.room) else np.empty(0)
    planes = np.stack([normals[before], normals, level], axis=1)
    points = intersect_planes(planes, np.stack([offsets[before], offsets, at], axis=1))
    # where the two walls are nearly one plane their meeting point says nothing: the outline does
    flat = np.column_stack((edges.ends[:, 0], at))
    off = np.linalg.norm(points[:, :2] - flat[:, :2], axis=1)
    return np.where((off < PLAUSIBLE)[:, None], points, flat)
