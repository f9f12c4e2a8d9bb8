"""Find the sequence of rooms along each reference line (Sec. 4.2.2, Fig. 8)."""

from collections.abc import Iterator
from typing import Literal

import numpy as np
from pydantic import Field, PositiveFloat, PositiveInt

from grammars.model import Grammar
from storage.layout import HIDDEN, LINE_END, Layout
from storage.observations import Observations
from tasks.layout.crowd.crowd import CrowdParams
from tasks.layout.decoding.kbest import best_decodings, rooms_of
from tasks.layout.decoding.plain import PlainParams, best_rules, make_plain, rule_rooms
from tasks.layout.decoding.posterior import (
    posterior,
    room_posteriors,
    undivided,
    wall_posteriors,
)
from tasks.layout.decoding.segmental import (
    SegmentalParams,
    as_seen,
    log_any,
    make_segmental,
    make_walls,
)
from tasks.layout.decoding.sequences import (
    Line,
    RoomSequence,
    as_observed,
    layout_of,
    lines_of,
)
from tasks.layout.decoding.states import States, Unexplained, Units, make_states
from tasks.layout.decoding.transitions import Transitions, transition_matrix
from tasks.params import Params


class DecodeParams(Params):
    """How rules are found along a line."""

    decoder: Literal["segmental", "plain"] = "segmental"
    """Segmental: walls may be missed or imagined. Plain: the paper's hidden Markov model, one rule
    for each observed width."""
    transitions: Transitions = "conditional"
    """How rules follow each other: the relationship probability, or Eq. 9."""
    smoothing: float = Field(default=0.02, ge=0, le=1)
    """Share of the a-priori probabilities mixed into the relationship probabilities. Assumption."""
    units: Units = "kept"
    """Whether the rooms of a unit come together or, split, each by itself."""
    unexplained: Literal["allowed", "forbidden"] = "allowed"
    """Whether the segmental decoder may leave a room to the data that no rule explains."""
    p_unexplained: float = Field(default=0.02, gt=0, lt=1)
    """Probability that an unexplained room follows one of a rule. Assumption."""
    p_unexplained_again: float = Field(default=0.5, gt=0, lt=1)
    """Probability that another follows. Assumption."""
    hypotheses: PositiveInt = 3
    """Sequences of each line that the segmental decoder returns at most, the best first."""
    near_m: PositiveFloat = 0.5
    """Walls no further apart are one, as to how probable it is that one stands there, metres.
    Assumption: how far off one may be that two rooms are still told by."""
    plain: PlainParams = PlainParams()
    """The paper's model."""
    segmental: SegmentalParams = SegmentalParams()
    """How walls are seen."""
    crowd: CrowdParams = CrowdParams()
    """How scans are held against each other at the decoded walls."""


def decode(observations: Observations, grammar: Grammar, params: DecodeParams) -> Layout:
    """Find the sequence of rooms along each reference line.

    Parameters
    ----------
    observations : Observations
        Walls seen along the lines of a storey.
    grammar : Grammar
        Its rules' widths run between the centres of walls, as the observations do.

    Returns
    -------
    Layout
        Of each line the best sequence and, of the segmental decoder, the next best. The rooms of a
        line that no sequence explains are those observed, unexplained, with log probability -inf.

    Raises
    ------
    MapSenseError
        If the grammar has too many ways to fill a gap; the message says what to change.
    """
    matrix = transition_matrix(
        grammar.p_apriori, grammar.p_relation, params.transitions, params.smoothing
    )
    lines = list(lines_of(observations))
    if params.decoder == "plain":
        states = make_states(grammar, matrix, params.units, None)
        return layout_of(list(_plain(lines, states, params)), states)
    unexplained = Unexplained(params.p_unexplained, params.p_unexplained_again)
    states = make_states(
        grammar, matrix, params.units, unexplained if params.unexplained == "allowed" else None
    )
    return layout_of(list(_segmental(lines, states, params)), states)


def _segmental(lines: list[Line], states: States, params: DecodeParams) -> Iterator[RoomSequence]:
    model = make_segmental(states, params.segmental)
    for line in lines:
        walls = make_walls(
            model, line.length, line.cuts, line.sigmas, line.presence, line.depths, line.rooms
        )
        sums = posterior(model, walls)
        gain = sums.log_total - as_seen(model, walls)
        decodings = best_decodings(model, walls, params.hypotheses)
        for i, decoding in enumerate(decodings):
            rooms = rooms_of(model, walls, decoding)
            p = room_posteriors(model, walls, decoding, sums)
            stand = wall_posteriors(model, walls, rooms, sums, params.near_m)
            whole = undivided(walls, rooms, sums)
            found = np.where(rooms.states < states.explained, rooms.states, -1)
            yield RoomSequence(
                line.id, i, found, rooms.bounds_m, rooms.cuts, p, stand, whole, gain, decoding.log_p
            )
        if not decodings:
            yield as_observed(line)


def _plain(lines: list[Line], states: States, params: DecodeParams) -> Iterator[RoomSequence]:
    plain = make_plain(states, params.plain)
    widths = [np.diff(line.bounds) for line in lines]
    lengths = np.array([line.length for line in lines])
    for line, observed, path, log_p in zip(
        lines, widths, *best_rules(plain, widths, lengths), strict=True
    ):
        if log_p == -np.inf:
            yield as_observed(line)
            continue
        found = rule_rooms(plain, states, observed, path, params.near_m)
        bounds, cuts, walls = [line.bounds[:1]], [np.array([LINE_END])], [np.ones(1)]
        for i, (rooms, shares, _, hidden) in enumerate(found):
            bounds += [
                line.bounds[i] + observed[i] * np.cumsum(shares)[:-1],
                line.bounds[i + 1, None],
            ]
            end = LINE_END if i == len(found) - 1 else i
            cuts += [np.full(len(rooms) - 1, HIDDEN), np.array([end])]
            walls += [hidden, line.presence[i : i + 1] if end >= 0 else np.ones(1)]
        rooms, posteriors = (np.concatenate([f[k] for f in found]) for k in (0, 2))
        yield RoomSequence(
            line.id,
            0,
            rooms,
            np.concatenate(bounds),
            np.concatenate(cuts),
            posteriors,
            np.concatenate(walls),
            np.ones(len(rooms)),
            float(log_p - log_any(params.segmental, observed).sum()),
            log_p,
        )
