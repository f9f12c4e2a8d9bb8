"""Walls against walls: by the ends of their lines, and by the length of face two plans share."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import PositiveFloat
from shapely import LineString, STRtree

from storage.plan import Plan, PlanWall
from storage.plan_geojson import read_plan
from storage.sources import Source
from storage.wall_quality import WallQuality
from tasks.evaluation.matching import Pairs, within
from tasks.params import Params


class WallQualityParams(Params):
    """What is compared, and how near two faces are one."""

    buffers_m: tuple[PositiveFloat, ...] = (0.1,)
    """Buffer b and cut-off r, metres (ISPRS benchmark on indoor modelling: b = r = 10 cm)."""
    sample_m: PositiveFloat = 0.02
    """Greatest spacing of the samples of which the accuracy is the median, metres. Assumption."""


def wall_ends(walls: Sequence[PlanWall]) -> NDArray[np.float64]:
    """Return the two ends of each wall's line, (w, 2, 2)."""
    lines = np.array([wall.line for wall in walls], object)
    ends = [shapely.get_coordinates(shapely.get_point(lines, k)) for k in (0, -1)]
    return np.stack([some.reshape(-1, 2) for some in ends], axis=1)


def both_ends(found: NDArray[np.float64], true: NDArray[np.float64], limit_m: float) -> Pairs:
    """Return the pairs of walls whose ends lie together, either way round.

    Parameters
    ----------
    found, true : (w, 2, 2) float
        Ends of walls, metres.
    limit_m : greatest Euclidean distance of two ends

    Returns
    -------
    Pairs
        With the greater of the two distances, in the order in which that is less.
    """
    # ends that lie together have middles that do
    near = within(found.mean(axis=1), true.mean(axis=1), limit_m)
    a, b = found[near.found], true[near.true]
    apart = np.linalg.norm([a - b, a - b[:, ::-1]], axis=-1).max(axis=-1).min(axis=0)
    return Pairs(near.found, near.true, apart).at(apart <= limit_m)


def evaluate_walls(found: Source, truth: Source, params: WallQualityParams) -> WallQuality:
    """Return completeness, correctness and accuracy of a GeoJSON plan's walls against another's.

    Nothing is aligned: the walls are taken where they lie in the building frame.
    """
    return compare_walls(read_plan(Path(found.path)), read_plan(Path(truth.path)), params)


def compare_walls(found: Plan, truth: Plan, params: WallQualityParams) -> WallQuality:
    """Return completeness, correctness and accuracy of a plan's walls against a true plan's.

    Notes
    -----
    Measures of the ISPRS benchmark on indoor modelling, on the plan: heights may be unknown, so
    lengths of wall faces stand for areas. Completeness is the share of the true faces within b of a
    found one (as Heipke et al. 1997 for roads), so that one found twice does not count twice.
    Accuracy is the median distance of the true faces, those farther than r left out, to the nearest
    found one.
    """
    true, mapped = faces(truth.walls), faces(found.walls)
    n = len(params.buffers_m)
    true_m, found_m = float(shapely.length(true).sum()), float(shapely.length(mapped).sum())
    apart = _distances(true, mapped, max(params.buffers_m, default=0.0), params.sample_m)
    near = [apart[apart <= buffer] for buffer in params.buffers_m]
    return WallQuality(
        simulated=np.full(n, found.simulated or truth.simulated),
        buffer_m=np.array(params.buffers_m, float),
        true_m=np.full(n, true_m),
        found_m=np.full(n, found_m),
        completeness=_shares(true, mapped, params.buffers_m),
        correctness=_shares(mapped, true, params.buffers_m),
        accuracy_m=np.array([np.median(some) if len(some) else np.nan for some in near], float),
    )


def faces(walls: Sequence[PlanWall]) -> NDArray[np.object_]:
    """Return the lines of the walls' faces, half a thickness to both sides of their centre lines.

    A wall of unknown thickness is known by one line only, and that is its face.
    """
    lines: list[LineString] = []
    for wall in walls:
        if wall.thickness_m:
            half = wall.thickness_m / 2
            lines += [
                shapely.offset_curve(wall.line, side * half, join_style="mitre") for side in (1, -1)
            ]
        else:
            lines.append(wall.line)
    made = np.empty(len(lines), object)
    made[:] = lines
    return made


def _shares(
    lines: NDArray[np.object_], others: NDArray[np.object_], buffers_m: Sequence[float]
) -> NDArray[np.float64]:
    """Return the share of the length of lines within each buffer around others; NaN of nothing."""
    length = shapely.length(lines).sum()
    if not length:
        return np.full(len(buffers_m), np.nan)
    return np.array([_length_within(lines, others, b) / length for b in buffers_m], float)


def _length_within(
    lines: NDArray[np.object_], others: NDArray[np.object_], buffer_m: float
) -> float:
    i, j = STRtree(others).query(lines, predicate="dwithin", distance=buffer_m)
    around = shapely.buffer(others, buffer_m)
    # buffers are united, not what they cut out: each point of a line counts once
    first, starts = np.unique(i, return_index=True)
    united = [shapely.union_all(around[some]) for some in np.split(j, starts[1:])] if len(i) else []
    return float(shapely.length(shapely.intersection(lines[first], united)).sum())


def _distances(
    true: NDArray[np.object_], found: NDArray[np.object_], limit_m: float, sample_m: float
) -> NDArray[np.float64]:
    """Return the distance of evenly spaced points of true faces to the nearest found, up to r."""
    if not len(true) or not len(found):
        return np.empty(0)
    lengths = shapely.length(true)
    counts = np.ceil(lengths / sample_m).astype(int)
    line = np.repeat(np.arange(len(true)), counts)
    number = np.arange(len(line)) - np.repeat(np.cumsum(counts) - counts, counts)
    along = (number + 0.5) * (lengths / np.maximum(counts, 1))[line]
    points = shapely.line_interpolate_point(true[line], along)
    _, apart = STRtree(found).query_nearest(
        points, max_distance=limit_m * (1 + 1e-9), return_distance=True, all_matches=False
    )
    return apart
