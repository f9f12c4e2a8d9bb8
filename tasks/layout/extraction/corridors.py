"""Corridors among the rooms of an initial model, and the straight runs of their walls.

An initial model knows no classes. A corridor shows in its form and its place: it is narrow for its
length, and many rooms lie about it.
"""

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import PositiveFloat, PositiveInt
from shapely import Polygon

from tasks.layout.extraction.fronts import CONTACT_M, fronts_on
from tasks.layout.extraction.fusion import weighted_median
from tasks.layout.extraction.model import LineFrame, Model
from tasks.layout.placement.outline import edges_of
from tasks.params import Params


class CorridorParams(Params):
    """What is taken for a corridor, and for one straight run of its walls. None is in the paper."""

    width_max_m: PositiveFloat = 4.0
    """Greatest mean width of a corridor, metres. Assumption."""
    slenderness_min: PositiveFloat = 3.0
    """Least length of a corridor in widths. Assumption."""
    rooms_min: PositiveInt = 4
    """Least number of rooms along the straight runs of a corridor's walls: a room around another
    is narrow for its length too, but few turn to it. Assumption."""
    run_min_m: PositiveFloat = 3.0
    """Shortest run that rooms are looked for along, metres: more than a corridor's end is wide,
    less than the shortest published one of 4.77. Assumption."""
    jog_m: PositiveFloat = 0.3
    """Pieces of wall off each other's line by less are one run, metres. Assumption."""
    turn_rad: PositiveFloat = 0.05
    """Pieces turned against each other by less are one run, radians. Assumption."""
    recess_m: PositiveFloat = 8.0
    """A gap in a run no deeper than this is a room whose wall was missed; a deeper one is another
    corridor, and ends the run, metres. Assumption."""
    corner_m: PositiveFloat = 1.0
    """Two runs whose ends are nearer meet in a corner, metres. Assumption."""


OBLIQUE = np.radians(15)
"""Runs that turn by less do not fix a corner."""
BESIDE = 0.5
"""A run is bridged where the corridor goes on this far beside it, metres."""


def mean_width(polygon: Polygon) -> float:
    """Return the width of the strip of a room's area and perimeter; the square's side if stouter.

    A strip of width w and length l has w l and 2 (w + l), a closed ring w l and 2 l.
    """
    area, half = polygon.area, polygon.length / 2
    if polygon.interiors:
        return float(area / half)
    return float(half / 2 - np.sqrt(max(half**2 / 4 - area, 0.0)))


def find_corridors(model: Model, params: CorridorParams) -> NDArray[np.int64]:
    """Return the rooms that are corridors, in their order.

    The one that serves most rooms comes first: rooms are served by others, not corridors.
    """
    like_one = []
    for i, polygon in enumerate(model.rooms.polygons):
        width = mean_width(polygon)
        if width <= params.width_max_m and polygon.area / width >= params.slenderness_min * width:
            like_one.append((i, _served(i, model, params)))
    found: set[int] = set()
    for i, served in sorted(like_one, key=lambda item: -len(item[1])):
        if len(served - found) >= params.rooms_min:
            found.add(i)
    return np.array(sorted(found), np.int64)


def _served(room: int, model: Model, params: CorridorParams) -> set[int]:
    """Return the rooms that stand along the runs of a room's walls."""
    itself = np.array([room])
    rooms: set[int] = set()
    for run in straight_runs(model.rooms.polygons[itself], params):
        fronts = fronts_on(LineFrame.between(*run), itself, model)
        rooms |= set(fronts.rooms[fronts.contacts >= CONTACT_M].tolist())
    return rooms


