"""What stands in the final plan's walls and rooms: doors, windows, furniture (Sec. 5, 6)."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from flows import stages
from flows.ended import made_by
from flows.forests import Kind, forest_source, shipped
from flows.params import MapSenseParams
from grammars.workplaces.rules import FILE as WORKPLACES
from storage.artifacts import Place, Ref
from storage.errors import InputError
from storage.layout_rooms import LAYOUT_ROOMS
from storage.sources import file_source


@dataclass(frozen=True)
class Objects:
    """What was found in a plan."""

    made: tuple[Ref, ...] = ()
    """of doors and windows: wall images, candidates and openings; of furniture: segments and
    furniture; none of what could not be looked for"""
    problems: tuple[str, ...] = ()
    """why something could not be looked for"""


def find_objects(
    place: Place,
    params: MapSenseParams,
    plan: Sequence[Ref],
    points: Sequence[Ref],
    snapshots: Sequence[Ref],
) -> Objects:
    """Look for doors, windows and furniture in a plan; what fails leaves the rest.

    Parameters
    ----------
    plan : its rooms and walls, as intersected or as a grammar has corrected them
    points, snapshots : of every scan, in the storey's order
    """
    corrected = any(ref.table == LAYOUT_ROOMS.table for ref in plan)
    found: list[Ref] = []
    problems, asked = [], {}
    for kind in params.detect:
        try:
            asked[kind] = LOOKED_FOR[kind](place, params, plan, points, snapshots, corrected)
        except InputError as error:  # a forest that is no forest
            problems.append(f"{kind} not looked for: {error}")
    for kind, futures in asked.items():
        made, why = made_by(futures)
        found += made
        problems += [f"{kind} not looked for: {why}"] if why else []
    return Objects(tuple(found), tuple(problems))


def _doors(
    place: Place,
    params: MapSenseParams,
    plan: Sequence[Ref],
    points: Sequence[Ref],
    snapshots: Sequence[Ref],
    corrected: bool,
) -> list[Any]:
    """Trace rays to the walls, find rectangles in the images, classify and merge them."""
    trace = stages.layout_wall_images if corrected else stages.wall_images
    find = stages.layout_openings if corrected else stages.openings
    images = trace.submit(place, plan, plan, points, snapshots, params.trace)
    forest = forest_source(shipped("doors"))
    candidates = stages.opening_candidates.submit(place, images, params.candidates)
    found = find.submit(place, candidates, images, plan, plan, snapshots, forest, params.openings)
    return [images, candidates, found]


def _furniture(
    place: Place,
    params: MapSenseParams,
    plan: Sequence[Ref],
    points: Sequence[Ref],
    snapshots: Sequence[Ref],
    corrected: bool,
) -> list[Any]:
    """Find level segments, and classify them."""
    find = stages.layout_furniture_segments if corrected else stages.furniture_segments
    classify = stages.layout_furniture if corrected else stages.furniture
    segments = find.submit(place, plan, points, params.furniture_segments)
    forest, rules = forest_source(shipped("furniture")), file_source(WORKPLACES, "workplaces")
    found = classify.submit(place, segments, plan, forest, rules, params.furniture)
    return [segments, found]


LOOKED_FOR: Mapping[Kind, Callable[..., list[Any]]] = {"doors": _doors, "furniture": _furniture}
"""What submits the stages of each kind of thing."""
