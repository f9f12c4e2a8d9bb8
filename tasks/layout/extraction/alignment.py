"""Lines of a plan laid onto the walls of a measured storey: a turn and a shift for all of them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PositiveFloat

from storage.errors import MapSenseError
from tasks.layout.extraction.model import LineFrame
from tasks.params import Params


class AlignParams(Params):
    """How lines are laid onto walls. None is in the paper."""

    fit_min: float = Field(default=0.6, gt=0, le=1)
    """Least share of the lines' length that must come to lie on walls. Assumption."""
    beside_m: PositiveFloat = 0.5
    """A line lies on a wall no further beside it, metres. Assumption."""
    turned_rad: PositiveFloat = 0.06
    """A line lies on a wall turned no further, radians. Assumption."""
    own_beside_m: PositiveFloat = 0.25
    """Lines are the building's own if they lie no further beside its walls, metres: what scans of a
    storey drift by at most. Assumption."""
    own_covered: float = Field(default=0.75, gt=0, le=1)
    """...and if so much of the length of the walls lies on lines as well; of lines that were moved,
    as much on walls. Assumption."""


NEAR_TURN = 0.02
"""What a half turn costs of the share that fits: of two turns that fit alike, as a symmetric storey
has them, the lesser is meant."""
CROSSING_SINE = 0.5
"""Two lines that turn by less do not fix a shift."""
ALIKE = 0.1
"""Runs turned off a line by less may be its wall, radians."""
STEPS = 10
"""Rounds of least squares; few are needed, for the start is near."""
END_M, END_WEIGHT = 1.0, 0.1
"""Ends nearer than this pull on each other along their line, metres, by this share of what the
lines' sides do: where rows end is less sure than where walls run."""


