"""An open-plan office across a corridor from cellular rooms."""

import numpy as np
from pydantic import Field, PositiveFloat
from shapely import box

from tasks.params import Params
from tasks.simulation.layouts.rows import Band, Space, fill_band
from tasks.simulation.layouts.units import MODULE_M, draw_row


class OpenPlanParams(Params):
    """An open-plan storey. All sizes are assumptions."""

    modules: int = Field(default=12, ge=10, le=40)
    """Length of the storey, facade modules of 2.4 m."""
    corridor_m: PositiveFloat = 2.1
    """Width of the corridor between centre lines, metres."""
    depth_m: float = Field(default=4.8, ge=3.5)
    """Depth of the cellular rooms between centre lines, metres."""
    open_depth_m: float = Field(default=9.6, ge=7.2)
    """Depth of the open-plan office between centre lines, metres."""
    core_modules: int = Field(default=2, ge=2, le=4)
    """Modules of the block with stairs and kitchen west of the office."""


def open_plan_layout(params: OpenPlanParams, rng: np.random.Generator) -> list[Space]:
    """Return the corridor, the cellular rooms, stairs, kitchen, meeting room, open office."""
    length, width = params.modules * MODULE_M, params.corridor_m
    low, top = np.array([(0, 0), (length, 0)]), width + params.open_depth_m
    cells = draw_row(params.modules, rng, ("wc", "wc", "storage"))
    spaces = [Space(box(0, 0, length, width), "corridor")]
    spaces += fill_band(Band(low.astype(float), low - np.array((0, params.depth_m))), cells)
    west, east = params.core_modules * MODULE_M, length - 2 * MODULE_M
    split = width + round(0.55 * params.open_depth_m, 2)
    spaces.append(Space(box(0, width, west, split), "stairs"))
    spaces.append(Space(box(0, split, west, top), "kitchen"))
    # the meeting room stands in the office: an L, entered from it
    meeting = box(east, split, length, top)
    spaces.append(Space(meeting, "meeting"))
    spaces.append(Space(box(west, width, length, top).difference(meeting), "open_office"))
    return spaces
