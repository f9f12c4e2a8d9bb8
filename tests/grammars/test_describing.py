"""The text of a grammar: what it says, and that its bars are to scale."""

from dataclasses import replace

import numpy as np

from grammars.describing import BAR, describe
from grammars.library import find_grammar
from grammars.model import Grammar, Part, ReferenceLine, Rule, WallKind
from grammars.reading import read_grammar


def grammar() -> Grammar:
    rules = (
        Rule("small", (Part("office", 2.4, 0.05),), 0.6),
        Rule("unit", (Part("lab", 4.8, 0.05), Part("store", 7.2, 0.1)), 0.4),
    )
    return Grammar(
        "g",
        "office",
        "by hand",
        (),
        False,
        ("office", "lab", "store"),
        rules,
        np.array([[0.25, 0.75], [1.0, 0.0]]),
        0.125,
        0.01,
        lines=(ReferenceLine("l", "3", (0, 0), (5, 0)),),
    )


def test_the_text_tells_rules_walls_followers_and_source():
    text = describe(grammar())
    assert text.startswith("g: office (no simulated data)\nby hand\n")
    assert "learnt from no plan: written by hand" in text
    assert "partitions: 0.125 ± 0.010 m" in text and "reference lines: 1, storey 3" in text
    assert "Space → lab 4.80±0.05 store 7.20±0.10 Space" in text
    lines = text.splitlines()
    assert "  small  unit 0.75, small 0.25" in lines and "  unit   small 1.00" in lines
    assert lines[-1] == "  unit   small 1.00" and text.endswith("\n")


def test_the_text_tells_of_walls_where_they_are_known():
    known = replace(grammar(), outer_wall=WallKind(0.3, 0.02))
    assert "outer walls: 0.300 ± 0.020 m" in describe(known)
    assert "corridor walls" not in describe(known)


def test_rules_stand_in_the_order_of_their_probability_with_bars_to_scale():
    swapped = grammar()
    rules = (replace(swapped.rules[0], p_apriori=0.4), replace(swapped.rules[1], p_apriori=0.6))
    rows = [row for row in describe(replace(swapped, rules=rules)).splitlines() if "Space" in row]
    assert [row.split()[:2] for row in rows] == [["0.600", "unit"], ["0.400", "small"]]
    bars = [row[row.index("├") + 1 : row.index("┤")] for row in rows]
    assert [len(room) for room in bars[0].split("┼")] == [10, 14]  # of 24 characters
    assert len(bars[1]) == 5 and BAR == 24


def test_long_lists_of_sources_are_cut_short():
    text = describe(read_grammar(find_grammar("office")))
    assert "(simulated data)" in text and "learnt from 16 storeys" in text
    assert "and 10 more buildings" in text and "facade module: 2.400" in text
