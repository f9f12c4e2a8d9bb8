"""What an accepted storey teaches a grammar (Fig. 8, line 26)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from grammars.generator.frontages import Frontage, Frontages, runs, survey
from grammars.generator.learning import classified, describe_parts, lines_of, origin, rule_ids
from grammars.generator.params import LearnParams
from grammars.generator.relations import count_pairs, rounded
from grammars.generator.room_types import METRE_DECIMALS, room_types
from grammars.generator.wall_kinds import SPREAD_FLOOR_M, kind_of, outer_walls
from grammars.model import Grammar, Part, ReferenceLine, Rule, WallKind
from storage.errors import MapSenseError
from storage.plan import Plan

NEAR_SPREADS, NEAR_M = 3.0, 0.1
"""A room is of a rule if its width is within so many of the rule's spreads, or this near."""
NEVER = 1e9
"""Cost, in nats, of a room no rule takes; any cutting without it is cheaper."""


@dataclass(frozen=True, eq=False)
class _Applied:
    """A rule applied in a row: which, and to which rooms, in the order of its parts."""

    rule: int
    rooms: tuple[Frontage, ...]


def update(grammar: Grammar, plan: Plan, params: LearnParams, weight: float = 1.0) -> Grammar:
    """Return a grammar that has learnt from one more storey.

    The grammar's own figures count as `evidence` applications of rules, those of the storey as
    their number times the weight: with n = evidence, and m_r applications of rule r in the storey,
    m in all,

        P_a(r) = (n P_a(r) + weight m_r) / (n + weight m),

    likewise each row of the relationship probabilities (a row's evidence is n P_a(r), twice that
    where rows are read in both directions, as each application then has a follower on either
    side), and each width, depth and the partition by mean and variance. Rooms that no rule takes
    become new rules, that may follow anything as often as they occur. Units are not sought anew:
    learn from all plans for that.

    Parameters
    ----------
    params : as the grammar was learnt with
    weight : of one application in the storey, above 0; 1 if the storey is as sure as a plan, less
        for one that was mapped, as the posterior of its rooms

    Raises
    ------
    MapSenseError
        If the plan is one the grammar was learnt from, or has no corridor.
    ValueError
        If the weight is not above 0.
    """
    if not weight > 0:
        raise ValueError(f"weight: expected more than 0, got {weight}")
    source = origin(plan)
    if source.digest in {o.digest for o in grammar.learnt_from}:
        raise MapSenseError(
            f"grammar '{grammar.name}' was learnt from building '{plan.building}', storey "
            f"'{plan.storey}' already; nothing new is in it, hand over another plan"
        )
    found = _recognised(grammar, survey(plan, params), params)
    rules = (*grammar.rules, *_new_rules(grammar, found, params))
    both = params.reading == "both"
    rows = [run for row in found.rows for run in runs(row)]
    read = [r for run in rows for r in ([run, run[::-1]] if both else [run])]
    parsed = [_parse(run, rules) for run in read]
    share = weight / (2 if both else 1)
    times = np.bincount([a.rule for row in parsed for a in row], minlength=len(rules))
    counts = share * times.astype(np.float64)
    p_apriori, p_relation = _probabilities(grammar, counts, parsed, weight, both)
    applied = [a for row in parsed for a in row]
    new = tuple(
        replace(
            rule,
            parts=_parts(rule, grammar, [a.rooms for a in applied if a.rule == i], share, params),
            p_apriori=float(p_apriori[i]),
        )
        for i, rule in enumerate(rules)
    )
    thickness, spread = _merged(
        (grammar.partition_m, grammar.partition_spread_m),
        grammar.evidence,
        found.partitions_m[found.partitions_m > 0],
        weight,
        0.0,
    )
    return replace(
        grammar,
        learnt_from=(*grammar.learnt_from, source),
        simulated=grammar.simulated or plan.simulated,
        classes=tuple(sorted({part.class_ for rule in new for part in rule.parts})),
        rules=new,
        p_relation=p_relation,
        partition_m=thickness,
        partition_spread_m=spread or grammar.partition_spread_m,
        corridor_wall=_wall(grammar.corridor_wall, grammar.evidence, found.fronts_m, weight),
        outer_wall=_wall(grammar.outer_wall, grammar.evidence, outer_walls([plan]), weight),
        evidence=round(grammar.evidence + float(counts.sum()), 6),
        lines=_lines(grammar, plan, found),
    )


def _recognised(grammar: Grammar, found: Frontages, params: LearnParams) -> Frontages:
    """Return the rooms with classes: those without take that of the nearest part of a rule."""
    parts = [part for rule in grammar.rules for part in rule.parts]
    rows = tuple(
        tuple(f if f.class_ else replace(f, class_=_nearest_class(f, parts)) for f in row)
        for row in found.rows
    )
    return classified([replace(found, rows=rows)], params)[0]


def _nearest_class(room: Frontage, parts: Sequence[Part]) -> str | None:
    def off(part: Part) -> float:
        deep = 0.0
        if part.depth_m is not None and part.depth_spread_m is not None:
            deep = abs(room.depth_m - part.depth_m) / part.depth_spread_m
        return float(np.hypot(abs(room.width_m - part.width_m) / _reach(part) * NEAR_SPREADS, deep))

    best = min(parts, key=off)
    return best.class_ if off(best) <= NEAR_SPREADS else None


def _reach(part: Part) -> float:
    return max(NEAR_SPREADS * part.spread_m, NEAR_M)


def _takes(part: Part, room: Frontage) -> bool:
    return part.class_ == room.class_ and abs(room.width_m - part.width_m) <= _reach(part)


