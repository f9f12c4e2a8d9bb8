"""What stands around the drawing: title, scale bar, legend, and what a reader must know."""

from typing import Any

from storage.plan import Plan
from tasks.exports.sheet import FOOT_IN, HEAD_IN, MARGIN_IN, WIDTH_IN, Sheet, text_width
from tasks.exports.style import INK, MUTED, SEEN, SEEN_ONCE, UNSEEN

BAR_LENGTHS_M = (10, 5, 2, 1)
"""Lengths a scale bar may have, longest first."""
BAR_MAX_IN = 2.4
"""Longest scale bar on the sheet."""


def draw_title(sheet: Sheet, plan: Plan) -> None:
    """Write building and storey, the number of rooms and their area."""
    top = sheet.height_in
    title = f"{plan.building}  ·  storey {plan.storey}"
    room_for = (WIDTH_IN - 2 * MARGIN_IN) * 72
    size = min(17.0, 17.0 * room_for / text_width(title, 17.0))
    sheet.write(MARGIN_IN, top - 0.5, title, size, fontweight="bold")
    sheet.write(MARGIN_IN, top - 0.76, _summary(plan), 10, color=MUTED)
    if not plan.rooms:
        middle = (top - HEAD_IN + FOOT_IN) / 2
        style = {"ha": "center", "color": MUTED}
        sheet.write(WIDTH_IN / 2, middle, "no rooms found", 16, **style)


def draw_footer(sheet: Sheet, plan: Plan, covered: bool) -> None:
    """Draw the scale bar and the coverage's legend; say what is simulated, and the notes."""
    if plan.rooms or plan.walls:
        _draw_scale_bar(sheet)
    if covered:
        _draw_legend(sheet)
    right = WIDTH_IN - MARGIN_IN
    if plan.simulated:
        sheet.write(right, 0.42, "simulated data", 10, color="#b3402f", ha="right")
    if plan.notes:
        sheet.write(
            right, 0.2, _shortened("; ".join(plan.notes), 110), 6.5, color=MUTED, ha="right"
        )


def _summary(plan: Plan) -> str:
    if not plan.rooms:
        return "no rooms"
    n, area = len(plan.rooms), sum(room.polygon.area for room in plan.rooms)
    return f"{n} room{'s' if n > 1 else ''}, {area:,.1f} m²"


def _draw_scale_bar(sheet: Sheet) -> None:
    """Draw a bar of round length in four parts, black and white."""
    scale = sheet.scale_in_per_m
    fitting = (length for length in BAR_LENGTHS_M if length * scale <= BAR_MAX_IN)
    length = next(fitting, BAR_LENGTHS_M[-1])
    part, high = length * scale / 4, 0.07
    for i in range(4):
        face = INK if i % 2 == 0 else "white"
        _block(sheet, MARGIN_IN + i * part, 0.42, part, high, facecolor=face, edgecolor=INK)
    for at in (0, length / 2, length):
        unit = " m" if at == length else ""
        style = {"ha": "center", "color": INK}
        sheet.write(MARGIN_IN + at * scale, 0.24, f"{at:g}{unit}", 7.5, **style)


def _draw_legend(sheet: Sheet) -> None:
    """Explain the shades of the coverage."""
    left, darkness = WIDTH_IN / 2 - 1.35, 0.0
    _swatch(sheet, left, "1 scan", facecolor=SEEN_ONCE)
    for i, (least, darker) in enumerate(SEEN):
        darkness += darker
        more = "+" if i == len(SEEN) - 1 else ""
        x = left + 0.72 * (i + 1)
        _swatch(sheet, x, f"{least}{more} scans", facecolor=SEEN_ONCE)
        _swatch(sheet, x, "", facecolor="black", alpha=darkness)
    style = {"hatch": "////////", "hatch_linewidth": 0.4, "edgecolor": UNSEEN}
    _swatch(sheet, left + 0.72 * (len(SEEN) + 1) + 0.1, "not scanned", facecolor="none", **style)


def _swatch(sheet: Sheet, x_in: float, text: str, **style: Any) -> None:
    _block(sheet, x_in, 0.4, 0.18, 0.11, **({"edgecolor": "none"} | style))
    sheet.write(x_in + 0.23, 0.42, text, 7.5, color=MUTED)


def _block(
    sheet: Sheet, x_in: float, y_in: float, wide_in: float, high_in: float, **style: Any
) -> None:
    from matplotlib.patches import Rectangle

    corner = (x_in / WIDTH_IN, y_in / sheet.height_in)
    size = (wide_in / WIDTH_IN, high_in / sheet.height_in)
    frame = {"transform": sheet.figure.transFigure, "linewidth": 0.6, **style}
    sheet.figure.add_artist(Rectangle(corner, *size, **frame))


def _shortened(text: str, at_most: int) -> str:
    return text if len(text) <= at_most else text[: at_most - 1] + "…"
