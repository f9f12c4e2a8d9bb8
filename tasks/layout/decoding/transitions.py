"""How rules follow each other: two models of `P_t(r_j | r_i)` (Sec. 4.2.2, Eq. 9)."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

Transitions = Literal["conditional", "paper"]
Floats = NDArray[np.float64]


def transition_matrix(
    p_apriori: Floats, p_relation: Floats, model: Transitions, smoothing: float
) -> Floats:
    """Return the transition probabilities between R rules.

    Parameters
    ----------
    p_apriori : (R,) float
        P_a.
    p_relation : (R, R) float
        P_r(r_j | r_i) in row i and column j.
    model : "conditional" or "paper"
        See the notes.
    smoothing : float
        Share of P_a mixed into every row of P_r, in [0, 1]: what never followed may yet follow.

    Returns
    -------
    (R, R) float
        P_t(r_j | r_i) in row i and column j; every row sums to one, or to zero where the model
        gives a rule no successor.

    Notes
    -----
    `conditional` is the smoothed P_r itself. `paper` is Eq. 9,

        P_t(r_j | r_i) = P_a(r_j) / P_a(r_i) * P_r(r_i | r_j) / P_r(r_j | r_i),

    which does not sum to one over r_j and is divided by its sum; P_a(r_i) cancels then. It is the
    acceptance ratio of a Metropolis-Hastings sampler and favours the rarer order of two rules.
    """
    relation = (1 - smoothing) * p_relation + smoothing * p_apriori
    if model == "conditional":
        return relation
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = p_apriori * relation.T / relation
    # a pair that never occurs in either order says nothing
    ratio[~np.isfinite(ratio)] = 0.0
    return _rows_to_one(ratio)


def _rows_to_one(matrix: Floats) -> Floats:
    sums = matrix.sum(axis=1, keepdims=True)
    return np.divide(matrix, sums, out=np.zeros_like(matrix), where=sums > 0)


def logarithm(probabilities: Floats) -> Floats:
    """Return natural logarithms, -inf for zero."""
    with np.errstate(divide="ignore"):
        return np.log(probabilities)
