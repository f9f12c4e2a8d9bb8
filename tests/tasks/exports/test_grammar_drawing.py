"""The drawing of a grammar: to scale, every probability in its place, the same each time."""

import re
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest

from grammars.library import library
from grammars.model import Grammar, Module, Part, ReferenceLine, Rule
from grammars.reading import read_grammar
from tasks.exports.grammar_drawing import draw_grammar
from tasks.exports.grammar_matrix import DEEP
from tasks.exports.sheet import MARGIN_IN, WIDTH_IN, text_width


def grammar(n: int = 3) -> Grammar:
    """Rules of 2.4 m, 4.8 m and a unit of 19.2 m, the last the likeliest; more if asked for."""
    unit = (Part("executive", 7.2, 0.05), Part("assistant", 4.8, 0.05), Part("executive", 7.2, 0.1))
    rules = [
        Rule("small", (Part("office", 2.4, 0.1),), 0.2),
        Rule("office", (Part("office", 4.8, 0.1),), 0.3),
        Rule("unit", unit, 0.5),
    ]
    rules += [Rule(f"more{i}", (Part("office", 3.0, 0.1),), 0.0) for i in range(n - 3)]
    relation = np.zeros((n, n))
    relation[:, :3] = (0.11, 0.22, 0.67)
    lines = (
        ReferenceLine("a", "1", (0, 0), (20, 0)),
        ReferenceLine("b", "1", (20, 2), (0, 2)),
        ReferenceLine("c", "2", (0, 0), (0, 9)),
    )
    return Grammar(
        "g",
        "office",
        "about $1 of it",
        (),
        True,
        ("office", "executive", "assistant"),
        tuple(rules),
        relation,
        0.125,
        0.01,
        lines=lines,
        module=Module(2.4, 0.03),
    )


def sheet_of(grammar, folder, monkeypatch):
    sheets = []
    with monkeypatch.context() as patch:
        patch.setattr(
            "tasks.exports.grammar_drawing.save", lambda sheet, path: sheets.append(sheet)
        )
        draw_grammar(grammar, folder / "g.svg", folder / "g.png")
    return sheets[0]


def texts_of(sheet):
    """Text and place, in inches."""
    texts = [(t.get_text(), t.get_position()) for t in sheet.axes.texts]
    size = np.array((WIDTH_IN, sheet.height_in))
    return texts + [(t.get_text(), tuple(t.get_position() * size)) for t in sheet.figure.texts]


CASES = {
    "three": grammar(),
    "one": replace(
        grammar(),
        rules=(replace(grammar().rules[0], p_apriori=1.0),),
        classes=("office",),
        p_relation=np.ones((1, 1)),
        lines=(),
        module=None,
    ),
    "many": grammar(40),
    "long name": replace(
        grammar(), rules=(*grammar().rules[:2], replace(grammar().rules[2], id="unit" * 30))
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_every_grammar_is_drawn_alike_each_time(case, tmp_path):
    for name in ("a", "b"):
        draw_grammar(CASES[case], tmp_path / f"{name}.svg", tmp_path / f"{name}.png")
    for suffix in ("svg", "png"):
        first, second = (tmp_path / f"{name}.{suffix}" for name in ("a", "b"))
        assert first.read_bytes() == second.read_bytes()
    svg = (tmp_path / "a.svg").read_text()
    assert ET.fromstring(svg).tag.endswith("svg") and not re.search(r"dc:date|matplotlib v", svg)


@pytest.mark.parametrize("case", [*CASES, *library()])
def test_nothing_is_written_beyond_the_sheet(case, tmp_path, monkeypatch):
    found = CASES[case] if case in CASES else read_grammar(library()[case])
    sheet = sheet_of(found, tmp_path, monkeypatch)
    for text in sheet.axes.texts:
        x, y = text.get_position()
        long = text_width(text.get_text(), text.get_fontsize()) / 72
        upright = text.get_rotation() == 90
        left = {"left": 0.0, "center": 0.5, "right": 1.0}[text.get_ha()] * long
        low, high = (x, x) if upright else (x - left, x - left + long)
        assert low > MARGIN_IN - 0.2 and high < WIDTH_IN - 0.1
        assert y > 0 and y + (long if upright else 0) < sheet.height_in


def test_rooms_are_drawn_to_one_scale(tmp_path, monkeypatch):
    sheet = sheet_of(grammar(), tmp_path, monkeypatch)
    rooms = [
        patch.get_extents().transformed(sheet.axes.transData.inverted())
        for patch in sheet.axes.patches
        if patch.get_linewidth() == 0.7
    ]
    widths = [room.width for room in rooms]
    true = [7.2, 4.8, 7.2, 4.8, 2.4]  # the likeliest rule first
    scale = widths[0] / 7.2
    assert widths == pytest.approx([scale * width for width in true])
    assert rooms[1].x0 == pytest.approx(rooms[0].x1)
    ticks = {t: p[0] for t, p in texts_of(sheet) if re.fullmatch(r"\d+( m)?", t)}
    assert ticks["10"] - ticks["0 m"] == pytest.approx(10 * scale)


def test_every_probability_stands_in_its_row_and_column(tmp_path, monkeypatch):
    texts = texts_of(sheet_of(grammar(), tmp_path, monkeypatch))
    by_place = [(t, p) for t, p in texts if re.fullmatch(r"\.\d\d", t)]
    rows = sorted({round(p[1], 6) for _, p in by_place}, reverse=True)
    found = [
        [t for t, p in sorted(by_place, key=lambda item: item[1][0]) if round(p[1], 6) == y]
        for y in rows
    ]
    # unit, office, small: the order of their a-priori probabilities, which stand below
    assert found == [[".67", ".22", ".11"]] * 3 + [[".50", ".30", ".20"]]


def test_the_greatest_probability_is_darkest(tmp_path, monkeypatch):
    sheet = sheet_of(grammar(), tmp_path, monkeypatch)
    colours = np.array([row.get_facecolors()[:, :3] for row in sheet.axes.collections])
    shares = np.array([[0.67, 0.22, 0.11]] * 3 + [[0.5, 0.3, 0.2]]) / 0.67
    assert colours == pytest.approx(1 - shares[..., None] * (1 - DEEP))


def test_the_sheet_says_what_a_reader_must_know(tmp_path, monkeypatch):
    texts = {t for t, _ in texts_of(sheet_of(grammar(), tmp_path, monkeypatch))}
    assert {"g", "about $1 of it", "learnt from simulated data", "0.500"} <= texts
    facts = "office  ·  3 rules over 3 classes  ·  partitions 0.125 m  ·  facade module 2.40 m"
    assert facts in texts
    plain = replace(grammar(), simulated=False, lines=())
    texts = {t for t, _ in texts_of(sheet_of(plain, tmp_path, monkeypatch))}
    assert "learnt from simulated data" not in texts and "Reference lines" not in texts
