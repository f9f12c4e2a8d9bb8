"""The segmental model of a reference line: which walls were seen, missed and imagined.

Along a line of length L the grammar's Markov chain draws rooms s_1, s_2, ... (`states`) with
widths N(w_s, v_s) until they fill it. Of the walls between them each is seen with probability
p_seen, off by N(0, sigma^2), or else hidden. Besides, walls are seen that divide nothing: a
Poisson process of lambda a metre. What a wall looks like says with odds q / (1 - q), its
`presence`, whether it divides rooms. The line's ends are walls that are known.

A decoding says which of the seen walls c_1 < c_2 < ... divide rooms and by which run of rooms
(`runs`) each two neighbours among them, a and b, are joined. With D = c_b - c_a it has

    log p = sum over the walls that divide         log(p_seen q_c)
          + sum over the walls that do not         log(lambda (1 - q_c))
          + sum over the runs                      log P(first room | last room before)
                                                 + log P(run | first room)
                                                 + log N(D; w_run, v_run + sigma_a^2 + sigma_b^2)
                                                 + sum of log P(depth | run)

where P(run | first room) holds its inner transitions and 1 - p_seen for each hidden wall. All
terms count one density a metre for each seen wall, so decodings of one line compare whichever
walls they use. The width of an unexplained room is log-normal, and so broad that it only wins
where no rule fits. A depth d seen somewhere between a and b belongs to one of the run's rooms,
by their shares of its width,

    P(depth | run) = (1 - u) sum_k share_k N(d; d_k, sigma_k^2) + u / D_max,

with u the probability that it is no depth of the room; rooms of any depth have 1 / D_max.

Two things are simplified. A wall's error is taken to be independent in the two rooms beside it,
and `reach` bounds how far apart two walls are that others are passed over in between: without it
the cost would not be linear in the walls.
"""

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, NonNegativeFloat, PositiveFloat

from tasks.layout.decoding.runs import Runs, make_runs
from tasks.layout.decoding.states import States
from tasks.params import Params

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SUREST = 0.99
"""No wall's presence counts for more, nor for less than the rest to one: an odd wall that the
initial model is sure of may still be wrong."""


class SegmentalParams(Params):
    """How walls are seen. None of it is in the paper."""

    p_seen: float = Field(default=0.9, gt=0, le=1)
    """Probability that a wall between two rooms was seen. Assumption: the paper finds 97.6 % of
    walls (Sec. 7.3), but not every room of a storey is scanned."""
    spurious_per_m: NonNegativeFloat = 0.05
    """Walls seen per metre of line that divide nothing. Assumption: one in 20 m; on the published
    ring corridor, 7 widths in 102 m are slivers of such walls."""
    end_sigma_m: NonNegativeFloat = 0.05
    """Standard deviation of the line's ends, metres. Assumption."""
    depth: Literal["used", "ignored"] = "used"
    """Whether observed depths count."""
    depth_sigma_m: PositiveFloat = 0.1
    """Standard deviation of an observed depth, metres. Assumption."""
    p_wrong_depth: float = Field(default=0.1, gt=0, le=1)
    """Probability that an observed depth is not the room's: it was seen through a door, or up to
    a cupboard. Assumption."""
    deepest_m: PositiveFloat = 20.0
    """Depth up to which any is as probable as any other where nothing is known, metres.
    Assumption."""
    unexplained_width_m: PositiveFloat = 4.0
    """Median width of a room that no rule explains, metres. Assumption."""
    unexplained_spread: PositiveFloat = 0.8
    """Standard deviation of the logarithm of that width: two in three such rooms are 1.8 to 8.9 m
    wide. Assumption."""
    rarest_run: float = Field(default=1e-5, gt=0, le=1)
    """Probability below which rooms without a seen wall between them are not tried. Assumption."""


class Walls(NamedTuple):
    """The walls seen along a line: its start, n cuts, its end; entry i is one of them."""

    at: Floats
    """(n + 2,), metres, rising"""
    variances: Floats
    """(n + 2,), square metres"""
    divides: Floats
    """(n + 2,), log probability density of the wall if it divides rooms; 0 for the ends"""
    passed: Floats
    """(n + 2,), the same if it does not; -inf for the ends"""
    has_depth: NDArray[np.bool_]
    """(n + 1,), whether a depth of its own was seen between a wall and the next"""
    log_depths: Floats
    """(n + 1, N), its log density in each run; 0 where there is none"""


