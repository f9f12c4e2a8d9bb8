"""The paper's hidden Markov model: one rule for each observed width (Sec. 4.2.2, Eq. 10, 11).

    eta_1(r_i) = P_a(r_i) P_e(O_1 | r_i)
    eta_t(r_i) = max_j eta_{t-1}(r_j) P_t(r_i | r_j) P_e(O_t | r_i)                       (Eq. 11)
    P_e(O_t | r_i) = N(O_t; W_i, sigma^2)                                                 (Eq. 10)

in logarithms. Of equally probable sequences the one whose last rule has the lowest index wins,
then that whose last but one has, and so on.

The steps are bound by R^2 additions each. Two things make them fast and change no bit of the
result: the target rule runs in the inner loop, so that a vector unit takes several at once, and a
rule j is left out of a step if even its most probable successor falls behind what the best rule
gives every successor. Only the probabilities are kept; the way back looks its maxima up again.
"""

from dataclasses import dataclass

import numba as nb
import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from tasks.threads import spread

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

NEAR = 1.5
"""How far below the best rule, in logarithms, the rules of a step lie that are tried first; any
value gives the same result."""
LINES_AT_ONCE = 32
"""Lines a thread takes on."""


@dataclass(frozen=True, eq=False)
class Model:
    """The hidden Markov model over R rules."""

    log_initial: Floats
    """(R,), log P_a"""
    log_transitions: Floats
    """(R, R), log P_t(r_j | r_i) in row i and column j"""
    widths: Floats
    """(R,), metres"""
    sigma: float
    """standard deviation of the emissions, metres"""


def emissions(model: Model, observations: Floats) -> Floats:
    """Return log P_e of each observation under each rule, Eq. 10: (..., R) for (...,)."""
    variance = model.sigma**2
    away = observations[..., None] - model.widths
    return -0.5 * (np.log(2 * np.pi) + np.log(variance) + away**2 / variance)


def viterbi(model: Model, observations: Floats, counts: Ints) -> tuple[Ints, Floats]:
    """Return the most probable sequence of rules of each of n lines, Eq. 11.

    Parameters
    ----------
    observations : (n, T) float
        Widths in their order along the line, metres; those beyond a line's count are ignored.
    counts : (n,) int
        Observations of each line, 0 to T.

    Returns
    -------
    (n, T) int
        Indices of rules; -1 beyond a line's count, and all along a line whose every sequence has
        probability zero.
    (n,) float
        Log probability of the sequence and the observations together; 0 without observations.
    """
    paths = np.full(observations.shape, -1, np.int64)
    log_p = np.zeros(len(observations))
    back = np.ascontiguousarray(model.log_transitions.T)
    most = model.log_transitions.max(axis=1)

    def decode(some: slice) -> None:
        _decode_lines(
            model.log_initial, model.log_transitions, back, most, model.widths, model.sigma,
            observations[some], counts[some], paths[some], log_p[some],
        )  # fmt: skip

    # threads of our own: numba's may not be entered from several of a flow's threads at once
    some = range(0, len(observations), LINES_AT_ONCE)
    spread(decode, (slice(i, i + LINES_AT_ONCE) for i in some))
    return paths, log_p


def rule_posteriors(model: Model, observations: Floats) -> Floats:
    """Return P(q_t = r_i | all observations of the line): (T, R) for (T,); forward-backward."""
    emitted = emissions(model, observations)
    forward, backward = np.empty_like(emitted), np.zeros_like(emitted)
    for t in range(len(emitted)):
        before = (
            model.log_initial
            if t == 0
            else logsumexp(forward[t - 1][:, None] + model.log_transitions, axis=0)
        )
        forward[t] = before + emitted[t]
    for t in range(len(emitted) - 2, -1, -1):
        after = emitted[t + 1] + backward[t + 1]
        backward[t] = logsumexp(model.log_transitions + after, axis=1)
    both = forward + backward
    total = logsumexp(both, axis=1, keepdims=True)
    return np.where(np.isfinite(total), np.exp(both - np.where(np.isfinite(total), total, 0)), 0.0)


@nb.njit(cache=True, nogil=True)
def _decode_lines(
    initial: Floats, onward: Floats, back: Floats, most: Floats, widths: Floats, sigma: float,
    observations: Floats, counts: Ints, paths: Ints, log_p: Floats,
) -> None:  # fmt: skip
    """Fill `paths` and `log_p`; `back` is `onward` transposed, `most` its greatest of each row."""
    rules = widths.size
    variance = sigma**2
    constant = np.log(2 * np.pi) + np.log(variance)
    for line in range(observations.shape[0]):
        steps = counts[line]
        if steps == 0:
            continue
        eta = np.empty((steps, rules))
        reached = np.empty(rules)
        for t in range(steps):
            if t == 0:
                reached[:] = initial
            else:
                _step(eta[t - 1], onward, most, reached)
            for i in range(rules):
                away = observations[line, t] - widths[i]
                eta[t, i] = reached[i] - 0.5 * (constant + away**2 / variance)
        last = np.argmax(eta[steps - 1])
        log_p[line] = eta[steps - 1, last]
        if log_p[line] == -np.inf:
            continue
        paths[line, steps - 1] = last
        for t in range(steps - 2, -1, -1):
            last = np.argmax(eta[t] + back[last])
            paths[line, t] = last


@nb.njit(cache=True, nogil=True)
def _step(eta: Floats, onward: Floats, most: Floats, reached: Floats) -> None:
    """Fill reached[j] = max_i eta[i] + onward[i, j]."""
    best = np.argmax(eta)
    reached[:] = eta[best] + onward[best]
    near = eta[best] - NEAR
    # what leads from the best few sets the bar for all others
    _raise(eta, onward, np.flatnonzero(eta > near), reached)
    _raise(eta, onward, np.flatnonzero((eta <= near) & (eta + most > reached.min())), reached)


@nb.njit(cache=True, nogil=True)
def _raise(eta: Floats, onward: Floats, rows: Ints, reached: Floats) -> None:
    """Raise reached[j] to max_i eta[i] + onward[i, j] over the rows i."""
    for k in range(0, rows.size, 4):
        # four rows at a time: the targets are read and written once for all of them
        a, b = rows[k], rows[min(k + 1, rows.size - 1)]
        c, d = rows[min(k + 2, rows.size - 1)], rows[min(k + 3, rows.size - 1)]
        row_a, row_b, row_c, row_d = onward[a], onward[b], onward[c], onward[d]
        at_a, at_b, at_c, at_d = eta[a], eta[b], eta[c], eta[d]
        for j in range(reached.size):
            x, y = at_a + row_a[j], at_b + row_b[j]
            z, w = at_c + row_c[j], at_d + row_d[j]
            x = x if x > y else y
            z = z if z > w else w
            x = x if x > z else z
            reached[j] = x if x > reached[j] else reached[j]
