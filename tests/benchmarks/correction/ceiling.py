"""How well classes are told where nothing else is amiss: true walls and true depths decoded."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from report import Column, Table

from correction.chain import Model
from correction.storeys import OTHER, SAME
from grammars.model import Rule
from storage.layout import Layout
from storage.observations import Observations
from tasks.layout.decoding.decode import DecodeParams, decode
from tasks.layout.placement.oracle import true_rules

SIGMA_M, SURE = 0.01, 0.99
"""Of a wall that is known."""
COLUMNS = (
    Column("case", "grammar"), Column("rooms", "rooms along lines"),
    Column("classes", "classes right", "{:.3f}"), Column("lines", "lines right", "{:.2f}"),
)  # fmt: skip


@dataclass(frozen=True)
class Ceiling:
    """What a grammar says of a storey's rooms if their walls are known."""

    storey: str
    is_preset: bool
    grammar: str
    rooms: int
    right: int
    lines: int
    lines_right: int


def ceilings(model: Model) -> list[Ceiling]:
    """Return what grammars of the building and of others can tell of the rooms on its lines."""
    scored = model.stored.scored
    found = []
    for kind in (SAME, OTHER):
        true = model.true_lines(kind)
        known = known_walls(true, true_rules(true, model.observed(kind), model.polygons))
        layout = decode(known, model.grammar(kind), DecodeParams())
        right = _right(layout, true)
        whole = [bool(line.all()) for line in right]
        rooms, hits = sum(map(len, right)), int(sum(line.sum() for line in right))
        found.append(
            Ceiling(scored.name, scored.is_preset, kind, rooms, hits, len(right), sum(whole))
        )
    return found


def known_walls(true: Layout, rules: Sequence[Rule]) -> Observations:
    """Return true rooms as observations without any error, on lines laid out one by one."""
    depth = {rule.id: rule.parts[0].depth_m for rule in rules}
    names = list(dict.fromkeys(true.line_ids.tolist()))
    rows = [np.flatnonzero(true.line_ids == name) for name in names]
    at = [np.cumsum(np.append(0.0, true.widths_m[own])) for own in rows]
    cuts = [len(own) - 1 for own in rows]
    n, none = sum(cuts), np.zeros(0)
    return Observations(
        line_ids=np.array(names, np.str_),
        starts=np.zeros((len(names), 2)),
        ends=np.array([(some[-1], 0.0) for some in at]).reshape(-1, 2),
        end_sigma_m=np.full((len(names), 2), SIGMA_M),
        end_faces_m=np.full((len(names), 2, 2), np.nan),
        lines=np.repeat(np.arange(len(names)), cuts),
        cut_m=np.concatenate([none, *(some[1:-1] for some in at)]),
        sigma_m=np.full(n, SIGMA_M),
        faces_m=np.full((n, 2), np.nan),
        scans=np.ones(n, np.int64),
        presence=np.full(n, SURE),
        interval_lines=np.repeat(np.arange(len(names)), [len(own) for own in rows]),
        from_m=np.concatenate([none, *(some[:-1] for some in at)]),
        to_m=np.concatenate([none, *(some[1:] for some in at)]),
        rooms=np.concatenate([np.zeros(0, np.int64), *rows]),
        depth_m=np.array([depth[str(true.rules[i])] for own in rows for i in own], float),
    )


def _right(layout: Layout, true: Layout) -> list[NDArray[np.bool_]]:
    """Return which rooms have their class, line by line; none of a line with other walls has."""
    found = []
    for name in dict.fromkeys(true.line_ids.tolist()):
        known = true.classes[true.line_ids == name]
        best = layout.classes[(layout.line_ids == name) & (layout.hypotheses == 0)]
        same = len(best) == len(known)
        found.append(best == known if same else np.zeros(len(known), bool))
    return found


def ceiling_table(title: str, found: Iterable[Ceiling]) -> Table:
    """Return the shares over the storeys of a group."""
    rows = []
    for kind in (SAME, OTHER):
        own = [c for c in found if c.grammar == kind]
        rooms, lines = sum(c.rooms for c in own), sum(c.lines for c in own)
        if rooms:
            right, whole = sum(c.right for c in own), sum(c.lines_right for c in own)
            row = {"case": kind, "rooms": rooms, "classes": right / rooms, "lines": whole / lines}
            rows.append(row)
    return Table(f"{title}: classes of rooms whose walls are known", COLUMNS, rows)
