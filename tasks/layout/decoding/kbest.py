"""The k most probable decodings of a line, exactly: Viterbi over (wall, state) with k entries."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from storage.layout import HIDDEN, LINE_END
from tasks.layout.decoding.lattice import search
from tasks.layout.decoding.segmental import Segmental, Walls

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Decoding:
    """One way to read a line: the runs of rooms between the walls that divide them."""

    walls: Ints
    """(g + 1,), walls that divide, the line's ends included, as indices in `Walls`"""
    runs: Ints
    """(g,), row in `Runs` between each two of them"""
    log_p: float


@dataclass(frozen=True, eq=False)
class Rooms:
    """The m rooms of a decoding, in order."""

    states: Ints
    """(m,)"""
    bounds_m: Floats
    """(m + 1,), positions of the walls between them"""
    cuts: Ints
    """(m + 1,), observed cut that each wall is, from 0; HIDDEN or LINE_END"""


def best_decodings(model: Segmental, walls: Walls, count: int) -> list[Decoding]:
    """Return the `count` most probable decodings of a line, most probable first.

    Fewer where there are fewer, none where none has a probability. Different decodings differ in
    the walls that divide or in the rooms: where hidden walls stand is summed over. Of equals, the
    one first met comes first: the order is the same every time.
    """
    found, log_p, steps = search(
        walls, model.runs, model.broad, model.states.log_initial, model.states.log_transitions,
        model.states.may_end, count,
    )  # fmt: skip
    decodings = []
    for i in range(found):
        taken = steps[i][steps[i, :, 1] >= 0][::-1]
        ends = np.append(taken[:, 0], len(walls.at) - 1)
        decodings.append(Decoding(ends, np.ascontiguousarray(taken[:, 1]), float(log_p[i])))
    return decodings


def rooms_of(model: Segmental, walls: Walls, decoding: Decoding) -> Rooms:
    """Return the rooms of a decoding; hidden walls stand where they are expected.

    That is where the widths' sum is shared out by the rooms' variances; by their widths instead
    where a room would come to nothing.
    """
    runs = model.runs
    states, bounds, cuts = [], [np.zeros(1)], [np.array([LINE_END])]
    for r, a, b in zip(decoding.runs, decoding.walls[:-1], decoding.walls[1:], strict=True):
        rooms = runs.states[r, : runs.counts[r]]
        states.append(rooms)
        inner = _hidden_walls(model, walls, rooms, a, b)
        bounds += [walls.at[a] + inner, walls.at[b : b + 1]]
        cut = LINE_END if b == len(walls.at) - 1 else b - 1
        cuts += [np.full(len(inner), HIDDEN), np.array([cut])]
    return Rooms(np.concatenate(states), np.concatenate(bounds), np.concatenate(cuts))


def _hidden_walls(model: Segmental, walls: Walls, rooms: Ints, a: int, b: int) -> Floats:
    """Return the walls within a run, metres from its first: their mean given its length."""
    if len(rooms) == 1:
        return np.empty(0)
    length = walls.at[b] - walls.at[a]
    widths, variances = model.states.widths[rooms], model.states.spreads[rooms] ** 2
    over = length - widths.sum()
    behind = np.cumsum(variances)[:-1] + walls.variances[a]
    inner = np.cumsum(widths)[:-1] + over * behind / (
        variances.sum() + walls.variances[a] + walls.variances[b]
    )
    if (np.diff(inner, prepend=0.0, append=length) > 0).all():
        return np.asarray(inner)
    return np.asarray(np.cumsum(widths)[:-1] * length / widths.sum())
