"""The probabilistic quality model: a scan's incompleteness and skewness (Sec. 3.2, Eq. 1-4).

Eq. 1 is the angle about the device's x axis. It sees the device tipped to look up or down, and
held upside down; a turn about the view axis alone (upright to sideways) leaves it at 90 degrees
until the device lies exactly on its side, where it is undefined.
"""

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, NonNegativeInt, PositiveFloat

from storage.quality import Quality
from storage.snapshots import Snapshots
from tasks.params import Params

T_Q = 0.8
"""Quality requirement where a query names none. Not in the paper: chosen on a simulated campaign of
48 scans of two training storeys, where it keeps back two, both of no use, and leaves one of no use;
0.5 would keep back 18 for three. A complete scan of level views has p_sum 0, one of level views and
of some 35 degrees up and down 0.33, one that only looks 40 degrees down 0.59."""
ON_ITS_SIDE = 1e-6
"""Sine of the angle between the device's x axis and the vertical below which Eq. 1 is noise."""


class QualityParams(Params):
    """Parameters of the quality model."""

    alpha_p: NonNegativeInt = 5000
    """Most points of an incomplete snapshot (Sec. 3.2.2)."""
    mu_rad: float = float(np.deg2rad(90))
    """Roll of a device held correctly, radians (Sec. 3.2.2)."""
    sigma_rad: PositiveFloat = float(np.deg2rad(30))
    """Standard deviation of the roll, radians. The paper prints a variance of 30 degrees; the unit
    is that of a standard deviation, and 5.5 degrees would reject all that look at a ceiling."""
    t_q: float = Field(default=T_Q, ge=0, le=1)
    """Quality requirement of the sensing query: greatest P_sum accepted (Eq. 4)."""


def assess(snapshots: Snapshots, params: QualityParams) -> Quality:
    """Return the quality of a scan and whether it may be uploaded.

    Parameters
    ----------
    snapshots : Snapshots
        k snapshots, poses from device frame to building frame. One without points counts as
        incomplete, and its pose as any other. With k = 0 the scan is not assessed.

    Notes
    -----
    Incompleteness is the share of snapshots of at most `alpha_p` points; with skewness P_sk,
    P_sum = P_in + P_sk - P_in P_sk (Eq. 3), accepted if P_sum <= T_q (Eq. 4).
    """
    k = len(snapshots)
    few = int((snapshots.points <= params.alpha_p).sum())
    if k == 0:
        return Quality(0, 0, None, None, None, None, params.t_q, None, "not assessed")
    p_in = few / k
    skews = skewness(roll(snapshots.rotations), params)
    p_sk = float(skews.mean())
    p_sum = p_in + (1 - p_in) * p_sk  # Eq. 3, so that rounding takes it past neither 0 nor 1
    return Quality(
        snapshots=k,
        incomplete=few,
        p_in=p_in,
        p_sk=p_sk,
        p_sk_worst=float(skews.max()),
        p_sum=p_sum,
        t_q=params.t_q,
        accepted=p_sum <= params.t_q,
        reason=_reason(p_in, p_sk, p_sum, params.t_q),
    )


def roll(rotations: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the roll of devices (Eq. 1), radians in [-pi, pi].

    Parameters
    ----------
    rotations : (k, 4) float
        Unit quaternions (a, b, c, d), device frame -> building frame.

    Returns
    -------
    (k,) float
        NaN for a device on its side, its x axis vertical: roll and heading are one angle there.
    """
    a, b, c, d = rotations.T
    up = 2 * (a * b + c * d)  # height of the device's y axis
    back = 1 - 2 * (b**2 + c**2)  # height of its z axis
    return np.where(np.hypot(up, back) > ON_ITS_SIDE, np.arctan2(up, back), np.nan)


def skewness(rolls: NDArray[np.float64], params: QualityParams) -> NDArray[np.float64]:
    """Return 1 - P(X = roll) per snapshot (Eq. 2), 1 where the roll is undefined.

    Notes
    -----
    A density is no probability: P(X = roll) is read as the density relative to its peak, at the
    smallest angle between the roll and mu.
    """
    off = np.remainder(rolls - params.mu_rad + np.pi, 2 * np.pi) - np.pi
    return np.where(np.isnan(rolls), 1.0, -np.expm1(-((off / params.sigma_rad) ** 2) / 2))


def _reason(p_in: float, p_sk: float, p_sum: float, t_q: float) -> str:
    if p_sum <= t_q:
        return ""
    if p_in > t_q >= p_sk:
        return "incomplete"
    if p_sk > t_q >= p_in:
        return "skewed"
    return "incomplete and skewed"  # both, or neither alone
