"""What a storey's final plan is made from."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from shapely import Polygon

from grammars.model import Grammar
from storage.layout import Layout
from storage.walls import Walls
from tasks.layout.placement.decoded_rows import DecodedRow, main_rows
from tasks.layout.placement.known_walls import KnownWalls, known_walls
from tasks.layout.placement.params import PlacementParams
from tasks.layout.placement.validity import overlap_m2


@dataclass(frozen=True, eq=False)
class Storey:
    """The initial model, what was decoded along its lines, and how to place that."""

    initial: list[Polygon]
    """outlines of the initial rooms"""
    walls: Walls
    rows: list[DecodedRow]
    layout: Layout
    grammar: Grammar
    params: PlacementParams

    @cached_property
    def overlap_m2(self) -> NDArray[np.float64]:
        """By how much the initial rooms overlap, (n, n)."""
        return overlap_m2(self.initial)

    @cached_property
    def fits(self) -> bool:
        """Whether the grammar explains the storey well enough to say which rooms there are."""
        gain = sum(float(self.layout.gains[row.decoded[0]]) for row in self.rows)
        rooms = sum(len(row.decoded) for row in self.rows)
        return gain >= self.params.least_gain * rooms

    @cached_property
    def known(self) -> KnownWalls:
        """The walls that the grammar knows the place of, if it is of this building."""
        ids = [str(self.layout.line_ids[row.decoded[0]]) for row in self.rows]
        return known_walls(self.grammar, self.rows, ids)

    @cached_property
    def main_rows(self) -> NDArray[np.int64]:
        """The row that each initial room stands on longest, (n,), -1 for none."""
        return main_rows(self.rows, len(self.initial))

    def probable_walls(self, row: int) -> NDArray[np.bool_]:
        """Return which boundaries of a row are probably walls, the one before each room, (n,)."""
        found = self.layout.from_posteriors[self.rows[row].decoded]
        return self.fits & (found >= self.params.cut_posterior)

    def undivided(self, row: int) -> NDArray[np.bool_]:
        """Return which rooms of a row no wall seen within them divides, almost surely, (n,)."""
        found = self.layout.undivided[self.rows[row].decoded]
        return self.fits & (found >= self.params.join_posterior)

    def rule_depth_m(self, row: int, rooms: list[int]) -> tuple[float, float]:
        """Return the mean depth and spread by the rules of some rooms of a row, NaN for any."""
        parts = {(r.id, i): part for r in self.grammar.rules for i, part in enumerate(r.parts)}
        known = []
        for decoded in self.rows[row].decoded[rooms]:
            key = (str(self.layout.rules[decoded]), int(self.layout.parts[decoded]))
            part = parts.get(key)
            if part is not None and part.depth_m is not None and part.depth_spread_m is not None:
                known.append((part.depth_m, part.depth_spread_m))
        depth, spread = np.mean(known, axis=0) if known else (np.nan, np.nan)
        return float(depth), float(spread)
