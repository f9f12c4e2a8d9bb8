"""Which hypotheses of a line's walls hold, and which rules: the most probable of all together.

With the hypotheses h of the walls and v of the rules (a rule holds, or says nothing of its room)
the boundaries x_0 .. x_n of a line have the density

    p(x, h, v) = prod_k p(h_k) N(x_k; centre_h, sigma_h^2)
               * prod_k (1 - q) N(x_{k+1} - x_k; width_k, (f spread_k)^2)  or  q / range,

the first factor of a pair where the rule holds, the second where it does not. Given h and v all is
normal and x integrates out step by step (Kalman's filter), so the search runs along the line over
mean, variance and probability of what came before; what is improbable is dropped. A room without a
rule, or whose rule does not hold, parts the line: before it only the most probable counts, as in
Viterbi's algorithm.

f says how closely the storey keeps to the rules' spreads, the same for all its rooms: where rooms
are multiples of a module they fit better than the tolerances a grammar allows for. Its posterior
over a few values is what all lines together say.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from tasks.layout.placement.hypotheses import Hypotheses
from tasks.layout.placement.widths import Chain

P_WRONG = 0.03
"""Probability that a decoded rule is not the room's. Assumption."""
RANGE_M = 2.0
"""Widths of rooms that no rule explains are alike over such a range, metres. Assumption."""
KEPT = 200
"""Combinations that are followed along a line."""
FITS = np.geomspace(0.125, 1.0, 7)
"""How closely a storey may keep to the rules' spreads; beforehand as probable as their square, so
that a storey that tells nothing hardly tightens them. None is looser: rules that fit worse than
they say are another building's."""


@dataclass(frozen=True, eq=False)
class Choice:
    """The most probable hypotheses of one line."""

    walls: NDArray[np.int64]
    """(n + 1,), hypothesis of each boundary"""
    doubted: NDArray[np.bool_]
    """(n,), rooms whose rule does not hold; False where there is none"""
    log_p: float

    @classmethod
    def first(cls, rooms: int) -> "Choice":
        """Return the first hypothesis of each wall: every face is a partition's, no rule wrong."""
        return cls(np.zeros(rooms + 1, np.int64), np.zeros(rooms, bool), 0.0)


def choose(chain: Chain, hypotheses: Sequence[Hypotheses], fit: float) -> Choice:
    """Return the most probable hypotheses of a line's boundaries and rules.

    Parameters
    ----------
    fit : float
        Factor on the spreads of the rules, f.
    """
    mean, variance, log_p = np.zeros(1), np.full(1, np.inf), np.zeros(1)
    walls, doubted = np.zeros((1, 0), np.int64), np.zeros((1, 0), bool)
    for k, wall in enumerate(hypotheses):
        centre, own = wall.centre_m[None], wall.sigma_m[None] ** 2
        total = variance[:, None] + own
        off = centre - mean[:, None]
        known = np.isfinite(total)
        total = np.where(known, total, 1.0)
        agree = np.where(known, -0.5 * (np.log(2 * np.pi * total) + off**2 / total), 0.0)
        gain = np.where(known, variance[:, None], 1.0) / total
        joint = log_p[:, None] + wall.log_p[None] + agree
        best = np.argsort(-joint, axis=None, kind="stable")[:KEPT]
        b, h = np.unravel_index(best, joint.shape)
        mean = np.where(known, mean[:, None] + gain * off, centre)[b, h]
        variance = (gain * own)[b, h]
        log_p = joint[b, h]
        walls, doubted = np.column_stack([walls[b], h]), doubted[b]
        if k == len(chain.width_m):
            break
        width, spread = float(chain.width_m[k]), fit * float(chain.spread_m[k])
        # sorted: the first is the most probable
        parted = np.zeros(1), np.full(1, np.inf), log_p[:1], walls[:1], doubted[:1]
        if np.isnan(width):
            mean, variance, log_p, walls, doubted = parted
            doubted = np.column_stack([doubted, [False]])
            continue
        mean = np.append(mean + width, parted[0])
        variance = np.append(variance + spread**2, parted[1])
        wrong = parted[2] + np.log(P_WRONG / RANGE_M)
        doubt = np.append(np.zeros(len(log_p), bool), True)
        log_p = np.append(log_p + np.log1p(-P_WRONG), wrong)
        walls = np.concatenate([walls, parted[3]])
        doubted = np.column_stack([np.concatenate([doubted, parted[4]]), doubt])
    return Choice(walls[0], doubted[0], float(log_p[0]))


def fit_of(chains: Sequence[Chain], hypotheses: Sequence[Sequence[Hypotheses]]) -> float:
    """Return how closely a storey keeps to the rules' spreads: the root mean square of f."""
    log_p = np.array(
        [
            sum(choose(c, h, fit).log_p for c, h in zip(chains, hypotheses, strict=True))
            for fit in FITS
        ]
    ) + 2 * np.log(FITS)
    share = np.exp(log_p - logsumexp(log_p))
    return float(np.sqrt(share @ FITS**2))


def chosen(chain: Chain, hypotheses: Sequence[Hypotheses], choice: Choice, fit: float) -> Chain:
    """Return the chain by the chosen hypotheses."""
    picked = list(zip(hypotheses, choice.walls.tolist(), strict=True))
    return Chain(
        np.array([wall.centre_m[h] for wall, h in picked]),
        np.array([wall.sigma_m[h] for wall, h in picked]),
        chain.width_m,
        fit * chain.spread_m,
    )


def faces_right(hypotheses: Sequence[Hypotheses], choice: Choice) -> NDArray[np.bool_]:
    """Return of which walls every face that was seen is the wall's, (n + 1,)."""
    return np.array(
        [wall.faces_right[h] for wall, h in zip(hypotheses, choice.walls.tolist(), strict=True)],
        bool,
    )
