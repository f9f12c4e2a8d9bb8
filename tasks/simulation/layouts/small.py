"""A small storey: eight rooms on both sides of a corridor, one an L, one with an oblique wall."""

from itertools import pairwise

import numpy as np
from pydantic import Field, PositiveFloat
from shapely import Polygon, box

from tasks.params import Params
from tasks.simulation.layouts.rows import Space

NORTH = ("office", "storage", "office", "meeting")
SOUTH = ("office", "office", "kitchen", "office")
"""Classes of the rooms, west to east."""


class SmallParams(Params):
    """Sizes of the small storey. Assumptions."""

    corridor_m: PositiveFloat = 2.2
    """Width of the corridor between centre lines, metres."""
    depth_m: PositiveFloat = 4.8
    """Depth of a room from corridor to facade, between centre lines, metres."""
    width_min_m: float = Field(default=3.4, ge=3.2)
    """Least width of a room between centre lines, metres; the L-shaped room needs 3.2."""
    width_max_m: float = Field(default=5.4, ge=3.2)
    """Greatest width of a room between centre lines, metres."""
    chamfer_m: float = Field(default=1.6, ge=0.5, le=2.4)
    """What the oblique wall cuts off the north-east corner along x and along y, metres."""


def small_layout(params: SmallParams, rng: np.random.Generator) -> list[Space]:
    """Return the corridor, the north rooms west to east, then the south rooms."""
    north = np.round(rng.uniform(params.width_min_m, params.width_max_m, len(NORTH)), 2)
    south = rng.uniform(params.width_min_m, params.width_max_m, len(SOUTH))
    length = north.sum()
    x_north = np.concatenate(([0.0], np.cumsum(north)))
    x_south = np.round(np.concatenate(([0.0], np.cumsum(south * length / south.sum()))), 2)
    x_south[-1] = x_north[-1]
    corridor = Space(box(0, 0, length, params.corridor_m), "corridor")
    rooms = [Space(cell, c) for cell, c in zip(_north(x_north, params), NORTH, strict=True)]
    rooms += [
        Space(box(a, -params.depth_m, b, 0), class_)
        for (a, b), class_ in zip(pairwise(x_south), SOUTH, strict=True)
    ]
    return [corridor, *rooms]


def _north(x: np.ndarray, params: SmallParams) -> list[Polygon]:
    y = params.corridor_m
    top, back = y + params.depth_m, y + 0.55 * params.depth_m
    cut = params.chamfer_m
    # the first room reaches behind the second: an L, and a second room without a window
    ell = Polygon([(x[0], y), (x[1], y), (x[1], back), (x[2], back), (x[2], top), (x[0], top)])
    last = [(x[3], y), (x[4], y), (x[4], top - cut), (x[4] - cut, top), (x[3], top)]
    return [ell, box(x[1], y, x[2], back), box(x[2], y, x[3], top), Polygon(last)]
