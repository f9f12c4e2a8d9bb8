"""Reading a grammar file: every fault is an error with file, line, field and remedy."""

import re
import tomllib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from shapely import Polygon

from grammars.fields import Fields, is_number, shown
from grammars.model import Grammar, Module, Origin, Part, Point, ReferenceLine, Rule, WallKind
from grammars.positions import line_numbers
from storage.errors import InputError

SUM_TOLERANCE = 1e-3
"""How far a sum of probabilities may be from one: thirds written to three decimals pass. Nothing is
normalised."""
LINE_LEAST_M = 0.1
"""Shortest reference line: no room is narrower."""
MODULE_SPREADS = 4.0
"""A rule's width may be off the facade module by so many of the module's spreads..."""
MODULE_SHARE = 0.5
"""...in rules that make up at least this share of the rooms, or the module is none."""

_FIELDS = (
    *("name", "building_type", "about", "simulated", "evidence", "classes", "partition"),
    *("corridor_wall", "outer_wall", "learnt_from", "module", "rules", "relations", "lines"),
)
_ID = re.compile(r"[A-Za-z0-9_-]+")


def read_grammar(path: Path | str) -> Grammar:
    """Read a grammar; raise InputError naming file, line, field and remedy if anything is wrong."""
    try:
        text = Path(path).read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})", "check the path") from error
    except UnicodeDecodeError as error:
        raise InputError(path, f"is no text ({error})", "save it as UTF-8") from error
    return from_toml(text, path)


def from_toml(text: str, source: Path | str) -> Grammar:
    """Return the grammar of a TOML text; `source` names it in errors."""
    try:
        values = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(source, f"is no TOML: {error}", "correct that line") from error
    top = Fields(source, line_numbers(text), (), "", values)
    top.only(_FIELDS)
    name, building_type, about = (top.text(f) for f in ("name", "building_type", "about"))
    simulated, evidence = top.flag("simulated"), top.number("evidence", 0)
    classes = _classes(top)
    rules = _rules(top, classes)
    partition = _wall(top.table("partition", "partition"))
    return Grammar(
        name=name,
        building_type=building_type,
        about=about,
        learnt_from=_origins(top),
        simulated=simulated,
        classes=classes,
        rules=rules,
        p_relation=_relations(top, rules),
        partition_m=partition.thickness_m,
        partition_spread_m=partition.spread_m,
        corridor_wall=_optional_wall(top, "corridor_wall"),
        outer_wall=_optional_wall(top, "outer_wall"),
        evidence=evidence,
        lines=_lines(top),
        module=_module(top, rules),
    )


def _origins(top: Fields) -> tuple[Origin, ...]:
    found = []
    for table in top.tables("learnt_from", "learnt_from", optional=True):
        table.only(("building", "storey", "digest"))
        origin = Origin(*(table.text(name) for name in ("building", "storey", "digest")))
        if origin in found:
            table.fail("digest", "and its storey are named before", "name each plan once")
        found.append(origin)
    return tuple(found)


def _classes(top: Fields) -> tuple[str, ...]:
    values = top.elements("classes")
    for i, value in enumerate(values):
        place = ("classes", i)
        if not isinstance(value, str) or not value.strip():
            top.fail_at(place, f"'classes' has {shown(value)}", "expected names of room classes")
        if value in values[:i]:
            top.fail_at(place, f"class {shown(value)} is named twice", "name each class once")
    return tuple(values)


def _rules(top: Fields, classes: tuple[str, ...]) -> tuple[Rule, ...]:
    rules: list[Rule] = []
    for table in top.tables("rules", "rule"):
        rule = _rule(table, classes)
        if rule.id in (r.id for r in rules):
            table.fail("id", f"{shown(rule.id)} is taken by an earlier rule", "give it another id")
        rules.append(rule)
    if not rules:
        top.fail("rules", "has no rule", "add one, [[rules]]")
    total = sum(rule.p_apriori for rule in rules)
    if abs(total - 1) > SUM_TOLERANCE + 1e-9:
        wrong = f"'p_apriori' of all rules sums to {total:.6g}, expected 1"
        top.fail_at(("rules",), wrong, _sum_remedy())
    used = {part.class_ for rule in rules for part in rule.parts}
    for i, class_ in enumerate(classes):
        if class_ not in used:
            wrong = f"class {shown(class_)} is in no rule"
            top.fail_at(("classes", i), wrong, "add a rule for it, or take it out")
    return tuple(rules)


def _rule(table: Fields, classes: tuple[str, ...]) -> Rule:
    id_ = table.text("id")
    if not _ID.fullmatch(id_):
        remedy = "use letters, digits, '_' and '-' alone: relations name it as a key"
        table.fail("id", f"is {shown(id_)}", remedy)
    table = table.named(f"rule '{id_}'")
    table.only(("id", "type", "p_apriori", "parts", "note"))
    parts = tuple(
        _part(part.named(f"rule '{id_}', part {i + 1}"), classes)
        for i, part in enumerate(table.tables("parts", "part"))
    )
    if not parts:
        table.fail("parts", "is empty", "give the rule its room, or the rooms of its unit")
    p_apriori = table.number("p_apriori", 0, 1)
    return Rule(id_, parts, p_apriori, table.text("type", ""), table.text("note", ""))


