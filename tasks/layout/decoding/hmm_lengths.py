"""The paper's hidden Markov model under its constraint: rules fit the line (Fig. 8, lines 12-25).

A sequence is admissible if the widths of its rules together are at most the line's length. Two
ways to heed that:

- `viterbi_pruned` is Fig. 8 as printed. Each state keeps its best partial path and that path's
  length alone, and skips the transitions that would make it longer than the line. A state may so
  lose every continuation although a less probable, shorter partial path had one: the sequence
  found is admissible, but not always the most probable one that is.
- `viterbi_within` finds that one: a dynamic programme over (rule, length so far).

Indices of rules, model and ties are those of `tasks.layout.decoding.hmm`.
"""

import numba as nb
import numpy as np

from tasks.layout.decoding.hmm import Floats, Ints, Model, emissions, viterbi

ROUNDING_M = 1e-9
"""By how much a sum of widths may miss the length by rounding alone."""


def viterbi_pruned(model: Model, observations: Floats, length: float) -> tuple[Ints, float]:
    """Return the sequence that Fig. 8 finds on one line.

    Parameters
    ----------
    observations : (T,) float
        Widths in their order along the line, metres.
    length : float
        Of the line, metres.

    Returns
    -------
    (T,) int
        Indices of rules; -1 everywhere if every partial path was skipped.
    float
        Log probability of the sequence and the observations together; -inf without a sequence.

    Notes
    -----
    Fig. 8 checks transitions only; here the first rule must fit the line too.
    """
    path = np.full(len(observations), -1, np.int64)
    if not len(observations):
        return path, 0.0
    emitted = emissions(model, observations)
    limit = length + ROUNDING_M
    eta = np.where(model.widths <= limit, model.log_initial + emitted[0], -np.inf)
    lengths = model.widths
    back = np.zeros((len(observations), len(model.widths)), np.int64)
    each = np.arange(len(model.widths))
    for t in range(1, len(observations)):
        fits = lengths[:, None] + model.widths <= limit
        alpha = np.where(fits, eta[:, None] + model.log_transitions, -np.inf)
        back[t] = alpha.argmax(axis=0)
        eta = alpha[back[t], each] + emitted[t]
        lengths = lengths[back[t]] + model.widths
    if eta.max() == -np.inf:
        return path, -np.inf
    path[-1] = eta.argmax()
    for t in range(len(observations) - 1, 0, -1):
        path[t - 1] = back[t, path[t]]
    return path, float(eta.max())


def viterbi_within(
    model: Model, observations: Floats, length: float, step: float
) -> tuple[Ints, float]:
    """Return the most probable sequence of one line whose rules fit it.

    Parameters
    ----------
    observations, length
        As in `viterbi_pruned`.
    step : float
        Widths count in whole steps, metres; exact where they are multiples of it.

    Returns
    -------
    (T,) int
        Indices of rules; -1 everywhere if no sequence with a probability fits.
    float
        Log probability of the sequence and the observations together; -inf without a sequence.
    """
    widths = np.rint(model.widths / step).astype(np.int64)
    room = int(np.floor((length + ROUNDING_M) / step))
    paths, log_p = viterbi(model, observations[None], np.array([len(observations)]))
    if log_p[0] == -np.inf or widths[paths[0]].sum() <= room:
        return paths[0], float(log_p[0])  # the best of all fits, or nothing has a probability
    path = np.full(len(observations), -1, np.int64)
    emitted = emissions(model, observations)
    best = _within(model.log_initial, model.log_transitions, emitted, widths, room, path)
    return path, float(best)


@nb.njit(cache=True, nogil=True)
def _within(
    initial: Floats, onward: Floats, emitted: Floats, widths: Ints, room: int, path: Ints
) -> float:
    """Fill `path` and return its log probability; eta[i, p] has p steps behind it, rule i last."""
    steps, rules = emitted.shape
    back = np.zeros((steps, rules, room + 1), np.int32)
    eta = np.full((rules, room + 1), -np.inf)
    for i in range(rules):
        if widths[i] <= room:
            eta[i, widths[i]] = initial[i] + emitted[0, i]
    for t in range(1, steps):
        reached = np.full((rules, room + 1), -np.inf)
        for j in range(rules):
            for i in range(rules):
                for p in range(widths[j], room + 1):
                    alpha = eta[i, p - widths[j]] + onward[i, j]
                    if alpha > reached[j, p]:
                        reached[j, p] = alpha
                        back[t, j, p] = i
            reached[j] += emitted[t, j]
        eta = reached
    best = np.argmax(eta)
    rule, at = best // (room + 1), best % (room + 1)
    log_p = eta[rule, at]
    if log_p > -np.inf:
        for t in range(steps - 1, -1, -1):
            path[t] = rule
            before = back[t, rule, at]
            at -= widths[rule]
            rule = before
    return log_p
