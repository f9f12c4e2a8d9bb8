"""What follows what in a grammar: its relationship probabilities as a heat map with numbers."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grammars.model import Rule
from tasks.exports.grammar_sheet import ID_PT, LAYER_FILL, SECTION_IN, draw_heading, draw_text
from tasks.exports.sheet import MARGIN_IN, WIDTH_IN, Sheet
from tasks.exports.style import INK

CELL_MAX_IN, CELL_NUMBER_IN = 0.42, 0.2
"""Largest cell of the matrix; smaller cells than the second have no numbers."""
DEEP = np.array((31, 78, 121)) / 255
"""Colour of the greatest probability; zero is white."""


@dataclass(frozen=True, eq=False)
class Matrix:
    """Rules, P_r(column | row), and the width of the longest name."""

    rules: list[Rule]
    p_relation: NDArray[np.float64]
    names_in: float

    @property
    def cell_in(self) -> float:
        """Return the side of a cell, inches."""
        room = WIDTH_IN - 2 * MARGIN_IN - self.names_in - 0.15
        return min(CELL_MAX_IN, room / len(self.rules))

    @property
    def height_in(self) -> float:
        """Return the height of the section, inches."""
        return SECTION_IN + self.names_in + self.cell_in * (len(self.rules) + 1) + 0.1


def draw_matrix(sheet: Sheet, matrix: Matrix, top: float) -> None:
    """Draw the matrix from the top of the section down, and P_a under it."""
    draw_heading(sheet, top, "What follows what", "P_r(column | row); last row: P_a")
    n, cell = len(matrix.rules), matrix.cell_in
    left = MARGIN_IN + matrix.names_in + 0.15
    high = top - SECTION_IN - matrix.names_in
    rows = np.vstack((matrix.p_relation, [rule.p_apriori for rule in matrix.rules]))
    greatest = max(float(rows.max()), 1e-9)
    names = [*(rule.id for rule in matrix.rules), "P_a"]
    for i, name in enumerate(names):
        # the a-priori probabilities stand a little apart
        y = high - cell * i - (0.08 if i == n else 0)
        draw_text(sheet, left - 0.12, y - cell / 2, name, min(ID_PT, cell * 60), ha="right")
        _draw_cells(sheet, (left, y), cell, rows[i], greatest)
    for j, rule in enumerate(matrix.rules):
        x = left + cell * (j + 0.5)
        style = {"rotation": 90, "ha": "center", "va": "bottom"}
        draw_text(sheet, x, high + 0.07, rule.id, min(ID_PT, cell * 60), **style)


def _draw_cells(
    sheet: Sheet,
    corner: tuple[float, float],
    cell: float,
    probabilities: NDArray[np.float64],
    greatest: float,
) -> None:
    """Draw a row of cells, its upper left corner given: the greater, the darker."""
    from matplotlib.collections import PolyCollection

    x = corner[0] + cell * np.arange(len(probabilities))
    middle = corner[1] - cell / 2
    shares = probabilities / greatest
    sides = cell * np.array(((0, 0.5), (1, 0.5), (1, -0.5), (0, -0.5)))
    cells = np.column_stack((x, np.full(len(x), middle)))[:, None] + sides
    colours = 1 - shares[:, None] * (1 - DEEP)
    style: dict[str, Any] = {"edgecolors": "white", "linewidths": 0.8, "zorder": LAYER_FILL}
    collection = PolyCollection(list(cells), facecolors=colours, **style)
    sheet.axes.add_collection(collection, autolim=False)
    if cell < CELL_NUMBER_IN:
        return
    for left, p, share in zip(x, probabilities, shares, strict=True):
        if p >= 0.005:
            ink = "white" if share > 0.55 else INK
            text = f"{p:.2f}".lstrip("0") if p < 0.995 else "1"
            size = min(7.0, cell * 24)
            draw_text(sheet, left + cell / 2, middle, text, size, ha="center", color=ink)