@dataclass(frozen=True, eq=False)
class Rigid:
    """A turn about the origin, then a shift."""

    turn_rad: float
    shift_m: NDArray[np.float64]

    def apply(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return (..., 2) points moved."""
        c, s = np.cos(self.turn_rad), np.sin(self.turn_rad)
        return points @ np.array([[c, s], [-s, c]]) + self.shift_m


def align(
    lines: NDArray[np.float64], runs: NDArray[np.float64], what: str, params: AlignParams
) -> Rigid:
    """Return the turn and shift that lay most of some lines onto runs of wall.

    Each line and run that may belong together propose a turn and a shift; the proposal under which
    most of the lines' length lies on walls is refined by least squares over what lies there.

    Parameters
    ----------
    lines, runs : (l, 2, 2), (r, 2, 2) float
        Starts and ends; both have their rooms to the left.
    what : whose lines they are, for the error

    Raises
    ------
    MapSenseError
        If too little of the lines' length comes to lie on walls.
    """
    best, share = Rigid(0.0, np.zeros(2)), 0.0
    rank = -np.inf
    for proposal in _proposals(lines, runs):
        fit = _on_walls(proposal.apply(lines), runs, params)[0].sum() / _lengths(lines).sum()
        ranked = fit - NEAR_TURN * abs(proposal.turn_rad) / np.pi
        if ranked > rank + 1e-9:
            best, share, rank = proposal, float(fit), float(ranked)
    for _ in range(STEPS if share > 0 else 0):
        best = _refined(best, lines, runs, params)
    if share > 0:
        on = _on_walls(best.apply(lines), runs, params)[0]
        share = float(on.sum() / _lengths(lines).sum())
    if share < params.fit_min:
        raise MapSenseError(
            f"{what}: its reference lines do not fit the storey: {share:.0%} of their length lies "
            f"on walls of its {len(runs)} corridor runs at best, {params.fit_min:.0%} is asked "
            "for; set lines = 'corridors', or take a grammar of this building"
        )
    return best


def fit_both_ways(
    lines: NDArray[np.float64], runs: NDArray[np.float64], params: AlignParams
) -> float:
    """Return the share of lines' length on walls, if they are the building's own; 0 if not."""
    if not len(lines) or not len(runs):
        return 0.0
    close = params.model_copy(update={"beside_m": params.own_beside_m})
    share = float(_on_walls(lines, runs, close)[0].sum() / _lengths(lines).sum())
    covered = float(_on_walls(runs, lines, close)[0].sum() / _lengths(runs).sum())
    return share if share >= params.fit_min and covered >= params.own_covered else 0.0


def _lengths(lines: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1)


def _angles(lines: NDArray[np.float64]) -> NDArray[np.float64]:
    step = lines[:, 1] - lines[:, 0]
    return np.arctan2(step[:, 1], step[:, 0])


def _proposals(lines: NDArray[np.float64], runs: NDArray[np.float64]) -> list[Rigid]:
    """Return for each line and run: start on start, end on end, middle on middle.

    Ends of a run are where a corridor's wall happens to be seen to; two lines that cross, each laid
    on a run, fix a shift that no end has a say in. The longest line that crosses is taken.
    """
    angles, targets = _angles(lines), _angles(runs)
    found = []
    for i in range(len(lines)):
        crossing = np.abs(np.sin(angles - angles[i])) > CROSSING_SINE
        other = int(np.argmax(_lengths(lines) * crossing))
        for j in range(len(runs)):
            turn = float((targets[j] - angles[i] + np.pi) % (2 * np.pi) - np.pi)
            turned = Rigid(turn, np.zeros(2)).apply(lines)
            steps = [runs[j, 0] - turned[i, 0], runs[j, 1] - turned[i, 1]]
            steps.append((steps[0] + steps[1]) / 2)
            if crossing[other]:
                alike = np.cos(targets - angles[other] - turn) > np.cos(ALIKE)
                steps += _crossing(runs[j], turned[i], turned[other], runs[alike])
            found += [Rigid(turn, step) for step in steps]
    return found


def _crossing(
    run: NDArray[np.float64],
    line: NDArray[np.float64],
    other: NDArray[np.float64],
    others: NDArray[np.float64],
) -> list[NDArray[np.float64]]:
    """Return the shifts that lay `line` on `run` and `other` on one of `others`."""
    frame = LineFrame.between(*run)
    aside = -frame.local(line[0])[1] * frame.left
    left = LineFrame.between(*other).left
    off = (others[:, 0] - other[0] - aside) @ left
    return [aside + o / float(frame.along @ left) * frame.along for o in off]


def _on_walls(
    lines: NDArray[np.float64], runs: NDArray[np.float64], params: AlignParams
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return for each line how much of it lies on a run, (l,), and on which one."""
    lengths = _lengths(runs)
    along = (runs[:, 1] - runs[:, 0]) / lengths[:, None]
    left = np.column_stack([-along[:, 1], along[:, 0]])
    off = lines[:, :, None] - runs[None, None, :, 0]
    ahead, aside = np.einsum("lerx,rx->ler", off, along), np.einsum("lerx,rx->ler", off, left)
    common = np.minimum(ahead[:, 1], lengths) - np.maximum(ahead[:, 0], 0.0)
    turned = np.abs(np.arctan2(aside[:, 1] - aside[:, 0], ahead[:, 1] - ahead[:, 0]))
    apart = (np.abs(aside.mean(axis=1)) > params.beside_m) | (turned > params.turned_rad)
    common = np.where(apart, 0.0, np.maximum(common, 0.0))
    return np.minimum(common.max(axis=1), _lengths(lines)), common.argmax(axis=1)


def _refined(
    at: Rigid, lines: NDArray[np.float64], runs: NDArray[np.float64], params: AlignParams
) -> Rigid:
    """Return the move improved by one step of robust least squares.

    Residuals are how far a line's ends lie beside their run, weighted by the length in common, and
    along it how far starts and ends are apart; what is far counts less (Huber).
    """
    moved = at.apply(lines)
    common, which = _on_walls(moved, runs, params)
    centre = moved.reshape(-1, 2).mean(axis=0)
    rows, sides = [], []
    for i in np.flatnonzero(common > 0):
        frame = LineFrame.between(*runs[which[i]])
        for end, goal in zip(moved[i], runs[which[i]], strict=True):
            arm = np.array([-(end - centre)[1], (end - centre)[0]])
            aside = float((frame.start - end) @ frame.left)
            ahead = float((goal - end) @ frame.along)
            for off, axis, weight in (
                (aside, frame.left, common[i]),
                (ahead, frame.along, END_WEIGHT * common[i] * (abs(ahead) < END_M)),
            ):
                root = np.sqrt(weight * min(1.0, 0.05 / max(abs(off), 1e-9)))
                rows.append(root * np.array([arm @ axis, *axis]))
                sides.append(root * off)
    turn, *shift = np.linalg.lstsq(np.array(rows), np.array(sides), rcond=None)[0]
    about = Rigid(float(turn), np.zeros(2))
    step = centre + np.array(shift) - about.apply(centre)
    return Rigid(at.turn_rad + float(turn), about.apply(at.shift_m) + step)
