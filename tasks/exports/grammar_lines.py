"""The reference lines of a grammar, drawn as a map."""

import numpy as np
from numpy.typing import NDArray

from grammars.model import Grammar
from tasks.exports.grammar_sheet import LAYER_LINE, P_INK, SECTION_IN, draw_heading
from tasks.exports.sheet import MARGIN_IN, WIDTH_IN, Sheet
from tasks.exports.style import INK

MAP_IN = 3.6
"""Height of the map."""


def draw_lines(sheet: Sheet, grammar: Grammar, top: float) -> None:
    """Draw the reference lines as arrows, ticks to the side of their rooms."""
    storeys = sorted({line.storey for line in grammar.lines})
    note = f"storey {', '.join(storeys)}; rooms on the side of the ticks"
    draw_heading(sheet, top, "Reference lines", note)
    ends = np.array([(line.start, line.end) for line in grammar.lines])
    low, high = ends.min(axis=(0, 1)), ends.max(axis=(0, 1))
    size = np.maximum(high - low, 1.0)
    wide = (WIDTH_IN - 2 * MARGIN_IN) / len(storeys) - 0.2
    scale = min(wide / size[0], (MAP_IN - 0.3) / size[1])
    for i, storey in enumerate(storeys):
        corner = np.array((MARGIN_IN + i * (wide + 0.2), top - SECTION_IN - 0.1))
        for line in (line for line in grammar.lines if line.storey == storey):
            start, end = (
                corner + (np.array(p) - (low[0], high[1])) * scale for p in (line.start, line.end)
            )
            _draw_line(sheet, start, end)


def _draw_line(sheet: Sheet, start: NDArray[np.float64], end: NDArray[np.float64]) -> None:
    length = float(np.linalg.norm(end - start))
    along = (end - start) / length
    left = np.array((-along[1], along[0]))
    sheet.stroke(np.array((start, end)), INK, 1.1, LAYER_LINE)
    head = min(0.09, length / 3)
    barbs = np.array(
        (end - head * along + head / 2 * left, end, end - head * along - head / 2 * left)
    )
    sheet.stroke(barbs, INK, 1.1, LAYER_LINE)
    for at in np.arange(0.08, length - head, 0.12):
        foot = start + at * along
        sheet.stroke(np.array((foot, foot + 0.045 * left)), P_INK, 0.8, LAYER_LINE)
