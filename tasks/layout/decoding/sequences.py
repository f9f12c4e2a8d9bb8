"""A line as the decoders take it, and the sequences of rooms that they return, as a table."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from storage.layout import LINE_END, Layout
from storage.observations import Observations
from tasks.layout.decoding.states import States

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Line:
    """One line's share of the observations."""

    id: str
    length: float
    cuts: Floats
    sigmas: Floats
    presence: Floats
    depths: Floats
    rooms: Ints

    @property
    def bounds(self) -> Floats:
        """Ends and cuts."""
        return np.concatenate([[0.0], self.cuts, [self.length]])


@dataclass(frozen=True, eq=False)
class RoomSequence:
    """The rooms of one hypothesis of a line."""

    line: str
    hypothesis: int
    states: Ints
    """(m,), -1 unexplained"""
    bounds: Floats
    """(m + 1,)"""
    cuts: Ints
    """(m + 1,)"""
    posteriors: Floats
    """(m,)"""
    walls: Floats
    """(m + 1,), posterior of each wall"""
    undivided: Floats
    """(m,)"""
    gain: float
    log_p: float


def lines_of(observations: Observations) -> Iterator[Line]:
    """Yield the lines of a storey."""
    for i, length in enumerate(observations.lengths_m):
        cuts, intervals = observations.lines == i, observations.interval_lines == i
        yield Line(
            str(observations.line_ids[i]),
            float(length),
            observations.cut_m[cuts],
            observations.sigma_m[cuts],
            observations.presence[cuts],
            observations.depth_m[intervals],
            observations.rooms[intervals],
        )


def as_observed(line: Line) -> RoomSequence:
    """Return the rooms between the walls that were seen, none explained."""
    count = len(line.cuts) + 1
    cuts = np.concatenate([[LINE_END], np.arange(count - 1), [LINE_END]])
    none, nothing = np.full(count, -1), np.zeros(count)
    walls = np.concatenate([[1.0], line.presence, [1.0]])
    return RoomSequence(
        line.id, 0, none, line.bounds, cuts, nothing, walls, np.ones(count), 0.0, -np.inf
    )


def layout_of(sequences: list[RoomSequence], states: States) -> Layout:
    """Return the rows of sequences of rooms."""
    counts = [len(s.states) for s in sequences]
    at = _joined([s.states for s in sequences], np.int64)
    # the row at -1 is the unexplained room's
    ids = np.array([*states.rules[: states.explained], ""], np.str_)
    classes = np.array([*states.classes[: states.explained], ""], np.str_)
    parts = np.append(states.parts[: states.explained], 0)
    widths = np.append(states.widths[: states.explained], np.nan)
    spreads = np.append(states.spreads[: states.explained], np.nan)
    return Layout(
        line_ids=np.repeat(np.array([s.line for s in sequences], np.str_), counts),
        hypotheses=np.repeat(np.array([s.hypothesis for s in sequences], np.int64), counts),
        orders=_joined([np.arange(n) for n in counts], np.int64),
        from_m=_joined([s.bounds[:-1] for s in sequences], np.float64),
        to_m=_joined([s.bounds[1:] for s in sequences], np.float64),
        from_cuts=_joined([s.cuts[:-1] for s in sequences], np.int64),
        to_cuts=_joined([s.cuts[1:] for s in sequences], np.int64),
        classes=classes[at],
        rules=ids[at],
        parts=parts[at],
        widths_m=widths[at],
        spreads_m=spreads[at],
        posteriors=_joined([s.posteriors for s in sequences], np.float64),
        from_posteriors=_joined([s.walls[:-1] for s in sequences], np.float64),
        to_posteriors=_joined([s.walls[1:] for s in sequences], np.float64),
        undivided=_joined([s.undivided for s in sequences], np.float64),
        gains=np.repeat(np.array([s.gain for s in sequences], np.float64), counts),
        log_p=np.repeat(np.array([s.log_p for s in sequences], np.float64), counts),
    )


def _joined(arrays: list[NDArray[Any]], dtype: type) -> NDArray[Any]:
    return np.concatenate([np.empty(0, dtype), *arrays]).astype(dtype)
