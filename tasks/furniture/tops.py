"""Candidates for all that is no chair: level patches, put together, split and completed."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import PositiveFloat
from scipy import ndimage

from tasks.furniture.boxes import Box, fit_box, without_fringe
from tasks.furniture.candidates import TOP, Candidate
from tasks.furniture.dimensions import widths_m
from tasks.furniture.elbows import cut_at_corner
from tasks.furniture.scene import Scene
from tasks.furniture.splitting import RunParams, SplitParams, pieces, split_grid, split_run
from tasks.params import Params

TABLE_M = (0.66, 1.0)
"""Heights between which a patch may be tables that touch, metres: tables to benches, not beds."""

RUN_M = (0.2, 0.7)
"""Least and greatest depth of a patch that may be a run of shelves, cabinets or cupboards."""
CLEAN_SHARE = 0.7
"""Share of a patch that must be left for its narrow parts to be cut off. Assumption."""
PIECE_SHARE = 0.15
"""Least share of one of several pieces that must be seen: worktops round a corner leave the rest of
their box empty. Assumption."""
TRIM = 0.01
"""Share of a top's columns that may stick out on each side. Assumption."""


class TopParams(Params):
    """How patches become tops of furniture. Assumptions."""

    core_m: PositiveFloat = 0.12
    """Width a patch must have somewhere, metres: the upper edges of doors, fronts and backs are
    thinner."""
    clean_m: PositiveFloat = 0.2
    """Width under which a part of a well seen patch is not its own, metres: backs of chairs that
    nearly touch a table's edge."""
    area_m2: PositiveFloat = 0.06
    """Least area of a patch without its thin parts, square metres."""
    level_m: PositiveFloat = 0.035
    """Greatest difference in height of two parts of one top, metres."""
    gap_m: PositiveFloat = 0.5
    """Greatest gap between two parts of one top, metres: what a screen hides."""
    wall_m: PositiveFloat = 0.22
    """Greatest gap to a wall that a top is completed over, metres: what a screen hides."""
    short_m: PositiveFloat = 0.35
    """Greatest length by which a top is completed to a standard size, metres."""


@dataclass(frozen=True, eq=False)
class Top:
    """One level patch, its thin parts cut off."""

    surfaces: NDArray[np.int64]
    box: Box
    height: float


def find_tops(scene: Scene, params: TopParams) -> list[Top]:
    """Return the level patches of a room that are wide somewhere, parts of one top joined."""
    tops = []
    for patch in scene.patches:
        if len(patch) * scene.columns.cell_m**2 < params.area_m2:
            continue
        wide = _without_thin(scene, patch, params)
        if len(wide) * scene.columns.cell_m**2 >= params.area_m2:
            tops.append(_top(scene, wide))
    return [part for top in _joined(scene, tops, params) for part in _cut(scene, top)]


def _cut(scene: Scene, top: Top) -> list[Top]:
    """Return a top, or the parts of one that goes round a corner."""
    if top.height < TABLE_M[0]:
        return [top]
    before = cut_at_corner(scene.xy[scene.where[top.surfaces]], top.box, scene.columns.cell_m)
    if before is None:
        return [top]
    parts = (_top(scene, top.surfaces[before]), _top(scene, top.surfaces[~before]))
    return [piece for part in parts for piece in _cut(scene, part)]


def tables_among(tops: list[Top]) -> list[Top]:
    """Return the tops at the height of tables."""
    return [t for t in tops if TABLE_M[0] <= t.height <= 0.8 and t.box.depth > 0.35]


