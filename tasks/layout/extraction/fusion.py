"""What several scans say of one position, combined: inverse variance, outliers named."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FAR = 3.5
"""Standard deviations from the others' median at which a scan is an outlier (Iglewicz and Hoaglin's
limit for modified z-scores)."""
ENOUGH = 3
"""Scans from which one can be told to be off: of two that differ, either may be."""


@dataclass(frozen=True)
class Fused:
    """A position that scans agree on."""

    position_m: float
    sigma_m: float
    outliers: tuple[int, ...]
    """scans left out, ascending"""


def fuse(
    positions: NDArray[np.float64], sigmas: NDArray[np.float64], scans: NDArray[np.int64]
) -> Fused:
    """Return the inverse-variance mean of what scans measured, without outliers.

    Parameters
    ----------
    positions, sigmas : (n,) float
        Metres; standard deviations are positive.
    scans : (n,) int
        Which scan each measurement is of. Those of one scan share its registration: together they
        count as one, at their inverse-variance mean and with the least of their deviations.

    Returns
    -------
    Fused
        NaN and infinite if nothing was measured.

    Notes
    -----
    A scan is an outlier if it lies further than FAR from the weighted median of all, in deviations
    of its own and of what the scans scatter by around that median (1.4826 times the median absolute
    deviation, no more than the scans' own if they keep to it). What is left is averaged; where it
    scatters by more than its deviations explain, sigma grows with it (the scale factor of Birge
    1932: the root of chi squared per degree of freedom, at least one).
    """
    every = np.unique(scans)
    if not len(every):
        return Fused(float("nan"), float("inf"), ())
    at, own = np.empty(len(every)), np.empty(len(every))
    for i, scan in enumerate(every):
        mine = scans == scan
        at[i] = np.average(positions[mine], weights=sigmas[mine] ** -2.0)
        own[i] = sigmas[mine].min()
    kept = _agreeing(at, own)
    weights = own[kept] ** -2.0
    mean = float(np.average(at[kept], weights=weights))
    degrees = int(kept.sum()) - 1
    chi2 = float(weights @ (at[kept] - mean) ** 2)
    scale = max(1.0, np.sqrt(chi2 / degrees)) if degrees else 1.0
    return Fused(mean, float(scale / np.sqrt(weights.sum())), tuple(every[~kept].tolist()))


def _agreeing(at: NDArray[np.float64], own: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which scans are no outliers."""
    if len(at) < ENOUGH:
        return np.ones(len(at), bool)
    middle = weighted_median(at, own**-2.0)
    away = np.abs(at - middle)
    usual = max(float(np.median(own)), 1.4826 * float(np.median(away)))
    return away <= FAR * np.maximum(own, usual)


def weighted_median(values: NDArray[np.float64], weights: NDArray[np.float64]) -> float:
    """Return the weighted median; the middle of two values that share the weight evenly."""
    order = np.argsort(values, kind="stable")
    ranked, share = values[order], np.cumsum(weights[order]) / weights.sum()
    low = int(np.searchsorted(share, 0.5 - 1e-12))
    high = int(np.searchsorted(share, 0.5 + 1e-12))
    return float((ranked[low] + ranked[min(high, len(ranked) - 1)]) / 2)
