"""The rules of a grammar, drawn to scale with their a-priori probabilities."""

import numpy as np
from shapely import box

from grammars.model import Grammar, Part, Rule
from tasks.exports.grammar_sheet import (
    ID_PT,
    LAYER_FILL,
    LAYER_GRID,
    LAYER_LINE,
    P_INK,
    SECTION_IN,
    draw_heading,
    draw_text,
)
from tasks.exports.sheet import MARGIN_IN, WIDTH_IN, Sheet, text_width
from tasks.exports.style import AREA_INK, INK, MUTED, room_tints

ROW_IN, BAR_IN = 0.33, 0.22
"""Height of a rule's row and of its bar."""
AXIS_IN = 0.34
"""Height of the axis under the rules."""
P_IN = 1.25
"""Length of the bar of the likeliest rule."""
MODULE_INK = "#d9d4c7"
TICKS_M = (1, 2, 5, 10, 20, 50)


def rules_height(n_rules: int) -> float:
    """Return the height of the section, inches."""
    return SECTION_IN + ROW_IN * n_rules + AXIS_IN


def draw_rules(
    sheet: Sheet, grammar: Grammar, rules: list[Rule], top: float, names_in: float
) -> None:
    """Draw rules from the top of the section down."""
    draw_heading(sheet, top, "Rules", "Space → rooms Space, to scale; P_a; whiskers: two spreads")
    left = MARGIN_IN + names_in + 0.15
    bars = left + P_IN + 0.55
    widest = max(rule.width_m + 2 * rule.parts[-1].spread_m for rule in rules)
    scale = (WIDTH_IN - MARGIN_IN - bars) / widest
    high = top - SECTION_IN
    low = high - ROW_IN * len(rules)
    _draw_axis(sheet, grammar, (bars, low, high), scale, widest)
    tints = room_tints(set(grammar.classes))
    likeliest = rules[0].p_apriori
    for i, rule in enumerate(rules):
        y = high - ROW_IN * (i + 0.5)
        draw_text(sheet, left - 0.12, y, rule.id, ID_PT, ha="right")
        long = P_IN * rule.p_apriori / likeliest
        bar = box(left, y - BAR_IN / 4, left + long, y + BAR_IN / 4)
        sheet.fill(bar, P_INK, LAYER_FILL)
        draw_text(sheet, left + long + 0.05, y, f"{rule.p_apriori:.3f}", 7, color=AREA_INK)
        x = bars
        for part in rule.parts:
            _draw_part(sheet, part, (x, y), scale, tints[part.class_])
            x += part.width_m * scale


def _draw_part(sheet: Sheet, part: Part, at: tuple[float, float], scale: float, tint: str) -> None:
    x, y = at
    end = x + part.width_m * scale
    room = box(x, y - BAR_IN / 2, end, y + BAR_IN / 2)
    sheet.fill(room, tint, LAYER_FILL, edgecolor=INK, linewidth=0.7)
    reach = 2 * part.spread_m * scale
    whisker = np.array(((end - reach, y - BAR_IN / 2), (end + reach, y - BAR_IN / 2)))
    sheet.stroke(whisker, INK, 1.6, LAYER_LINE)
    for label in (f"{part.class_} {part.width_m:.2f}", f"{part.width_m:.2f}", part.class_):
        if text_width(label, 6.5) / 72 < end - x - 0.06:
            draw_text(sheet, (x + end) / 2, y, label, 6.5, ha="center")
            break


def _draw_axis(
    sheet: Sheet,
    grammar: Grammar,
    place: tuple[float, float, float],
    scale: float,
    widest_m: float,
) -> None:
    """Draw metres under the rules, and the facade module behind them."""
    left, low, high = place
    if grammar.module is not None:
        for k in range(1, int(widest_m / grammar.module.width_m) + 1):
            x = left + k * grammar.module.width_m * scale
            sheet.stroke(np.array(((x, low), (x, high))), MODULE_INK, 0.6, LAYER_GRID)
    axis = np.array(((left, low), (left + widest_m * scale, low)))
    sheet.stroke(axis, MUTED, 0.7, LAYER_LINE)
    step = next((t for t in TICKS_M if widest_m / t <= 12), TICKS_M[-1])
    for at in range(0, int(widest_m) + 1, step):
        x = left + at * scale
        sheet.stroke(np.array(((x, low), (x, low - 0.05))), MUTED, 0.7, LAYER_LINE)
        unit = " m" if at == 0 else ""
        draw_text(sheet, x, low - 0.14, f"{at}{unit}", 7, ha="center", color=MUTED)
