"""What the learning of a grammar may be told."""

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, PositiveFloat


class LearnParams(BaseModel):
    """How a grammar is learnt from plans. The paper assumes a generator and tells none of this."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    classes: dict[str, str] = {}
    """What rooms of a class are taken for, by the plan's name of it: plans may name rooms one by
    one, as 'S-3 conference', where a grammar needs 'conference'."""
    wall_max_m: PositiveFloat = 0.6
    """Thickest wall, metres: a room stands on a line, or beside another, if no more is between
    them. Assumption: outer walls of brick rarely exceed it."""
    line_min_m: PositiveFloat = 1.0
    """Shortest reference line, metres: shorter ones are jambs and niches. Assumption."""
    partition_m: PositiveFloat = 0.125
    """Thickness of partitions where no two rooms of a plan show it, metres: boards of 12.5 mm twice
    on a 75 mm stud (DIN 18183 W112)."""
    spread_floor_m: PositiveFloat = 0.03
    """Least spread of a width, metres: what builders' tolerances leave (DIN 18202 allows 24 mm over
    6 m in plan), rounded up."""
    spread_unknown_m: PositiveFloat = 0.1
    """Spread of widths where no two rooms of a plan are alike, metres. Assumption."""
    spread_samples: PositiveFloat = 3.0
    """How many rooms the spread common to all rules counts for in that of each. Assumption."""
    depth_floor_m: PositiveFloat = 0.03
    """Least spread of a depth, metres: as of a width."""
    depth_apart_m: PositiveFloat = 0.1
    """Rooms without a name whose depths differ by less are of one class, metres. Assumption."""
    p_least: float = Field(default=0.002, ge=0, lt=0.1)
    """Rules that were applied less often than this share are left out: no rule explains such
    rooms. Assumption: the guard against rules learnt from oddities of many plans."""
    unit_parts_max: int = Field(default=4, ge=2, le=8)
    """Most rooms of a unit. Table 1's has three."""
    reading: Literal["both", "walked"] = "both"
    """Whether lines are read in `both` directions, so that a building and its mirror image give one
    grammar, or only as `walked`, the rooms to the left. Assumption: builders have no handedness."""
    smoothing: PositiveFloat | None = None
    """How many followers of each rule the a-priori probabilities count for; None: the numbers
    that predict each pair of neighbours best from all others (`best_strengths`)."""
    module_min_m: PositiveFloat = 0.9
    """Least facade module, metres: any width is near a multiple of a small one. Assumption."""
    module_max_m: PositiveFloat = 4.0
    """Greatest facade module, metres. Assumption."""
    module_spread_max: float = Field(default=0.04, gt=0, lt=0.25)
    """Greatest spread about a module's multiples, as a share of the module; without any module it
    is 0.29. Assumption."""
    module_rooms_min: int = Field(default=10, ge=3)
    """Fewest rooms that show a module. Assumption."""
