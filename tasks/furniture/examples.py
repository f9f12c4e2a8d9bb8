"""Examples to learn from: segments named by a true plan, and real sizes in their surroundings."""

from functools import cache

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field, NonNegativeInt

from storage.furniture import CLASSES
from storage.furniture_segments import FurnitureSegments
from storage.plan import Plan
from tasks.forest import Examples, joined
from tasks.furniture.candidates import SEAT, SOFA, TOP
from tasks.furniture.dimensions import SEAT_M, draw_m
from tasks.furniture.features import FEATURES
from tasks.furniture.homes import BUILDING, HomeParams, homes
from tasks.furniture.segments import FurnitureSegmentParams, find_furniture_segments
from tasks.params import Params

NOTHING = "nothing"
"""What is no piece of furniture: sills, noise along walls, parts of what was found better."""
CLASS_NAMES = (*CLASSES, NOTHING)
SIZES = "tasks/furniture/dimensions.py"
"""Where the examples of real sizes come from, as the others' storeys."""
SAME, APART = 0.3, 0.15
"""IoU of a segment and a true piece over which it shows that piece, and under which it shows
none; between them it teaches nothing. Assumption."""
WORSE = 0.6
"""Share of the best segment's IoU under which another of the same piece shows nothing: a table cut
in two where it is one must not teach that halves are tables. Assumption; of 0.6 to 0.8 the one with
which most is found on training and tuning storeys."""
LEVEL_M = 0.08
"""How far a level segment may lie off the top of the piece it shows, metres."""
SOFA_M = 0.15
"""How far the edge seen of a sofa's back or arms may lie off its top, metres."""


class RealSizeParams(Params):
    """What is learnt of real sizes besides the simulated storeys."""

    each: NonNegativeInt = 300
    """Examples of each kind of furniture. Assumption: about as many as simulated storeys give."""
    seed: int = Field(default=0, ge=0, lt=2**32)
    """Seed of the sizes drawn."""
    homes: HomeParams = HomeParams()
    """Rooms of flats."""


def examples_of(segments: FurnitureSegments, truth: Plan) -> Examples:
    """Return the segments a true plan names, of the classes of CLASS_NAMES.

    A segment is the true piece that it overlaps most, if their heights agree: a table and most
    else by its top, a chair by any surface under its back's edge. Of several segments of one piece
    those count that are nearly as good as the best.
    """
    names = np.array([piece.class_ or "" for piece in truth.furniture])
    found, overlaps = _shown(segments, truth, names)
    best = np.zeros(len(names))
    np.maximum.at(best, found[found >= 0], overlaps[found >= 0])
    labels = np.full(len(segments), CLASS_NAMES.index(NOTHING))
    kept = np.ones(len(segments), bool)
    for i in np.flatnonzero(found >= 0):
        name = names[found[i]]
        if overlaps[i] < SAME or name not in CLASSES:
            kept[i] = overlaps[i] < APART
        elif overlaps[i] >= WORSE * best[found[i]]:
            labels[i] = CLASSES.index(name)
    group = np.full(len(segments), f"{truth.building}/{truth.storey}")
    return Examples(segments.features, labels.astype(np.int64), group)[kept]


