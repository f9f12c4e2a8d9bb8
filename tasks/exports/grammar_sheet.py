"""What the sections of a grammar's drawing share: a sheet in inches, headings, texts, inks."""

from typing import Any

from tasks.exports.sheet import DPI, FONT, MARGIN_IN, WIDTH_IN, Sheet, text_width
from tasks.exports.style import INK, MUTED

SECTION_IN = 0.36
"""Height of a section's heading."""
ID_PT = 7.5
"""Size of the rules' names."""
P_INK = "#7a8fa6"
"""Bars of probabilities, ticks of reference lines."""
LAYER_GRID, LAYER_FILL, LAYER_LINE, LAYER_TEXT = 1.0, 2.0, 3.0, 4.0


def inch_sheet(height_in: float) -> Sheet:
    """Return an empty sheet whose axes are inches from its lower left corner."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH_IN, height_in), dpi=DPI, facecolor="white")
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(0, WIDTH_IN), ylim=(0, height_in))
    axes.set_axis_off()
    return Sheet(figure, axes, height_in, 1.0)


def draw_heading(sheet: Sheet, top: float, text: str, note: str) -> None:
    """Write the heading of a section that starts at `top`, and a note beside it."""
    sheet.write(MARGIN_IN, top - 0.14, text, 11, fontweight="bold")
    x = MARGIN_IN + 1.12 * text_width(text, 11) / 72 + 0.15
    sheet.write(x, top - 0.14, note, 7.5, color=MUTED)


def draw_text(sheet: Sheet, x: float, y: float, text: str, size_pt: float, **style: Any) -> None:
    """Write at a place in inches; the text starts there unless told otherwise."""
    style = {"color": INK, "va": "center_baseline", "fontfamily": FONT} | style
    sheet.axes.text(x, y, text, fontsize=size_pt, parse_math=False, zorder=LAYER_TEXT, **style)


def fitted(text: str, size_pt: float, room_in: float) -> str:
    """Return a text that fits, cut short if need be."""
    whole = text
    while text and text_width(text if text == whole else f"{text}…", size_pt) > 72 * room_in:
        text = text[:-1]
    return text if text == whole else f"{text.rstrip()}…"
