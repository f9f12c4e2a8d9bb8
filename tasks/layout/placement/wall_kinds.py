"""What the partitions of a storey are: how thick, by the grammar and by what was seen of them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tasks.layout.placement.decoded_rows import DecodedRow

ENOUGH = 4
"""Walls seen from both sides from which the storey tells how thick its own partitions are."""
FAR = 3.0
"""A wall is a partition if its thickness is no more standard deviations off."""
TO_SIGMA = 1.4826
"""A normal distribution's standard deviation over its median absolute deviation."""
PLASTER_M = 0.005
"""Least spread of the partitions' thickness, metres: plaster. Assumption."""
LEAST_SIGMA_M = 0.005
"""Least standard deviation of a wall's face, metres: what registration leaves. Assumption."""


@dataclass(frozen=True)
class Partition:
    """Thickness of partitions, a normal distribution."""

    thickness_m: float
    spread_m: float
    noise: float = 1.0
    """standard deviation of the distance of two faces, as a share of what their own say: faces that
    are off together are as far apart as ever"""


def partition_of(rows: Sequence[DecodedRow], thickness_m: float, spread_m: float) -> Partition:
    """Return the partitions of a storey, by those of the grammar.

    Parameters
    ----------
    thickness_m, spread_m : float
        Of the grammar's partitions. Its spread is that of all walls along lines, thick ones among
        them, and of several buildings.

    Notes
    -----
    Of the walls seen from both sides those within FAR deviations are partitions: their median is
    weighed against the grammar's thickness by precision (the variance of a median is pi / 2 that
    of a mean), their robust variance, less that of what is seen, is the spread; where they
    scatter by less than what is seen ought to, that is less uncertain.
    """
    between = [row.two_faced & (row.cuts >= 0) for row in rows]
    apart = [np.diff(row.faces_m[k], axis=1)[:, 0] for row, k in zip(rows, between, strict=True)]
    seen = np.concatenate([np.zeros(0), *apart])
    own_m = (row.chain.sigma_m[k] for row, k in zip(rows, between, strict=True))
    sigma = np.concatenate([np.zeros(0), *own_m])
    noise = 2 * sigma  # the centre is the mean of two faces, the thickness their difference
    near = np.abs(seen - thickness_m) <= FAR * np.hypot(noise, spread_m)
    if near.sum() < ENOUGH:
        return Partition(thickness_m, spread_m)
    median = float(np.median(seen[near]))
    scatter = TO_SIGMA * float(np.median(np.abs(seen[near] - median)))
    of_median = np.pi / 2 * max(scatter, PLASTER_M) ** 2 / near.sum()
    own, prior = 1 / of_median, 1 / spread_m**2
    usual = float(np.median(noise[near]))
    excess = np.sqrt(max(scatter**2 - usual**2, 0.0))
    return Partition(
        (median * own + thickness_m * prior) / (own + prior),
        float(np.clip(excess, min(PLASTER_M, spread_m), spread_m)),
        min(max(scatter, PLASTER_M) / usual, 1.0),
    )


def face_sigma_m(sigma_m: float, faces: int, spread_m: float) -> float:
    """Return the standard deviation of a wall's face, by that of its centre.

    The variance of a centre is half that of either of two faces; of a single face it is the face's
    and a quarter of the thickness'.
    """
    variance = 2 * sigma_m**2 if faces == 2 else sigma_m**2 - spread_m**2 / 4
    return max(float(np.sqrt(max(variance, 0.0))), LEAST_SIGMA_M)
