"""Which scans contradict the others along a line: all that one of them saw lies off alike.

A scan's error is mostly one of its registration, which shifts the walls on a room's two sides the
same way; furniture before a wall lets one side seem nearer, and a thicker wall both sides apart. So
a scan is held against the others over a line's walls: the faces lie r = d + noise off where the
others have them. The shift d is that of the most faces, and the scan an outlier if by the faces of
either side alone its squared Mahalanobis distance

    d^2 / (1 / sum 1 / sigma^2 + sigma_scan^2)

is beyond what chi squared, of one degree of freedom, allows a scan that is registered as scans are.
"""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from tasks.layout.crowd.faces import Faces, Seen
from tasks.layout.extraction.fusion import fuse

ENOUGH_SCANS = 2
"""Other scans that one must be off from: of two that differ, either may be."""
FITS = 3.0
"""A face agrees with a shift if it is no more standard deviations off."""


@dataclass(frozen=True)
class Drift:
    """A scan's shift along a line against what the others agree on."""

    shift_m: float
    sigma_m: float
    """standard deviation"""
    distance: float
    """squared Mahalanobis distance from how scans are registered, by the side that says less"""


@dataclass(frozen=True, eq=False)
class Residuals:
    """How far off from where others saw it a scan saw each of n faces."""

    off_m: NDArray[np.float64]
    sigma_m: NDArray[np.float64]
    sides: NDArray[np.int64]
    others: tuple[frozenset[int], ...]
    """who saw each"""


def drifting(
    seen: Seen, faces: Faces, partition: tuple[float, float], sigma_m: float, p_outlier: float
) -> dict[int, Drift]:
    """Return the scans that contradict the others along one line.

    Parameters
    ----------
    seen : what scans saw of that line's faces
    partition : thickness of a wall between two faces and its standard deviation, metres
    sigma_m : float
        Standard deviation of a scan's registration, metres.
    p_outlier : float
        Probability with which a scan that is registered as scans are is taken for an outlier.

    Notes
    -----
    The scan that is off furthest is told first; the others are then compared without it.
    """
    found: dict[int, Drift] = {}
    limit = float(chi2.isf(np.sqrt(p_outlier), 1))  # both sides are to be beyond it
    while True:
        away: dict[int, Drift] = {}
        for scan in np.unique(seen.scans).tolist():
            off = residuals(scan, found, seen, faces, partition, sigma_m)
            drift = None if scan in found else drift_of(off, sigma_m)
            if drift is not None and drift.distance > limit:
                away[scan] = drift
        if not away:
            return found
        worst = max(away, key=lambda scan: away[scan].distance)
        found[worst] = away[worst]


def residuals(
    scan: int,
    left_out: Collection[int],
    seen: Seen,
    faces: Faces,
    partition: tuple[float, float],
    sigma_m: float,
) -> Residuals:
    """Return how far off a scan is at each face that others saw, or the opposite one of."""
    off, sigma, sides, others = [], [], [], []
    by_others = (seen.scans != scan) & ~np.isin(seen.scans, list(left_out))
    for i in np.flatnonzero(seen.scans == scan):
        face = seen.faces[i]
        same = np.flatnonzero(by_others & (seen.faces == face))
        behind = np.flatnonzero(by_others & (seen.faces == faces.opposite[face]))
        # an upper face lies further along the line than the lower one of its wall
        through = (2 * faces.sides[face] - 1) * partition[0]
        at = np.append(seen.at_m[same], seen.at_m[behind] + through)
        spread = np.repeat([sigma_m, np.hypot(sigma_m, partition[1])], [len(same), len(behind)])
        who = np.append(seen.scans[same], seen.scans[behind])
        if len(at):
            told = fuse(at, spread, who)
            off.append(seen.at_m[i] - told.position_m)
            sigma.append(np.hypot(told.sigma_m, sigma_m))
            sides.append(faces.sides[face])
            others.append(frozenset(who.tolist()) - set(told.outliers))
    return Residuals(
        np.array(off, float), np.array(sigma, float), np.array(sides, np.int64), tuple(others)
    )


def drift_of(found: Residuals, sigma_m: float) -> Drift | None:
    """Return the shift that most faces are off by; None if too few tell of one."""
    if not len(found.off_m):
        return None
    agree = _agreeing(found)
    who = frozenset[int]().union(*(found.others[i] for i in np.flatnonzero(agree)))
    both = len(np.unique(found.sides[agree])) == 2
    if not both or 2 * agree.sum() < len(agree) or len(who) < ENOUGH_SCANS:
        return None
    of_sides = [_mean(found, agree & (found.sides == side)) for side in (0, 1)]
    distance = min(shift**2 / (variance + sigma_m**2) for shift, variance in of_sides)
    shift, variance = _mean(found, agree)
    return Drift(shift, float(np.sqrt(variance)), distance)


def _mean(found: Residuals, some: NDArray[np.bool_]) -> tuple[float, float]:
    """Return the inverse-variance mean of some residuals and its variance."""
    weight = found.sigma_m[some] ** -2.0
    return float(weight @ found.off_m[some] / weight.sum()), float(1 / weight.sum())


def _agreeing(found: Residuals) -> NDArray[np.bool_]:
    """Return which faces agree with the shift that most do; of equals with the least shift."""
    shifts = np.append(0.0, found.off_m)
    agree: NDArray[np.bool_] = np.abs(found.off_m - shifts[:, None]) <= FITS * found.sigma_m
    return agree[np.lexsort((np.abs(shifts), -agree.sum(axis=1)))[0]]
