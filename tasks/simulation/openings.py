"""Doors that make every room reachable, and windows module by module."""

from collections.abc import Sequence

import numpy as np
import shapely
from pydantic import Field, PositiveFloat
from shapely import LineString

from storage.plan import PlanOpening
from tasks.params import Params
from tasks.simulation.cells import Line
from tasks.simulation.layouts.units import CIRCULATION, MODULE_M

MARGIN_M = 0.35
"""Wall left on either side of an opening, from the next centre line: half of the thickest wall and
a door frame. Assumption."""
NO_WAY_THROUGH = ("stairs", "wc", "storage")
"""Classes nobody walks through to another room if there is another way. Assumption."""
NARROW, WIDE = ("wc", "storage"), ("seminar", "lab", "open_office", "stairs")
"""Classes with the narrowest and with the widest doors. Assumption."""
TWO_DOORS_M = 8.0
"""A room this long along the corridor has a door near either end. Assumption."""
APART_M, DRAWS = 1.1, 8
"""Distance at which the leaves of two doors do not meet, and the places drawn for it."""
LEAST_WINDOW_M = 0.6
"""Narrowest window. Assumption."""
STATES = ("open", "ajar", "shut")


class OpeningParams(Params):
    """Doors and windows. Assumptions unless a source is given."""

    doors_m: tuple[PositiveFloat, PositiveFloat, PositiveFloat] = (0.811, 0.936, 1.061)
    """Clear widths of doors in steel frames, metres: narrow, usual, wide. DIN 18101 and DIN 18111
    give leaves of 860, 985 and 1110 mm and a frame 64 mm within the wall's opening."""
    door_head_m: PositiveFloat = 1.968
    """Clear height of a door, metres: DIN 18101's wall opening of 2000 mm less 32 mm of frame."""
    p_state: tuple[float, float, float] = (0.45, 0.2, 0.35)
    """Shares of doors that are open, ajar, shut."""
    p_connecting: float = Field(default=0.1, ge=0, le=1)
    """Share of offices with a door to the next."""
    p_corner: float = Field(default=0.65, ge=0, le=1)
    """Share of doors close to a corner of their room."""
    window_m: PositiveFloat = 1.5
    """Width of a window in a module of 2.4 m, metres."""
    sill_m: PositiveFloat = 0.9
    """Height of a window's sill over the floor, metres."""
    window_head_m: PositiveFloat = 2.2
    """Height of a window's head over the floor, metres."""


def make_doors(
    lines: Sequence[Line], classes: Sequence[str], params: OpeningParams, rng: np.random.Generator
) -> tuple[PlanOpening, ...]:
    """Return doors such that every cell can be reached from the first.

    Parameters
    ----------
    lines : walls between cells; wall i of the plan is `w{i + 1}`, cell j is room `r{j}`
    classes : of the cells
    """
    doors: list[PlanOpening] = []
    needed = _tree(lines, classes, params)
    for index in needed + _connecting(lines, classes, params, rng):
        line = lines[index]
        pair = {classes[cell] for cell in line.cells}
        width = params.doors_m[0 if pair & set(NARROW) else 2 if pair & set(WIDE) else 1]
        width = min(width, line.line.length - 2 * MARGIN_M)
        parts, apart = _apart(line, width, pair, doors, params, rng)
        if index not in needed and apart < APART_M:
            continue
        for part in parts:
            doors.append(
                PlanOpening(
                    id=f"d{len(doors) + 1}",
                    line=part,
                    sill_m=0.0,
                    head_m=params.door_head_m,
                    wall=f"w{index + 1}",
                    state=str(rng.choice(STATES, p=params.p_state)),
                    rooms=tuple(f"r{cell}" for cell in line.cells),
                )
            )
    return tuple(doors)


