"""What is compared: all of it, and each ingredient left out or exchanged."""

from dataclasses import dataclass

from flows.learners import LEARNERS
from tasks.forest import ForestParams
from tasks.furniture.backs import BackParams
from tasks.furniture.chairs import ChairParams
from tasks.furniture.classification import FurnitureParams
from tasks.furniture.examples import RealSizeParams
from tasks.furniture.fronts import FrontParams
from tasks.furniture.homes import HomeParams
from tasks.furniture.segments import FurnitureSegmentParams
from tasks.furniture.splitting import RunParams, SplitParams

FOREST = LEARNERS["furniture"].forest
FURNITURE = FurnitureParams()
SIZES = RealSizeParams()
SEGMENTS = FurnitureSegmentParams()
TOGETHER = SEGMENTS.model_copy(
    update={
        "split": SplitParams(most=1),
        "backs": BackParams(wide_m=10.0),
        "chairs": ChairParams(row=1),
        "runs": RunParams(most=1),
    }
)
"""Nothing is split: what touches is one piece."""
NO_BACKS = SEGMENTS.model_copy(update={"backs": BackParams(narrow_m=100.0)})
"""No panel is wide enough to be a back."""
TOPS_AND_CHAIRS = SEGMENTS.model_copy(
    update={"fronts": FrontParams(width_m=100.0), "standing": BackParams(narrow_m=100.0)}
)
"""What is seen from the front alone is not looked for."""
BACK = (
    *("top_m", "back_share", "back_rise_m", "panel_below"),
    *("panel_width_m", "panel_thickness_m", "panel_share"),
)
LEGS = ("below", "rim_below", "closed_below")


@dataclass(frozen=True)
class Variant:
    """One way to find furniture."""

    name: str
    segments: FurnitureSegmentParams = SEGMENTS
    forest: ForestParams = FOREST
    real_sizes: RealSizeParams | None = SIZES
    """what the forest learns besides the simulated storeys"""
    without: tuple[str, ...] = ()
    """features the forest is not told"""
    furniture: FurnitureParams = FURNITURE


def _trees(n: int) -> ForestParams:
    return FOREST.model_copy(update={"trees": n})


ALL = Variant("all of it, 8 trees")
OTHERS = (
    Variant("with workplaces", furniture=FurnitureParams(workplaces=0.5, chair=0.4)),
    Variant("with workplaces in full", furniture=FurnitureParams(workplaces=1.0)),
    Variant("100 trees", forest=_trees(100)),
    Variant("without real sizes", real_sizes=None),
    Variant("without rooms of flats", real_sizes=RealSizeParams(homes=HomeParams(rooms=0))),
    Variant("without splitting", segments=TOGETHER),
    Variant("without features of backs", without=BACK),
    Variant("without features of legs", without=LEGS),
    Variant("without backs at all", segments=NO_BACKS, without=BACK),
    Variant("without fronts and screens", segments=TOPS_AND_CHAIRS),
)
