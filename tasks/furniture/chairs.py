"""Candidates for chairs: a back with its seat, or a seat alone; rows that touch are split."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from pydantic import PositiveFloat, PositiveInt

from tasks.furniture.backs import Back, BackParams, find_backs, groups_of
from tasks.furniture.boxes import Box, fit_box
from tasks.furniture.candidates import BACK, SEAT, Candidate
from tasks.furniture.scene import Scene
from tasks.furniture.tops import Top
from tasks.furniture.windows import quantile
from tasks.params import Params

WALL_M = 0.1
"""Distance from the wall within which its points hide a panel, metres."""
TABLE_M = (0.62, 0.8)
"""Heights between which a level surface may be a table's, metres."""
LEVEL_M = 0.05
"""How far parts of one seat may differ in height, metres: noise and drift."""
EDGE_M, RISE_M = 0.08, 0.06
"""How far within a table's edge the back of a chair may seem to stand, metres, and how much higher
than the table it ends at least: what is lower is the table's own side panel. Assumption."""
NEAR_M = 1.0
"""How far from its back parts of a chair are looked for, along x and y, metres."""
BACK_HALF_M = 0.025
"""How far a chair reaches behind the middle of its back, metres. Assumption."""


class ChairParams(Params):
    """How chairs are put together. Assumptions unless a source is given."""

    seat_low_m: PositiveFloat = 0.36
    """Least height of a seat over the floor, metres: standard seats (0.40) less noise."""
    seat_high_m: PositiveFloat = 0.62
    """Greatest height of a seat, metres: office chairs raised (0.51) and low stools."""
    side_m: PositiveFloat = 0.48
    """Usual side of a chair, metres: catalogue chairs have a median of 0.53 m with armrests."""
    least_m: PositiveFloat = 0.40
    """Least side of a chair, metres: the 5 % quantile of catalogue chairs is 0.41 m."""
    deepest_m: PositiveFloat = 0.60
    """Greatest depth of a seat from its back, metres."""
    seat_area_m2: PositiveFloat = 0.035
    """Least area of a seat that has no back, square metres."""
    row: PositiveInt = 8
    """Most chairs that touch, in each direction. Assumption."""
    above_back_m: PositiveFloat = 0.39
    """Usual height of a back's edge over its seat, metres; used where no seat was seen."""


def find_chairs(
    scene: Scene, tables: list[Top], back_params: BackParams, params: ChairParams
) -> Iterator[Candidate]:
    """Yield the candidates for chairs in one room.

    Parameters
    ----------
    tables : list of Top
        Level patches at the height of tables: their side panels are no backs, and chairs face
        them.
    """
    free = scene.from_wall > WALL_M
    for table in tables:
        free[_own_panels(scene, table)] = False
    level = (scene.heights >= params.seat_low_m) & (scene.heights <= params.seat_high_m)
    seats = np.flatnonzero(level & (scene.from_wall[scene.where] > 0.02))
    seat_xy = scene.xy[scene.where[seats]]
    by_x = np.argsort(seat_xy[:, 0], kind="stable")
    sorted_x = seat_xy[by_x, 0]
    taken = np.zeros(len(scene.where), bool)
    for back in find_backs(scene.columns, scene.panels[free], scene.rows[free], back_params):
        # a hall holds many chairs: only the seats in a strip are looked at
        x = back.centre[0]
        strip = by_x[slice(*np.searchsorted(sorted_x, (x - NEAR_M, x + NEAR_M)))]
        near = np.sort(seats[strip[np.abs(seat_xy[strip, 1] - back.centre[1]) <= NEAR_M]])
        candidate = _with_seat(scene, back, near, params)
        taken[candidate.seen] = True
        taken[near[candidate.box.holds(scene.xy[scene.where[near]], 0.04)]] = True
        yield candidate
    yield from _alone(scene, seats[~taken[seats]], params)


def _own_panels(scene: Scene, table: Top) -> NDArray[np.int64]:
    """Return the columns whose panels are a table's own, or stand on it: no backs before it."""
    near = scene.within(table.box, 0.04)
    edge = np.array((table.box.length, table.box.depth)) / 2 - EDGE_M
    amid = (np.abs(table.box.local(scene.xy[near])) < edge).all(axis=1)
    with np.errstate(invalid="ignore"):
        low = scene.panels[near] <= table.height + RISE_M
    return near[amid | low]


def _with_seat(scene: Scene, back: Back, near: NDArray[np.int64], params: ChairParams) -> Candidate:
    """Return a chair from its back, towards the seat or else the table before it."""
    local = scene.xy[scene.where[near]] - back.centre
    along = local @ back.axis
    best: tuple[float, NDArray[np.float64], NDArray[np.int64]] | None = None
    for side in (1.0, -1.0):
        forward = side * np.array((-back.axis[1], back.axis[0]))
        out = local @ forward
        held = (np.abs(along) <= max(back.width, params.least_m) / 2 + 0.03) & (out > 0.03)
        held &= out <= params.deepest_m
        ahead = Box(back.centre + 0.27 * forward, back.axis, 0.44, 0.4)
        tables = len(scene.surfaces_in(ahead, *TABLE_M))
        outside = 0.44 * 0.4 / scene.columns.cell_m**2 - len(scene.within(ahead))
        score = float(held.sum()) + 0.3 * tables - max(outside, 0.0)
        if best is None or score > best[0]:
            best = score, forward, near[held]
    assert best is not None
    _, forward, seat = best
    return _chair(scene, back, forward, seat, params)


