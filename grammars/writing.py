"""Writing a grammar as a TOML text that a person can read and edit: same grammar, same bytes."""

import json
from pathlib import Path

import numpy as np

from grammars.model import Grammar, Part, ReferenceLine, Rule
from grammars.reading import from_toml
from storage.files import write_whole

_HEAD = """\
# A formal indoor grammar (Sec. 4.2.1). Widths run along a corridor, between the centre lines of the
# walls at a room's sides; metres. Probabilities sum to one: over all rules, and over what follows a
# rule. What is not named has probability 0. Comments are lost when a program writes this file.
"""


def write_grammar(grammar: Grammar, path: Path | str) -> None:
    """Write a grammar beside its target, sync, rename; one that could not be read is refused.

    Raises
    ------
    InputError
        If the grammar is wrong in itself, as when its probabilities do not sum to one.
    StoreError
        If the file cannot be written.
    """
    text = to_toml(grammar)
    from_toml(text, path)
    write_whole(Path(path), text.encode(), "grammar")


def to_toml(grammar: Grammar) -> str:
    """Return the text of a grammar; `from_toml` gives every number back as it was."""
    blocks = [
        _HEAD + _top(grammar),
        f"[partition]  # walls between rooms\nthickness_m = {_number(grammar.partition_m)}\n"
        f"spread_m = {_number(grammar.partition_spread_m)}",
    ]
    walls = (
        ("corridor_wall", "between corridors and rooms", grammar.corridor_wall),
        ("outer_wall", "around the storey", grammar.outer_wall),
    )
    blocks += [
        f"[{name}]  # {what}\nthickness_m = {_number(wall.thickness_m)}\n"
        f"spread_m = {_number(wall.spread_m)}"
        for name, what, wall in walls
        if wall is not None
    ]
    if grammar.module is not None:
        blocks.append(
            f"[module]  # of the facade\nwidth_m = {_number(grammar.module.width_m)}\n"
            f"spread_m = {_number(grammar.module.spread_m)}"
        )
    blocks += [_rule(rule) for rule in grammar.rules]
    blocks += [_relations(grammar, i) for i in range(len(grammar.rules))]
    blocks += [_line(line) for line in grammar.lines]
    return "\n\n".join(blocks) + "\n"


def _top(grammar: Grammar) -> str:
    return "\n".join(
        (
            f"name = {_text(grammar.name)}",
            f"building_type = {_text(grammar.building_type)}",
            f"about = {_long_text(grammar.about)}",
            f"simulated = {str(grammar.simulated).lower()}",
            f"evidence = {_number(grammar.evidence)}  # applications of rules it rests on",
            "classes = [",
            *(f"    {_text(class_)}," for class_ in grammar.classes),
            "]",
            *_origins(grammar),
        )
    )


def _origins(grammar: Grammar) -> list[str]:
    rows = [
        f"    {{ building = {_text(origin.building)}, storey = {_text(origin.storey)}, "
        f"digest = {_text(origin.digest)} }},"
        for origin in grammar.learnt_from
    ]
    return ["learnt_from = [", *rows, "]"] if rows else []


def _rule(rule: Rule) -> str:
    lines = ["[[rules]]", f"id = {_text(rule.id)}"]
    lines += [f"type = {_text(rule.type)}"] if rule.type else []
    lines += [f"note = {_text(rule.note)}"] if rule.note else []
    lines += [f"p_apriori = {_number(rule.p_apriori)}", "parts = ["]
    lines += [f"    {_part(part)}," for part in rule.parts]
    return "\n".join((*lines, "]"))


def _part(part: Part) -> str:
    fields = [f"class = {_text(part.class_)}", f"width_m = {_number(part.width_m)}"]
    fields.append(f"spread_m = {_number(part.spread_m)}")
    if part.depth_m is not None and part.depth_spread_m is not None:
        fields.append(f"depth_m = {_number(part.depth_m)}")
        fields.append(f"depth_spread_m = {_number(part.depth_spread_m)}")
    return f"{{ {', '.join(fields)} }}"


def _relations(grammar: Grammar, i: int) -> str:
    """Return what follows a rule, the likeliest first."""
    row = grammar.p_relation[i]
    order = [int(j) for j in np.argsort(-row, kind="stable") if row[j] > 0]
    lines = (f"{grammar.rules[j].id} = {_number(row[j])}" for j in order)
    return "\n".join((f"[relations.{grammar.rules[i].id}]", *lines))


def _line(line: ReferenceLine) -> str:
    lines = ["[[lines]]", f"id = {_text(line.id)}", f"storey = {_text(line.storey)}"]
    lines += [f"start = {_numbers(line.start)}", f"end = {_numbers(line.end)}"]
    if line.space is not None:
        lines.append(f"space = [{', '.join(_numbers(corner) for corner in line.space)}]")
    return "\n".join(lines)


def _number(value: float) -> str:
    """Return the shortest text that reads back as the same number."""
    return repr(float(value))


def _numbers(values: tuple[float, ...]) -> str:
    return f"[{', '.join(_number(value) for value in values)}]"


def _text(value: str) -> str:
    """Return a basic string; TOML's escapes are those of JSON, and it forbids DEL besides."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def _long_text(value: str) -> str:
    """Return a text over several lines as it stands, where its characters allow that."""
    plain = all(c == "\n" or (c.isprintable() and c != "\\") for c in value)
    if "\n" not in value or not plain or '"""' in value or value.endswith('"'):
        return _text(value)
    return f'"""\n{value}"""'
