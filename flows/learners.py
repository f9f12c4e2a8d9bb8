"""What each classifier learns from a mapped storey, and how its forest is grown."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from flows import stages
from flows.forests import Kind
from flows.params import MapSenseParams
from flows.training_storeys import MappedStorey
from storage.artifacts import read
from storage.candidates import CANDIDATES
from storage.candidates import FEATURES as OPENING_FEATURES
from storage.furniture_segments import FURNITURE_SEGMENTS
from storage.wall_images import WALL_IMAGES
from tasks.doors.examples import CLASSES as OPENING_CLASSES
from tasks.doors.examples import ExampleParams, examples
from tasks.forest import Examples, ForestParams
from tasks.furniture.examples import CLASS_NAMES as FURNITURE_CLASSES
from tasks.furniture.examples import RealSizeParams, examples_of, real_sizes
from tasks.furniture.features import FEATURES as FURNITURE_FEATURES
from tasks.held_out import nothing_more


@dataclass(frozen=True)
class Learner:
    """What a classifier tells apart, by what, and where its examples come from."""

    features: tuple[str, ...]
    classes: tuple[str, ...]
    forest: ForestParams
    examples: Callable[[MappedStorey, MapSenseParams], Examples]
    """of a storey, from what its mapping made; runs the component's stages up to candidates"""
    more: Callable[[Examples], Examples]
    """what is made of them besides"""


def _openings(storey: MappedStorey, params: MapSenseParams) -> Examples:
    place, store = storey.request.place(), storey.request.store
    images = stages.wall_images(
        place,
        storey.whole("rooms"),
        storey.whole("walls"),
        storey.of_scans("points"),
        storey.of_scans("snapshots"),
        params.trace,
    )
    candidates = stages.opening_candidates(place, images, params.candidates)
    found = read(CANDIDATES, candidates, store)
    return examples(found, read(WALL_IMAGES, images, store), storey.truth, ExampleParams())


def _furniture(storey: MappedStorey, params: MapSenseParams) -> Examples:
    place, store = storey.request.place(), storey.request.store
    points = storey.of_scans("points")
    segments = stages.furniture_segments(
        place, storey.whole("rooms"), points, params.furniture_segments
    )
    return examples_of(read(FURNITURE_SEGMENTS, segments, store), storey.truth)


def _real_sizes(simulated: Examples) -> Examples:
    return real_sizes(simulated, RealSizeParams())


OPENINGS_FOREST = ForestParams(trees=60, leaf=1, share=0.25, class_weights="equal")
"""Most of a hundred thousand candidates are nothing: as if there were as many of each class, what
is rare would be said too often. So, on training storeys held back, 0.87 to 0.90 of the doors found
are doors instead of 0.80 to 0.84, and 0.02 fewer are found."""
LEARNERS: Mapping[Kind, Learner] = {
    "doors": Learner(OPENING_FEATURES, OPENING_CLASSES, OPENINGS_FOREST, _openings, nothing_more),
    "furniture": Learner(
        FURNITURE_FEATURES, FURNITURE_CLASSES, ForestParams(trees=8), _furniture, _real_sizes
    ),
}
