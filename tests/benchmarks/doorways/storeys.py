"""A stored storey, its doors and windows found variant by variant: the stages' functions alone."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from correction.stored import Stored
from numpy.typing import NDArray

from doorways.variants import OURS, Variant
from flows.model import Made, initial_plan, with_openings
from storage import points, rooms, snapshots, walls
from storage.candidates import FEATURES, Candidates
from storage.openings import Openings
from storage.plan import Plan
from storage.plan_geojson import read_plan
from storage.wall_images import WallImages
from tasks.doors.candidates import CandidateParams, find_candidates
from tasks.doors.openings import told_openings
from tasks.doors.trace import TraceParams, trace_walls
from tasks.evaluation.detections import EvaluationParams
from tasks.evaluation.matching import most_overlapping, overlapping
from tasks.evaluation.openings import along_wall

TABLES: Mapping[str, str] = {
    "rooms": "rooms",
    "walls": "rooms",
    "points": "decoded",
    "snapshots": "clouds",
}
"""What the door stages take: tables, and the stage each is of."""
Tell = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""Probabilities of classes, (n, c), by some of the features, (n, k)."""


@dataclass(frozen=True, eq=False)
class Score:
    """What one variant found on one storey with one seed; entry i of an array is true door i."""

    storey: str
    seed: int
    variant: str
    states: NDArray[np.str_]
    hidden: NDArray[np.float64]
    """share of the door that no ray reached"""
    hit: NDArray[np.bool_]
    linked: NDArray[np.bool_]
    """found, and of all its rooms but those that were not found themselves"""
    linked_whole: NDArray[np.bool_]
    """found, and of all its rooms"""
    told: NDArray[np.bool_]
    """found, and its state is right"""
    doors: int
    """found"""
    windows: tuple[int, int, int]
    """true, found, and right"""


@dataclass
class Costs:
    """Processor seconds of the steps, all threads."""

    storey: str
    seed: int
    seconds: dict[str, float] = field(default_factory=dict)


class Doorways:
    """A storey as its initial model was stored, with its truth and what variants share."""

    def __init__(self, stored: Stored, campaigns: Path) -> None:
        self.stored = stored
        self.truth: Plan = read_plan(stored.scored.truth(campaigns))
        self.rooms = rooms.from_table(stored.one("rooms"))
        self.walls = walls.from_table(stored.one("walls"))
        self.points = [points.from_table(table) for table in stored.each("points")]
        self.snapshots = [snapshots.from_table(table) for table in stored.each("snapshots")]
        self.costs = Costs(stored.scored.name, stored.seed)
        self._candidates: dict[CandidateParams, Candidates] = {}

    @cached_property
    def images(self) -> WallImages:
        """The images of its walls."""
        return self._timed(
            "trace", trace_walls, self.rooms, self.walls, self.points, self.snapshots, TraceParams()
        )

    def warm_up(self) -> None:
        """Load what is compiled, by one wall piece: it is no part of what a step costs."""
        one = replace(
            self.walls, **{f.name: getattr(self.walls, f.name)[:1] for f in fields(self.walls)}
        )
        images = trace_walls(self.rooms, one, self.points[:1], self.snapshots[:1], TraceParams())
        find_candidates(images, OURS.candidates)

    def score(self, variant: Variant, tell: Tell, hidden: NDArray[np.float64]) -> Score:
        """Return how a variant does, given its classifier."""
        candidates = self.candidates(variant)
        known = [FEATURES.index(name) for name in variant.features]
        found = self._timed(f"tell {variant.name}", self._found, variant, tell, candidates, known)
        return self._score(variant.name, found, hidden)

    def candidates(self, variant: Variant) -> Candidates:
        """Return the candidates of a variant."""
        params = variant.candidates
        if params not in self._candidates:
            name = "candidates" if params == OURS.candidates else "other candidates"
            self._candidates[params] = self._timed(name, find_candidates, self.images, params)
        return self._candidates[params]

    def _found(
        self, variant: Variant, tell: Tell, candidates: Candidates, known: list[int]
    ) -> Openings:
        told = tell(candidates.features[:, known])
        return told_openings(
            told,
            candidates,
            self.images,
            self.walls,
            self.rooms,
            self.snapshots,
            variant.openings,
        )

    def _timed(self, name: str, function: Callable[..., Any], *arguments: Any) -> Any:
        start = process_time()
        made = function(*arguments)
        self.costs.seconds[name] = process_time() - start
        return made

    def _score(self, variant: str, openings: Openings, hidden: NDArray[np.float64]) -> Score:
        params, scored = EvaluationParams(), self.stored.scored
        scans = [str(i) for i in range(len(self.points))]
        made = Made(scored.building, scored.storey, scans, simulated=True)
        found = with_openings(initial_plan(self.rooms, self.walls, made), openings)
        (limit,) = params.opening_iou
        _, pairs = along_wall(found.doors, self.truth.doors, params.off_wall_m)
        doors = most_overlapping(pairs, limit)
        _, pairs = along_wall(found.windows, self.truth.windows, params.off_wall_m)
        windows = most_overlapping(pairs, limit)
        true_room = self._true_rooms(found, params.link_iou)
        true, n = self.truth.doors, len(self.truth.doors)
        hit, linked, linked_whole, told = (np.zeros(n, bool) for _ in range(4))
        for i, j in zip(doors.found, doors.true, strict=True):
            ours, theirs = found.doors[i], set(true[j].rooms)
            leads_to = {true_room.get(room, "") for room in ours.rooms}
            hit[j] = True
            linked_whole[j] = leads_to == theirs
            linked[j] = leads_to == theirs & set(true_room.values())
            told[j] = ours.state == true[j].state
        return Score(
            storey=scored.name,
            seed=self.stored.seed,
            variant=variant,
            states=np.array([door.state or "" for door in true]),
            hidden=hidden,
            hit=hit,
            linked=linked,
            linked_whole=linked_whole,
            told=told,
            doors=len(found.doors),
            windows=(len(self.truth.windows), len(found.windows), len(windows)),
        )

    def _true_rooms(self, found: Plan, limit: float) -> dict[str, str]:
        """Return the true room of each found one that is one."""
        polygons = [[room.polygon for room in plan.rooms] for plan in (found, self.truth)]
        pairs = most_overlapping(overlapping(*polygons), limit)
        return {
            found.rooms[i].id: self.truth.rooms[j].id
            for i, j in zip(pairs.found, pairs.true, strict=True)
        }
