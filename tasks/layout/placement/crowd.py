"""Several volunteers' decoded rooms of one reference line, combined."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tasks.layout.extraction.fusion import fuse


@dataclass(frozen=True, eq=False)
class Agreed:
    """The rooms most volunteers decoded along a line, and where their walls stand."""

    rules: tuple[str, ...]
    """of the n rooms"""
    position_m: NDArray[np.float64]
    """(n + 1,), NaN where nobody saw the wall"""
    sigma_m: NDArray[np.float64]
    """(n + 1,), infinite where nobody saw the wall"""
    others: tuple[int, ...]
    """volunteers who decoded other rooms: they have no say"""
    outliers: tuple[tuple[int, ...], ...]
    """(n + 1,), volunteers whose wall lies off what the others agree on"""


def fuse_decoded(
    rules: Sequence[tuple[str, ...]],
    position_m: Sequence[NDArray[np.float64]],
    sigma_m: Sequence[NDArray[np.float64]],
) -> Agreed:
    """Return what volunteers who mapped one line independently agree on.

    Parameters
    ----------
    rules : per volunteer the rules of the rooms along the line
    position_m, sigma_m : per volunteer the boundaries, one more than rooms, along the same line;
        NaN positions: not seen

    Raises
    ------
    ValueError
        Without volunteers, or where boundaries do not fit the rooms.

    Notes
    -----
    Of the sequences of rooms the one decoded most often counts, of equals the one with the least
    variance in sum. Its boundaries are combined by inverse variance without outliers (`fusion`).
    """
    if not rules:
        raise ValueError("fuse_decoded: no volunteer; give at least one")
    for who, (some, at, sigma) in enumerate(zip(rules, position_m, sigma_m, strict=True)):
        if not len(at) == len(sigma) == len(some) + 1:
            raise ValueError(
                f"volunteer {who}: expected {len(some) + 1} boundaries, got {len(at)} and "
                f"{len(sigma)} deviations"
            )
    votes = Counter(rules)

    def rank(who: int) -> tuple[int, float, int]:
        return -votes[rules[who]], float(np.square(sigma_m[who]).sum()), who

    chosen = rules[min(range(len(rules)), key=rank)]
    members = np.array([who for who, some in enumerate(rules) if some == chosen])
    at, sigma = np.array([position_m[m] for m in members]), np.array([sigma_m[m] for m in members])
    seen = ~np.isnan(at)
    walls = [
        fuse(at[seen[:, k], k], sigma[seen[:, k], k], members[seen[:, k]])
        for k in range(len(chosen) + 1)
    ]
    return Agreed(
        rules=chosen,
        position_m=np.array([wall.position_m for wall in walls]),
        sigma_m=np.array([wall.sigma_m for wall in walls]),
        others=tuple(who for who, some in enumerate(rules) if some != chosen),
        outliers=tuple(wall.outliers for wall in walls),
    )
