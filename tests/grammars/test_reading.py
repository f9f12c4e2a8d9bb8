"""Grammar files: what is wrong is named with its line; what is right comes back as it was."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grammars.model import Grammar, Module, Origin, Part, ReferenceLine, Rule, WallKind
from grammars.reading import from_toml, read_grammar
from grammars.writing import to_toml, write_grammar
from storage.errors import InputError

TEXT = """\
name = "test"
building_type = "office"
about = "by hand"
simulated = false
evidence = 10
classes = ["office", "executive", "assistant"]
learnt_from = [
    { building = "b", storey = "1", digest = "aa" },
]

[partition]
thickness_m = 0.1
spread_m = 0.02

[module]
width_m = 2.4
spread_m = 0.03

[[rules]]
id = "r1"
type = "small office"
p_apriori = 0.6
parts = [{ class = "office", width_m = 2.4, spread_m = 0.05, depth_m = 5, depth_spread_m = 0.2 }]

[[rules]]
id = "r5"
type = "two executives with assistant's office"
note = "Table 1"
p_apriori = 0.4
parts = [
    { class = "executive", width_m = 7.2, spread_m = 0.05 },
    { class = "assistant", width_m = 4.8, spread_m = 0.05 },
    { class = "executive", width_m = 7.2, spread_m = 0.05 },
]

[relations.r1]
r1 = 0.7
r5 = 0.3

[relations.r5]
r1 = 1

