"""Plans whose widths are known: rooms on both sides of a straight corridor."""

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from shapely import LineString, box

from storage.plan import Plan, PlanRoom, PlanWall

Room = tuple[str | None, float]
"""class, and width between centre lines, metres"""


def row_plan(
    south: Sequence[Room],
    north: Sequence[Room] = (),
    *,
    partition: float = 0.1,
    bearing: float = 0.2,
    outer: float = 0.3,
    depth: float = 5.0,
    walls: bool = True,
    building: str = "b",
    storey: str = "1",
) -> Plan:
    """Rooms west to east, south and north of a corridor 2 m wide whose wall faces are y = 0 and 2.

    The corridor runs from x = 0 to the face of the outer wall beyond the longer row; rooms reach
    `depth` from its face. The west wall's centre line is x = -outer / 2.
    """
    rooms, ends = [], []
    for row, (low, high) in ((south, (-depth, -bearing)), (north, (2 + bearing, 2 + depth))):
        axes = -outer / 2 + np.concatenate(([0.0], np.cumsum([width for _, width in row])))
        halves = np.full(len(axes), partition / 2)
        halves[[0, -1]] = outer / 2
        ends.append(float(axes[-1]))
        for i, (class_, _) in enumerate(row):
            outline = box(axes[i] + halves[i], low, axes[i + 1] - halves[i + 1], high)
            rooms.append(PlanRoom(f"r{len(rooms) + 1}", outline, class_))
    length = max(ends) - outer / 2
    corridor = PlanRoom("r0", box(0, 0, length, 2), "corridor")
    lines = [((x, -depth), (x, 2 + depth)) for x in (-outer / 2, length + outer / 2)]
    found = tuple(PlanWall(f"w{i}", LineString(line), outer) for i, line in enumerate(lines))
    return Plan(building, storey, (corridor, *rooms), found if walls else ())


@pytest.fixture
def make_row() -> Callable[..., Plan]:
    return row_plan
