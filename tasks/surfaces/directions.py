"""The directions a storey is built in, and which faces keep to them."""

import numpy as np
from numpy.typing import NDArray

from storage.faces import Faces

QUARTER = np.pi / 2
FRAME_WIDTH = np.radians(4)
"""Faces within this of a direction belong to its frame."""
FRAME_SHARE = 0.12
"""Share of all wall area a frame of two perpendicular directions must hold."""


def frames(angles: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the directions, modulo a quarter turn, that most walls keep to, strongest first.

    One frame is a Manhattan world, several are an Atlanta world; a storey whose walls keep to
    nothing has none.

    Parameters
    ----------
    angles : (k,) float
        Directions of the walls, radians.
    weights : (k,) float
        Their areas.
    """
    angles, left = angles % QUARTER, weights.astype(float).copy()
    found: list[float] = []
    while left.sum() > 0:
        near = np.abs(_turn(angles[:, None], angles[None])) < FRAME_WIDTH
        support = near @ left
        centre = angles[support.argmax()]
        if support.max() < FRAME_SHARE * weights.sum():
            break
        inside = np.abs(_turn(angles, centre)) < FRAME_WIDTH
        off = _turn(angles[inside], centre)
        found.append(float((centre + np.average(off, weights=left[inside] + 1e-12)) % QUARTER))
        left[inside] = 0
    return np.array(found)


def off_frames(angles: NDArray[np.float64], frames_: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return each angle's signed distance from its nearest frame direction, (k,), radians."""
    if not len(frames_):
        return np.full(len(angles), np.inf)
    off = _turn(angles[:, None] % QUARTER, frames_[None])
    return off[np.arange(len(off)), np.abs(off).argmin(axis=1)]


def face_angles(faces: Faces) -> NDArray[np.float64]:
    """Return the direction of each face's normal in plan, (k,), radians."""
    return np.arctan2(faces.normals[:, 1], faces.normals[:, 0])


def _turn(a: NDArray[np.float64], b: NDArray[np.float64] | float) -> NDArray[np.float64]:
    """Return a - b modulo a quarter turn, in [-1/8, 1/8) turn."""
    return (a - b + QUARTER / 2) % QUARTER - QUARTER / 2