def _chair(
    scene: Scene,
    back: Back,
    forward: NDArray[np.float64],
    seat: NDArray[np.int64],
    params: ChairParams,
) -> Candidate:
    height = back.top - params.above_back_m
    low, high, depth = -back.width / 2, back.width / 2, 0.0
    cell = scene.columns.cell_m
    if len(seat):
        # the seat's own level: what else lies between the heights is thrown out
        levels = scene.heights[seat]
        near = np.abs(levels[:, None] - levels) <= LEVEL_M
        seat = seat[near[np.argmax(near.sum(axis=1))]]
        height = quantile(scene.heights[seat], 0.5)
        local = scene.xy[scene.where[seat]] - back.centre
        along, out = local @ back.axis, local @ forward
        if back.row == 1 and not back.whole and len(seat) > 5:
            low = min(low, quantile(along, 0.1) - cell / 2)
            high = max(high, quantile(along, 0.9) + cell / 2)
        depth = quantile(out, 0.95) + cell / 2
    missing = params.side_m - (high - low)
    if high - low < params.least_m:
        low, high = low - missing / 2, high + missing / 2
    depth = max(depth, min(high - low, 1.1 * params.side_m))
    size = high - low
    centre = back.centre + (low + high) / 2 * back.axis
    centre = centre + forward * (depth / 2 - BACK_HALF_M)
    box = Box(centre, back.axis, size, depth)
    return Candidate(box, seat, height, back.top, BACK, back.row, None, back.panel)


def _alone(scene: Scene, seats: NDArray[np.int64], params: ChairParams) -> Iterator[Candidate]:
    """Yield chairs from patches at the height of seats that no back has claimed."""
    if not len(seats):
        return
    cell = scene.columns.cell_m
    # one surface a column: the highest
    _, first = np.unique(scene.where[seats], return_index=True)
    seats = seats[first]
    cells = scene.columns.cells[scene.rows[scene.where[seats]]].astype(np.int64)
    group = groups_of(cells, 2)
    order = np.argsort(group, kind="stable")
    for part in np.split(order, np.flatnonzero(np.diff(group[order])) + 1):
        level = quantile(scene.heights[seats[part]], 0.5)
        part = part[np.abs(scene.heights[seats[part]] - level) <= LEVEL_M]
        if len(part) * cell**2 < params.seat_area_m2:
            continue
        xy = scene.xy[scene.where[seats[part]]]
        around = fit_box(xy, scene.directions, cell, 0.02)
        if around.depth < 0.12:
            continue
        yield from _split(scene, seats[part], around, float(level), params)


def _split(
    scene: Scene, seats: NDArray[np.int64], around: Box, level: float, params: ChairParams
) -> Iterator[Candidate]:
    xy = scene.xy[scene.where[seats]]
    counts = []
    for size in (around.length, around.depth):
        fitting = 1 if size < 1.45 * params.side_m else round(size / params.side_m)
        counts.append(min(fitting, params.row))
    for i in range(counts[0]):
        for j in range(counts[1]):
            unit = np.array((around.length / counts[0], around.depth / counts[1]))
            low = np.array((i, j)) * unit - np.array((around.length, around.depth)) / 2
            piece = around.part(low, low + unit)
            inside = piece.holds(xy)
            if inside.sum() * scene.columns.cell_m**2 < params.seat_area_m2 / 2:
                continue
            whole = _completed(scene, piece, level, params)
            yield Candidate(whole, seats[inside], level, level, SEAT, counts[0] * counts[1], piece)


def _completed(scene: Scene, piece: Box, level: float, params: ChairParams) -> Box:
    """Return a seat grown to a chair's size, to the sides on which least speaks against it."""
    size = np.array((piece.length, piece.depth))
    wanted = np.where(size < params.least_m, params.side_m, size)
    if (wanted == size).all():
        return piece
    best, found = np.inf, piece
    for a in (-1, 0, 1) if wanted[0] > size[0] else (0,):
        for b in (-1, 0, 1) if wanted[1] > size[1] else (0,):
            middle = np.array((a, b)) * (wanted - size) / 2
            grown = piece.part(middle - wanted / 2, middle + wanted / 2)
            cells = scene.within(grown)
            expected = wanted.prod() / scene.columns.cell_m**2
            against = max(expected - len(cells), 0.0) + 0.5 * scene.floor_seen[cells].sum()
            against -= 0.3 * len(scene.surfaces_in(grown, *TABLE_M))
            if against < best - 1e-9:
                best, found = against, grown
    return found
