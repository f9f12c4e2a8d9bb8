"""Groups of like numbers: the division of widths, or depths, that is shortest to describe."""

import numpy as np
from numpy.typing import NDArray

DIGITS = 6
"""Numbers are compared to the micrometre, lest a turned plan's rounding regroups them."""


def group_values(values: NDArray[np.float64], floor: float) -> NDArray[np.int64]:
    """Return the group of each value, from 0 for the least; groups do not overlap.

    Parameters
    ----------
    values : (n,) float
    floor : least standard deviation of a group: values that close are alike

    Returns
    -------
    (n,) int

    Notes
    -----
    The description length of a division into groups k of n_k values, mean m_k and spread s_k =
    max(standard deviation, floor), in nats, is

        sum_k [ sum_i (x_i - m_k)^2 / (2 s_k^2) + n_k log s_k - n_k log(n_k / n) + (3/2) log n ]

    up to a constant: each value's negative log density in a mixture of normal distributions, and
    half a log n for each of a group's three parameters (Bayesian information criterion). Its least
    value over all divisions of the sorted values is found exactly by dynamic programming.
    """
    order = np.argsort(values, kind="stable")
    x = np.round(values[order], DIGITS)
    n = len(x)
    if n == 0:
        return np.empty(0, np.int64)
    x = x - x.mean()  # sums of squares lose less
    sums, squares = (np.concatenate(([0.0], np.cumsum(v))) for v in (x, x * x))
    best, start = np.zeros(n + 1), np.zeros(n + 1, np.int64)
    for end in range(1, n + 1):
        begin = np.arange(end)
        count = (end - begin).astype(float)
        around = squares[end] - squares[begin] - (sums[end] - sums[begin]) ** 2 / count
        variance = np.maximum(np.maximum(around, 0) / count, floor**2)
        cost = np.maximum(around, 0) / (2 * variance) + count / 2 * np.log(variance)
        cost += 1.5 * np.log(n) - count * np.log(count / n) + best[:end]
        # equal values stay together
        split = (begin > 0) & (x[begin] == x[np.maximum(begin - 1, 0)])
        cost = np.where(split, np.inf, cost)
        start[end] = int(np.argmin(cost))
        best[end] = cost[start[end]]
    labels = np.empty(n, np.int64)
    end, groups = n, []
    while end > 0:
        groups.append((int(start[end]), end))
        end = int(start[end])
    for label, (low, high) in enumerate(reversed(groups)):
        labels[order[low:high]] = label
    return labels
