"""Rooms in a row along a corridor, and the lines that rows stand on."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from shapely import Polygon

from tasks.simulation.layouts.units import Part

Corners = NDArray[np.float64]
"""(n, 2), metres"""


@dataclass(frozen=True, eq=False)
class Space:
    """A room to be: its cell, measured to the centre lines of its walls, and its class."""

    cell: Polygon
    class_: str


@dataclass(frozen=True, eq=False)
class Band:
    """A strip between a corridor's wall and a facade, both as centre lines."""

    base: Corners
    """(2, 2), along the corridor, metres"""
    facade: Corners
    """(2, 2), metres; longer than the base where the corridor turns away, shorter towards"""


def fill_band(band: Band, parts: Sequence[Part]) -> list[Space]:
    """Return rooms side by side in a band, each as long as its modules ask for.

    Walls between rooms stand square on the corridor; the band's own ends are as they are.
    """
    along = band.base[1] - band.base[0]
    outward = np.array((along[1], -along[0])) / np.linalg.norm(along)
    if outward @ (band.facade[0] - band.base[0]) < 0:
        outward = -outward
    depth = outward @ (band.facade[0] - band.base[0])
    modules = np.array([part.modules for part in parts])
    cuts = np.concatenate(([0.0], np.cumsum(modules) / modules.sum()))
    base = band.base[0] + cuts[:, None] * along
    facade = base + depth * outward
    facade[0], facade[-1] = band.facade
    return [
        Space(Polygon((base[i], base[i + 1], facade[i + 1], facade[i])), part.class_)
        for i, part in enumerate(parts)
    ]


def offset_ring(ring: Corners, distance_m: float) -> Corners:
    """Return a closed anticlockwise ring moved outwards by a distance, corners mitred."""
    ends = np.roll(ring, -1, axis=0)
    return _mitred(np.roll(ring, 1, axis=0), ring, ends, distance_m)


def offset_path(path: Corners, distance_m: float) -> Corners:
    """Return an open path moved to its right by a distance, corners mitred, ends square."""
    before = np.vstack((2 * path[0] - path[1], path[:-1]))
    after = np.vstack((path[1:], 2 * path[-1] - path[-2]))
    return _mitred(before, path, after, distance_m)


def _mitred(before: Corners, at: Corners, after: Corners, distance_m: float) -> Corners:
    u, v = _unit(at - before), _unit(after - at)
    right_u, right_v = np.column_stack((u[:, 1], -u[:, 0])), np.column_stack((v[:, 1], -v[:, 0]))
    cosine = np.einsum("ij,ij->i", right_u, right_v)
    return at + distance_m * (right_u + right_v) / (1 + cosine)[:, None]


def _unit(vectors: Corners) -> Corners:
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def cut_out(space: Space, cut: Polygon, class_: str) -> list[Space]:
    """Return a room less a part of it, and that part as a room of its own (Sec. 7.4)."""
    inner = space.cell.intersection(cut)
    outer = space.cell.difference(cut)
    if not isinstance(inner, Polygon) or not isinstance(outer, Polygon) or inner.is_empty:
        raise ValueError(f"{cut.wkt} does not cut one room out of {space.cell.wkt}")
    return [replace(space, cell=outer), Space(inner, class_)]


def local_box(space: Space, along: tuple[float, float], outward: tuple[float, float]) -> Polygon:
    """Return a rectangle in a room of a row, by shares of its base and of its depth.

    What cuts the room's sides starts beyond them: no sliver may stay.
    """
    a, b, _, d = np.array(space.cell.exterior.coords)[:4]
    length, depth = b - a, np.array((-(b - a)[1], (b - a)[0]))
    depth = depth / np.linalg.norm(depth)
    depth = depth * (depth @ (d - a))
    corners = [(along[0], outward[0]), (along[1], outward[0])]
    corners += [(along[1], outward[1]), (along[0], outward[1])]
    return Polygon([a + s * length + t * depth for s, t in corners])