def straight_runs(polygons: NDArray[np.object_], params: CorridorParams) -> NDArray[np.float64]:
    """Return the straight runs (l, 2, 2) of the corridors' walls, rooms behind them to the left.

    Pieces of wall in one line are one run: over what doors and jogs leave of it, over a room that
    lies open to the corridor, not over another corridor. Runs come in the order of their longest
    pieces among the corridors' edges; where two meet they end in the corner.
    """
    edges = edges_of(list(polygons)).ends[:, ::-1]  # a corridor's inside is left of its own edges
    lengths = np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1)
    edges, lengths = edges[lengths > 0], lengths[lengths > 0]
    space = shapely.union_all(polygons) if len(polygons) else Polygon()
    free = np.ones(len(edges), bool)
    found: list[tuple[int, NDArray[np.float64]]] = []
    for seed in np.argsort(-lengths, kind="stable"):
        if free[seed]:
            members = _in_line(int(seed), edges, free, space, params)
            free[members] = False
            if lengths[members].sum() >= params.run_min_m:
                found.append((int(seed), _fit(edges[members], lengths[members])))
    found.sort(key=lambda run: run[0])
    runs = np.array([run for _, run in found]).reshape(-1, 2, 2)
    return _to_corners(runs, params.corner_m)


def _in_line(
    seed: int,
    edges: NDArray[np.float64],
    free: NDArray[np.bool_],
    space: shapely.Geometry,
    params: CorridorParams,
) -> NDArray[np.int64]:
    """Return the edges of the seed's run."""
    frame = LineFrame.between(*edges[seed])
    local = frame.local(edges)
    steps = local[:, 1] - local[:, 0]
    turned = np.abs(np.arctan2(steps[:, 1], steps[:, 0]))
    near = np.abs(local[..., 1]).max(axis=1) <= params.jog_m
    fits = np.flatnonzero(free & near & (turned <= params.turn_rad))
    fits = fits[np.argsort(local[fits, 0, 0], kind="stable")]
    at = int(np.flatnonzero(fits == seed)[0])
    first, last = at, at
    while last + 1 < len(fits) and _bridged(
        local[fits[first : last + 1], 1, 0].max(), local[fits[last + 1], 0, 0], frame, space, params
    ):
        last += 1
    while first > 0 and _bridged(
        local[fits[:first], 1, 0].max(), local[fits[first], 0, 0], frame, space, params
    ):
        first -= 1
    return fits[first : last + 1]


def _bridged(
    a: float, b: float, frame: LineFrame, space: shapely.Geometry, params: CorridorParams
) -> bool:
    """Return whether a run goes on from a to b, metres along the seed's line."""
    if b - a <= params.corner_m:
        return True
    if b - a > 2 * params.recess_m:
        return False
    reach = np.array([((a + b) / 2, -params.jog_m), ((a + b) / 2, params.recess_m)])
    line = shapely.linestrings(frame.building(reach))
    return not shapely.buffer(space, 1e-6).covers(line) and _beside(a, b, frame, space)


def _beside(a: float, b: float, frame: LineFrame, space: shapely.Geometry) -> bool:
    """Return whether the corridor runs along the whole gap, on the right of it."""
    path = np.array([(a, -BESIDE), (b, -BESIDE)])
    return bool(shapely.buffer(space, 1e-6).covers(shapely.linestrings(frame.building(path))))


def _fit(edges: NDArray[np.float64], lengths: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the line (2, 2) that most metres of some edges lie on, as long as all of them."""
    mean = (edges[:, 1] - edges[:, 0]).sum(axis=0)
    frame = LineFrame(edges[0, 0], mean / np.linalg.norm(mean), 0.0)
    local = frame.local(edges)
    offset = weighted_median(local[..., 1].mean(axis=1), lengths)
    ends = np.array([(local[:, 0, 0].min(), offset), (local[:, 1, 0].max(), offset)])
    return frame.building(ends)


def _to_corners(runs: NDArray[np.float64], corner: float) -> NDArray[np.float64]:
    """Return runs drawn out or cut back to where they meet the next one."""
    met = runs.copy()
    for i, run in enumerate(runs):
        near = np.linalg.norm(runs[:, 0] - run[1], axis=1)
        for j in np.flatnonzero(near <= corner):
            a, b = run[1] - run[0], runs[j, 1] - runs[j, 0]
            cross = a[0] * b[1] - a[1] * b[0]
            if abs(cross) > np.sin(OBLIQUE) * np.linalg.norm(a) * np.linalg.norm(b):
                off = runs[j, 0] - run[0]
                at = run[0] + (off[0] * b[1] - off[1] * b[0]) / cross * a
                if np.linalg.norm(at - run[1]) <= 2 * corner:
                    met[i, 1] = met[j, 0] = at
    return met
