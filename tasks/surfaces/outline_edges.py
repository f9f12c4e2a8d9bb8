"""The edges of the rooms' outlines, and the face each of them lies on."""

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from storage.faces import Faces
from storage.rooms import Rooms

ON_FACE = 0.12
"""An edge lies on a face whose line is nearer than this at both its ends, metres."""


@dataclass(frozen=True, eq=False)
class OutlineEdges:
    """e edges of n rooms, ring after ring, each edge after the one before: inside is left."""

    room: NDArray[np.int32]
    ring: NDArray[np.int32]
    """(e,), ring of each edge, counted over all rooms"""
    ends: NDArray[np.float64]
    """(e, 2, 2)"""
    outward: NDArray[np.float64]
    """(e, 2), unit, away from the room"""
    face: NDArray[np.int64]
    """(e,), the face each edge lies on, -1 for none"""


def outline_edges(rooms: Rooms, faces: Faces) -> OutlineEdges:
    """Return the edges of all rooms' outlines."""
    rings, owner = shapely.get_rings(shapely.orient_polygons(rooms.polygons), return_index=True)
    room, ring, ends = [], [], []
    for number, (line, of_room) in enumerate(zip(rings, owner, strict=True)):
        at = shapely.get_coordinates(line)
        room += [of_room] * (len(at) - 1)
        ring += [number] * (len(at) - 1)
        ends.append(np.stack([at[:-1], at[1:]], axis=1))
    edges = np.concatenate([*ends, np.empty((0, 2, 2))])
    spans = edges[:, 1] - edges[:, 0]
    lengths = np.maximum(np.linalg.norm(spans, axis=1, keepdims=True), 1e-9)
    outward = np.column_stack((spans[:, 1], -spans[:, 0])) / lengths
    return OutlineEdges(
        np.array(room, np.int32),
        np.array(ring, np.int32),
        edges,
        outward,
        _faces_of(edges, outward, faces),
    )


def _faces_of(
    edges: NDArray[np.float64], outward: NDArray[np.float64], faces: Faces
) -> NDArray[np.int64]:
    """Return for each edge the face it runs along furthest, -1 for none."""
    if not len(faces) or not len(edges):
        return np.full(len(edges), -1)
    flat = faces.normals[:, :2] / np.linalg.norm(faces.normals[:, :2], axis=1, keepdims=True)
    starts = faces.lines[:, 0]
    away = np.abs(
        np.einsum("epx,fx->efp", edges, flat) - np.einsum("fx,fx->f", starts, flat)[:, None]
    )
    facing = outward @ flat.T  # a face looks into its room
    fits = (away.max(axis=2) < ON_FACE) & np.where(faces.sides == 1, facing < 0, True)
    along = np.column_stack((-flat[:, 1], flat[:, 0]))
    of_edge = np.sort(np.einsum("epx,fx->efp", edges, along), axis=2)
    of_face = np.sort(np.einsum("fpx,fx->fp", faces.lines, along), axis=1)
    common = np.minimum(of_edge[..., 1], of_face[:, 1]) - np.maximum(of_edge[..., 0], of_face[:, 0])
    common = np.where(fits, common, -np.inf)
    best = common.argmax(axis=1)
    return np.where(np.isfinite(common[np.arange(len(edges)), best]), best, -1)


def seen_along(
    edges: NDArray[np.float64], face: NDArray[np.int64], faces: Faces
) -> NDArray[np.float64]:
    """Return the share of each edge along which its face was seen, (e,)."""
    shares = np.zeros(len(edges))
    for e in np.flatnonzero(face >= 0):
        start, end = faces.lines[face[e]]
        step = (end - start) / max(np.linalg.norm(end - start), 1e-9)
        a, b = np.sort((edges[e] - start) @ step)
        profile = faces.profiles[face[e]] > 0
        t = (np.arange(len(profile)) + 0.5) * faces.bin_m
        seen = (profile & (t >= a) & (t <= b)).sum() * faces.bin_m
        shares[e] = min(1.0, seen / max(b - a, 1e-9))
    return shares
