"""A ring corridor: rooms on its outer sides, core rooms within it."""

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field
from shapely import Polygon, box

from tasks.params import Params
from tasks.simulation.layouts.rows import Band, Corners, Space, fill_band, offset_ring
from tasks.simulation.layouts.units import MODULE_M, draw_row, parts_of

TURN_RAD = 2 * np.pi / 8
"""Turn between two lines of a loop of eight."""


class RingParams(Params):
    """A ring corridor. Assumptions unless a source is given."""

    sides_m: tuple[float, ...] | None = Field(default=None, min_length=8, max_length=8)
    """Lengths of the eight reference lines around the corridor, on the faces of its outer walls,
    metres: a rectangle with cut corners, starting with a corner. None draws a plain rectangle."""
    modules_min: int = Field(default=7, ge=5)
    """Least length of a side of the drawn rectangle, facade modules of 2.4 m."""
    modules_max: int = Field(default=12, le=30)
    """Greatest length of a side of the drawn rectangle, facade modules."""
    corridor_m: float = Field(default=2.1, ge=1.4)
    """Width of the corridor between centre lines, metres."""
    depth_m: float = Field(default=4.8, ge=3.5)
    """Depth of outer and of core rooms between centre lines, metres."""
    rows: tuple[tuple[str, ...], ...] | None = None
    """Units of the outer rooms, one row a side; None draws them."""


def ring_layout(params: RingParams, bearing_m: float, rng: np.random.Generator) -> list[Space]:
    """Return the corridor, the outer rooms side by side, then the core rooms.

    A core too deep for two rows of rooms has a light court in its middle.
    """
    if params.sides_m is None:
        nx, ny = rng.integers(params.modules_min, params.modules_max, 2, endpoint=True)
        x, y = nx * MODULE_M, ny * MODULE_M
        loop = np.array([(0.0, 0.0), (x, 0.0), (x, y), (0.0, y)])
        bands = _square_bands(loop, params.depth_m)
    else:
        # the faces are given; walls and rooms stand on centre lines
        loop = offset_ring(closed_loop(np.array(params.sides_m)), bearing_m / 2)
        facade = offset_ring(loop, params.depth_m)
        ends = np.roll(loop, -1, axis=0), np.roll(facade, -1, axis=0)
        bands = [
            Band(np.array((a, b)), np.array((fa, fb)))
            for a, b, fa, fb in zip(loop, ends[0], facade, ends[1], strict=True)
        ]
    core = Polygon(offset_ring(loop, -params.corridor_m))
    corridor = Space(Polygon(loop, [core.exterior.coords]), "corridor")
    return [corridor, *_outer(params, loop, bands, rng), *_core(core, params.depth_m, rng)]


def closed_loop(sides_m: NDArray[np.float64]) -> Corners:
    """Return the corners of a loop of eight lines of given lengths, anticlockwise.

    Lines turn by 45 degrees each, and by the least more or less that closes the loop. So read, the
    lines that the authors' group published close within 0.15 m, and the rectangle whose corners
    they cut measures 11 by 12 modules of 2.4 m.
    """
    angles = -TURN_RAD + TURN_RAD * np.arange(8.0)
    for _ in range(20):
        steps = sides_m[:, None] * np.column_stack((np.cos(angles), np.sin(angles)))
        turned = np.vstack((-steps[:, 1], steps[:, 0]))
        angles = angles - np.linalg.pinv(turned) @ steps.sum(axis=0)
    return np.vstack(((0.0, 0.0), np.cumsum(steps, axis=0)[:-1]))


def _square_bands(loop: Corners, depth: float) -> list[Band]:
    """Return the bands of a rectangle; south and north reach around the corners."""
    (x0, y0), (x1, y1) = loop[0], loop[2]
    ends = [(x0 - depth, x1 + depth, y0, y0 - depth), (x1 + depth, x0 - depth, y1, y1 + depth)]
    south, north = (
        Band(np.array([(a, y), (b, y)]), np.array([(a, f), (b, f)])) for a, b, y, f in ends
    )
    east = Band(np.array([(x1, y0), (x1, y1)]), np.array([(x1 + depth, y0), (x1 + depth, y1)]))
    west = Band(np.array([(x0, y1), (x0, y0)]), np.array([(x0 - depth, y1), (x0 - depth, y0)]))
    return [south, east, north, west]


def _outer(
    params: RingParams, loop: Corners, bands: Sequence[Band], rng: np.random.Generator
) -> list[Space]:
    spaces = []
    for i, band in enumerate(bands):
        length = float(np.linalg.norm(band.base[1] - band.base[0]))
        modules = max(1, round(length / MODULE_M))
        # a room in a square corner must reach past it to touch the corridor
        past = length > np.linalg.norm(loop[(i + 1) % len(loop)] - loop[i]) + params.depth_m
        if params.rows is not None:
            parts = parts_of(params.rows[i])
        else:
            needed = () if modules < 8 else (("kitchen",), ("storage",))[i % 2]
            corner = int(np.ceil((params.depth_m + 1.2) / MODULE_M))
            parts = draw_row(modules, rng, needed, corner if past else 1)
        spaces += fill_band(band, parts)
    return spaces


def _core(core: Polygon, depth: float, rng: np.random.Generator) -> list[Space]:
    """Return the rooms within the corridor: one row, two back to back, or four about a court."""
    x0, y0, x1, y1 = core.bounds
    deep = min(x1 - x0, y1 - y0)
    needed = ("stairs", "wc", "wc")
    if deep < 1.5 * depth:
        spaces = _grid_row(core.bounds, x1 - x0 >= y1 - y0, rng, needed)
    elif deep < 3 * depth:
        y = (y0 + y1) / 2
        spaces = _grid_row((x0, y0, x1, y), True, rng, needed)
        spaces += _grid_row((x0, y, x1, y1), True, rng, ())
    else:
        # walls of the long rows meet the corners of the court rather than just miss them
        corners = depth, x1 - x0 - depth
        spaces = _grid_row((x0, y0, x1, y0 + depth), True, rng, needed, corners)
        spaces += _grid_row((x0, y1 - depth, x1, y1), True, rng, ("storage",), corners)
        spaces += _grid_row((x0, y0 + depth, x0 + depth, y1 - depth), False, rng, ())
        spaces += _grid_row((x1 - depth, y0 + depth, x1, y1 - depth), False, rng, ())
    return [Space(shapely.intersection(s.cell, core), s.class_) for s in spaces]


def _grid_row(
    bounds: tuple[float, float, float, float],
    along_x: bool,
    rng: np.random.Generator,
    needed: Sequence[str],
    corners: tuple[float, ...] = (),
) -> list[Space]:
    x0, y0, x1, y1 = bounds
    length = x1 - x0 if along_x else y1 - y0
    parts = draw_row(max(1, round(length / MODULE_M)), rng, needed, 2 if corners else 1)
    modules = np.array([part.modules for part in parts])
    cuts = np.concatenate(([0.0], np.cumsum(modules) / modules.sum())) * length
    for corner in corners:
        nearest = int(np.argmin(np.abs(cuts - corner)))
        if abs(cuts[nearest] - corner) < MODULE_M / 2:
            cuts[nearest] = corner
    return [
        Space(box(x0 + a, y0, x0 + b, y1) if along_x else box(x0, y0 + a, x1, y0 + b), part.class_)
        for a, b, part in zip(cuts[:-1], cuts[1:], parts, strict=True)
    ]
