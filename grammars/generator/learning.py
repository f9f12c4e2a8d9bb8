"""The grammar generator: a whole grammar learnt from known plans (Sec. 4.2.1 assumes one)."""

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from grammars.generator.facade import find_module
from grammars.generator.frontages import Frontages, named, runs, survey
from grammars.generator.params import LearnParams
from grammars.generator.relations import best_strengths, count_pairs, relate, rounded
from grammars.generator.room_types import METRE_DECIMALS, NAMELESS, classes_of, room_types
from grammars.generator.spaces import Corners
from grammars.generator.units import Reading, find_units
from grammars.generator.wall_kinds import SPREAD_FLOOR_M, kind_of, outer_walls
from grammars.model import Grammar, Origin, Part, Point, ReferenceLine, Rule, WallKind
from storage.errors import MapSenseError
from storage.plan import Plan
from storage.plan_digest import plan_digest

ABOUT = "learnt from plans: the rooms along their corridors"
"""What a grammar tells of itself where nobody else does."""


def learn(
    plans: Sequence[Plan],
    params: LearnParams,
    name: str = "learnt",
    building_type: str = "unknown",
    about: str = ABOUT,
) -> Grammar:
    """Learn a grammar from one or more known plans.

    Corridors are found (`find_corridors`), reference lines laid on both of their sides
    (`corridor_lines`), the rooms along them measured between centre lines (`survey`), rooms of a
    class grouped by width (`room_types`; rooms without a class get one for width and depth), room
    units found (`find_units`). A-priori probabilities are the relative frequencies of the rules
    applied, relationship probabilities those of neighbours, smoothed (`relate`).

    Parameters
    ----------
    plans : the same storey twice counts twice
    name, building_type : what people call the grammar, and the kind of building it is for
    about : what else to tell of it

    Returns
    -------
    Grammar
        Its reference lines are kept if all plans are of one building: those of another say nothing.

    Raises
    ------
    MapSenseError
        If there is no plan, a plan has no corridor, or no room stands along any.
    """
    if not plans:
        raise MapSenseError("a grammar is learnt from plans, and none was given; name one or more")
    surveys = classified([survey(plan, params) for plan in plans], params)
    found = [f for s in surveys for row in s.rows for f in row]
    if not found:
        raise MapSenseError(
            f"building '{plans[0].building}', storey '{plans[0].storey}': no room stands along a "
            "corridor; check that rooms are drawn up to their walls' faces"
        )
    types = room_types(found, params)
    rows = rows_of(surveys, types.of)
    both = params.reading == "both"
    reading = find_units(rows, len(types.parts), params.unit_parts_max, both)
    rules, p_relation = rules_of(reading, types.parts, params)
    partition = kind_of(np.concatenate([s.partitions_m for s in surveys]))
    partition = partition or WallKind(params.partition_m, SPREAD_FLOOR_M)
    return Grammar(
        name=name,
        building_type=building_type,
        about=about,
        learnt_from=tuple(dict.fromkeys(origin(plan) for plan in plans)),
        simulated=any(plan.simulated for plan in plans),
        classes=tuple(sorted({part.class_ for rule in rules for part in rule.parts})),
        rules=rules,
        p_relation=p_relation,
        partition_m=partition.thickness_m,
        partition_spread_m=partition.spread_m,
        corridor_wall=kind_of(np.concatenate([s.fronts_m for s in surveys])),
        outer_wall=kind_of(outer_walls(plans)),
        evidence=round(sum(map(len, reading.rows)) / (2 if both else 1), 1),
        lines=lines_of(plans, surveys),
        module=find_module(np.array([f.width_m for f in found]), params),
    )


def classified(surveys: Sequence[Frontages], params: LearnParams) -> list[Frontages]:
    """Return the surveys with a class for every room."""
    classes = classes_of([f for s in surveys for row in s.rows for f in row], params)
    found, at = [], 0
    for frontages in surveys:
        n = sum(map(len, frontages.rows))
        found.append(named(frontages, classes[at : at + n]))
        at += n
    return found


def rows_of(surveys: Sequence[Frontages], types: Sequence[int]) -> list[tuple[int, ...]]:
    """Return the types of rooms in runs of neighbours; `types` are in the order of the rows."""
    left = iter(types)
    return [tuple(next(left) for _ in run) for s in surveys for row in s.rows for run in runs(row)]


def rules_of(
    reading: Reading, parts: Sequence[Part], params: LearnParams
) -> tuple[tuple[Rule, ...], NDArray[np.float64]]:
    """Return the rules applied often enough, and their relationship probabilities."""
    applied = np.bincount([r for row in reading.rows for r in row], minlength=len(reading.rules))
    keep = np.nonzero(applied >= params.p_least * applied.sum())[0]
    index = np.full(len(applied), -1)
    index[keep] = np.arange(len(keep))
    p_apriori = applied[keep] / applied[keep].sum()
    pairs = count_pairs([index[list(row)].tolist() for row in reading.rows], len(keep))
    both = params.reading == "both"
    strengths = params.smoothing or best_strengths(pairs, p_apriori, both)
    p_relation = relate(pairs, p_apriori, strengths)
    kept = [tuple(parts[type_] for type_ in reading.rules[i]) for i in keep]
    shown = rounded(p_apriori)
    ids = rule_ids(kept)
    rules = tuple(
        Rule(ids[i], kept[i], float(shown[i]), describe_parts(kept[i])) for i in range(len(kept))
    )
    return rules, rounded(p_relation)


def rule_ids(rules: Sequence[Sequence[Part]], taken: Sequence[str] = ()) -> list[str]:
    """Return an id per rule: its classes and its width in centimetres, as `office_240`.

    A class that is named after a width already is an id by itself.
    """
    found: list[str] = []
    for parts in rules:
        words = [re.sub(r"\W+", "_", part.class_.lower(), flags=re.ASCII) for part in parts]
        width = f"{sum(part.width_m for part in parts) * 100:.0f}"
        sized = len(parts) == 1 and NAMELESS.fullmatch(parts[0].class_)
        base = words[0] if sized else "_".join((*words, width))
        id_, n = base, 2
        while id_ in found or id_ in taken:
            id_, n = f"{base}-{n}", n + 1
        found.append(id_)
    return found


def describe_parts(parts: Sequence[Part]) -> str:
    """Return what a rule learnt is called: nobody has named it."""
    words = [part.class_.replace("_", " ") for part in parts]
    return f"{', '.join(words)} of {' + '.join(f'{part.width_m:.2f}' for part in parts)} m"


def lines_of(plans: Sequence[Plan], surveys: Sequence[Frontages]) -> tuple[ReferenceLine, ...]:
    """Return the reference lines of the storeys of one building, none if there are several."""
    if len({plan.building for plan in plans}) > 1:
        return ()
    by_storey = {p.storey: s.lines for p, s in zip(plans, surveys, strict=True)}
    return tuple(
        ReferenceLine(
            line.id, line.storey, _rounded(line.start), _rounded(line.end), _corners(line.space)
        )
        for lines in by_storey.values()
        for line in lines
    )


def origin(plan: Plan) -> Origin:
    """Return what a plan is known by."""
    return Origin(plan.building, plan.storey, plan_digest(plan))


def _corners(space: Corners | None) -> Corners | None:
    if space is None:
        return None
    a, b, c, d = map(_rounded, space)
    return a, b, c, d


def _rounded(point: Point) -> Point:
    return (round(point[0], METRE_DECIMALS), round(point[1], METRE_DECIMALS))
