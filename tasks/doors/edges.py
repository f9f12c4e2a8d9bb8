"""Edges of a wall face: Canny's and Sobel's of its depth and label images, fused (Sec. 5)."""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PositiveFloat

from storage.wall_images import EMPTY
from tasks.doors.straightening import Straightened, StraightParams
from tasks.params import Params

GREYS = 255
"""Brightest of an 8-bit image, which is what Canny's detector takes."""
SOBEL_OF_STEP = 4
"""What Sobel's 3 x 3 kernel makes of a step of one: the weights of its one side, 1 + 2 + 1."""
Image = NDArray[np.uint8]
"""(a, b): columns along the wall, rows up"""
Mask = NDArray[np.bool_]


class EdgeParams(Params):
    """What step in depth is an edge. The paper names the detectors only."""

    canny_low_m: PositiveFloat = 0.015
    """Step in depth at which Canny's edges go on, metres. Assumption."""
    canny_high_m: PositiveFloat = 0.035
    """Step in depth at which Canny's edges begin, metres: half the recess of a leaf in a thin
    wall. Assumption."""
    sobel_m: PositiveFloat = 0.03
    """Step in depth that is an edge by Sobel's filter, metres. Assumption."""
    median_px: int = Field(default=3, ge=1, le=5)
    """Edge of the median filter before, pixels; odd. Single pixels are the sensor's noise.
    Assumption."""


@dataclass(frozen=True, eq=False)
class Edges:
    """What each detector finds on a face, and both fused."""

    canny: Mask
    """(a, b), I_canny"""
    sobel: Mask
    """(a, b), I_h and I_v in one: the ridges of both slopes"""
    upright: Image
    """(a, b), 255 on an upright edge of I_com and 0 elsewhere"""
    level: Image
    """(a, b), 255 on a level edge"""


def find_edges(
    labels: NDArray[np.uint8], straight: Straightened, shape: StraightParams, params: EdgeParams
) -> Edges:
    """Return the edges of a face.

    Parameters
    ----------
    labels : (a, b) uint8
        As in `WallImages`.
    straight : of the same face
    shape : what reach of depths counts

    Notes
    -----
    Sec. 5 fuses I_canny, I_h and I_v to I_com. Here an edge keeps its direction, that of the
    steeper slope at its pixel: an upright line is looked for among upright edges only.
    """
    to_grey = GREYS / (2 * shape.reach_m)
    depth = np.nan_to_num(straight.depth, nan=0.0)
    depth = np.where((labels == EMPTY) & ~np.isnan(straight.depth), shape.reach_m, depth)
    grey = (np.clip(depth, -shape.reach_m, shape.reach_m) + shape.reach_m) * to_grey
    image = cv2.medianBlur(np.ascontiguousarray(grey.round(), np.uint8), params.median_px)
    scale = SOBEL_OF_STEP * to_grey
    # OpenCV's rows are our columns: its y runs along the wall, its x runs up
    along, up = _sobel(image, 0, 1), _sobel(image, 1, 0)
    canny = _canny(along, up, params.canny_low_m * scale, params.canny_high_m * scale)
    steep = np.abs(along) >= np.abs(up)
    limit = params.sobel_m * scale
    across, over = _ridge(np.abs(along), limit, 0), _ridge(np.abs(up), limit, 1)
    return Edges(
        canny=canny,
        sobel=across | over,
        upright=_drawn((canny & steep) | across),
        level=_drawn((canny & ~steep) | over),
    )


def _drawn(mask: Mask) -> Image:
    return np.where(mask, np.uint8(GREYS), np.uint8(0))


def _sobel(image: Image, x: int, y: int) -> NDArray[np.int16]:
    return np.asarray(cv2.Sobel(image, cv2.CV_16S, x, y, ksize=3, borderType=cv2.BORDER_REPLICATE))


def _canny(along: NDArray[np.int16], up: NDArray[np.int16], low: float, high: float) -> Mask:
    return np.asarray(cv2.Canny(up, along, low, high, L2gradient=True)) > 0


def _ridge(slope: NDArray[Any], limit: float, axis: int) -> Mask:
    """Return the pixels over the limit that are no less steep than their two neighbours."""
    padded = np.pad(slope, [(1, 1) if a == axis else (0, 0) for a in (0, 1)])
    before = padded[:-2] if axis == 0 else padded[:, :-2]
    after = padded[2:] if axis == 0 else padded[:, 2:]
    return (slope >= limit) & (slope >= before) & (slope > after)