def candidates(
    scene: Scene,
    tops: list[Top],
    standard: NDArray[np.float64],
    params: TopParams,
    split: SplitParams,
    runs: RunParams,
) -> Iterator[Candidate]:
    """Yield the candidates of all tops, those that may be several tables or cabinets split."""
    for top in tops:
        n = 1
        if top.height >= TABLE_M[0] and RUN_M[0] <= top.box.depth <= RUN_M[1]:
            n = split_run(top.box.length, widths_m(top.box.depth), runs)
        if not TABLE_M[0] <= top.height <= TABLE_M[1] or top.box.depth < 0.35:
            yield from _run(scene, top, n, params)
            continue
        if n > 1:
            yield from _run(scene, top, n, params)
        box = _to_wall(scene, top.box, standard, params)
        grid = split_grid(
            (box.length, box.depth), _supports(scene, box, top.height), standard, split
        )
        xy = scene.xy[scene.where[top.surfaces]]
        for piece in pieces(box, grid):
            inside = piece.holds(xy)
            seen = inside.sum() * scene.columns.cell_m**2
            if seen < max(params.area_m2, PIECE_SHARE * piece.area):
                continue
            around = fit_box(xy[inside], scene.directions, scene.columns.cell_m, TRIM)
            n = grid[0] * grid[1]
            whole = piece if n > 1 else _to_standard(scene, piece, standard, params)
            yield Candidate(whole, top.surfaces[inside], top.height, top.height, TOP, n, around)


def _run(scene: Scene, top: Top, n: int, params: TopParams) -> Iterator[Candidate]:
    """Yield a top as some equal pieces side by side."""
    if n == 1:
        yield Candidate(top.box, top.surfaces, top.height, top.height, TOP)
        return
    xy = scene.xy[scene.where[top.surfaces]]
    for piece in pieces(top.box, (n, 1)):
        inside = piece.holds(xy)
        if inside.sum() * scene.columns.cell_m**2 < max(params.area_m2, PIECE_SHARE * piece.area):
            continue
        around = fit_box(xy[inside], scene.directions, scene.columns.cell_m, TRIM)
        yield Candidate(piece, top.surfaces[inside], top.height, top.height, TOP, n, around)


def _without_thin(scene: Scene, patch: NDArray[np.int64], params: TopParams) -> NDArray[np.int64]:
    """Return the surfaces of a patch that lie where it is wide."""
    cells = scene.columns.cells[scene.rows[scene.where[patch]]].astype(np.int64)
    low = cells.min(axis=0) - 2
    mask = np.zeros(cells.max(axis=0) - low + 3, bool)
    cells -= low
    mask[cells[:, 0], cells[:, 1]] = True
    # gaps between the points of far scans are no holes
    closed = ndimage.binary_closing(mask, np.ones((3, 3), bool))
    kept = patch
    for core_m in (params.core_m, params.clean_m):
        width = max(2, round(core_m / scene.columns.cell_m))
        opened = ndimage.binary_opening(closed, np.ones((width, width), bool))
        wide = patch[opened[cells[:, 0], cells[:, 1]]]
        # of a top seen from afar the stricter test would leave little
        if core_m == params.core_m or len(wide) >= CLEAN_SHARE * len(kept):
            kept = wide
    return kept


def _top(scene: Scene, surfaces: NDArray[np.int64]) -> Top:
    xy = scene.xy[scene.where[surfaces]]
    box = fit_box(xy, scene.directions, scene.columns.cell_m, TRIM)
    box = without_fringe(xy, box, scene.columns.cell_m)
    return Top(surfaces, box, float(np.median(scene.heights[surfaces])))


def _joined(scene: Scene, tops: list[Top], params: TopParams) -> list[Top]:
    """Return the tops with those parts joined that form one rectangle with what hides between."""
    tops = sorted(tops, key=lambda top: -top.box.area)
    i = 0
    while i < len(tops):
        for j in range(i + 1, len(tops)):
            both = _both(scene, tops[i], tops[j], params)
            if both is not None:
                tops[i] = both
                del tops[j]
                break
        else:
            i += 1
    return tops


