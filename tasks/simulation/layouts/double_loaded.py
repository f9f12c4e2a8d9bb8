"""A corridor with a row of rooms on either side."""

from typing import Literal, Self

import numpy as np
from pydantic import Field, PositiveFloat, model_validator
from shapely import box

from tasks.params import Params
from tasks.simulation.layouts.rows import Band, Space, cut_out, fill_band, local_box
from tasks.simulation.layouts.units import MODULE_M, draw_row, parts_of

SERVICES: tuple[tuple[str, ...], tuple[str, ...]] = (("stairs", "wc"), ("kitchen",))
"""Units that the south and the north row have in any case: no storey is without."""


class DoubleLoadedParams(Params):
    """A double-loaded corridor. Assumptions unless a source is given."""

    modules: int = Field(default=12, ge=8, le=60)
    """Length of the corridor, facade modules of 2.4 m (Table 1's least width)."""
    corridor_m: PositiveFloat = 2.1
    """Width of the corridor between centre lines, metres."""
    depth_south_m: float = Field(default=5.4, ge=3.5)
    """Depth of the south rooms between centre lines, metres."""
    depth_north_m: float = Field(default=4.8, ge=3.5)
    """Depth of the north rooms between centre lines, metres."""
    rows: tuple[tuple[str, ...], tuple[str, ...]] | None = None
    """Units of the south and the north row, west to east; None draws them."""

    @model_validator(mode="after")
    def _rows_fill_the_corridor(self) -> Self:
        for row in self.rows or ():
            filled = sum(part.modules for part in parts_of(row))
            if filled != self.modules:
                raise ValueError(f"row {row} takes {filled} modules of {self.modules}; fill it")
        return self

    cut_outs: Literal[0, 1, 2] = 0
    """Rooms cut out of a bigger one, the easternmost first (Sec. 7.4's overlapped rooms)."""


def double_loaded_layout(params: DoubleLoadedParams, rng: np.random.Generator) -> list[Space]:
    """Return the corridor, the south rooms west to east, then the north rooms."""
    length, width = params.modules * MODULE_M, params.corridor_m
    spaces = [Space(box(0, 0, length, width), "corridor")]
    for side, (base, facade) in enumerate(
        ((0.0, -params.depth_south_m), (width, width + params.depth_north_m))
    ):
        band = Band(
            np.array([(0, base), (length, base)]), np.array([(0, facade), (length, facade)])
        )
        if params.rows is None:
            parts = draw_row(params.modules, rng, SERVICES[side])
        else:
            parts = parts_of(params.rows[side])
        spaces += fill_band(band, parts)
    return with_cut_outs(spaces, params.cut_outs)


def with_cut_outs(spaces: list[Space], count: int) -> list[Space]:
    """Return the rooms with small ones cut out of as many big ones, the easternmost first.

    The first is cut from the corridor's side and makes the big room a U, the second from a corner
    at the facade and is entered through the big room.
    """
    big = [s for s in spaces if s.class_ in BIG and s.cell.area > BIG_M2 and _rectangular(s)]
    chosen = sorted(big, key=lambda s: -s.cell.centroid.x)[:count]
    found = []
    for space in spaces:
        if not any(space is c for c in chosen):
            found.append(space)
        elif space is chosen[0]:
            found += cut_out(space, local_box(space, (0.36, 0.68), (-0.1, 0.45)), "storage")
        else:
            found += cut_out(space, local_box(space, (-0.1, 0.34), (0.55, 1.1)), "storage")
    return found


def _rectangular(space: Space) -> bool:
    return space.cell.oriented_envelope.area - space.cell.area < 1e-6


BIG, BIG_M2 = ("seminar", "lab", "meeting", "office", "executive"), 30.0
"""Rooms one may cut another out of. Assumption."""
