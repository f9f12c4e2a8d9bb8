"""One opening seen from both of its rooms is one opening: both faces of a wall, and walls that the
initial model drew twice."""

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PositiveFloat

from storage.candidates import Candidates
from storage.wall_images import WallImages
from storage.walls import Walls
from tasks.geometry import unit_axes
from tasks.params import Params


class CrossCheckParams(Params):
    """What lies at the same place."""

    parallel_cos: float = Field(default=0.95, gt=0, le=1)
    """Least cosine between two lines that may be one opening's. Assumption."""
    apart_m: PositiveFloat = 0.5
    """How far from each other two such lines lie at most, metres: a thick wall. Assumption."""
    overlap: float = Field(default=0.25, gt=0, lt=1)
    """Share of the shorter of two lines that they have to share. Assumption."""


def on_walls(candidates: Candidates, images: WallImages, walls: Walls) -> NDArray[np.float64]:
    """Return the candidates as they lie along the centre lines of their walls, (n, 4).

    Returns
    -------
    (n, 4) float
        Begin and end along the wall from its line's first end, sill and head, metres.
    """
    faces = candidates.faces
    lines = walls.lines[images.walls[faces]]
    axes = unit_axes(lines)
    origin = np.einsum("nx,nx->n", images.origins[faces] - lines[:, 0], axes)
    turn = np.einsum("nx,nx->n", images.axes[faces], axes)
    ends = origin[:, None] + turn[:, None] * np.column_stack([candidates.from_m, candidates.to_m])
    return np.column_stack(
        [ends.min(axis=1), ends.max(axis=1), candidates.sill_m, candidates.head_m]
    )


def distinct(
    lines: NDArray[np.float64], confidences: NDArray[np.float64], params: CrossCheckParams
) -> NDArray[np.int64]:
    """Return which openings to keep: of those at one place the most sure, in their order.

    Parameters
    ----------
    lines : (n, 2, 2) float
        Ends in the plan, metres.
    """
    across = lines[:, 1] - lines[:, 0]
    lengths = np.linalg.norm(across, axis=1)
    axes = across / np.maximum(lengths, 1e-12)[:, None]
    middles = lines.mean(axis=1)
    left = np.ones(len(lines), bool)
    kept = []
    for i in np.argsort(-confidences, kind="stable"):
        if not left[i]:
            continue
        kept.append(int(i))
        from_start = lines - lines[i, 0]
        along = from_start @ axes[i]
        out = (middles - lines[i, 0]) @ np.array([-axes[i][1], axes[i][0]])
        shared = np.minimum(along.max(axis=1), lengths[i]) - np.maximum(along.min(axis=1), 0)
        same = (
            (np.abs(axes @ axes[i]) >= params.parallel_cos)
            & (np.abs(out) <= params.apart_m)
            & (shared >= params.overlap * np.minimum(lengths, lengths[i]))
        )
        left &= ~same
    return np.sort(np.array(kept, np.int64))
