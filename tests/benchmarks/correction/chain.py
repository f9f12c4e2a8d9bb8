"""Initial models corrected variant by variant: the stages' functions, without the flow about them.

What variants share is computed once, so an ablation costs a fraction of a run. Scores are those of
the evaluation flow's queries: rooms matched one to one at the greatest IoU in all, found at an IoU
over 0.5.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from correction.stored import Stored
from correction.storeys import OTHER, SAME, grammar_file
from correction.variants import HOSPITAL, NONE, ORACLE, WRONG, Variant, nested
from grammars.library import library
from grammars.model import Grammar
from grammars.reading import read_grammar
from storage.faces import Faces
from storage.layout import Layout
from storage.observations import Observations
from storage.plan import Plan
from storage.plan_geojson import read_plan
from storage.rooms import Rooms
from storage.segments import Segments
from storage.walls import Walls
from tasks.evaluation.disturbance import DisturbParams, disturb
from tasks.evaluation.rooms import ious, match
from tasks.layout.crowd.crowd import CrowdParams, fuse_scans
from tasks.layout.decoding.decode import DecodeParams, decode
from tasks.layout.extraction.branches import BranchParams
from tasks.layout.extraction.observations import ExtractParams, extract_observations
from tasks.layout.placement.oracle import true_layout, true_rules
from tasks.layout.placement.params import PlacementParams
from tasks.layout.placement.place import place_rooms

FOUND_IOU = 0.5
SAME_WALL_M = 0.3
"""A true wall along a line is the observed one no further off, metres."""


class Lines(NamedTuple):
    """What a grammar made of the reference lines behind which true rooms stand."""

    walls: int = 0
    """lines with the true walls, each within `SAME_WALL_M` of its true place, and no other"""
    classes: int = 0
    """of them those with the true rooms' classes in order"""
    count: int = 0


NO_LINES = Lines()


@dataclass(frozen=True, eq=False)
class Score:
    """How one variant did on one storey with one seed."""

    storey: str
    is_preset: bool
    seed: int
    variant: str
    true_m2: NDArray[np.float64]
    """(t,), areas of the true rooms"""
    error_m2: NDArray[np.float64]
    """(t,), |true - found|; NaN of a room that none was found for"""
    found: int
    """rooms found"""
    hits: int
    """of them the true ones"""
    classed: tuple[int, int]
    """hits whose class is right, hits"""
    lines: Lines = NO_LINES
    """along its reference lines; of none without a grammar"""


