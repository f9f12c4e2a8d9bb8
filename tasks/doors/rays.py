"""Rays from where the sensor was to the pixels of a wall face (Sec. 5, Fig. 9)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numba as nb
import numpy as np
from numpy.typing import NDArray

from tasks.doors.voxels import DistanceField

STOPPED, HIT, ASIDE, PASSED = range(4)
"""How a ray ends: before the face; at it; within the wall but beside the pixel, at the reveal of an
opening if not at a surface behind it; or it went through."""


@dataclass(frozen=True, eq=False)
class Canvas:
    """The pixels of one face: column i, row j has its middle half a pixel further than
    `origin` + i `pixel_m` along `axis`, and j `pixel_m` up."""

    origin: NDArray[np.float64]
    """(3,), metres, building frame: lower corner where column 0 begins"""
    axis: NDArray[np.float64]
    """(2,), unit plan direction of the columns; the room lies to the left"""
    shape: tuple[int, int]
    """columns, rows"""
    pixel_m: float

    @property
    def normal(self) -> NDArray[np.float64]:
        """(2,), unit, into the room."""
        return np.array([-self.axis[1], self.axis[0]])

    def moved(self, depth: float) -> "Canvas":
        """Return the canvas moved away from the room by `depth` metres."""
        return replace(self, origin=self.origin - np.append(depth * self.normal, 0.0))

    def corners(self) -> NDArray[np.float64]:
        """Return its lower corner at column 0 and its upper one at the other end, (2, 3)."""
        along, up = np.array(self.shape) * self.pixel_m
        return self.origin + np.array([[0.0, 0.0, 0.0], [*(along * self.axis), up]])


@dataclass(frozen=True, eq=False)
class Eyes:
    """k places rays start from, and what can be seen from each."""

    positions: NDArray[np.float64]
    """(k, 3), metres, building frame"""
    frames: NDArray[np.float64]
    """(k, 3, 3), rows: the directions right, up and backwards of the device, building frame"""
    all_round: bool
    """whether they see in every direction, wherever the device looks"""
    half_view: tuple[float, float]
    """tangents of half the angles of view, to the right and up; unless `all_round`"""
    reach_m: float
    """how far they see"""

    def __len__(self) -> int:
        return len(self.positions)

    def take(self, rows: NDArray[np.int64]) -> "Eyes":
        """Return some of them, in the order asked for."""
        return Eyes(
            self.positions[rows], self.frames[rows], self.all_round, self.half_view, self.reach_m
        )


@dataclass(frozen=True)
class Limits:
    """What a ray's end says of its pixel. Depths are measured along the face's normal, metres."""

    before_m: float
    """a ray that ends further before the face than this is stopped by something else (d)"""
    through_m: float
    """a ray that comes further behind it than this went through (d + d_0)"""
    aside_m: float
    """a ray that ends further than this both behind the face and beside the pixel entered the wall
    and ended elsewhere in it"""
    behind_m: float
    """how far behind the face a ray is followed"""
    least_cosine: float
    """of the angle to the normal: no ray is cast at a pixel that is seen at a sharper angle"""
    enough: int
    """rays that reach a pixel after which no more are cast at it"""
    need_background: bool
    """whether a ray that meets nothing at all says nothing"""


@dataclass(frozen=True, eq=False)
class Votes:
    """What the rays at each pixel of a face met."""

    counts: NDArray[np.int32]
    """(4, a, b), rays that ended each way: STOPPED, HIT, ASIDE, PASSED"""
    depth_m: NDArray[np.float32]
    """(4, a, b), sum of the depths at which they ended; at most `behind_m` each"""
    cast: int
    """rays cast"""


def uncast(canvas: Canvas) -> Votes:
    """Return what a face shows at which no ray is cast."""
    shape = (4, *canvas.shape)
    return Votes(np.zeros(shape, np.int32), np.zeros(shape, np.float32), 0)


def cast_rays(field: DistanceField, canvas: Canvas, rounds: Sequence[tuple[Eyes, Limits]]) -> Votes:
    """Cast a ray from each place to the middle of each pixel that it sees.

    Parameters
    ----------
    field : DistanceField
        Of the storey; what lies outside is empty.
    canvas : Canvas
        a x b pixels.
    rounds : sequence of (Eyes, Limits)
        Asked in this order, and each round's eyes in theirs, until `enough` rays have reached a
        pixel.

    Notes
    -----
    Sec. 5 compares distances along the ray; depths along the normal keep the wall's own voxels
    from standing before the pixels that are seen at a slant. The time is linear in rays.
    """
    counts = np.zeros((4, *canvas.shape), np.int32)
    depths = np.zeros((4, *canvas.shape), np.float32)
    edge, cast = field.edge_m, 0
    corner = (canvas.origin - field.low) / edge
    for eyes, limits in rounds:
        for position, frame in zip(eyes.positions, eyes.frames, strict=True):
            cast += _cast(
                field.distances,
                (position - field.low) / edge,
                corner,
                canvas.axis,
                canvas.pixel_m / edge,
                frame,
                eyes.all_round,
                eyes.half_view,
                eyes.reach_m / edge,
                limits.before_m / edge,
                limits.through_m / edge,
                limits.aside_m / edge,
                limits.behind_m / edge,
                limits.least_cosine,
                limits.enough,
                limits.need_background,
                counts,
                depths,
            )
    depths *= np.float32(edge)
    return Votes(counts, depths, cast)


@nb.njit(cache=True, nogil=True)
def _cast(
    field, eye, corner, axis, pixel, frame, all_round, half_view, reach,
    before, through, aside, behind, least_cosine, enough, need_background, counts, depths,
):  # fmt: skip
    """Cast from one place; lengths in voxels. Return the rays cast."""
    away = (corner[0] - eye[0]) * axis[1] - (corner[1] - eye[1]) * axis[0]
    if away <= before:
        return 0
    cast = 0
    # a ray is 1 long from the eye to the pixel: where it goes on behind the face, and where it ends
    stop_at, end_at = (away - before) / away, (away + behind) / away
    for i in range(counts.shape[1]):
        s = (i + 0.5) * pixel
        d_x, d_y = corner[0] + s * axis[0] - eye[0], corner[1] + s * axis[1] - eye[1]
        for j in range(counts.shape[2]):
            if counts[HIT, i, j] + counts[ASIDE, i, j] + counts[PASSED, i, j] >= enough:
                continue
            d_z = corner[2] + (j + 0.5) * pixel - eye[2]
            length = np.sqrt(d_x * d_x + d_y * d_y + d_z * d_z)
            if length > reach or away < least_cosine * length:
                continue
            if not all_round and not _in_view(d_x, d_y, d_z, frame, half_view):
                continue
            cast += 1
            at = _first(field, eye, d_x, d_y, d_z, end_at)
            depth = (at - 1.0) * away
            if at >= end_at and need_background:
                continue
            end = PASSED
            if at < stop_at:
                end = STOPPED
            elif at < end_at and depth <= through:
                beside = (at - 1.0) * np.sqrt(max(length * length - away * away, 0.0))
                end = ASIDE if depth > aside and beside > aside else HIT
            counts[end, i, j] += 1
            depths[end, i, j] += min(depth, behind)
    return cast


@nb.njit(cache=True, nogil=True, inline="always")
def _in_view(d_x, d_y, d_z, frame, half_view):
    """Return whether the device sees this way; it looks along its -z."""
    ahead = -(frame[2, 0] * d_x + frame[2, 1] * d_y + frame[2, 2] * d_z)
    right = frame[0, 0] * d_x + frame[0, 1] * d_y + frame[0, 2] * d_z
    up = frame[1, 0] * d_x + frame[1, 1] * d_y + frame[1, 2] * d_z
    return ahead > 0 and abs(right) <= half_view[0] * ahead and abs(up) <= half_view[1] * ahead


@nb.njit(cache=True, nogil=True, inline="always")
def _first(field, eye, d_x, d_y, d_z, end):
    """Return where eye + t d first meets a full voxel, `end` if it does not before."""
    t, last = 0.0, end
    # only the part of the ray within the box: no step has to ask whether it left
    for o, d, n in (
        (eye[0], d_x, field.shape[0]), (eye[1], d_y, field.shape[1]), (eye[2], d_z, field.shape[2])
    ):  # fmt: skip
        top = n - 1e-6
        if d > 0:
            t, last = max(t, -o / d), min(last, (top - o) / d)
        elif d < 0:
            t, last = max(t, (top - o) / d), min(last, -o / d)
        elif o < 0 or o > top:
            return end
    unit = 1.0 / max(abs(d_x), abs(d_y), abs(d_z))
    while t < last:
        # rounding may leave the box by a hair: -1e-12 becomes voxel 0
        d = field[int(eye[0] + t * d_x), int(eye[1] + t * d_y), int(eye[2] + t * d_z)]
        if d == 0:
            return t
        # d layers on along the ray's main axis: those between are empty, and no layer is left out.
        # To look at every voxel the ray merely clips takes twice as long and labels no better.
        t += d * unit
    return end
