"""A formal indoor grammar: rules that cut a space into rooms along a reference line (Sec. 4.2.1).

`G = (v_n, v_t, s, r_i)`: the non-terminal and axiom is `Space`; the terminals are classes of rooms;
a rule `Space -> r Space` cuts off one room, `Space -> r3 r2 r3 Space` a room unit (Table 1).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Part:
    """A room of a rule. Widths run along the reference line, between centre lines of side walls."""

    class_: str
    width_m: float
    spread_m: float
    """standard deviation of the width, metres; positive"""
    depth_m: float | None = None
    """from the reference line to the opposite wall's face, metres; None: any"""
    depth_spread_m: float | None = None
    """standard deviation of the depth; None as the depth is"""


@dataclass(frozen=True)
class Rule:
    """`Space -> part part ... Space`: a room, or a unit of rooms that come together."""

    id: str
    parts: tuple[Part, ...]
    p_apriori: float
    """relative frequency of the rule among all rules applied, P_a"""
    type: str = ""
    """what people call it, as 'two executives with assistant'"""
    note: str = ""
    """where its figures come from, where that is not `Grammar.about`"""

    @property
    def width_m(self) -> float:
        """Return the width of all its rooms."""
        return sum(part.width_m for part in self.parts)


Point = tuple[float, float]
"""x and y, building frame, metres"""


@dataclass(frozen=True, eq=False)
class ReferenceLine:
    """A line that rooms stand along, to the left of one who walks from start to end.

    It lies on the corridor's wall faces; a corridor with rooms on both sides has two, in opposite
    directions. Building frame, metres.
    """

    id: str
    storey: str
    start: Point
    end: Point
    space: tuple[Point, Point, Point, Point] | None = None
    """what the rules cut into rooms: the corners of the row, on the faces that enclose it, first
    those at the line from start to end, then those at the rear, back again; None: not known"""


@dataclass(frozen=True)
class Module:
    """A facade module: widths between centre lines are its multiples, but for the spread."""

    width_m: float
    spread_m: float


@dataclass(frozen=True)
class WallKind:
    """How thick walls of one kind are."""

    thickness_m: float
    spread_m: float


@dataclass(frozen=True)
class Origin:
    """A plan the grammar was learnt from."""

    building: str
    storey: str
    digest: str
    """what the plan is known by: `storage.plan_digest.plan_digest`; none is ever scored on"""


@dataclass(frozen=True, eq=False)
class Grammar:
    """R rules over room classes, and how they follow each other."""

    name: str
    building_type: str
    about: str
    learnt_from: tuple[Origin, ...]
    simulated: bool
    """whether a plan it was learnt from is simulated"""
    classes: tuple[str, ...]
    rules: tuple[Rule, ...]
    p_relation: NDArray[np.float64]
    """(R, R), P_r(r_j | r_i) in row i and column j: every row sums to one"""
    partition_m: float
    """thickness of the walls between rooms along a line"""
    partition_spread_m: float
    evidence: float = 0.0
    """how many applications of rules the probabilities and widths rest on: what an update weighs
    them with; 0: nothing is known, the first update replaces them"""
    lines: tuple[ReferenceLine, ...] = ()
    module: Module | None = None
    corridor_wall: WallKind | None = None
    """walls between a corridor and the rooms along it; None: not known"""
    outer_wall: WallKind | None = None
    """walls behind which lies nothing of the storey; None: not known"""

    @property
    def p_apriori(self) -> NDArray[np.float64]:
        """(R,), P_a of each rule."""
        return np.array([rule.p_apriori for rule in self.rules])
