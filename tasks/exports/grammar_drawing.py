"""A grammar as a drawing: rules to scale, what follows what, reference lines; SVG and PNG."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from grammars.model import Grammar
from tasks.exports.grammar_lines import MAP_IN, draw_lines
from tasks.exports.grammar_matrix import Matrix, draw_matrix
from tasks.exports.grammar_rules import draw_rules, rules_height
from tasks.exports.grammar_sheet import ID_PT, SECTION_IN, fitted, inch_sheet
from tasks.exports.sheet import MARGIN_IN, WIDTH_IN, Sheet, save, text_width
from tasks.exports.style import AREA_INK, MUTED

TITLE_IN, GAP_IN = 0.85, 0.45
"""Height of the title, and air over each section."""
ABOUT_IN, ABOUT_PT, ABOUT_LINES = 0.15, 7.5, 6
"""Height and size of a line of what the grammar tells of itself, and the most of them."""
NAMES_MAX_IN = 2.3
"""Longest name of a rule; longer ones are cut short."""
FOOT_IN = 0.35
"""Height of the footer."""


def draw_grammar(grammar: Grammar, path_svg: Path | str, path_png: Path | str) -> None:
    """Draw a grammar to an SVG and a PNG file; the same grammar gives the same bytes.

    Rules stand in the order of their a-priori probability, rooms to scale along one axis, with a
    whisker of two spreads under the far side of each; the facade module is a grid behind them. The
    matrix shows P_r(column | row) in the same order, and under it P_a.

    Raises
    ------
    StoreError
        If a file cannot be written.
    """
    order = np.argsort(-grammar.p_apriori, kind="stable")
    rules = [grammar.rules[i] for i in order]
    matrix = grammar.p_relation[np.ix_(order, order)]
    names = {rule.id: fitted(rule.id, ID_PT, NAMES_MAX_IN) for rule in rules}
    rules = [replace(rule, id=names[rule.id]) for rule in rules]
    names_in = max(text_width(rule.id, ID_PT) for rule in rules) / 72
    followers = Matrix(rules, matrix, names_in)
    heights = [
        rules_height(len(rules)),
        followers.height_in,
        SECTION_IN + MAP_IN if grammar.lines else 0.0,
    ]
    title = TITLE_IN + ABOUT_IN * len(_about(grammar))
    total = title + sum(h + GAP_IN for h in heights if h) + FOOT_IN
    sheet = inch_sheet(total)
    top = total - title
    _draw_title(sheet, grammar)
    draw_rules(sheet, grammar, rules, top - GAP_IN / 2, names_in)
    top -= heights[0] + GAP_IN
    draw_matrix(sheet, followers, top)
    if grammar.lines:
        draw_lines(sheet, grammar, top - heights[1] - GAP_IN)
    _draw_footer(sheet, grammar)
    save(sheet, path_svg)
    save(sheet, path_png)


def _draw_title(sheet: Sheet, grammar: Grammar) -> None:
    top = sheet.height_in
    sheet.write(MARGIN_IN, top - 0.5, grammar.name, 17, fontweight="bold")
    n, m = len(grammar.rules), len(grammar.classes)
    facts = [grammar.building_type, f"{_count(n, 'rule')} over {_count(m, 'class', 'es')}"]
    if grammar.learnt_from:
        facts.append(f"learnt from {_count(len(grammar.learnt_from), 'storey', 's')}")
    facts.append(f"partitions {grammar.partition_m:.3f} m")
    if grammar.module is not None:
        facts.append(f"facade module {grammar.module.width_m:.2f} m")
    sheet.write(MARGIN_IN, top - 0.76, "  ·  ".join(facts), 10, color=MUTED)
    for i, line in enumerate(_about(grammar)):
        sheet.write(MARGIN_IN, top - 0.97 - ABOUT_IN * i, line, ABOUT_PT, color=AREA_INK)


def _about(grammar: Grammar) -> list[str]:
    """Return what the grammar tells of itself in lines that fit, at most `ABOUT_LINES`."""
    room_in = WIDTH_IN - 2 * MARGIN_IN
    lines: list[str] = []
    for word in grammar.about.split():
        longer = f"{lines[-1]} {word}" if lines else word
        if lines and text_width(longer, ABOUT_PT) <= room_in * 72:
            lines[-1] = longer
        else:
            lines.append(word)
    if len(lines) > ABOUT_LINES:
        lines = [*lines[: ABOUT_LINES - 1], f"{lines[ABOUT_LINES - 1]} {lines[ABOUT_LINES]}"]
    return [fitted(line, ABOUT_PT, room_in) for line in lines]


def _count(n: int, word: str, plural: str = "s") -> str:
    return f"{n} {word}{plural if n != 1 else ''}"


def _draw_footer(sheet: Sheet, grammar: Grammar) -> None:
    if grammar.simulated:
        x = WIDTH_IN - MARGIN_IN
        sheet.write(x, 0.2, "learnt from simulated data", 9, color="#b3402f", ha="right")