class Model:
    """An initial model with its truth and grammars, and what variants share."""

    def __init__(self, stored: Stored, campaigns: Path, grammars: Path) -> None:
        self.stored = stored
        self.given = stored.read()
        self.truth: Plan = read_plan(stored.scored.truth(campaigns))
        self.grammars = grammars
        self._observed: dict[tuple[str, str], Observations] = {}
        self._spoilt: dict[str, tuple[Rooms, Walls, Faces]] = {}
        self._read: dict[str, Grammar] = {}

    def score(self, variant: Variant) -> Score:
        """Return how a variant does."""
        settings = nested(variant.settings)
        rooms, walls, faces = self._initial(settings.get("disturb", {}))
        if variant.grammar == NONE:
            return self._score(variant.name, rooms.polygons, [""] * len(rooms))
        grammar = self.grammar(variant.grammar)
        observed = self._observations(variant.grammar, settings, rooms, faces)
        decoding = DecodeParams(**settings.get("decode", {}))
        layout = decode(observed, grammar, decoding)
        seen = fuse_scans(observed, layout, self._segments, grammar.partition_m, decoding.crowd)
        params = PlacementParams(**settings.get("place", {}))
        placed = place_rooms(rooms, walls, observed, layout, grammar, params, seen)
        lines = right_lines(layout, self._true_layout(observed, rooms))
        return self._score(variant.name, placed.rooms.polygons, placed.classes, lines)

    def oracle(self) -> Score:
        """Return how the true rooms do that are placed with their true widths and depths."""
        rooms, walls, _ = self._initial({})
        observed, layout = self.observed(SAME), self.true_lines(SAME)
        rules = true_rules(layout, observed, self.polygons)
        grammar = replace(self.grammar(SAME), rules=rules)
        seen = fuse_scans(observed, layout, self._segments, grammar.partition_m, CrowdParams())
        placed = place_rooms(rooms, walls, observed, layout, grammar, PlacementParams(), seen)
        lines = right_lines(layout, layout)
        return self._score(ORACLE, placed.rooms.polygons, placed.classes, lines)

    def observed(self, kind: str) -> Observations:
        """Return what a kind of grammar finds along the lines of the initial model as it is."""
        rooms, _, faces = self._initial({})
        return self._observations(kind, {}, rooms, faces)

    def true_lines(self, kind: str) -> Layout:
        """Return the true rooms along those lines."""
        return self._true_layout(self.observed(kind), self._initial({})[0])

    @cached_property
    def polygons(self) -> list[Polygon]:
        """The true rooms."""
        return [room.polygon for room in self.truth.rooms]

    @property
    def _segments(self) -> list[Segments]:
        return self.given[3]

    def _initial(self, spoilt: Mapping[str, Any]) -> tuple[Rooms, Walls, Faces]:
        key = repr(spoilt)
        if key not in self._spoilt:
            params = DisturbParams(seed=self.stored.seed, **spoilt)
            self._spoilt[key] = disturb(*self.given[:3], params)
        return self._spoilt[key]

    def grammar(self, kind: str) -> Grammar:
        """Return a storey's grammar of some kind."""
        if kind not in self._read:
            known = {SAME, OTHER}
            own = grammar_file(self.grammars, kind, self.stored.scored)
            self._read[kind] = read_grammar(own if kind in known else library()[_LIBRARY[kind]])
        return self._read[kind]

    def _observations(
        self, kind: str, settings: Mapping[str, Any], rooms: Rooms, faces: Faces
    ) -> Observations:
        extract = settings.get("extract", {})
        key = kind, repr((settings.get("disturb", {}), extract))
        if key not in self._observed:
            self._observed[key] = extract_observations(
                rooms, faces, self._segments, self.grammar(kind), ExtractParams(**extract)
            )
        return self._observed[key]

    def _true_layout(self, observed: Observations, rooms: Rooms) -> Layout:
        classes = [room.class_ or "" for room in self.truth.rooms]
        return true_layout(
            observed, rooms, self.polygons, classes, BranchParams().outer_m, SAME_WALL_M
        )

    def _score(
        self,
        variant: str,
        polygons: NDArray[np.object_],
        classes: Sequence[str] | NDArray[np.str_],
        lines: Lines = NO_LINES,
    ) -> Score:
        overlap = ious(list(polygons), self.polygons)
        partner = match(overlap)
        true_m2 = shapely.area(np.array(self.polygons, object))
        found_m2 = np.append(shapely.area(np.array(list(polygons), object)), np.nan)[partner]
        # as in the flow's detections: at a threshold, only pairs over it compete
        over = match(np.where(overlap > FOUND_IOU, overlap, 0.0))
        hits = np.flatnonzero(over >= 0)
        right = sum(str(classes[over[i]]) == (self.truth.rooms[i].class_ or "") for i in hits)
        return Score(
            storey=self.stored.scored.name,
            is_preset=self.stored.scored.is_preset,
            seed=self.stored.seed,
            variant=variant,
            true_m2=true_m2,
            error_m2=np.abs(true_m2 - found_m2),
            found=len(polygons),
            hits=len(hits),
            classed=(right, len(hits)),
            lines=lines,
        )


_LIBRARY = {WRONG: HOSPITAL}


def right_lines(layout: Layout, true: Layout) -> Lines:
    """Return on how many lines the best sequence is the true one: a room more or less is wrong."""
    walls = classes = 0
    names = dict.fromkeys(true.line_ids.tolist())
    for name in names:
        found, known = _best(layout, name), _best(true, name)
        if len(found) == len(known):
            off = np.abs(layout.to_m[found] - true.to_m[known])
            same = bool((off <= SAME_WALL_M).all())
            walls += same
            classes += same and bool((layout.classes[found] == true.classes[known]).all())
    return Lines(walls, classes, len(names))


def _best(layout: Layout, line: str) -> NDArray[np.int64]:
    """Return the rows of a line's best sequence, in its order."""
    rows = np.flatnonzero((layout.line_ids == line) & (layout.hypotheses == 0))
    return rows[np.argsort(layout.orders[rows])]
