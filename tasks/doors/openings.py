"""The doors and windows of a storey, from classified candidates (Sec. 5)."""

from dataclasses import dataclass, fields
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, NonNegativeFloat, PositiveInt

from storage.candidates import SHARES, Candidates
from storage.forest import Forest
from storage.openings import DOOR, WINDOW, Openings
from storage.rooms import Rooms
from storage.snapshots import Snapshots
from storage.wall_images import WallImages
from storage.walls import Walls
from tasks.doors.classifying import classified
from tasks.doors.crosscheck import CrossCheckParams, distinct, on_walls
from tasks.doors.examples import CLASSES, DOOR_CLASSES
from tasks.doors.merging import MergingParams, Rectangles, per_door, per_wall, weights
from tasks.doors.states import StateParams, states
from tasks.doors.topology import TopologyParams, doors_of_rooms, rooms_beside
from tasks.doors.trajectory import TrajectoryParams, crossed, crossings, steps
from tasks.geometry import unit_axes
from tasks.params import Params


class OpeningsParams(Params):
    """From classified candidates to doors and windows."""

    door_p: float = Field(default=0.5, ge=0, le=1)
    """Least probability of a door. Assumption: more probable than not."""
    window_p: float = Field(default=0.5, ge=0, le=1)
    """Least probability of a window. Assumption: more probable than not."""
    door_margin: NonNegativeFloat = 0.2
    """By how much more probable than a door a window has to be to stand in its place: the upper
    half of an open door looks like one. Assumption."""
    least_p: float = Field(default=0.1, ge=0, le=1)
    """Candidates less probable than this are not looked at any more. Assumption."""
    door_agree: PositiveInt = 6
    """A door is as probable as so many of its rectangles are on average, the most probable ones:
    one of many is by chance. Windows have fewer. Not in the paper, which has one. Assumption."""
    crossing_weight: NonNegativeFloat = 3.0
    """What a path through a candidate adds to its log-odds of being a door; 0 leaves paths out. Not
    in the paper. Assumption."""
    winner: Literal["door", "wall"] = "door"
    """What the merging keeps: one rectangle per door, or the paper's one per wall face."""
    faces: Literal["both", "each"] = "both"
    """Whether what both faces of a wall show is one opening, or each face is for itself as in the
    paper."""
    merging: MergingParams = MergingParams()
    """Redundant rectangles of one opening."""
    crosscheck: CrossCheckParams = CrossCheckParams()
    """Openings at the same place."""
    trajectory: TrajectoryParams = TrajectoryParams()
    """Paths through walls."""
    topology: TopologyParams = TopologyParams()
    """Rooms linked."""
    states: StateParams = StateParams()
    """Leaves."""


PAPER = OpeningsParams(
    least_p=0.5,
    door_agree=1,
    crossing_weight=0.0,
    winner="wall",
    faces="each",
    topology=TopologyParams(only_door_p=1.0, second_door_p=0.0),
)
"""The paper's own way: no path, no other face, one winner per wall, nothing asked of rooms."""


@dataclass(frozen=True, eq=False)
class _Found:
    """n merged openings of one kind; entry i is one everywhere."""

    walls: NDArray[np.int32]
    boxes: NDArray[np.float64]
    """(n, 4), begin and end along the wall, sill and head"""
    confidences: NDArray[np.float64]
    states: NDArray[np.float64]
    """(n, 3), probability of each state"""

    def __len__(self) -> int:
        return len(self.walls)

    def take(self, rows: NDArray[np.int64] | NDArray[np.bool_]) -> "_Found":
        """Return some of them."""
        return _Found(*(getattr(self, field.name)[rows] for field in fields(self)))

    def lines(self, walls: Walls) -> NDArray[np.float64]:
        """Return the ends in the plan, (n, 2, 2)."""
        lines = walls.lines[self.walls]
        return lines[:, :1] + self.boxes[:, :2, None] * unit_axes(lines)[:, None]


def find_openings(
    candidates: Candidates,
    images: WallImages,
    walls: Walls,
    rooms: Rooms,
    snapshots: list[Snapshots],
    forest: Forest,
    params: OpeningsParams,
) -> Openings:
    """Return the doors and windows of a storey: doors first, each in the order of the walls.

    Parameters
    ----------
    candidates : found on `images`
    images, walls, rooms : of one storey
    snapshots : of its scans
    forest : as of `read_classifier`

    Notes
    -----
    Sec. 5: classification, then k-means over redundant rectangles. Not in the paper: one opening
    for both faces of a wall, paths of the sensor through walls as evidence, a door for every room.
    """
    told = classified(candidates, forest)
    return told_openings(told, candidates, images, walls, rooms, snapshots, params)


