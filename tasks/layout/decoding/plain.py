"""The paper's decoding of a line: each width between two walls seen is one rule (Fig. 8)."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import PositiveFloat

from tasks.layout.decoding.hmm import Model, rule_posteriors, viterbi
from tasks.layout.decoding.hmm_lengths import viterbi_pruned, viterbi_within
from tasks.layout.decoding.states import States
from tasks.params import Params

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class PlainParams(Params):
    """The paper's hidden Markov model."""

    sigma_m: PositiveFloat = 1.0
    """Standard deviation of the emissions, metres (Eq. 10)."""
    length: Literal["free", "pruned", "within"] = "pruned"
    """Whether rules must fit the line: not at all; as Fig. 8 prunes, each partial path carrying
    its length; by the exact dynamic programme over rule and length."""
    length_step_m: PositiveFloat = 0.01
    """Step in which `within` counts lengths, metres. Not in the paper."""


@dataclass(frozen=True, eq=False)
class Plain:
    """The model over rules, and the states that are the rooms of each."""

    model: Model
    first: Ints
    """(R,), state of each rule's first room; the others follow it"""
    counts: Ints
    """(R,), rooms of each rule"""
    params: PlainParams


def make_plain(states: States, params: PlainParams) -> Plain:
    """Return the model of states without an unexplained one: a unit is emitted as one width."""
    lasts = np.flatnonzero(states.may_end)
    first = np.append(0, lasts[:-1] + 1)
    model = Model(
        states.log_initial[first],
        np.ascontiguousarray(states.log_transitions[np.ix_(lasts, first)]),
        np.add.reduceat(states.widths, first),
        params.sigma_m,
    )
    return Plain(model, first, lasts - first + 1, params)


def best_rules(plain: Plain, widths: list[Floats], lengths: Floats) -> tuple[list[Ints], Floats]:
    """Return the sequence of rules of each line, and its log probability.

    Parameters
    ----------
    widths : n arrays of float
        Observed widths of each line, metres.
    lengths : (n,) float
        Of each line, metres.

    Returns
    -------
    n arrays of int
        Indices of rules; -1 along a line that no admissible sequence explains.
    (n,) float
        -inf without a sequence.
    """
    model, params = plain.model, plain.params
    if params.length == "free":
        counts = np.array([len(w) for w in widths], np.int64)
        observed = np.zeros((len(widths), counts.max(initial=0)))
        for line, w in enumerate(widths):
            observed[line, : len(w)] = w
        paths, log_p = viterbi(model, observed, counts)
        return [path[:n] for path, n in zip(paths, counts, strict=True)], log_p
    found = [
        viterbi_pruned(model, w, length)
        if params.length == "pruned"
        else viterbi_within(model, w, length, params.length_step_m)
        for w, length in zip(widths, lengths, strict=True)
    ]
    return [path for path, _ in found], np.array([log_p for _, log_p in found])


def rule_rooms(
    plain: Plain, states: States, widths: Floats, path: Ints, near_m: float
) -> list[tuple[Ints, Floats, Floats, Floats]]:
    """Return states, shares of the width and posteriors of each rule's rooms along a line.

    Last come the posteriors of the hidden walls between them: how probable a rule is that has one
    no further off than `near_m`.

    A unit's rooms share its observed width as they share the rule's. A room's posterior is the
    probability, over all sequences of any length, of a rule of as many rooms with one of its
    class in this room's place.
    """
    p_rules = rule_posteriors(plain.model, widths)
    classes = np.array(states.classes)
    inner = [
        np.cumsum(states.widths[a : a + n])[:-1] / states.widths[a : a + n].sum()
        for a, n in zip(plain.first, plain.counts, strict=True)
    ]
    found = []
    for rule, p, width in zip(path, p_rules, widths, strict=True):
        rooms = plain.first[rule] + np.arange(plain.counts[rule])
        alike = np.flatnonzero(plain.counts == len(rooms))
        same = classes[plain.first[alike][:, None] + np.arange(len(rooms))] == classes[rooms]
        shares = states.widths[rooms] / states.widths[rooms].sum()
        hidden = [
            sum(
                p[i]
                for i, walls in enumerate(inner)
                if (np.abs(walls * width - at * width) <= near_m).any()
            )
            for at in inner[rule]
        ]
        found.append((rooms, shares, p[alike] @ same, np.minimum(np.array(hidden, float), 1.0)))
    return found
