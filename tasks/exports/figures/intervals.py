"""The mean over repeats, and how sure it is."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit


@dataclass(frozen=True)
class Mean:
    """A mean and the ends of its 95 % interval; NaN where it is not defined."""

    value: float
    low: float
    high: float


def mean_of(values: NDArray[np.float64]) -> Mean:
    """Return the mean of repeats with its 95 % confidence interval, by Student's t.

    Parameters
    ----------
    values : (n,) float
        NaN is left out. Of none the mean is NaN, of one the interval is.
    """
    known = values[~np.isnan(values)]
    if len(known) == 0:
        return Mean(np.nan, np.nan, np.nan)
    mean = float(known.mean())
    if len(known) == 1:
        return Mean(mean, np.nan, np.nan)
    half = float(stdtrit(len(known) - 1, 0.975) * known.std(ddof=1) / np.sqrt(len(known)))
    return Mean(mean, mean - half, mean + half)