[[lines]]
id = "south"
storey = "1"
start = [0, 0]
end = [21.6, 0]
"""


def test_a_file_is_read_as_it_stands(tmp_path):
    (tmp_path / "g.toml").write_text(TEXT)
    grammar = read_grammar(tmp_path / "g.toml")
    assert (grammar.name, grammar.building_type, grammar.simulated) == ("test", "office", False)
    assert grammar.learnt_from == (Origin("b", "1", "aa"),)
    assert grammar.classes == ("office", "executive", "assistant")
    assert grammar.rules[0] == Rule(
        "r1", (Part("office", 2.4, 0.05, 5.0, 0.2),), 0.6, "small office"
    )
    assert grammar.rules[1].width_m == pytest.approx(19.2)
    assert [part.class_ for part in grammar.rules[1].parts] == [
        "executive",
        "assistant",
        "executive",
    ]
    assert grammar.rules[1].note == "Table 1"
    assert grammar.p_relation.tolist() == [[0.7, 0.3], [1.0, 0.0]]
    assert grammar.p_apriori.tolist() == [0.6, 0.4]
    assert (grammar.partition_m, grammar.partition_spread_m) == (0.1, 0.02)
    assert grammar.module == Module(2.4, 0.03) and grammar.evidence == 10
    line = grammar.lines[0]
    assert (line.id, line.storey, line.start, line.end) == ("south", "1", (0, 0), (21.6, 0))


WRONG = {
    "unknown key": ('type = "small', 'typ = "small', 21, "'typ'", "did you mean 'type'?"),
    "unknown key at the top": ("evidence", "evidenz", 5, "'evidenz'", "did you mean 'evidence'?"),
    "unknown key without a like": ('storey = "1"\nstart', "xyz = 1\nstart", 45, "'xyz'", "known:"),
    "missing field": ("p_apriori = 0.6\n", "", 19, "rule 'r1': 'p_apriori' is missing", "add it"),
    "missing name": ('name = "test"\n', "", 1, "'name' is missing", "add it"),
    "missing table": ("[partition]", "[module.x]", 1, "'partition' is missing", "add it"),
    "text for a number": ("= 0.6", '= "0.6"', 22, "'p_apriori' is \"0.6\"", "without quotes"),
    "number for a text": ('about = "by hand"', "about = 3", 3, "'about' is 3", "text in quotes"),
    "empty text": ('"test"', '" "', 1, "'name' is \" \"", "not empty"),
    "text for a flag": ("= false", '= "no"', 4, "'simulated' is \"no\"", "true or false"),
    "true for a number": ("= 0.6", "= true", 22, "'p_apriori' is true", "finite number"),
    "infinite": ("thickness_m = 0.1", "thickness_m = inf", 12, "is inf", "finite number"),
    "not a number": ("thickness_m = 0.1", "thickness_m = nan", 12, "is nan", "finite number"),
    "no list": ("[0, 0]", "0", 46, "'start' is 0", "[x, y]"),
    "no table": (
        "[partition]\nthickness_m = 0.1\nspread_m = 0.02\n",
        "partition = 1\n",
        *(11, "'partition' is 1", "expected a table, [partition]"),
    ),
    "class twice": ('"assistant"]', '"office"]', 6, "is named twice", "once"),
    "class that no rule has": ('"assistant"]', '"assistant", "lab"]', 6, '"lab" is in no rule', ""),
    "class of no name": ('"assistant"]', "3]", 6, "'classes' has 3", "names of room classes"),
    "unknown class": ('"assistant", w', '"asistant", w', 32, '"asistant"', "office, executive"),
    "rule twice": ('id = "r5"', 'id = "r1"', 26, '"r1" is taken', "another id"),
    "rule with a blank": ('id = "r5"', 'id = "r 5"', 26, '"r 5"', "letters, digits"),
    "width zero": ("width_m = 4.8", "width_m = 0", 32, "part 2: 'width_m' is 0", "more than zero"),
    "width below zero": ("width_m = 4.8", "width_m = -4.8", 32, "is -4.8", "more than zero"),
    "spread zero": ("0.03\n", "0.0\n", 17, "'spread_m' is 0.0", "more than zero"),
    "spread too wide": ("2.4, spread_m = 0.05", "2.4, spread_m = 3", 23, "is 3", "deviation"),
    "depth without spread": (
        ", depth_spread_m = 0.2",
        "",
        23,
        "'depth_spread_m' is missing",
        "both",
    ),
    "probability over one": ("= 0.6", "= 1.2", 22, "'p_apriori' is 1.2", "from 0 to 1"),
    "probability below zero": ("r1 = 0.7", "r1 = -0.7", 37, "'r1' is -0.7", "from 0 to 1"),
    "a-priori sum": ("= 0.6", "= 0.55", 19, "sums to 0.95, expected 1", "nothing is normalised"),
    "row sum": ("r5 = 0.3", "r5 = 0.31", 36, "relations of 'r1': sums to 1.01", "normalised"),
    "unknown rule in a row": ("r5 = 0.3", "r6 = 0.3", 38, "'r6' is no rule", "r1, r5"),
    "row of an unknown rule": ("[relations.r5]", "[relations.r6]", 40, "'r6' is no rule", "r1, r5"),
    "no row for a rule": (
        "[relations.r5]\nr1 = 1\n",
        "",
        36,
        "'r5' has no relations",
        "add [relat",
    ),
    "row in a row": ("r1 = 1\n", "r1 = { r1 = 1 }\n", 41, "'r1' is", "without quotes"),
    "empty parts": (
        re.compile(r"parts = \[\{.*\}\]"),
        "parts = []",
        23,
        "'parts' is empty",
        "room",
    ),
    "no rules": (re.compile(r"\[\[rules\]\].*?(?=\[\[lines)", re.S), "", 1, "'rules'", "add it"),
    "degenerate line": ("[21.6, 0]", "[0.05, 0]", 47, "line 'south': 'end' is 0.05 m", "0.1 m or"),
    "three coordinates": ("[21.6, 0]", "[21.6, 0, 0]", 47, "'end' is", "[x, y]"),
    "space to the right": (
        "end = [21.6, 0]\n",
        "end = [21.6, 0]\nspace = [[0, -5], [21.6, -5], [21.6, -0.2], [0, -0.2]]\n",
        48,
        "line 'south': 'space' is no outline of rooms to the left",
        "corners at the line, from start to end",
    ),
    "space walked the wrong way": (
        "end = [21.6, 0]\n",
        "end = [21.6, 0]\nspace = [[0, 5], [21.6, 5], [21.6, 0.2], [0, 0.2]]\n",
        48,
        "'space' is no outline",
        "then those at the rear, back",
    ),
    "space of three corners": (
        "end = [21.6, 0]\n",
        "end = [21.6, 0]\nspace = [[0, 0.2], [21.6, 0.2], [21.6, 5]]\n",
        48,
        "'space' is [[0, 0.2]",
        "expected 4 points",
    ),
    "module that divides nothing": (
        "width_m = 2.4\nspread_m",
        "width_m = 2.9\nspread_m",
        16,
        "0%",
        "",
    ),
    "module of any width": ("spread_m = 0.03", "spread_m = 1.3", 17, "half the module", "smaller"),
    "plan twice": (
        "\n]\n\n[part",
        '\n{ building = "b", storey = "1", digest = "aa" }]\n\n[part',
        9,
        "",
        "",
    ),
    "evidence below zero": ("evidence = 10", "evidence = -1", 5, "'evidence' is -1", "0 or more"),
    "partition of no thickness": ("thickness_m = 0.1", "thickness_m = 0", 12, "is 0", "more than"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_named_with_file_line_and_remedy(case):
    old, new, line, wrong, remedy = WRONG[case]
    text = old.sub(new, TEXT) if isinstance(old, re.Pattern) else TEXT.replace(old, new, 1)
    assert text != TEXT
    with pytest.raises(InputError) as caught:
        from_toml(text, "mine.toml")
    assert caught.value.path == "mine.toml"
    assert caught.value.field.startswith(f"line {line}: ")
    assert wrong in caught.value.field
    assert remedy in caught.value.remedy


def test_walls_and_the_space_of_a_line_are_read():
    walls = "[corridor_wall]\nthickness_m = 0.24\nspread_m = 0.01\n\n[module]"
    space = "end = [21.6, 0]\nspace = [[0, 0.2], [21.6, 0.2], [21.6, 5], [0, 5]]\n"
    text = TEXT.replace("[module]", walls).replace("end = [21.6, 0]\n", space)
    grammar = from_toml(text, "g")
    assert (grammar.corridor_wall, grammar.outer_wall) == (WallKind(0.24, 0.01), None)
    assert grammar.lines[0].space == ((0, 0.2), (21.6, 0.2), (21.6, 5), (0, 5))
    with pytest.raises(InputError, match=r"line 16: corridor_wall: 'thickness_m' is 0"):
        from_toml(text.replace("0.24", "0"), "g")


def test_a_text_that_is_no_toml_is_refused_with_its_line():
    with pytest.raises(InputError, match=r"g.toml: is no TOML: .*line 2.*; correct that line"):
        from_toml('name = "a"\nb = = 1\n', "g.toml")


def test_a_file_that_cannot_be_read_is_named(tmp_path):
    with pytest.raises(InputError, match=r"none.toml: cannot be read \(No such file"):
        read_grammar(tmp_path / "none.toml")
    (tmp_path / "latin.toml").write_bytes(b'name = "\xe9"')
    with pytest.raises(InputError, match=r"is no text .*UTF-8"):
        read_grammar(tmp_path / "latin.toml")


def test_thirds_to_three_decimals_pass_as_they_are():
    text = TEXT.replace("r1 = 0.7\nr5 = 0.3", "r1 = 0.333\nr5 = 0.666")
    assert from_toml(text, "g").p_relation[0].tolist() == [0.333, 0.666]


@pytest.mark.parametrize("p", [0.1, 0.59, 0.61])
def test_a_grammar_whose_probabilities_do_not_sum_to_one_is_not_written(p, tmp_path):
    grammar = from_toml(TEXT, "g")
    rules = (replace(grammar.rules[0], p_apriori=p), grammar.rules[1])
    with pytest.raises(InputError, match="sums to"):
        write_grammar(replace(grammar, rules=rules), tmp_path / "g.toml")
    assert not list(tmp_path.iterdir())


lengths = st.floats(0.2, 50)
texts = st.text(min_size=1, max_size=20).filter(lambda t: t.strip() != "")
spreads = st.floats(1e-6, 0.19)
depths = st.none() | st.tuples(lengths, spreads)


def shares(n: int) -> st.SearchStrategy[np.ndarray]:
    """n probabilities, some of them zero, that sum to one."""
    weights = st.lists(st.integers(0, 1000), min_size=n, max_size=n).filter(any)
    return weights.map(lambda w: np.array(w) / sum(w))


@st.composite
def grammars(draw) -> Grammar:
    classes = tuple(draw(st.lists(texts, min_size=1, max_size=4, unique=True)))
    n = draw(st.integers(1, 5)) + len(classes)
    p_apriori = draw(shares(n))
    rules = []
    for i in range(n):
        # every class is in a rule
        names = [classes[i % len(classes)], *draw(st.lists(st.sampled_from(classes), max_size=2))]
        parts = []
        for name in names:
            depth = draw(depths)
            parts.append(Part(name, draw(lengths), draw(spreads), *(depth or (None, None))))
        note = draw(st.just("") | texts)
        rules.append(Rule(f"r-{i}_x", tuple(parts), float(p_apriori[i]), note, note[::-1]))
    points = st.tuples(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4))
    lines = [
        ReferenceLine(f"l{i}", draw(texts), (x, y), (x + draw(lengths), y), draw(spaces(x, y)))
        for i, (x, y) in enumerate(draw(st.lists(points, max_size=3)))
    ]
    origins = draw(st.lists(st.builds(Origin, texts, texts, texts), max_size=2, unique=True))
    about = draw(texts | st.just("two\nlines\n") | st.just('a\n"""b') | st.just("a\n\\b"))
    return Grammar(
        draw(texts),
        draw(texts),
        about,
        tuple(origins),
        draw(st.booleans()),
        classes,
        tuple(rules),
        np.array([draw(shares(n)) for _ in range(n)]),
        draw(lengths),
        draw(lengths),
        draw(st.floats(0, 1e6)),
        tuple(lines),
        None,
        *(draw(st.none() | st.builds(WallKind, lengths, lengths)) for _ in range(2)),
    )


