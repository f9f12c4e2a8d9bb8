"""Upright and level lines among edges, by the probabilistic Hough transform (Sec. 5)."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import PositiveFloat, PositiveInt

from tasks.params import Params


class LineParams(Params):
    """What is a line. The paper names the method only (Matas et al. 2000)."""

    votes_m: PositiveFloat = 0.25
    """Edge pixels on a line that make it one, as a length, metres. Assumption."""
    length_m: PositiveFloat = 0.3
    """Shortest line, metres. Assumption."""
    gap_m: PositiveFloat = 0.3
    """Longest gap within a line, metres: furniture hides some of an edge. Assumption."""
    apart_m: PositiveFloat = 0.06
    """Lines nearer than this to a longer one are that one, metres: a frame's width. Assumption."""
    most: PositiveInt = 40
    """Lines of one direction kept per ten metres of face, the longest first: what bounds the
    rectangles made of them. Assumption."""


@dataclass(frozen=True, eq=False)
class Lines:
    """k parallel lines, ascending by place; entry i is one line in every array. Metres."""

    places: NDArray[np.float64]
    """(k,), where the line lies across its direction"""
    begins: NDArray[np.float64]
    """(k,), where it begins along its direction"""
    ends: NDArray[np.float64]
    """(k,), where it ends along its direction"""
    lengths: NDArray[np.float64]
    """(k,), metres of it that are an edge's"""

    def __len__(self) -> int:
        return len(self.places)


def upright_lines(edges: NDArray[np.uint8], pixel_m: float, params: LineParams) -> Lines:
    """Return the upright lines of a face: places along the face, begins and ends up.

    Parameters
    ----------
    edges : (a, b) uint8
        255 on upright edges, as of `find_edges`.
    """
    return _lines(edges, pixel_m, params, most=_most(len(edges), pixel_m, params))


def level_lines(edges: NDArray[np.uint8], pixel_m: float, params: LineParams) -> Lines:
    """Return the level lines of a face: places up, begins and ends along the face."""
    return _lines(edges.T, pixel_m, params, most=_most(len(edges), pixel_m, params))


def _most(columns: int, pixel_m: float, params: LineParams) -> int:
    return int(np.ceil(params.most * columns * pixel_m / 10))


def _lines(edges: NDArray[np.uint8], pixel_m: float, params: LineParams, most: int) -> Lines:
    """Return the lines that run along an image's second axis."""
    found = cv2.HoughLinesP(
        np.ascontiguousarray(edges),
        rho=1,
        theta=np.pi / 2,  # the two directions of a wall's rectangles and nothing between
        threshold=max(round(params.votes_m / pixel_m), 1),
        minLineLength=params.length_m / pixel_m,
        maxLineGap=params.gap_m / pixel_m,
    )
    ends = np.empty((0, 4), np.int64) if found is None else found.reshape(-1, 4).astype(np.int64)
    x0, y0, x1, _ = ends[ends[:, 1] == ends[:, 3]].T  # along the rows of OpenCV's image
    low, high = np.minimum(x0, x1), np.maximum(x0, x1)
    on_edge = np.concatenate([np.zeros((len(edges), 1)), np.cumsum(edges > 0, axis=1)], axis=1)
    lengths = on_edge[y0, high + 1] - on_edge[y0, low]
    kept = _longest(y0, low, high, lengths, params.apart_m / pixel_m, most)
    return Lines(
        places=(y0[kept] + 0.5) * pixel_m,
        begins=low[kept] * pixel_m,
        ends=(high[kept] + 1) * pixel_m,
        lengths=lengths[kept] * pixel_m,
    )


def _longest(
    rows: NDArray[np.int64],
    low: NDArray[np.int64],
    high: NDArray[np.int64],
    lengths: NDArray[np.float64],
    apart: float,
    most: int,
) -> NDArray[np.int64]:
    """Return the lines but those beside a longer one that overlaps them, ascending by row."""
    kept: list[int] = []
    for i in np.lexsort((low, rows, -lengths)):
        if len(kept) == most:
            break
        near = [j for j in kept if abs(rows[j] - rows[i]) < apart]
        if not any(low[i] <= high[j] and low[j] <= high[i] for j in near):
            kept.append(int(i))
    chosen = np.array(kept, np.int64)
    return chosen[np.lexsort((low[chosen], rows[chosen]))]
