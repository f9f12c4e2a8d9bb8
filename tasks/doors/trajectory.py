"""Where somebody walked through a wall: the path of the sensor between snapshots of one scan."""

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import PositiveFloat
from shapely import STRtree

from storage.snapshots import Snapshots
from tasks.params import Params


class TrajectoryParams(Params):
    """What counts as walking from one snapshot to the next."""

    step_m: PositiveFloat = 2.0
    """Two snapshots further apart than this may be on any way, metres. Assumption."""
    step_s: PositiveFloat = 5.0
    """Two snapshots further apart in time may be on any way, seconds. Assumption."""
    beside_m: PositiveFloat = 0.15
    """How far beside an opening a straight step may cross its wall, metres: paths bend and scans
    drift. Assumption."""


def steps(snapshots: list[Snapshots], params: TrajectoryParams) -> NDArray[np.float64]:
    """Return the plan lines between consecutive snapshots of each scan, (k, 2, 2)."""
    found = [np.empty((0, 2, 2))]
    for scan in snapshots:
        if len(scan) < 2:
            continue
        order = np.argsort(scan.times, kind="stable")
        xy, times = scan.positions[order, :2], scan.times[order]
        lines = np.stack([xy[:-1], xy[1:]], axis=1)
        near = np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1) <= params.step_m
        found.append(lines[near & (np.diff(times) <= params.step_s)])
    return np.concatenate(found)


def crossings(
    lines: NDArray[np.float64], walls: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return which walls were crossed, and how far from their begin.

    Parameters
    ----------
    lines : (k, 2, 2) float
        Steps, as of `steps`.
    walls : (w, 2, 2) float
        Ends of the walls' centre lines.

    Returns
    -------
    walls, places : (m,)
        Rows of walls, and metres along each.
    """
    step, wall = STRtree(shapely.linestrings(walls)).query(
        shapely.linestrings(lines), predicate="intersects"
    )
    begin, across = walls[wall, 0], walls[wall, 1] - walls[wall, 0]
    length = np.linalg.norm(across, axis=1)
    axis = across / np.maximum(length, 1e-12)[:, None]
    from_wall = lines[step] - begin[:, None]
    along = np.einsum("pex,px->pe", from_wall, axis)
    a, b = (from_wall[..., 1] * axis[:, :1] - from_wall[..., 0] * axis[:, 1:]).T
    through = (a < 0) != (b < 0)  # not along it, nor up to it and back
    share = a[through] / (a - b)[through]
    place = along[through, 0] + share * np.diff(along[through], axis=1)[:, 0]
    return wall[through], place


def crossed(
    walls: NDArray[np.int32],
    begins: NDArray[np.float64],
    ends: NDArray[np.float64],
    where: tuple[NDArray[np.int64], NDArray[np.float64]],
    params: TrajectoryParams,
) -> NDArray[np.int64]:
    """Return how many steps went through each interval of a wall, (n,).

    Parameters
    ----------
    walls, begins, ends : (n,)
        Row of the wall of each interval, and where it lies along it, metres.
    where : as of `crossings`
    """
    counts = np.zeros(len(walls), np.int64)
    for wall in np.unique(where[0]):
        places = np.sort(where[1][where[0] == wall])
        some = np.flatnonzero(walls == wall)
        low = np.searchsorted(places, begins[some] - params.beside_m)
        counts[some] = np.searchsorted(places, ends[some] + params.beside_m, side="right") - low
    return counts