class Broad(NamedTuple):
    """The log-normal width of an unexplained room."""

    log_median: float
    spread: float


@dataclass(frozen=True, eq=False)
class Segmental:
    """What all lines of a storey share."""

    states: States
    runs: Runs
    broad: Broad
    params: SegmentalParams


def make_segmental(states: States, params: SegmentalParams) -> Segmental:
    """Return the model of a grammar's states."""
    runs = make_runs(states, params.p_seen, params.rarest_run)
    broad = Broad(float(np.log(params.unexplained_width_m)), params.unexplained_spread)
    return Segmental(states, runs, broad, params)


def make_walls(
    model: Segmental,
    length: float,
    cuts: Floats,
    sigmas: Floats,
    presence: Floats,
    depths: Floats,
    rooms: Ints,
) -> Walls:
    """Return the walls seen along one line.

    Parameters
    ----------
    length : float
        Of the line, metres.
    cuts, sigmas : (n,) float
        Position of each wall seen, rising from 0 to the length, and its standard deviation.
    presence : (n,) float
        Probability, before the grammar is asked, that it divides rooms.
    depths : (n + 1,) float
        Depth between each two of them, NaN unknown.
    rooms : (n + 1,) int
        Room of the initial model there, -1 none: what was seen of one room counts once.
    """
    params = model.params
    with np.errstate(divide="ignore"):
        rate = np.log(np.float64(params.spurious_per_m))
    q = np.clip(presence, 1 - SUREST, SUREST)
    ends = params.end_sigma_m**2
    again = np.append(False, (rooms[1:] == rooms[:-1]) & (rooms[1:] >= 0) & ~np.isnan(depths[:-1]))
    has_depth = ~np.isnan(depths) & ~again & (params.depth == "used")
    return Walls(
        at=np.concatenate([[0.0], cuts, [length]]),
        variances=np.concatenate([[ends], sigmas**2, [ends]]),
        divides=np.concatenate([[0.0], np.log(params.p_seen) + np.log(q), [0.0]]),
        passed=np.concatenate([[-np.inf], rate + np.log(1 - q), [-np.inf]]),
        has_depth=has_depth,
        log_depths=_log_depths(model, np.where(has_depth, depths, np.nan)),
    )


def as_seen(model: Segmental, walls: Walls) -> float:
    """Return the log probability of a line all of whose seen walls divide rooms of any kind.

    That is what is said of unexplained rooms, but for how often they come.
    """
    return (
        float(walls.divides.sum() + log_any(model.params, np.diff(walls.at)).sum())
        - np.log(model.params.deepest_m) * walls.has_depth.sum()
    )


def log_any(params: SegmentalParams, widths: Floats) -> Floats:
    """Return the log density of each width of a room of any kind."""
    away = np.log(widths / params.unexplained_width_m) / params.unexplained_spread
    scale = np.log(params.unexplained_spread * widths) + np.log(2 * np.pi) / 2
    return np.asarray(-0.5 * away**2 - scale)


def _log_depths(model: Segmental, depths: Floats) -> Floats:
    states, runs, params = model.states, model.runs, model.params
    variance = states.depth_spreads**2 + params.depth_sigma_m**2
    away = depths[:, None] - states.depths
    fits = np.exp(-(away**2) / (2 * variance)) / np.sqrt(2 * np.pi * variance)
    broad, u = 1 / params.deepest_m, params.p_wrong_depth
    in_state = np.where(np.isnan(fits), broad, (1 - u) * fits + u * broad)
    in_run = np.zeros((len(depths), len(runs.counts)))
    for states_k, shares_k in zip(runs.states.T, runs.shares.T, strict=True):
        in_run += shares_k * in_state[:, states_k]  # the last state at -1, with no share
    return np.where(np.isnan(depths)[:, None], 0.0, np.log(in_run))
