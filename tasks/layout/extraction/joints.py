"""Where walls that nobody saw join the fronts and rears of rooms: gaps as wide as a partition.

Where a wall stands against another, nobody sees what is behind it. The faces of the rooms on its
two sides lie in one plane mostly, and so are found as one face with a gap in it, as wide as the
wall is thick. Two rooms that the initial model takes for one, because the wall between them was
missed, still show it. What the paper lacks: it only counts the walls that were seen (Fig. 8).
"""

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field, PositiveFloat

from storage.faces import NOT_SEEN, Faces
from tasks.layout.extraction.branches import Branches
from tasks.layout.extraction.model import LineFrame, Model
from tasks.layout.extraction.presence import JointParams, joint_presence
from tasks.params import Params

STEP_M = 0.01
"""Step in which it is told what was seen along a face, metres."""
SQUARE_COS = float(np.cos(np.radians(8)))
"""Faces that are turned against the line by more are no front and no rear."""


class GapParams(Params):
    """Which gaps in a face are taken for walls that join it. None is in the paper."""

    beside_m: PositiveFloat = 0.2
    """A face in a room or no further from it is seen from it, metres. Assumption."""
    narrowest_m: PositiveFloat = 0.07
    """Faces are known in bins of 0.1 m, which may reach into a gap: of a partition of 0.12 m so
    much is left at least, metres. Assumption."""
    widest_m: PositiveFloat = 0.24
    """A wider gap is a door or what furniture hides, metres. Assumption: a partition and a bin."""
    flank_m: PositiveFloat = 0.3
    """Length on either side of a gap, metres,"""
    flank: float = Field(default=0.8, gt=0, le=1)
    """of which so much was seen: no gap is what was hardly seen at all. Assumption."""
    same_m: PositiveFloat = 0.2
    """Gaps in front and rear are of one wall if they are no further apart, metres. Assumption."""
    evidence: JointParams = JointParams()
    """How much gaps say."""


def find_joints(
    frame: LineFrame,
    rooms: Sequence[int],
    apart_m: float,
    model: Model,
    params: GapParams,
) -> Branches:
    """Return the walls across a line that rooms' fronts and rears have gaps for.

    Parameters
    ----------
    rooms : those that stand along the line
    apart_m : float
        How far from a room's ends a wall in it is, metres, at least.
    """
    found: list[tuple[float, float, int]] = []
    for room in rooms:
        polygon = model.rooms.polygons[room]
        x = frame.local(shapely.get_coordinates(polygon))[:, 0]
        low, high = float(x.min()), float(x.max())
        walls = [
            _seen(model.faces, polygon, frame, (low, high), side, params) for side in (1.0, -1.0)
        ]
        gaps = [_gaps(seen, low, params) for seen in walls]
        for at in _merged(gaps, params.same_m):
            if min(at - low, high - at) < apart_m:
                continue
            says = [
                _says(at, of_side, seen, low, params)
                for of_side, seen in zip(gaps, walls, strict=True)
            ]
            found.append((at, joint_presence(says, params.evidence), room))
    found.sort()
    n = len(found)
    return Branches(
        at=np.array([f[0] for f in found], float),
        faces=np.full((n, 2), np.nan),
        sigma=np.full(n, model.faces.bin_m / 2),
        scans=np.zeros(n, np.int64),
        presence=np.array([f[1] for f in found], float),
        beside=np.array([[f[2], f[2]] for f in found], np.int64).reshape(-1, 2),
        outliers=((),) * n,
    )


def _seen(
    faces: Faces,
    room: shapely.Polygon,
    frame: LineFrame,
    span: tuple[float, float],
    side: float,
    params: GapParams,
) -> NDArray[np.bool_]:
    """Return where, step by step along a room, its front (side 1) or rear (-1) was seen."""
    seen = np.zeros(max(1, round((span[1] - span[0]) / STEP_M)), bool)
    looks = side * (faces.normals[:, :2] @ frame.left) >= SQUARE_COS
    # what stands in the room counts as well: before a gap it closes it
    near = shapely.intersects(
        shapely.linestrings(faces.lines), shapely.buffer(room, params.beside_m)
    )
    for i in np.flatnonzero(looks & near & (faces.sides != 0)):
        ends = frame.local(faces.lines[i])[:, 0]
        profile = np.asarray(faces.profiles[i]) != NOT_SEEN
        length = abs(float(ends[1] - ends[0]))
        at = np.minimum(np.arange(len(profile) + 1) * faces.bin_m, length)
        at = ends[0] + np.sign(ends[1] - ends[0]) * at
        steps = np.rint((np.sort(np.column_stack([at[:-1], at[1:]])) - span[0]) / STEP_M)
        for a, b in np.clip(steps[profile].astype(int), 0, len(seen)):
            seen[a:b] = True
    return seen


def _gaps(seen: NDArray[np.bool_], low: float, params: GapParams) -> list[float]:
    """Return the middles of the gaps along the line that a partition may stand before."""
    steps = np.flatnonzero(np.diff(np.concatenate([[True], seen, [True]]).astype(np.int8)))
    flank = round(params.flank_m / STEP_M)
    middles = []
    for a, b in steps.reshape(-1, 2).tolist():
        width = (b - a) * STEP_M
        if a < flank or b + flank > len(seen):
            continue
        beside = min(seen[a - flank : a].mean(), seen[b : b + flank].mean())
        if params.narrowest_m <= width <= params.widest_m and beside >= params.flank:
            middles.append(low + (a + b) / 2 * STEP_M)
    return middles


def _merged(gaps: Sequence[Sequence[float]], same_m: float) -> list[float]:
    """Return the places of gaps, those of front and rear that are near each other as one."""
    places: list[list[float]] = []
    for at in sorted(at for some in gaps for at in some):
        if places and at - places[-1][0] <= same_m:
            places[-1].append(at)
        else:
            places.append([at])
    return [float(np.mean(some)) for some in places]


def _says(
    at: float, gaps: Sequence[float], seen: NDArray[np.bool_], low: float, params: GapParams
) -> int:
    """Return what a front or rear says: 1 a wall joins there, -1 it runs through, 0 nothing."""
    if any(abs(at - gap) <= params.same_m for gap in gaps):
        return 1
    i, flank = round((at - low) / STEP_M), round(params.flank_m / STEP_M)
    return -1 if seen[max(i - flank, 0) : i + flank].all() else 0
