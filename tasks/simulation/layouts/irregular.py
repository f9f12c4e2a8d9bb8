"""An irregular storey: an angled wing, L- and U-shaped rooms, rooms in rooms, a pointed end."""

from itertools import pairwise

import numpy as np
from pydantic import Field
from shapely import Polygon

from tasks.params import Params
from tasks.simulation.layouts.double_loaded import with_cut_outs
from tasks.simulation.layouts.rows import Band, Space, fill_band, offset_path
from tasks.simulation.layouts.units import MODULE_M, draw_row


class IrregularParams(Params):
    """An irregular storey. All sizes are assumptions."""

    main_modules: int = Field(default=9, ge=8, le=30)
    """Length of the main wing along its corridor, facade modules of 2.4 m."""
    wing_modules: int = Field(default=6, ge=5, le=20)
    """Length of the angled wing, facade modules."""
    bend_min_rad: float = Field(default=np.deg2rad(20), ge=np.deg2rad(10))
    """Least angle between the wings, radians."""
    bend_max_rad: float = Field(default=np.deg2rad(40), le=np.deg2rad(45))
    """Greatest angle between the wings, radians."""
    corridor_m: float = Field(default=2.3, ge=1.4)
    """Width of the corridor between centre lines, metres."""
    depth_m: float = Field(default=4.8, ge=3.5)
    """Depth of the rooms between centre lines, metres."""


def irregular_layout(params: IrregularParams, rng: np.random.Generator) -> list[Space]:
    """Return the corridor, the rooms right of it, those left of it, and the room at its end."""
    bend = rng.uniform(params.bend_min_rad, params.bend_max_rad)
    main, wing = params.main_modules * MODULE_M, params.wing_modules * MODULE_M
    direction = np.array((np.cos(bend), np.sin(bend)))
    path = np.array(((0.0, 0.0), (main, 0.0), (main, 0.0) + wing * direction))
    half = params.corridor_m / 2
    right, left = offset_path(path, half), offset_path(path, -half)
    outer_right = offset_path(path, half + params.depth_m)
    outer_left = offset_path(path, -half - params.depth_m)
    spaces = [Space(Polygon((*right, *left[::-1])), "corridor")]
    # left of the corridor the bend takes from the facade: end rooms there are two modules or more
    for base, facade, needed, ends in (
        (right, outer_right, (("seminar", "stairs"), ("wc",)), 1),
        (left, outer_left, (("lab", "wc"), ("kitchen",)), 2),
    ):
        for i, modules in enumerate((params.main_modules, params.wing_modules)):
            band = Band(base[i : i + 2], facade[i : i + 2])
            spaces += fill_band(band, draw_row(modules, rng, needed[i], ends))
    spaces.append(_end_room(outer_right[-1], right[-1], left[-1], outer_left[-1], direction))
    return with_cut_outs(_with_ell(spaces), 2)


def _end_room(
    a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray, direction: np.ndarray
) -> Space:
    """Return a six-sided room across the end of the wing."""
    middle = (a + d) / 2
    shoulder, tip = 2.0 * direction, 4.2 * direction
    near = 0.35 * (d - a) / 2
    return Space(
        Polygon((a, a + shoulder, middle - near + tip, middle + near + tip, d + shoulder, d)),
        "meeting",
    )


def _with_ell(spaces: list[Space]) -> list[Space]:
    """Return the rooms with the first two offices side by side made an L and a storage room."""
    for i, (space, following) in enumerate(pairwise(spaces)):
        if space.class_ == following.class_ == "office" and _rectangles(space, following):
            a, b, c, d = np.array(following.cell.exterior.coords)[:4]
            low, high = b + 0.55 * (c - b), a + 0.55 * (d - a)
            back = Polygon((high, low, c, d))
            ell = space.cell.union(back, grid_size=1e-9)
            return [
                *spaces[:i],
                Space(ell, "office"),
                Space(Polygon((a, b, low, high)), "storage"),
                *spaces[i + 2 :],
            ]
    return spaces


def _rectangles(*spaces: Space) -> bool:
    """Return whether rooms are rectangles that share a whole side."""
    cells = [space.cell for space in spaces]
    full = all(cell.oriented_envelope.area - cell.area < 1e-6 for cell in cells)
    shared = cells[0].boundary.intersection(cells[1].boundary.buffer(1e-6)).length
    return full and shared > 3.0