def _part(table: Fields, classes: tuple[str, ...]) -> Part:
    table.only(("class", "width_m", "spread_m", "depth_m", "depth_spread_m"))
    class_ = table.text("class")
    if class_ not in classes:
        remedy = f"add it to 'classes', which are {', '.join(classes)}"
        table.fail("class", f"is {shown(class_)}, and no class has that name", remedy)
    width, spread = table.length("width_m"), table.length("spread_m")
    if spread >= width:
        wrong = f"is {spread:g}, as much as the width"
        table.fail("spread_m", wrong, "give the standard deviation of the width, metres")
    depth = table.optional_length("depth_m")
    depth_spread = table.optional_length("depth_spread_m")
    if (depth is None) != (depth_spread is None):
        names = ["depth_m", "depth_spread_m"]
        missing, there = names if depth is None else names[::-1]
        table.fail(missing, f"is missing beside '{there}'", "give both, or neither: any depth")
    return Part(class_, width, spread, depth, depth_spread)


def _relations(top: Fields, rules: tuple[Rule, ...]) -> NDArray[np.float64]:
    """Return P_r(r_j | r_i) in row i and column j; what a row does not name is zero."""
    index = {rule.id: i for i, rule in enumerate(rules)}
    found = np.zeros((len(rules), len(rules)))
    table = top.table("relations", "relations")
    _know(table, index)
    for id_, i in index.items():
        if id_ not in table.values:
            table.fail(id_, "has no relations", f"add [relations.{id_}]: what follows the rule")
        row = table.table(id_, f"relations of '{id_}'")
        _know(row, index)
        for follower in row.values:
            found[i, index[follower]] = row.number(follower, 0, 1)
        total = float(found[i].sum())
        if abs(total - 1) > SUM_TOLERANCE + 1e-9:
            row.fail_at(row.place, f"sums to {total:.6g}, expected 1", _sum_remedy())
    return found


def _know(table: Fields, rules: dict[str, int]) -> None:
    for id_, value in table.values.items():
        if id_ not in rules:
            table.fail(id_, "is no rule", f"correct it; rules are {', '.join(rules)}")
        if not (isinstance(value, dict) or is_number(value)):
            table.fail(id_, f"is {shown(value)}", "expected a probability")


def _wall(table: Fields) -> WallKind:
    table.only(("thickness_m", "spread_m"))
    return WallKind(table.length("thickness_m"), table.length("spread_m"))


def _optional_wall(top: Fields, name: str) -> WallKind | None:
    table = top.optional_table(name, name)
    return None if table is None else _wall(table)


def _lines(top: Fields) -> tuple[ReferenceLine, ...]:
    lines: list[ReferenceLine] = []
    for table in top.tables("lines", "reference line", optional=True):
        table.only(("id", "storey", "start", "end", "space"))
        id_ = table.text("id")
        table = table.named(f"reference line '{id_}'")
        if id_ in (line.id for line in lines):
            table.fail("id", "is taken by an earlier line", "give it another id")
        start, end = table.point("start"), table.point("end")
        length = float(np.hypot(end[0] - start[0], end[1] - start[1]))
        if length < LINE_LEAST_M:
            remedy = f"expected a line of {LINE_LEAST_M:g} m or more, from start to end"
            table.fail("end", f"is {length:g} m from 'start'", remedy)
        space = _space(table, start, end) if "space" in table.values else None
        lines.append(ReferenceLine(id_, table.text("storey"), start, end, space))
    return tuple(lines)


def _space(table: Fields, start: Point, end: Point) -> tuple[Point, Point, Point, Point]:
    """Return the corners of a row: a simple outline to the left of its line, anticlockwise."""
    corners = table.points("space", 4)
    ring = np.array(corners)
    ahead = np.array(end) - start
    left = np.array([-ahead[1], ahead[0]]) / np.hypot(*ahead)
    outline = Polygon(ring)
    beside = bool(((ring - start) @ left > -LINE_LEAST_M).all())
    if not (outline.is_valid and outline.exterior.is_ccw and beside):
        remedy = "expected its corners at the line, from start to end, then those at the rear, back"
        table.fail("space", "is no outline of rooms to the left of the line", remedy)
    a, b, c, d = corners
    return a, b, c, d


def _module(top: Fields, rules: tuple[Rule, ...]) -> Module | None:
    table = top.optional_table("module", "module")
    if table is None:
        return None
    table.only(("width_m", "spread_m"))
    module = Module(table.length("width_m"), table.length("spread_m"))
    if module.spread_m >= module.width_m / 2:
        wrong = f"is {module.spread_m:g}, half the module or more: any width would do"
        table.fail("spread_m", wrong, "give a smaller spread, or take the module out")
    fitting = sum(
        rule.p_apriori * len(rule.parts) * _share_on(module, rule) for rule in rules
    ) / sum(rule.p_apriori * len(rule.parts) for rule in rules)
    if fitting < MODULE_SHARE:
        wrong = f"of {module.width_m:g} m divides the widths of {fitting:.0%} of the rooms only"
        table.fail("width_m", wrong, "correct the module or the widths, or take the module out")
    return module


def _share_on(module: Module, rule: Rule) -> float:
    """Return the share of a rule's rooms whose width is a multiple of the module."""
    widths = np.array([part.width_m for part in rule.parts])
    multiples = np.maximum(np.rint(widths / module.width_m), 1)
    off = np.abs(widths - multiples * module.width_m)
    return float(np.mean(off <= MODULE_SPREADS * module.spread_m + 1e-9))


def _sum_remedy() -> str:
    return f"correct them; more than {SUM_TOLERANCE:g} off is an error, nothing is normalised"
