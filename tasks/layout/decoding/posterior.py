"""How probable each wall and each room of a line is, over all decodings: forward-backward."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from storage.layout import HIDDEN
from tasks.layout.decoding.kbest import Decoding, Rooms
from tasks.layout.decoding.lattice import sum_all, sum_of_hidden, sum_of_run
from tasks.layout.decoding.segmental import Segmental, Walls

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Posterior:
    """Sums over all decodings of a line with S states, in logarithms."""

    log_total: float
    """log probability of the observations, all decodings together; -inf if there is none"""
    walls: Floats
    """(n + 2,), probability that each wall divides rooms; 1 for the ends"""
    begin: Floats
    """(n + 2, S), log probability of all up to a wall, with a room of the state to begin there"""
    rest: Floats
    """(n + 2, S), log probability of all beyond a wall, given a room of the state before it"""


def posterior(model: Segmental, walls: Walls) -> Posterior:
    """Return the sums over all decodings of a line."""
    states = model.states
    begin, end, rest = sum_all(
        walls, model.runs, model.broad, states.log_initial, states.log_transitions, states.may_end
    )
    both = np.logaddexp.reduce(end[1:] + rest[1:], axis=1)
    total = float(both[-1])
    divide = np.exp(both - total) if total > -np.inf else np.zeros_like(both)
    return Posterior(total, np.append(float(total > -np.inf), divide), begin, rest)


def room_posteriors(model: Segmental, walls: Walls, decoding: Decoding, sums: Posterior) -> Floats:
    """Return how probable each room of a decoding is, (m,).

    That is the probability that the two seen walls about the room's run divide rooms, with as many
    rooms between them and, in this room's place, one of its class.
    """
    classes, known = np.empty(len(model.states), np.int64), dict[str, int]()
    for i, class_ in enumerate(model.states.classes):
        classes[i] = known.setdefault(class_, len(known))
    ends = decoding.walls
    found = [
        sum_of_run(
            walls, model.runs, model.broad, classes, sums.begin, sums.rest, sums.log_total, a, b, r
        )
        for a, b, r in zip(ends[:-1], ends[1:], decoding.runs, strict=True)
    ]
    return np.minimum(np.concatenate(found), 1.0)  # a sum of shares may round to more


def wall_posteriors(
    model: Segmental, walls: Walls, rooms: Rooms, sums: Posterior, near_m: float
) -> Floats:
    """Return how probable it is that each wall of a decoding stands there, (m + 1,).

    Of a seen wall that is the probability that it divides rooms, of whatever class. Of a hidden one
    it is the number of walls, seen or hidden, expected within `near_m`, at most one: all readings
    that have a wall there count, whatever rooms they put beside it.
    """
    states = model.states
    variances = states.spreads**2
    found = np.ones(len(rooms.cuts))
    for k, (cut, at) in enumerate(zip(rooms.cuts.tolist(), rooms.bounds_m.tolist(), strict=True)):
        if cut >= 0:
            found[k] = sums.walls[cut + 1]
        elif cut == HIDDEN:
            beside = np.abs(walls.at[1:-1] - at) <= near_m
            found[k] = sums.walls[1:-1][beside].sum() + sum_of_hidden(
                walls, model.runs, model.broad, states.widths, variances, sums.begin, sums.rest,
                sums.log_total, at, near_m,
            )  # fmt: skip
    return np.minimum(found, 1.0)


def undivided(walls: Walls, rooms: Rooms, sums: Posterior) -> Floats:
    """Return how surely no wall seen within each room of a decoding divides it, (m,).

    That is the probability of the most doubtful of them; one where none was seen.
    """
    found = np.ones(len(rooms.states))
    inside = np.searchsorted(rooms.bounds_m, walls.at[1:-1], "right") - 1
    passed = np.setdiff1d(np.arange(len(inside)), rooms.cuts)
    np.minimum.at(found, inside[passed], 1 - sums.walls[1:-1][passed])
    return np.clip(found, 0.0, 1.0)
