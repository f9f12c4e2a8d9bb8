"""Which rule follows which: bigrams, smoothed with the a-priori probabilities."""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

PROBABILITY_DECIMALS = 6
"""Probabilities are learnt to six decimals; rounded so that they still sum to one."""
STRENGTHS: NDArray[np.float64] = 2.0 ** np.arange(-1.0, 11.0)
"""Numbers of followers that the a-priori probabilities may count for."""
OWN_NATS = 2.0
"""What a rule's own strength must gain: one number more for each such rule (Akaike's criterion asks
for 1), and two like followers may be chance."""


def count_pairs(rows: Iterable[Sequence[int]], n_rules: int) -> NDArray[np.float64]:
    """Return how often rule j (column) follows rule i (row); -1 is no rule and parts a row."""
    found = np.zeros((n_rules, n_rules))
    for row in rows:
        before, after = np.array(row[:-1], int), np.array(row[1:], int)
        both = (before >= 0) & (after >= 0)
        np.add.at(found, (before[both], after[both]), 1.0)
    return found


def relate(
    pairs: NDArray[np.float64],
    p_apriori: NDArray[np.float64],
    strengths: NDArray[np.float64] | float,
) -> NDArray[np.float64]:
    """Return P_r(r_j | r_i) = (c_ij + k_i P_a(r_j)) / (c_i. + k_i): all neighbours stay possible.

    Unseen neighbours get the share of the a-priori probability, and a rule that nothing follows
    gets the a-priori probabilities themselves.

    Parameters
    ----------
    pairs : (R, R) float
        c_ij, how often rule j follows rule i.
    p_apriori : (R,) float
    strengths : (R,) float or one for all
        k_i, how many followers of rule i the a-priori probabilities count for.
    """
    k = np.broadcast_to(np.asarray(strengths, float), len(pairs))[:, None]
    return (pairs + k * p_apriori) / (pairs.sum(axis=1, keepdims=True) + k)


def best_strengths(
    pairs: NDArray[np.float64], p_apriori: NDArray[np.float64], both: bool
) -> NDArray[np.float64]:
    """Return the strengths k_i of `relate` that predict each pair best from all other pairs.

    Each pair in turn is taken out of the counts - in both readings, where rows are read in both
    directions - and predicted from the rest. Of `STRENGTHS` the one is taken under which the
    logarithms of all predictions sum highest, the greatest of equals; a rule whose own followers
    another strength predicts better by `OWN_NATS` or more takes that one.

    Parameters
    ----------
    pairs : (R, R) float
        Whole numbers.
    p_apriori : (R,) float

    Returns
    -------
    (R,) float
    """
    out = np.ones(pairs.shape) + (np.eye(len(pairs)) if both else 0.0)
    i, j = np.nonzero(pairs)
    rest, total = np.maximum(pairs - out, 0)[i, j], (pairs.sum(axis=1, keepdims=True) - out)[i, j]
    scores = np.zeros((len(STRENGTHS), len(pairs)))
    for score, k in zip(scores, STRENGTHS, strict=True):
        np.add.at(score, i, pairs[i, j] * np.log((rest + k * p_apriori[j]) / (total + k)))
    # rounded, lest noise decides between equals, of which the last is the greatest strength
    common = _last_best(scores.sum(axis=1))
    own = np.array([_last_best(score) for score in scores.T])
    gains = scores[own, np.arange(len(pairs))] - scores[common]
    return STRENGTHS[np.where(gains >= OWN_NATS, own, common)]


def _last_best(scores: NDArray[np.float64]) -> int:
    rounded_scores = np.round(scores, 9)
    return int(np.nonzero(rounded_scores == rounded_scores.max())[0][-1])


def rounded(probabilities: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return probabilities to few decimals that sum to one: the largest remainders are rounded up.

    Parameters
    ----------
    probabilities : (..., n) float, that sum to one over the last axis
    """
    scale = 10**PROBABILITY_DECIMALS
    units = np.floor(probabilities * scale + 1e-6)
    missing = np.rint(scale - units.sum(axis=-1)).astype(int)
    rank = np.argsort(np.argsort(units - probabilities * scale, axis=-1, kind="stable"), axis=-1)
    return np.round((units + (rank < missing[..., None])) / scale, PROBABILITY_DECIMALS)