def _apart(
    line: Line,
    width: float,
    pair: set[str],
    doors: Sequence[PlanOpening],
    params: OpeningParams,
    rng: np.random.Generator,
) -> tuple[list[LineString], float]:
    """Return the doors of a wall, drawn clear of others, and how far from them they are."""
    others = shapely.union_all([door.line for door in doors])
    best: tuple[list[LineString], float] = ([], -1.0)
    for _ in range(DRAWS):
        starts = _starts(line.line.length, width, pair, params, rng)
        parts = [_part(line.line, start, width) for start in starts]
        apart = np.inf if not doors else min(part.distance(others) for part in parts)
        if apart > best[1]:
            best = parts, apart
        if apart >= APART_M:
            break
    return best


def make_windows(lines: Sequence[Line], params: OpeningParams) -> tuple[PlanOpening, ...]:
    """Return a window in the middle of every facade module of every outer wall."""
    found = []
    for index, line in enumerate(lines):
        if len(line.cells) == 2:
            continue
        length = line.line.length
        n = max(1, round(length / MODULE_M))
        width = min(params.window_m, length / n - 2 * MARGIN_M)
        if width < LEAST_WINDOW_M:
            continue
        for i in range(n):
            start = (i + 0.5) * length / n - width / 2
            found.append((_part(line.line, start, width), f"w{index + 1}"))
    return tuple(
        PlanOpening(f"n{i + 1}", part, params.sill_m, params.window_head_m, wall)
        for i, (part, wall) in enumerate(found)
    )


def _tree(lines: Sequence[Line], classes: Sequence[str], params: OpeningParams) -> list[int]:
    """Return one wall per cell but the first through which it is entered."""
    fitting = [
        (i, line)
        for i, line in enumerate(lines)
        if len(line.cells) == 2 and line.line.length > params.doors_m[0] + 2 * MARGIN_M
    ]
    reached, chosen = {0}, []
    while len(reached) < len(classes):
        ways = [
            (_rank(classes[_inside(line, reached)]), -line.line.length, i)
            for i, line in fitting
            if len(reached & set(line.cells)) == 1
        ]
        if not ways:
            missing = sorted(set(range(len(classes))) - reached)
            raise ValueError(f"cells {missing} have no wall long enough for a door")
        index = min(ways)[2]
        chosen.append(index)
        reached |= set(lines[index].cells)
    # corridor doors in the order of the rooms, however long their walls are
    return sorted(chosen, key=lambda i: max(lines[i].cells))


def _inside(line: Line, reached: set[int]) -> int:
    return next(cell for cell in line.cells if cell in reached)


def _rank(class_: str) -> int:
    """Return how unwilling one is to walk through a room of a class."""
    return 0 if class_ in CIRCULATION else 2 if class_ in NO_WAY_THROUGH else 1


def _connecting(
    lines: Sequence[Line], classes: Sequence[str], params: OpeningParams, rng: np.random.Generator
) -> list[int]:
    """Return walls between offices, and between executives and their assistant, with a door."""
    found = []
    for i, line in enumerate(lines):
        pair = "-".join(sorted(classes[cell] for cell in line.cells))
        share = {"office-office": params.p_connecting, "assistant-executive": 1.0}.get(pair, 0.0)
        if share and rng.uniform() < share and line.line.length > 2.0:
            found.append(i)
    return found


def _starts(
    length: float, width: float, pair: set[str], params: OpeningParams, rng: np.random.Generator
) -> list[float]:
    """Return where the doors of a wall start along it, metres."""
    least, most = MARGIN_M, length - MARGIN_M - width
    near = least + min(0.4 * rng.uniform(), most - least)
    far = most - min(0.4 * rng.uniform(), most - least)
    if length > TWO_DOORS_M and "corridor" in pair:
        return [near, far]
    if rng.uniform() < params.p_corner:
        return [near if rng.uniform() < 0.5 else far]
    return [rng.uniform(least, max(most, least))]


def _part(line: LineString, start_m: float, width_m: float) -> LineString:
    return LineString([line.interpolate(start_m), line.interpolate(start_m + width_m)])