def _new_rules(grammar: Grammar, found: Frontages, params: LearnParams) -> list[Rule]:
    """Return rules for the rooms that none of the grammar's takes."""
    single = [_parse(run, grammar.rules) for row in found.rows for run in runs(row)]
    left = [room for row in single for a in row if a.rule < 0 for room in a.rooms]
    if not left:
        return []
    parts = [(part,) for part in room_types(left, params).parts]
    ids = rule_ids(parts, [rule.id for rule in grammar.rules])
    return [Rule(i, p, 0.0, describe_parts(p)) for i, p in zip(ids, parts, strict=True)]


def _parse(row: Sequence[Frontage], rules: Sequence[Rule]) -> list[_Applied]:
    """Return the likeliest rules that make up a row; rule -1 where none takes a room."""
    best: list[tuple[float, list[_Applied]]] = [(0.0, [])]  # from the row's end
    for start in range(len(row) - 1, -1, -1):
        options = []
        for i, rule in enumerate(rules):
            rooms = tuple(row[start : start + len(rule.parts)])
            if len(rooms) == len(rule.parts) and all(map(_takes, rule.parts, rooms)):
                cost, rest = best[len(row) - start - len(rooms)]
                options.append((cost + _cost(rule, rooms), [_Applied(i, rooms), *rest]))
        cost, rest = best[-1]
        options.append((cost + NEVER, [_Applied(-1, (row[start],)), *rest]))
        best.append(min(options, key=lambda option: option[0]))
    return best[-1][1]


def _cost(rule: Rule, rooms: Sequence[Frontage]) -> float:
    """Return the negative log probability of a rule and of the widths it is applied to."""
    # a rule that was never applied is rarer than all others
    cost = -float(np.log(rule.p_apriori)) if rule.p_apriori > 0 else NEVER / 1e6
    for part, room in zip(rule.parts, rooms, strict=True):
        spread = _reach(part) / NEAR_SPREADS
        cost += ((room.width_m - part.width_m) / spread) ** 2 / 2 + float(np.log(spread))
    return cost


def _probabilities(
    grammar: Grammar,
    counts: NDArray[np.float64],
    parsed: Sequence[Sequence[_Applied]],
    weight: float,
    both: bool,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    n_old, n = len(grammar.rules), len(counts)
    before = np.concatenate((grammar.p_apriori, np.zeros(n - n_old)))
    total = grammar.evidence + counts.sum()
    p_apriori = (grammar.evidence * before + counts) / total if total else before
    relation = np.tile(p_apriori, (n, 1))
    relation[:n_old, :n_old] = (1 - p_apriori[n_old:].sum()) * grammar.p_relation
    pairs = weight * count_pairs([[a.rule for a in row] for row in parsed], n)
    rest = (2 if both else 1) * grammar.evidence * before
    rest = np.where(rest + pairs.sum(axis=1) > 0, rest, 1.0)  # unknown before and without follower
    rest[n_old:] = 1.0  # what is new follows the a-priori probabilities as one follower would
    sums = rest + pairs.sum(axis=1)
    return rounded(p_apriori), rounded((rest[:, None] * relation + pairs) / sums[:, None])


def _parts(
    rule: Rule,
    grammar: Grammar,
    rooms: Sequence[tuple[Frontage, ...]],
    share: float,
    params: LearnParams,
) -> tuple[Part, ...]:
    """Return a rule's parts with widths and depths that have learnt from rooms."""
    known = grammar.evidence * rule.p_apriori
    found = []
    for i, part in enumerate(rule.parts):
        widths = np.array([r[i].width_m for r in rooms])
        old = part.width_m, part.spread_m
        width, spread = _merged(old, known, widths, share, params.spread_floor_m)
        part = replace(part, width_m=width, spread_m=spread)
        if part.depth_m is not None and part.depth_spread_m is not None:
            depths = np.array([r[i].depth_m for r in rooms])
            old = part.depth_m, part.depth_spread_m
            deep, spread = _merged(old, known, depths, share, params.depth_floor_m)
            part = replace(part, depth_m=deep, depth_spread_m=spread)
        found.append(part)
    return tuple(found)


def _merged(
    old: tuple[float, float],
    known: float,
    values: NDArray[np.float64],
    share: float,
    floor: float,
) -> tuple[float, float]:
    """Return mean and spread of what was known and of new values, each counted `share` times."""
    total = known + share * len(values)
    if not len(values):
        return old
    mean = (known * old[0] + share * values.sum()) / total
    squares = known * (old[1] ** 2 + (old[0] - mean) ** 2)
    squares += share * ((values - mean) ** 2).sum()
    # few values alone do not show a spread: the old one counts as one more of them
    variance = (squares + share * old[1] ** 2) / (total + share)
    return round(float(mean), METRE_DECIMALS), round(max(variance**0.5, floor), METRE_DECIMALS)


def _wall(
    old: WallKind | None, known: float, walls: NDArray[np.float64], weight: float
) -> WallKind | None:
    """Return a kind of walls that has learnt from some more."""
    if old is None:
        return kind_of(walls)
    of_kind = old.thickness_m, old.spread_m
    return WallKind(*_merged(of_kind, known, walls[walls > 0], weight, SPREAD_FLOOR_M))


def _lines(grammar: Grammar, plan: Plan, found: Frontages) -> tuple[ReferenceLine, ...]:
    """Return the lines with those of the storey; none if the grammar is of several buildings."""
    buildings = {origin.building for origin in grammar.learnt_from}
    if not buildings:
        return grammar.lines
    if buildings != {plan.building}:
        return ()
    kept = tuple(line for line in grammar.lines if line.storey != plan.storey)
    return (*kept, *lines_of([plan], [found]))
