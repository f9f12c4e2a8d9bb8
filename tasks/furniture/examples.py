"""Examples to learn from: segments named by a true plan, and real sizes in their surroundings."""

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field, NonNegativeInt

from storage.furniture import CLASSES
from storage.furniture_segments import FurnitureSegments
from storage.plan import Plan
from tasks.forest import Examples
from tasks.furniture.candidates import SEAT, TOP
from tasks.furniture.dimensions import SEAT_M, draw_m
from tasks.furniture.features import FEATURES
from tasks.params import Params

NOTHING = "nothing"
"""What is no piece of furniture: sills, noise along walls, parts of what was found better."""
CLASS_NAMES = (*CLASSES, NOTHING)
SIZES = "tasks/furniture/dimensions.py"
"""Where the examples of real sizes come from, as the others' storeys."""
SAME, APART = 0.3, 0.15
"""IoU of a segment and a true piece over which it shows that piece, and under which it shows
none; between them it teaches nothing. Assumption."""
LEVEL_M = 0.08
"""How far a level segment may lie off the top of the piece it shows, metres."""


class RealSizeParams(Params):
    """How many examples are made of the table of real sizes."""

    each: NonNegativeInt = 300
    """Examples of each kind of furniture. Assumption: about as many as simulated storeys give."""
    seed: int = Field(default=0, ge=0, lt=2**32)
    """Seed of the sizes drawn."""


def examples_of(segments: FurnitureSegments, truth: Plan) -> Examples:
    """Return the segments a true plan names, of the classes of CLASS_NAMES.

    A segment is the true piece that it overlaps most, if their heights agree: a table and most
    else by its top, a chair by any surface under its back's edge.
    """
    names = np.array([piece.class_ or "" for piece in truth.furniture])
    shapes = np.array([piece.footprint for piece in truth.furniture], object)
    tops = np.array([np.nan if p.top_m is None else p.top_m for p in truth.furniture], float)
    labels = np.full(len(segments), CLASS_NAMES.index(NOTHING))
    kept = np.ones(len(segments), bool)
    found_by = segments.features[:, FEATURES.index("found_by")]
    tree = shapely.STRtree(shapes)
    for i, footprint in enumerate(segments.footprints):
        near = tree.query(footprint, predicate="intersects")
        near = near[_agree(segments, i, found_by[i], names[near], tops[near])]
        if not len(near):
            continue
        shared = shapely.area(shapely.intersection(shapes[near], footprint))
        overlaps = shared / (shapely.area(shapes[near]) + footprint.area - shared)
        best = int(np.argmax(overlaps))
        if overlaps[best] >= SAME and names[near[best]] in CLASSES:
            labels[i] = CLASSES.index(names[near[best]])
        else:
            kept[i] = overlaps[best] < APART
    group = np.full(len(segments), f"{truth.building}/{truth.storey}")
    return Examples(segments.features, labels.astype(np.int64), group)[kept]


def _agree(
    segments: FurnitureSegments,
    i: int,
    found_by: float,
    names: NDArray[np.str_],
    tops: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Return which pieces may be seen at the height of a segment."""
    level = np.abs(tops - segments.surface_m[i]) <= LEVEL_M
    seat = (segments.surface_m[i] < tops + LEVEL_M) & (found_by != TOP)
    return np.isnan(tops) | np.where(names == "chair", seat | level, level)


def real_sizes(simulated: Examples, params: RealSizeParams) -> Examples:
    """Return examples with the sizes of real furniture, seen as simulated pieces were.

    Each takes a simulated example of its class, with its cues, and the size of a real piece: what
    was seen of the simulated one, as a share of its box, is seen of the real one.

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
    return Examples(features, labels, np.full(len(labels), SIZES))


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