@st.composite
def spaces(draw, x: float, y: float):
    """Return the corners of a row over a line that runs along x, or None."""
    low, high = y + draw(st.floats(0.1, 0.5)), y + draw(st.floats(3, 9))
    right = x + draw(st.floats(2, 90))
    return draw(st.none() | st.just(((x, low), (right, low), (right + 1, high), (x - 1, high))))


@settings(max_examples=100, deadline=None)
@given(grammars())
def test_a_grammar_comes_back_from_its_file_to_the_last_bit(grammar):
    text = to_toml(grammar)
    back = from_toml(text, "g.toml")
    for name in Grammar.__dataclass_fields__:
        before, after = getattr(grammar, name), getattr(back, name)
        if name == "p_relation":
            assert after.dtype == np.float64 and after.tolist() == before.tolist()
        elif name == "lines":
            assert [vars(line) for line in after] == [vars(line) for line in before]
        else:
            assert after == before
    assert to_toml(back) == text


def test_the_text_is_what_a_planner_would_write(tmp_path):
    grammar = from_toml(TEXT, "g")
    write_grammar(grammar, tmp_path / "g.toml")
    text = (tmp_path / "g.toml").read_text()
    assert "[relations.r1]\nr1 = 0.7\nr5 = 0.3\n\n[relations.r5]\nr1 = 1.0\n" in text
    assert '    { class = "assistant", width_m = 4.8, spread_m = 0.05 },\n' in text
    assert max(map(len, text.splitlines())) <= 110
