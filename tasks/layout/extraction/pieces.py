"""Pieces of wall as a reference line meets them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tasks.layout.extraction.model import LineFrame


@dataclass(frozen=True, eq=False)
class Pieces:
    """k pieces of wall across a line."""

    at: NDArray[np.float64]
    """(k,), place along the line of the middle of what lies to the left of it, metres"""
    near: NDArray[np.float64]
    far: NDArray[np.float64]
    """(k,), from where to where they reach to the left of the line, metres"""
    across: NDArray[np.bool_]
    """(k,), square on the line, to its left, and long enough"""


def pieces_across(
    lines: NDArray[np.float64],
    frame: LineFrame,
    reach: tuple[float, float],
    angle: float,
    shortest: float,
) -> Pieces:
    """Return straight pieces (k, 2, 2) in a line's coordinates, and which of them lie across it.

    Parameters
    ----------
    reach : where along the line to look, metres
    angle : greatest turn off the square on it, radians
    shortest : least metres on its left
    """
    local = frame.local(lines)
    near, far = local[..., 1].min(axis=1), local[..., 1].max(axis=1)
    step = local[:, 1] - local[:, 0]
    square = np.abs(step[:, 0]) <= np.tan(angle) * np.abs(step[:, 1])
    begin = np.maximum(near, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        rise = np.where(square & (far > near), step[:, 0] / step[:, 1], 0.0)
    at = local[:, 0, 0] + ((begin + far) / 2 - local[:, 0, 1]) * rise
    across = square & (far - begin >= shortest) & (at >= reach[0]) & (at <= reach[1])
    return Pieces(at, near, far, across)
