"""What of a wall face lies behind or before the wall around it: its depth image set straight.

A face is drawn as one plane, but scans drift against each other and a fitted plane is a little off:
the depths of a flat wall rise and fall by centimetres over metres. A door's leaf lies back by no
more than that, so depths are taken from the wall within a door's width or two, not from the face.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import PositiveFloat, PositiveInt

from storage.wall_images import EMPTY, OCCUPIED
from tasks.params import Params


class StraightParams(Params):
    """How the wall around a pixel is found, and what lies behind it."""

    around_m: PositiveFloat = 1.5
    """To either side of a column, what is hit makes up the wall there, metres: more than an
    opening's width, so that most of it is wall. Assumption."""
    over_m: PositiveFloat = 2.1
    """What is hit higher than this over the wall's foot is wall before all else, metres: heads of
    doors lie at 2 m. Assumption."""
    least_hits: PositiveInt = 60
    """Pixels hit over that height that are enough; else what is hit at all heights makes up the
    wall. Assumption."""
    step_m: PositiveFloat = 0.25
    """Between the places where the wall is found; linear in between, metres. Assumption."""
    back_m: PositiveFloat = 0.03
    """By more than this, metres, a surface lies behind the wall: above twice what voxels of 2 cm
    leave of noise, below the recess of 75 mm of a leaf in a thin wall. Assumption."""
    reach_m: PositiveFloat = 0.15
    """Depths beyond this, metres before or behind, say nothing more to edges. Assumption."""


@dataclass(frozen=True, eq=False)
class Straightened:
    """One face."""

    depth: NDArray[np.float32]
    """(a, b), metres behind the wall around; NaN where nothing was seen"""
    noise_m: float
    """median deviation of what was hit from the wall; NaN where nothing was hit"""


def straightened(
    labels: NDArray[np.uint8],
    depths: NDArray[np.float32],
    pixel_m: float,
    params: StraightParams,
) -> Straightened:
    """Return what lies behind (+) or before (-) the wall around each pixel.

    Parameters
    ----------
    labels : (a, b) uint8
        As in `WallImages`.
    depths : (a, b) float32
        Metres behind the face. An EMPTY pixel through which nothing was seen is unknown: nobody
        may ever have looked there.
    """
    hit = (labels == OCCUPIED) & ~np.isnan(depths)
    seen = hit | ((labels == EMPTY) & ~np.isnan(depths))
    at, wall = _wall(np.where(hit, depths, np.float32(np.nan)), pixel_m, params)
    columns = np.arange(len(labels))
    wall_there = np.interp(columns, at, wall) if len(at) else np.zeros(len(columns))
    straight = depths - wall_there[:, None].astype(np.float32)
    noise = float(np.median(np.abs(straight[hit]))) if hit.any() else np.nan
    return Straightened(np.where(seen, straight, np.float32(np.nan)), noise)


def _wall(
    hits: NDArray[np.float32], pixel_m: float, params: StraightParams
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return columns and the depth of the wall there; none where nothing was hit nearby."""
    step = max(round(params.step_m / pixel_m), 1)
    reach = max(round(params.around_m / pixel_m), 1)
    over = round(params.over_m / pixel_m)
    at, wall = [], []
    for i in range(0, len(hits) + step, step):
        band = hits[max(i - reach, 0) : i + reach]
        high, near = band[:, over:], band[~np.isnan(band)]
        high = high[~np.isnan(high)]
        near = high if len(high) >= params.least_hits else near
        if len(near):
            at.append(float(i))
            wall.append(float(np.median(near)))
    return np.array(at), np.array(wall)
