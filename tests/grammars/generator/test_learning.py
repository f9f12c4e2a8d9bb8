"""Whole grammars, learnt from plans whose rooms, statistics or mirror images are known."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chisquare
from shapely import affinity

from grammars.generator.facade import find_module
from grammars.generator.frontages import survey
from grammars.generator.learning import learn, rule_ids
from grammars.generator.params import LearnParams
from grammars.model import Module, Part
from grammars.writing import to_toml
from storage.errors import MapSenseError
from storage.plan import Plan, PlanRoom
from storage.plan_digest import plan_digest
from tasks.simulation.furnishing import FurnishingParams
from tasks.simulation.layouts.double_loaded import DoubleLoadedParams
from tasks.simulation.layouts.units import UNITS, draw_row
from tasks.simulation.plan import StoreyParams, make_storey, turned
from tasks.simulation.presets import preset

SOUTH = [("a", 2.4), ("b", 4.8), ("a", 2.4), ("b", 4.8), ("c", 3.6), ("a", 2.4)]
WALKED = LearnParams(reading="walked", smoothing=2.0)


def test_a_grammar_worked_by_hand(make_row):
    plan = make_row(SOUTH, partition=0.1)
    grammar = learn([plan], WALKED, "hand", "test", "none")
    assert [rule.id for rule in grammar.rules] == ["a_240", "b_480", "c_360"]
    assert grammar.classes == ("a", "b", "c")
    assert [rule.parts for rule in grammar.rules] == [
        (Part(class_, width, 0.03, 5.0, 0.03),)
        for class_, width in (("a", 2.4), ("b", 4.8), ("c", 3.6))
    ]
    p = np.array([3, 2, 1]) / 6
    assert grammar.p_apriori == pytest.approx(p, abs=1e-6)
    # the south row is walked westwards: a c b a b a; two followers' worth of P_a are added
    pairs = np.array([[0, 1, 1], [2, 0, 0], [0, 1, 0]])
    expected = (pairs + 2 * p) / (pairs.sum(axis=1, keepdims=True) + 2)
    assert grammar.p_relation == pytest.approx(expected, abs=1e-6)
    assert (grammar.partition_m, grammar.evidence) == (0.1, 6.0)
    assert [(o.building, o.storey, o.digest) for o in grammar.learnt_from] == [
        ("b", "1", plan_digest(plan))
    ]
    assert (grammar.name, grammar.building_type, grammar.about) == ("hand", "test", "none")
    assert not grammar.simulated and grammar.module is None and len(grammar.lines) == 1


def test_read_both_ways_every_pair_counts_in_both_orders(make_row):
    grammar = learn([make_row(SOUTH)], LearnParams(smoothing=2.0))
    p = np.array([3, 2, 1]) / 6
    pairs = np.array([[0, 3, 1], [3, 0, 1], [1, 1, 0]])
    expected = (pairs + 2 * p) / (pairs.sum(axis=1, keepdims=True) + 2)
    assert grammar.p_relation == pytest.approx(expected, abs=1e-6)
    assert grammar.evidence == 6.0


def test_one_class_of_several_widths_is_several_rules(make_row):
    rng = np.random.default_rng(0)
    true = rng.choice([2.4, 3.6, 7.2], 40)
    row = [("office", float(w)) for w in true + rng.normal(0, 0.02, 40)]
    rules = learn([make_row(row)], LearnParams()).rules
    assert [rule.width_m for rule in rules] == pytest.approx([2.4, 3.6, 7.2], abs=0.02)
    counts = [int((true == w).sum()) for w in (2.4, 3.6, 7.2)]
    assert [rule.p_apriori * 40 for rule in rules] == pytest.approx(counts, abs=1e-3)


def test_rooms_without_a_name_are_classes_of_width_and_depth(make_row):
    row = [(None, 2.4), (None, 3.6)] * 4
    shallow, deep = make_row(row, depth=4.0), make_row(row, depth=6.0, storey="2")
    grammar = learn([shallow, deep], LearnParams())
    ids = ["room_240x400", "room_240x600", "room_360x400", "room_360x600"]
    assert sorted(grammar.classes) == ids
    assert sorted({part.class_ for rule in grammar.rules for part in rule.parts}) == ids
    singles = [rule for rule in grammar.rules if len(rule.parts) == 1]
    assert all(rule.id == rule.parts[0].class_ for rule in singles)


def test_the_spread_of_a_rule_is_shrunk_to_that_of_all(make_row):
    rng = np.random.default_rng(4)
    widths = 3.0 + rng.normal(0, 0.1, 30)
    row = [*(("a", float(w)) for w in widths), ("b", 6.0)]
    a, b = learn([make_row(row)], LearnParams()).rules
    deviations = ((widths - widths.mean()) ** 2).sum()
    common = deviations / 29
    assert a.parts[0].spread_m == pytest.approx(np.sqrt((deviations + 3 * common) / 32), abs=1e-4)
    assert b.parts[0].spread_m == pytest.approx(np.sqrt(common), abs=1e-4)  # of one room


def test_where_no_two_rooms_are_alike_spreads_are_unknown(make_row):
    rules = learn([make_row([("a", 2.4), ("b", 4.8)])], LearnParams(spread_unknown_m=0.2)).rules
    assert [rule.parts[0].spread_m for rule in rules] == [0.2, 0.2]


def test_classes_may_be_taken_for_others(make_row):
    row = [("S-1 conference", 4.8), ("wc", 2.4), ("S-2 conference", 4.8)]
    renamed = {"S-1 conference": "conference", "S-2 conference": "conference"}
    grammar = learn([make_row(row)], LearnParams(classes=renamed))
    assert grammar.classes == ("conference", "wc")
    assert grammar.p_apriori == pytest.approx([2 / 3, 1 / 3], abs=1e-6)


def unit_storeys(n):
    """Storeys whose rows are drawn from `UNITS`, with nothing required."""
    found, drawn = [], Counter()
    names = {tuple(part for part in unit.parts): name for name, unit in UNITS.items()}
    for seed in range(n):
        rng = np.random.default_rng(9000 + seed)
        rows = []
        for _ in range(2):
            row = draw_row(MODULES, rng)
            rest, units = list(row), []
            while rest:  # no unit starts like another: its rooms tell it
                unit = max((u for u in names if tuple(rest[: len(u)]) == u), key=len)
                units.append(names[unit])
                rest = rest[len(unit) :]
            rows.append(tuple(units))
            drawn.update(units)
        layout = DoubleLoadedParams(modules=MODULES, rows=(rows[0], rows[1]))
        found.append(
            make_storey(
                StoreyParams(
                    seed=seed, layout="double_loaded", double_loaded=layout, furnishing=BARE
                ),
                f"b{seed}",
                "1",
            )
        )
    return found, drawn


MODULES = 40
BARE = FurnishingParams(
    workplace_m2=1e3, open_workplace_m2=1e3, cabinet_m2=1e3, clutter_m2=1e3, corridor_m2=1e3
)


@pytest.fixture(scope="module")
def simulated():
    plans, drawn = unit_storeys(8)
    return plans, drawn, learn(plans, LearnParams())


def test_the_simulation_s_units_are_recovered_with_their_counts(simulated):
    _, drawn, grammar = simulated
    found = {
        tuple((part.class_, round(part.width_m / 2.4, 2)) for part in rule.parts): rule.p_apriori
        for rule in grammar.rules
    }
    total = sum(drawn.values())
    expected = {
        tuple((part.class_, float(part.modules)) for part in UNITS[name].parts): n / total
        for name, n in drawn.items()
    }
    assert found.keys() == expected.keys()
    assert [found[key] for key in expected] == pytest.approx(list(expected.values()), abs=2e-6)
    assert grammar.evidence == total
    assert grammar.module == Module(2.4, 0.03)
    assert grammar.partition_m == pytest.approx(0.125) and grammar.simulated and not grammar.lines


def test_the_simulation_s_statistics_are_within_chance(simulated):
    _, drawn, grammar = simulated
    # rows must be filled, which favours small units at their ends: only the rest is compared
    wide = [name for name, unit in UNITS.items() if unit.modules == 3 and len(unit.parts) == 1]
    rules = {rule.parts[0].class_: rule for rule in grammar.rules if rule.width_m > 7}
    classes = [UNITS[name].parts[0].class_ for name in wide]
    counts = np.array([rules[c].p_apriori * grammar.evidence for c in classes])
    stated = np.array([UNITS[name].p_apriori for name in wide])
    assert chisquare(counts, stated / stated.sum() * counts.sum()).pvalue > 0.01
    assert sum(drawn.values()) > 200


def mirrored(plan: Plan) -> Plan:
    def flip(shape):
        return affinity.scale(shape, -1, 1, origin=(0, 0))

    return replace(
        plan,
        rooms=tuple(replace(r, polygon=flip(r.polygon)) for r in plan.rooms),
        walls=tuple(replace(w, line=flip(w.line)) for w in plan.walls),
        doors=tuple(replace(d, line=flip(d.line)) for d in plan.doors),
    )


def assert_same(a, b):
    assert [rule.id for rule in a.rules] == [rule.id for rule in b.rules]
    for one, other in zip(a.rules, b.rules, strict=True):
        assert one.p_apriori == other.p_apriori
        for part, twin in zip(one.parts, other.parts, strict=True):
            numbers = [part.width_m, part.spread_m, part.depth_m, part.depth_spread_m]
            twins = [twin.width_m, twin.spread_m, twin.depth_m, twin.depth_spread_m]
            assert numbers == pytest.approx(twins, abs=2e-4)
    assert a.p_relation == pytest.approx(b.p_relation, abs=2e-6)
    assert (a.partition_m, a.evidence) == pytest.approx((b.partition_m, b.evidence), abs=2e-4)


@pytest.mark.parametrize("name", ["ring", "wing"])
def test_a_building_its_turned_and_its_mirror_image_give_one_grammar(name):
    plan = preset(name)
    grammar = learn([plan], LearnParams())
    assert_same(grammar, learn([turned(plan, 0.7)], LearnParams()))
    assert_same(grammar, learn([mirrored(plan)], LearnParams()))


def test_the_order_of_plans_and_rooms_does_not_matter(make_row):
    plans = [make_row(SOUTH, storey="1"), make_row(SOUTH[::-1] + SOUTH, storey="2")]
    grammar = learn(plans, LearnParams())
    other = [replace(plan, rooms=plan.rooms[::-1]) for plan in plans[::-1]]
    assert_same(grammar, learn(other, LearnParams()))


def test_same_plans_same_bytes():
    assert to_toml(learn([preset("wing")], LearnParams())) == to_toml(
        learn([preset("wing")], LearnParams())
    )


def test_lines_are_kept_for_one_building_alone(make_row):
    one, two = make_row(SOUTH, storey="1"), make_row(SOUTH, SOUTH, storey="2")
    grammar = learn([one, two], LearnParams())
    assert [line.storey for line in grammar.lines] == ["1", "2", "2"]
    found = survey(two, LearnParams()).lines
    assert [line.start for line in grammar.lines[1:]] == [line.start for line in found]
    elsewhere = make_row(SOUTH, building="another")
    assert learn([one, elsewhere], LearnParams()).lines == ()


def test_rare_rules_are_left_out_and_nothing_follows_across_them(make_row):
    row = [("a", 2.4)] * 10 + [("odd", 5.0)] + [("b", 3.6)] * 10
    grammar = learn([make_row(row)], LearnParams(p_least=0.09, smoothing=1e-6))
    assert grammar.classes == ("a", "b")
    single = [rule.id for rule in grammar.rules]
    assert grammar.p_relation[single.index("a_240"), single.index("b_360")] < 1e-5
    assert grammar.p_apriori.sum() == pytest.approx(1)


@pytest.mark.parametrize("module", [1.2, 2.4, 3.3])
def test_a_facade_module_is_found_through_noise_and_corner_rooms(module):
    rng = np.random.default_rng(7)
    widths = module * rng.choice([1, 2, 3], 60) + rng.normal(0, 0.02, 60)
    widths[:4] += module / 2  # corners
    found = find_module(widths, LearnParams())
    assert found.width_m == pytest.approx(module, abs=0.01) and found.spread_m < 0.05


def test_widths_without_a_module_have_none():
    rng = np.random.default_rng(8)
    assert find_module(rng.uniform(2, 8, 60), LearnParams()) is None
    assert find_module(np.full(30, 3.6), LearnParams()) is None
    assert find_module(np.array([2.4, 4.8]), LearnParams()) is None


def test_rules_of_like_name_and_width_have_ids_of_their_own():
    parts = [(Part("WC / shower", 2.4, 0.1),), (Part("wc shower", 2.401, 0.1),)]
    assert rule_ids(parts) == ["wc_shower_240", "wc_shower_240-2"]
    assert rule_ids(parts[:1], ["wc_shower_240"]) == ["wc_shower_240-2"]


def test_what_cannot_teach_is_refused(make_row):
    with pytest.raises(MapSenseError, match="none was given"):
        learn([], LearnParams())
    alone = Plan("b", "2", (PlanRoom("r", make_row(SOUTH).rooms[0].polygon, "corridor"),))
    with pytest.raises(MapSenseError, match="storey '2': no room stands along a corridor"):
        learn([alone], LearnParams())