def _both(scene: Scene, a: Top, b: Top, params: TopParams) -> Top | None:
    if abs(a.height - b.height) > params.level_m or a.height < TABLE_M[0]:
        return None
    first, second = a.box.polygon, b.box.polygon
    if shapely.distance(first, second) > params.gap_m:
        return None
    together = _top(scene, np.concatenate((a.surfaces, b.surfaces)))
    whole = together.box
    added = whole.area - shapely.union(first, second).area
    # what lies between must be hidden: no floor, and nothing lower
    gap = scene.within(whole)
    gap = gap[~(a.box.holds(scene.xy[gap]) | b.box.holds(scene.xy[gap]))]
    open_floor = scene.floor_seen[gap].mean() if len(gap) else 0.0
    if added > 0.3 * whole.area or (open_floor > 0.4 and added > 0.08 * whole.area):
        return None
    return together


def _supports(scene: Scene, box: Box, height: float) -> NDArray[np.float64]:
    """Return the places of what stands upright under a top, along and across from its middle."""
    places = scene.within(box, 0.02)
    counts = scene.slices(places, 0.1, height - 0.1)
    tall = (counts > 0).sum(axis=1) >= max(3, counts.shape[1] // 4)
    return box.local(scene.xy[places[tall]])


def _to_wall(scene: Scene, box: Box, standard: NDArray[np.float64], params: TopParams) -> Box:
    """Return a top with each side that nearly reaches a wall moved up to it."""
    for axis in range(2):
        for side in (-1, 1):
            half = np.array((box.length, box.depth)) / 2
            at = np.zeros(2)
            at[axis] = side * half[axis]
            edge = box.centre + at[0] * box.axis + at[1] * box.across
            way = (box.axis, box.across)[axis] * side
            reach = _wall_ahead(scene, edge, way, params.wall_m)
            # a gap of a hand is left behind furniture, not filled
            if reach is None or reach < 0.05:
                continue
            low, high = -half, half.copy()
            (high if side > 0 else low)[axis] += side * (reach - 0.02)
            longer, before = (high - low)[axis], 2 * half[axis]
            sizes = standard.ravel()
            if np.abs(sizes - longer).min() < np.abs(sizes - before).min():
                box = box.part(low, high)
    return box


def _wall_ahead(
    scene: Scene, at: NDArray[np.float64], way: NDArray[np.float64], reach: float
) -> float | None:
    ray = shapely.LineString((at, at + way * reach))
    hit = shapely.intersection(ray, scene.polygon.boundary)
    if hit.is_empty:
        return None
    return float(shapely.distance(shapely.Point(at), hit))


def _to_standard(scene: Scene, box: Box, standard: NDArray[np.float64], params: TopParams) -> Box:
    """Return a top that is shorter than any standard one completed, where nothing speaks against.

    The nearest standard size that holds it is tried to all sides; the columns added must not show
    the floor, nor lie outside the room.
    """
    size = np.array((box.length, box.depth))
    slack = 0.05
    sizes = np.concatenate((standard, standard[:, ::-1]))
    sizes = sizes[
        (sizes >= size - slack).all(axis=1) & (sizes <= size + params.short_m).all(axis=1)
    ]
    if not len(sizes):
        return box
    target = np.maximum(sizes[np.argmin((sizes - size).sum(axis=1))], size)
    if (target - size < slack).all():
        return box
    best, found = 0.3, box
    for a in (-1, 0, 1) if target[0] - size[0] >= slack else (0,):
        for b in (-1, 0, 1) if target[1] - size[1] >= slack else (0,):
            middle = np.array((a, b)) * (target - size) / 2
            grown = box.part(middle - target / 2, middle + target / 2)
            cells = scene.within(grown)
            added = cells[~box.holds(scene.xy[cells])]
            expected = (target.prod() - size.prod()) / scene.columns.cell_m**2
            outside = max(expected - len(added), 0.0)
            against = (outside + scene.floor_seen[added].sum()) / max(expected, 1.0)
            if against < best - 1e-9:
                best, found = against, grown
    return found
