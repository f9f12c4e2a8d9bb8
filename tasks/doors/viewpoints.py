"""Where the rays at a wall face start: places from which the sensor truly looked at it."""

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field, PositiveFloat, PositiveInt
from scipy.spatial.transform import Rotation

from storage.snapshots import Snapshots
from tasks.doors.rays import Canvas, Eyes
from tasks.params import Params

SAMPLE_M = 0.4
"""Distance of the places of a face that are asked whether a snapshot saw them, metres."""
ALL_ROUND = np.pi
"""Angle of view from which a sensor is taken to see in every direction."""


class ViewParams(Params):
    """What a snapshot saw, and how many of them are asked."""

    view_across_rad: float = Field(default=0.666, gt=0, le=2 * np.pi)
    """Angle of view along the device's x, radians; from pi on it saw all around. Assumption: a
    Tango tablet's 180 pixels at a focal length of 260."""
    view_up_rad: float = Field(default=1.104, gt=0, le=2 * np.pi)
    """Angle of view along the device's y, radians: 320 pixels."""
    reach_m: PositiveFloat = 3.8
    """Distance to which a snapshot sees a surface for sure, metres: four (Sec. 3.2.1) less noise.
    Where nothing was seen beyond it, nothing can be said."""
    near_room_m: PositiveFloat = 0.3
    """A snapshot further outside a room's outline was not taken in it, metres: drift of the poses.
    Assumption."""
    snapshots: PositiveInt = 48
    """Snapshots asked about a face, spread over where they were taken and where they looked. Not
    in the paper."""
    interior_step_m: PositiveFloat = 1.0
    """Distance of the places that stand for the snapshots of a room that has none, metres."""
    interior_height_m: PositiveFloat = 1.5
    """Their height over its floor, metres: a device in a hand. Assumption."""


def snapshot_eyes(snapshots: Sequence[Snapshots], params: ViewParams) -> Eyes:
    """Return the snapshots of all scans as places that rays start from."""
    positions = np.concatenate([np.empty((0, 3)), *(s.positions for s in snapshots)])
    turns = np.concatenate([np.empty((0, 4)), *(s.rotations for s in snapshots)])
    # rows of the transposed rotation are the device's axes in the building frame
    frames = np.empty((0, 3, 3))
    if len(turns):
        frames = Rotation.from_quat(turns, scalar_first=True).as_matrix().transpose(0, 2, 1)
    views = (params.view_across_rad, params.view_up_rad)
    across, up = (float(np.tan(min(view, ALL_ROUND - 1e-6) / 2)) for view in views)
    all_round = max(views) >= ALL_ROUND
    return Eyes(positions, np.ascontiguousarray(frames), all_round, (across, up), params.reach_m)


def of_room(eyes: Eyes, room: shapely.Polygon, near: float) -> Eyes:
    """Return the places within a room, or at most `near` metres outside it."""
    points = shapely.points(eyes.positions[:, :2])
    shapely.prepare(room)
    return eyes.take(np.flatnonzero(shapely.dwithin(points, room, near)))


def interior_eyes(room: shapely.Polygon, floor: float, params: ViewParams) -> Eyes:
    """Return places all over a room's inside that look in every direction (Sec. 5)."""
    low, high = np.reshape(room.bounds, (2, 2))
    counts = np.maximum(np.ceil((high - low) / params.interior_step_m).astype(int), 1)
    lattice = low + (np.argwhere(np.ones(counts, bool)) + 0.5) * (high - low) / counts
    shapely.prepare(room)
    inside = lattice[shapely.contains_xy(room, lattice)]
    if not len(inside):
        inside = shapely.get_coordinates(shapely.point_on_surface(room))
    heights = np.full(len(inside), floor + params.interior_height_m)
    frames = np.tile(np.eye(3), (len(inside), 1, 1))
    positions = np.column_stack([inside, heights])
    return Eyes(positions, frames, True, (1.0, 1.0), params.reach_m)


def chosen(eyes: Eyes, canvas: Canvas, least_cosine: float, most: int) -> Eyes:
    """Return the places that see something of a face, well spread ones first.

    Parameters
    ----------
    eyes : Eyes
        k places.
    canvas : Canvas
        The face.
    least_cosine : float
        Of the angle to its normal, below which nothing is seen.
    most : int
        Greatest number returned.

    Notes
    -----
    Each is the one furthest from all before it (Gonzalez 1985): in plan, and in the part of the
    face that it sees.
    """
    size = np.array(canvas.shape) * canvas.pixel_m
    counts = np.maximum(np.ceil(size / SAMPLE_M).astype(int), 1)
    along, up = ((np.arange(n) + 0.5) * length / n for n, length in zip(counts, size, strict=True))
    s, z = (values.ravel() for values in np.meshgrid(along, up, indexing="ij"))
    places = np.column_stack([canvas.origin[:2] + s[:, None] * canvas.axis, canvas.origin[2] + z])
    seen = sees(eyes, places, canvas.normal, least_cosine)
    rows = np.flatnonzero(seen.any(axis=1))
    if not len(rows):
        return eyes.take(rows)
    middle = seen[rows] @ s / seen[rows].sum(axis=1)
    features = np.column_stack([eyes.positions[rows, :2], middle])
    return eyes.take(rows[_spread(features, most)])


def sees(
    eyes: Eyes, places: NDArray[np.float64], normal: NDArray[np.float64], least_cosine: float
) -> NDArray[np.bool_]:
    """Return whether each of k eyes has each of p places of a face in view, (k, p); what may
    stand between is left aside."""
    d = places - eyes.positions[:, None]
    length = np.linalg.norm(d, axis=2)
    away = -d[..., :2] @ normal
    seen = (length <= eyes.reach_m) & (away > 0) & (away >= least_cosine * length)
    if not eyes.all_round:
        right, upward, back = np.moveaxis(np.einsum("kij,kpj->kpi", eyes.frames, d), 2, 0)
        across, up = eyes.half_view
        seen &= (back < 0) & (abs(right) <= -across * back) & (abs(upward) <= -up * back)
    return seen


def _spread(features: NDArray[np.float64], most: int) -> NDArray[np.int64]:
    """Return rows, each the furthest from those before it; the first is nearest to the middle."""
    rows = [int(np.argmin(((features - features.mean(axis=0)) ** 2).sum(axis=1)))]
    gap = np.full(len(features), np.inf)
    while len(rows) < min(most, len(features)):
        gap = np.minimum(gap, ((features - features[rows[-1]]) ** 2).sum(axis=1))
        gap[rows] = -1.0
        rows.append(int(np.argmax(gap)))
    return np.array(rows)