def told_openings(
    told: NDArray[np.float64],
    candidates: Candidates,
    images: WallImages,
    walls: Walls,
    rooms: Rooms,
    snapshots: list[Snapshots],
    params: OpeningsParams,
) -> Openings:
    """Return the doors and windows of classified candidates: what follows in `find_openings`.

    Parameters
    ----------
    told : (n, c) float
        Probability of each of `CLASSES`, by whatever classifier.
    """
    boxes = on_walls(candidates, images, walls)
    on = images.walls[candidates.faces]
    door_p = door_probabilities(told, on, boxes, walls, snapshots, params)
    window_p = told[:, CLASSES.index(WINDOW)]
    doors = _merged(candidates, on, boxes, told, door_p, params.door_agree, params)
    windows = _merged(candidates, on, boxes, told, window_p, 1, params)
    windows = windows.take(windows.confidences >= params.window_p)
    doors, windows = _one_per_place(doors, windows, walls, params)
    linked = rooms_beside(doors.lines(walls), doors.walls, walls, rooms, params.topology)
    sure = doors.confidences
    taken = doors_of_rooms(linked, sure, params.door_p, len(rooms), params.topology)
    doors, linked = doors.take(taken), linked[taken]
    beside = rooms_beside(windows.lines(walls), windows.walls, walls, rooms, params.topology)
    return Openings(
        kinds=np.repeat([DOOR, WINDOW], [len(doors), len(windows)]),
        lines=np.concatenate([doors.lines(walls), windows.lines(walls)]),
        sill_m=np.concatenate([doors.boxes[:, 2], windows.boxes[:, 2]]),
        head_m=np.concatenate([doors.boxes[:, 3], windows.boxes[:, 3]]),
        walls=np.concatenate([doors.walls, windows.walls]).astype(np.int32),
        rooms=np.concatenate([linked, beside]),
        states=np.concatenate([states(doors.states, params.states), [""] * len(windows)]),
        confidences=np.concatenate([doors.confidences, windows.confidences]),
    )


def door_probabilities(
    told: NDArray[np.float64],
    on: NDArray[np.int32],
    boxes: NDArray[np.float64],
    walls: Walls,
    snapshots: list[Snapshots],
    params: OpeningsParams,
) -> NDArray[np.float64]:
    """Return the probability of each candidate to be a door, (n,), paths through it counted.

    Parameters
    ----------
    told : (n, c), as of `classified`
    on : (n,), row of the wall
    boxes : (n, 4), as of `on_walls`
    """
    door_p = told[:, list(DOOR_CLASSES)].sum(axis=1)
    return _more_likely(door_p, _walked(on, boxes, walls, snapshots, params))


def _walked(
    on: NDArray[np.int32],
    boxes: NDArray[np.float64],
    walls: Walls,
    snapshots: list[Snapshots],
    params: OpeningsParams,
) -> NDArray[np.float64]:
    """Return what paths through candidates add to their log-odds of being doors."""
    if not params.crossing_weight:
        return np.zeros(len(on))
    where = crossings(steps(snapshots, params.trajectory), walls.lines)
    through = crossed(on, boxes[:, 0], boxes[:, 1], where, params.trajectory)
    return np.where(through > 0, params.crossing_weight, 0.0)


def _one_per_place(
    doors: _Found, windows: _Found, walls: Walls, params: OpeningsParams
) -> tuple[_Found, _Found]:
    """Return the openings but those at the place of a more probable one."""
    n = len(doors)
    sure = np.where(doors.confidences >= params.door_p, params.door_margin, 0.0)
    lines = np.concatenate([doors.lines(walls), windows.lines(walls)])
    both = np.concatenate([doors.confidences + sure, windows.confidences])
    kept = distinct(lines, both, params.crosscheck)
    return doors.take(kept[kept < n]), windows.take(kept[kept >= n] - n)


def _more_likely(p: NDArray[np.float64], weight: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return probabilities whose log-odds a weight was added to."""
    odds = p * np.exp(weight)
    return odds / (odds + 1 - p)


def _merged(
    candidates: Candidates,
    on: NDArray[np.int32],
    boxes: NDArray[np.float64],
    told: NDArray[np.float64],
    p: NDArray[np.float64],
    agree: int,
    params: OpeningsParams,
) -> _Found:
    """Return one opening for all candidates at one place, by their probability to be of a kind."""
    likely = np.flatnonzero(p >= params.least_p)
    faces = candidates.faces[likely]
    groups = on[likely] if params.faces == "both" else faces
    merge = per_door if params.winner == "door" else per_wall
    shares = np.column_stack([candidates.feature(name) for name in SHARES])
    parts = [_Found(np.empty(0, np.int32), np.empty((0, 4)), np.empty(0), np.empty((0, 3)))]
    for group in np.unique(groups):
        rows = likely[groups == group]
        merged, means = merge(Rectangles(boxes[rows], p[rows], shares[rows]), params.merging)
        there = np.unique(merged[merged >= 0])
        members = [rows[merged == k] for k in there]
        weigh = [weights(p[some], params.merging) for some in members]
        leaf = [
            np.average(told[some][:, list(DOOR_CLASSES)], axis=0, weights=w)
            for some, w in zip(members, weigh, strict=True)
        ]
        parts.append(
            _Found(
                walls=np.full(len(there), on[rows[0]], np.int32),
                boxes=means[there],
                confidences=np.array([np.sort(p[some])[-agree:].mean() for some in members]),
                states=np.array(leaf).reshape(-1, 3),
            )
        )
    return _Found(
        *(np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(_Found))
    )