def _shown(
    segments: FurnitureSegments, truth: Plan, names: NDArray[np.str_]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the true piece that each segment overlaps most, -1 for none, and their IoU."""
    shapes = np.array([piece.footprint for piece in truth.furniture], object)
    tops = np.array([np.nan if p.top_m is None else p.top_m for p in truth.furniture], float)
    found_by = segments.features[:, FEATURES.index("found_by")]
    tree = shapely.STRtree(shapes)
    found, best = np.full(len(segments), -1), np.zeros(len(segments))
    for i, footprint in enumerate(segments.footprints):
        near = tree.query(footprint, predicate="intersects")
        near = near[_agree(segments, i, found_by[i], names[near], tops[near])]
        if not len(near):
            continue
        shared = shapely.area(shapely.intersection(shapes[near], footprint))
        overlaps = shared / (shapely.area(shapes[near]) + footprint.area - shared)
        most = int(np.argmax(overlaps))
        found[i], best[i] = near[most], overlaps[most]
    return found, best


def _agree(
    segments: FurnitureSegments,
    i: int,
    found_by: float,
    names: NDArray[np.str_],
    tops: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Return which pieces may be seen at the height of a segment."""
    if found_by == SOFA:
        same: NDArray[np.bool_] = np.abs(tops - segments.top_m[i]) <= SOFA_M
        return same & (names == "other")
    level = np.abs(tops - segments.surface_m[i]) <= LEVEL_M
    seat = (segments.surface_m[i] < tops + LEVEL_M) & (found_by != TOP)
    return np.isnan(tops) | np.where(names == "chair", seat | level, level)


def real_sizes(simulated: Examples, params: RealSizeParams) -> Examples:
    """Return examples with the sizes of real furniture, and rooms of flats.

    Each of the first takes a simulated example of its class, with its cues, and the size of a
    real piece: what was seen of the simulated one, as a share of its box, is seen of the real one.

    Parameters
    ----------
    simulated : Examples
        As from `examples_of`.
    """
    rng = np.random.default_rng(params.seed)
    parts = []
    for kind, class_ in KINDS.items():
        rows = _models(simulated, class_)
        if len(rows) and params.each:
            models = simulated.features[rng.choice(rows, params.each)]
            parts.append(_resized(models, kind, rng))
    features = np.concatenate([np.empty((0, len(FEATURES))), *parts])
    made = [CLASSES.index(c) for c in KINDS.values() if len(_models(simulated, c)) and params.each]
    labels = np.repeat(np.array(made, np.int64), params.each)
    resized = Examples(features, labels, np.full(len(labels), SIZES))
    return joined([resized, home_examples(params.homes)])


@cache
def home_examples(params: HomeParams) -> Examples:
    """Return what is learnt of rooms of flats, found as with the default parameters."""
    found = [
        examples_of(find_furniture_segments(rooms, points, FurnitureSegmentParams()), truth)
        for rooms, points, truth in homes(params)
    ]
    none = Examples(np.empty((0, len(FEATURES))), np.empty(0, np.int64), np.empty(0, "U1"))
    every = joined([none, *found])
    return Examples(every.features, every.labels, np.full(len(every), BUILDING))


KINDS = {"chair": "chair", "table": "table", "desk": "table", "cabinet": "other", "shelf": "other"}
"""Kinds of the table of sizes, and the class of each."""


def _models(simulated: Examples, class_: str) -> NDArray[np.int64]:
    """Return the examples whose surroundings a class's real sizes are put into."""
    found_by = simulated.features[:, FEATURES.index("found_by")]
    level = np.isfinite(simulated.features[:, FEATURES.index("area_m2")])
    ours = (simulated.labels == CLASSES.index(class_)) & level
    return np.flatnonzero(ours & ((found_by != TOP) if class_ == "chair" else (found_by != SEAT)))


def _resized(
    models: NDArray[np.float64], kind: str, rng: np.random.Generator
) -> NDArray[np.float64]:
    made, n = models.copy(), len(models)

    def column(name: str) -> int:
        return FEATURES.index(name)

    total = draw_m(kind, "top", rng, n)
    distance = rng.uniform(*SEAT_M, n) if kind == "chair" else total
    sizes = np.stack((draw_m(kind, "width", rng, n), draw_m(kind, "depth", rng, n)))
    width, depth = sizes.max(axis=0), sizes.min(axis=0)
    old_width, old_depth = models[:, column("box_width_m")], models[:, column("box_depth_m")]
    seen_width = width * models[:, column("width_m")] / old_width
    seen_depth = depth * models[:, column("depth_m")] / old_depth
    made[:, column("width_m")] = np.maximum(seen_width, seen_depth)
    made[:, column("depth_m")] = np.minimum(seen_width, seen_depth)
    made[:, column("aspect")] = made[:, column("width_m")] / np.maximum(
        made[:, column("depth_m")], 0.04
    )
    made[:, column("box_width_m")], made[:, column("box_depth_m")] = width, depth
    made[:, column("area_m2")] *= width * depth / (old_width * old_depth)
    seen_top = models[:, column("top_m")] > models[:, column("distance_m")] + 0.1
    made[:, column("distance_m")] = distance
    made[:, column("top_m")] = np.where(seen_top, total, distance)
    rise = column("back_rise_m")
    made[:, rise] = np.where(models[:, rise] > 0, total - distance, models[:, rise])
    return made
