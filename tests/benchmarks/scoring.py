"""How well found planes match the true surfaces of a simulated cloud."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tasks.simulation.clouds import Surfaces

ANGLE_DEG, OFFSET_M = 5.0, 0.05
"""A plane stands for a surface within this angle, and this distance at the surface's centre."""
ROOM = ("floor", "ceiling", "wall")
FURNITURE = ("table", "seat", "back")


@dataclass(frozen=True, eq=False)
class Errors:
    """How far each of m planes is from each of s surfaces."""

    angle_deg: NDArray[np.float64]
    """(s, m)"""
    offset_m: NDArray[np.float64]
    """(s, m), at the surface's centre"""

    @property
    def close(self) -> NDArray[np.bool_]:
        """(s, m), which plane stands for which surface"""
        return (self.angle_deg < ANGLE_DEG) & (self.offset_m < OFFSET_M)


def errors(
    normals: NDArray[np.float64], offsets: NDArray[np.float64], surfaces: Surfaces
) -> Errors:
    """Compare m planes, taken as unbounded, with s surfaces."""
    # by the sine: the cosine of a hundredth of a degree is 1 to eight digits
    sine = np.linalg.norm(np.cross(surfaces.normals[:, None], normals[None]), axis=2)
    away = np.abs(surfaces.centres @ normals.T - offsets)
    return Errors(np.degrees(np.arcsin(np.clip(sine, 0, 1))), away)


def score(
    normals: NDArray[np.float64], offsets: NDArray[np.float64], surfaces: Surfaces
) -> dict[str, Any]:
    """Return what was found and how exactly.

    Parameters
    ----------
    normals : (m, 3) float, unit length
    offsets : (m,) float, metres
    surfaces : the truth

    Returns
    -------
    dict
        Planes, surfaces of the rooms and of the furniture found, angle and offset errors of the
        best plane of each found room surface. Surfaces in one plane count as found by one plane.
    """
    off = errors(normals, offsets, surfaces)
    room, furniture = (np.isin(surfaces.roles, roles) for roles in (ROOM, FURNITURE))
    badness = np.where(off.close, off.angle_deg / ANGLE_DEG + off.offset_m / OFFSET_M, np.inf)
    found = off.close.any(axis=1)
    figures: dict[str, Any] = {
        "planes": len(offsets),
        "recall": int(found[room].sum()),
        "surfaces": int(room.sum()),
        "furniture": int(found[furniture].sum()),
        "pieces": int(furniture.sum()),
    }
    rows = np.flatnonzero(room & found)
    if len(rows):
        best = badness[rows].argmin(axis=1)
        angles, offset = off.angle_deg[rows, best], 1000 * off.offset_m[rows, best]
        figures |= {
            "angle_deg": float(np.median(angles)),
            "angle_worst_deg": float(angles.max()),
            "offset_mm": float(np.median(offset)),
            "offset_worst_mm": float(offset.max()),
        }
    return figures
