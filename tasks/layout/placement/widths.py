"""Where walls stand along reference lines: observed positions and rule widths, fused.

Along a line with boundaries x_0 .. x_n between n rooms the sum

    sum_k (x_k - observed_k)^2 / sigma_k^2 + sum_k (x_{k+1} - x_k - width_k)^2 / spread_k^2

is least. Its normal equations are tridiagonal and closed; the inverse of their matrix is the
covariance. The line's two ends are boundaries like any other, so widths add up to its length.
Lines that share walls are solved together.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, solveh_banded
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components


@dataclass(frozen=True, eq=False)
class Chain:
    """The n + 1 boundaries of n rooms along one line."""

    observed_m: NDArray[np.float64]
    """(n + 1,), positions along the line"""
    sigma_m: NDArray[np.float64]
    """(n + 1,), their standard deviations, positive"""
    width_m: NDArray[np.float64]
    """(n,), widths by the rules; NaN where no rule explains the room"""
    spread_m: NDArray[np.float64]
    """(n,), their standard deviations, positive; NaN as the width is"""

    def without(self, rooms: NDArray[np.bool_]) -> "Chain":
        """Return the chain with some rooms' rules left out."""
        return replace(self, width_m=np.where(rooms, np.nan, self.width_m))


@dataclass(frozen=True)
class Tie:
    """One wall that two lines cross: x_b = sign x_a + offset, but for sigma."""

    chain_a: int
    boundary_a: int
    chain_b: int
    boundary_b: int
    sign: float
    offset_m: float
    sigma_m: float


@dataclass(frozen=True, eq=False)
class Fused:
    """The boundaries of one line after the fusion."""

    position_m: NDArray[np.float64]
    """(n + 1,)"""
    sigma_m: NDArray[np.float64]
    """(n + 1,), standard deviations"""


def fuse_chain(chain: Chain) -> Fused:
    """Return the least-squares positions of one line's boundaries and their deviations."""
    diagonal, off, right = _normal_equations(chain)
    banded = np.vstack([np.append(0.0, off), diagonal])
    solved = solveh_banded(banded, np.column_stack([right, np.eye(len(right))]))
    return Fused(solved[:, 0], np.sqrt(np.diag(solved[:, 1:])))


def fuse_chains(chains: Sequence[Chain], ties: Sequence[Tie]) -> list[Fused]:
    """Return the least-squares positions of several lines' boundaries, shared walls tied.

    Notes
    -----
    Each tie adds (x_b - sign x_a - offset)^2 / sigma^2 to the sum. Only lines that ties connect
    are solved together; every other line costs its own length.
    """
    group = _groups(len(chains), ties)
    fused: list[Fused | None] = [None] * len(chains)
    for number in range(group.max(initial=-1) + 1):
        members = np.flatnonzero(group == number)
        if len(members) == 1:
            fused[members[0]] = fuse_chain(chains[members[0]])
            continue
        within = [t for t in ties if group[t.chain_a] == number]
        for i, one in zip(members, _fuse_tied(members, chains, within), strict=True):
            fused[i] = one
    return [one for one in fused if one is not None]


def replace_chain(chain: Chain) -> Fused:
    """Return the boundaries as the paper places them: rule widths one after the other.

    Notes
    -----
    Sec. 4.2.2: rooms are cascaded from the line's start, each as wide as its rule; a room without
    a rule keeps its observed width. Observations have no further say and the line's end none.
    """
    observed = np.diff(chain.observed_m)
    widths = np.where(np.isnan(chain.width_m), observed, chain.width_m)
    position = chain.observed_m[0] + np.concatenate([[0.0], np.cumsum(widths)])
    variance = np.where(
        np.isnan(chain.width_m),
        chain.sigma_m[1:] ** 2 + chain.sigma_m[:-1] ** 2,
        chain.spread_m**2,
    )
    summed = chain.sigma_m[0] ** 2 + np.concatenate([[0.0], np.cumsum(variance)])
    return Fused(position, np.sqrt(summed))


def _normal_equations(
    chain: Chain,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return diagonal, first off-diagonal and right side of the tridiagonal system."""
    known = ~np.isnan(chain.width_m)
    stiff = np.where(known, 1 / np.where(known, chain.spread_m, 1.0) ** 2, 0.0)
    pull = stiff * np.where(known, chain.width_m, 0.0)
    weight = 1 / chain.sigma_m**2
    diagonal = weight + np.append(stiff, 0.0) + np.append(0.0, stiff)
    right = weight * chain.observed_m + np.append(0.0, pull) - np.append(pull, 0.0)
    return diagonal, -stiff, right


def _groups(count: int, ties: Sequence[Tie]) -> NDArray[np.int32]:
    a = [t.chain_a for t in ties]
    b = [t.chain_b for t in ties]
    graph = coo_array((np.ones(len(ties)), (a, b)), shape=(count, count))
    labels: NDArray[np.int32] = connected_components(graph, directed=False)[1]
    return labels


def _fuse_tied(
    members: NDArray[np.int64], chains: Sequence[Chain], ties: Sequence[Tie]
) -> list[Fused]:
    sizes = [len(chains[i].observed_m) for i in members]
    first = dict(zip(members.tolist(), np.cumsum([0, *sizes[:-1]]).tolist(), strict=True))
    matrix, right = np.zeros((sum(sizes), sum(sizes))), np.zeros(sum(sizes))
    for i in members:
        diagonal, off, pull = _normal_equations(chains[i])
        at = first[int(i)] + np.arange(len(diagonal))
        matrix[at, at] = diagonal
        matrix[at[:-1], at[1:]] = matrix[at[1:], at[:-1]] = off
        right[at] = pull
    for tie in ties:
        a, b = first[tie.chain_a] + tie.boundary_a, first[tie.chain_b] + tie.boundary_b
        weight = 1 / tie.sigma_m**2
        matrix[a, a] += weight
        matrix[b, b] += weight
        matrix[a, b] -= tie.sign * weight
        matrix[b, a] -= tie.sign * weight
        right[a] -= tie.sign * tie.offset_m * weight
        right[b] += tie.offset_m * weight
    factor = cho_factor(matrix)
    position = cho_solve(factor, right)
    sigma = np.sqrt(np.diag(cho_solve(factor, np.eye(len(right)))))
    spans = [slice(first[int(i)], first[int(i)] + n) for i, n in zip(members, sizes, strict=True)]
    return [Fused(position[span], sigma[span]) for span in spans]
