"""Rooms of a grammar's rules as the states of a Markov chain along a reference line.

A unit of m rooms is a chain of m states that follow each other with certainty; from the last room
of a rule the transition model leads to the first room of the next. One more state, `unexplained`,
is a room that no rule knows.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from grammars.model import Grammar, Rule
from tasks.layout.decoding.transitions import logarithm

Units = Literal["kept", "split"]
Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class States:
    """S states, rule by rule, a rule's rooms in their order; `unexplained` last, if there is one.

    Entry i is one state in every array.
    """

    log_initial: Floats
    """(S,), log probability that a line begins with the state"""
    log_transitions: Floats
    """(S, S), log probability that state j follows i, in row i and column j"""
    may_end: NDArray[np.bool_]
    """(S,), whether a line may end with it: no unit is left unfinished"""
    rules: tuple[str, ...]
    """id of the rule; '' unexplained"""
    parts: Ints
    """(S,), place in the rule; 0 unexplained"""
    classes: tuple[str, ...]
    """class of the room; '' unexplained"""
    widths: Floats
    """(S,), metres; NaN unexplained"""
    spreads: Floats
    """(S,), standard deviation of the width, metres; NaN unexplained"""
    depths: Floats
    """(S,), metres; NaN: any"""
    depth_spreads: Floats
    """(S,), standard deviation of the depth, metres; NaN: any"""

    def __len__(self) -> int:
        return len(self.parts)

    @property
    def explained(self) -> int:
        """Return the number of states that are a rule's room."""
        return len(self) - (not self.rules[-1])


@dataclass(frozen=True)
class Unexplained:
    """How often a room is none of the grammar's."""

    p: float
    """that an unexplained room follows a rule"""
    p_again: float
    """that one follows another"""


def make_states(
    grammar: Grammar, p_transition: Floats, units: Units, unexplained: Unexplained | None
) -> States:
    """Return the states of a grammar.

    Parameters
    ----------
    p_transition : (R, R) float
        P_t(r_j | r_i), by `tasks.layout.decoding.transitions`.
    units : "kept" or "split"
        Split: a unit's rooms come singly, each as often as its unit; what follows a rule follows
        each of its rooms, and begins with any room of the next.
    unexplained : Unexplained or None
        None: every room is a rule's.

    Notes
    -----
    A line begins with an unexplained room as often as one stands anywhere, by the chain's own
    balance p / (p + 1 - p_again); what follows it is drawn by P_a.
    """
    rules = grammar.rules
    p_first, p_matrix = grammar.p_apriori, p_transition
    if units == "split":
        counts = np.array([len(rule.parts) for rule in rules])
        of = np.repeat(np.arange(len(rules)), counts)
        p_first = p_first[of] / p_first[of].sum()
        p_matrix = p_transition[np.ix_(of, of)] / counts[of]
        chains = [[(rule, k)] for rule in rules for k in range(len(rule.parts))]
    else:
        chains = [[(rule, k) for k in range(len(rule.parts))] for rule in rules]
    return _chained(chains, p_first, p_matrix, unexplained)


def _chained(
    chains: list[list[tuple[Rule, int]]],
    p_first: Floats,
    p_matrix: Floats,
    none: Unexplained | None,
) -> States:
    """Return the states of chains of rooms, given what a line begins with and what follows."""
    places = [place for chain in chains for place in chain]
    sizes = np.array([len(chain) for chain in chains])
    lasts = np.cumsum(sizes) - 1
    firsts = lasts - sizes + 1
    extra = 0 if none is None else 1
    count = len(places) + extra
    initial, matrix, may_end = np.zeros(count), np.zeros((count, count)), np.zeros(count, bool)
    inside = np.setdiff1d(np.arange(len(places)), lasts)
    matrix[inside, inside + 1] = 1.0
    may_end[lasts] = True
    initial[firsts] = p_first
    matrix[np.ix_(lasts, firsts)] = p_matrix
    if none is not None:
        anywhere = none.p / (none.p + 1 - none.p_again)
        initial[firsts] *= 1 - anywhere
        matrix[np.ix_(lasts, firsts)] *= 1 - none.p
        initial[-1], matrix[lasts, -1], matrix[-1, -1] = anywhere, none.p, none.p_again
        matrix[-1, firsts] = (1 - none.p_again) * p_first
        may_end[-1] = True
    parts = [rule.parts[k] for rule, k in places]

    def column(value: str) -> Floats:
        found = [getattr(part, value) for part in parts]
        return np.array([np.nan if x is None else x for x in found] + [np.nan] * extra)

    return States(
        log_initial=logarithm(initial),
        log_transitions=logarithm(matrix),
        may_end=may_end,
        rules=(*(rule.id for rule, _ in places), *[""] * extra),
        parts=np.array([k for _, k in places] + [0] * extra, np.int64),
        classes=(*(part.class_ for part in parts), *[""] * extra),
        widths=column("width_m"),
        spreads=column("spread_m"),
        depths=column("depth_m"),
        depth_spreads=column("depth_spread_m"),
    )
