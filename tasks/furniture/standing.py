"""What stands on tables: upright panels such as screens, which hide the table behind them."""

from collections.abc import Iterator

import numpy as np

from tasks.furniture.backs import BackParams, find_backs
from tasks.furniture.boxes import Box
from tasks.furniture.candidates import ON_TABLE, Candidate
from tasks.furniture.scene import Scene
from tasks.furniture.tops import Top

DEPTH_M = 0.2
"""Depth of a screen's foot, metres. Assumption."""
OVER_M, MOST_M = 0.2, 0.65
"""How far over its table a screen ends, metres. Assumption."""
INSIDE_M = 0.06
"""How far within the edge of its table it stands at least, metres: what stands nearer may be the
back of a chair."""


def find_standing(scene: Scene, tables: list[Top], params: BackParams) -> Iterator[Candidate]:
    """Yield what stands upright on the tables of a room."""
    for table in tables:
        inner = Box(
            table.box.centre,
            table.box.axis,
            max(table.box.length - 2 * INSIDE_M, 0.01),
            max(table.box.depth - 2 * INSIDE_M, 0.01),
        )
        places = scene.within(inner)
        if not len(places):
            continue
        tops = scene.standing[places]
        with np.errstate(invalid="ignore"):
            fits = (tops > table.height + OVER_M) & (tops < table.height + MOST_M)
        for back in find_backs(scene.columns, tops[fits], scene.rows[places[fits]], params):
            box = Box(back.centre, back.axis, back.width, DEPTH_M)
            seen = scene.surfaces_in(box, back.top - 0.08, back.top + 0.08)
            yield Candidate(
                box, seen, back.top, back.top, ON_TABLE, back.row, None, back.panel, table.height
            )
