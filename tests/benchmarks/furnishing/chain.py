"""Furniture found and named variant by variant: the stages' functions, without the flow about them.

What variants share is computed once: segments by their parameters, forests by what they learn.
"""

import time
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor
from functools import partial

import numpy as np

from furnishing.scores import Score, counted
from furnishing.seen import is_seen, seen_shares, standing
from furnishing.stored import Surroundings
from furnishing.variants import Variant
from grammars.workplaces.rules import FILE, read_workplaces
from storage.forest import Forest
from storage.furniture_segments import FurnitureSegments
from tasks.forest import Examples, fit, joined
from tasks.furniture.classification import named
from tasks.furniture.examples import CLASS_NAMES, examples_of, real_sizes
from tasks.furniture.features import FEATURES
from tasks.furniture.segments import FurnitureSegmentParams, find_furniture_segments


def forests(
    storeys: Sequence[Surroundings], variants: Iterable[Variant], pool: Executor
) -> dict[str, Forest]:
    """Return the forest of each variant, learnt from the training storeys."""
    variants = list(variants)
    each = list({variant.segments for variant in variants})
    learnt = list(pool.map(partial(examples_from, each=each), storeys))
    return {variant.name: _grown(variant, [some[each.index(variant.segments)] for some in learnt])
            for variant in variants}  # fmt: skip


def examples_from(storey: Surroundings, each: Sequence[FurnitureSegmentParams]) -> list[Examples]:
    """Return what is learnt of a storey, for each way to find segments."""
    rooms, clouds, truth = storey.read()
    return [examples_of(find_furniture_segments(rooms, clouds, params), truth) for params in each]


def _grown(variant: Variant, each: Sequence[Examples]) -> Forest:
    examples = joined(each)
    if variant.real_sizes is not None:
        examples = joined([examples, real_sizes(examples, variant.real_sizes)])
    examples.features[:, _columns(variant)] = np.nan
    return fit(examples, FEATURES, CLASS_NAMES, variant.forest)


def score_all(
    storey: Surroundings, variants: Sequence[Variant], known: Mapping[str, Forest]
) -> list[Score]:
    """Return the scores of all variants on one storey and seed."""
    rooms, clouds, truth = storey.read()
    rules = read_workplaces(FILE)
    shares = seen_shares(truth, clouds)
    seen, stands = is_seen(shares), standing(truth, shares)
    made: dict[FurnitureSegmentParams, tuple[FurnitureSegments, float]] = {}
    scores = []
    for variant in variants:
        if variant.segments not in made:
            # what numba compiles is no cost of a storey
            find_furniture_segments(rooms, clouds[:1], variant.segments)
            start = time.thread_time()
            found = find_furniture_segments(rooms, clouds, variant.segments)
            made[variant.segments] = found, time.thread_time() - start
        segments, cost = made[variant.segments]
        told = segments.features.copy()
        told[:, _columns(variant)] = np.nan
        blind = FurnitureSegments(
            segments.names, told, segments.footprints, segments.hulls, segments.surface_m,
            segments.top_m, segments.base_m, segments.rooms,
        )  # fmt: skip
        start = time.thread_time()
        furniture = named(blind, rooms, known[variant.name], rules, variant.furniture)
        cost += time.thread_time() - start
        counts = counted(furniture, truth, seen, stands)
        scores.append(
            Score(storey.name, storey.seed, variant.name, counts, cost, storey.planes_cpu_s)
        )
    return scores


def _columns(variant: Variant) -> list[int]:
    return [FEATURES.index(name) for name in variant.without]
