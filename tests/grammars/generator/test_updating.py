"""What a storey adds to a grammar, worked by hand and against learning all at once."""

from dataclasses import replace

import numpy as np
import pytest

from grammars.generator.frontages import survey
from grammars.generator.learning import learn
from grammars.generator.params import LearnParams
from grammars.generator.updating import update
from grammars.model import Grammar, Part, ReferenceLine, Rule
from grammars.reading import from_toml
from grammars.writing import to_toml
from storage.errors import MapSenseError
from storage.plan_digest import plan_digest

WALKED = LearnParams(reading="walked")


def grammar() -> Grammar:
    rules = (
        Rule("a", (Part("a", 2.4, 0.05, 5.0, 0.2),), 0.5),
        Rule("b", (Part("b", 4.8, 0.05),), 0.3),
        Rule("aba", (Part("a", 2.4, 0.05), Part("b", 3.6, 0.05), Part("a", 2.4, 0.05)), 0.2),
    )
    relation = np.array([[0.5, 0.5, 0.0], [0.2, 0.3, 0.5], [1.0, 0.0, 0.0]])
    line = ReferenceLine("l", "9", (0, 0), (5, 0))
    return Grammar(
        "g", "t", "by hand", (), False, ("a", "b"), rules, relation, 0.1, 0.01, 20.0, (line,)
    )


def test_probabilities_are_weighed_by_evidence(make_row):
    # walked westwards: aba b a a
    row = [("a", 2.4), ("a", 2.4), ("b", 4.8), ("a", 2.4), ("b", 3.6), ("a", 2.4)]
    plan = make_row(row)
    found = update(grammar(), plan, WALKED, weight=2.0)
    assert found.p_apriori == pytest.approx(
        np.array([20 * 0.5 + 2 * 2, 20 * 0.3 + 2, 20 * 0.2 + 2]) / (20 + 2 * 4), abs=1e-6
    )
    expected = [
        [(10 * 0.5 + 2) / 12, 10 * 0.5 / 12, 0],
        [(6 * 0.2 + 2) / 8, 6 * 0.3 / 8, 6 * 0.5 / 8],
        [4 / 6, 2 / 6, 0],
    ]
    assert found.p_relation == pytest.approx(np.array(expected), abs=1e-6)
    assert found.evidence == 28
    assert [o.digest for o in found.learnt_from] == [plan_digest(plan)]
    assert [rule.id for rule in found.rules] == ["a", "b", "aba"]
    assert from_toml(to_toml(found), "g").evidence == 28


def test_widths_are_merged_by_mean_and_variance(make_row):
    found = update(grammar(), make_row([("a", 2.5), ("a", 2.5), ("b", 4.8)]), WALKED)
    part = found.rules[0].parts[0]
    mean = (10 * 2.4 + 2 * 2.5) / 12
    squares = 10 * (0.05**2 + (2.4 - mean) ** 2) + 2 * (2.5 - mean) ** 2
    assert part.width_m == pytest.approx(mean, abs=1e-4)
    assert part.spread_m == pytest.approx(np.sqrt((squares + 0.05**2) / 13), abs=1e-4)
    assert part.depth_m == pytest.approx(5.0)
    assert found.rules[1].parts[0].depth_m is None  # any depth stays any depth
    assert found.rules[2].parts == grammar().rules[2].parts


def test_rooms_that_no_rule_takes_become_rules(make_row):
    row = [("a", 2.4), ("c", 6.0), ("b", 9.0), ("a", 2.4)]
    found = update(grammar(), make_row(row), WALKED)
    assert [rule.id for rule in found.rules] == ["a", "b", "aba", "b_900", "c_600"]
    assert found.classes == ("a", "b", "c")
    n = 24
    assert found.p_apriori == pytest.approx(np.array([12, 6, 4, 1, 1]) / n, abs=1e-6)
    # walked westwards, c follows b_900; the a-priori probabilities count for one follower more
    expected = found.p_apriori.copy()
    expected[4] += 1
    assert found.p_relation[3] == pytest.approx(expected / 2, abs=1e-6)
    assert found.p_relation.sum(axis=1) == pytest.approx(np.ones(5), abs=1e-9)
    assert found.p_relation[2] == pytest.approx([22 / 24, 0, 0, 1 / 24, 1 / 24], abs=1e-6)


def test_rooms_without_a_name_are_recognised_by_size(make_row):
    found = update(grammar(), make_row([(None, 2.45), (None, 4.78), (None, 6.0)]), WALKED)
    assert found.classes == ("a", "b", "room_600x500")
    assert found.evidence == 23


def test_learning_storey_by_storey_comes_near_learning_all_at_once(make_row):
    rng = np.random.default_rng(3)
    kinds = [("office", 2.4), ("office", 4.8), ("lab", 7.2), ("wc", 2.4)]
    plans = [
        make_row([kinds[i] for i in rng.choice(4, 40, p=[0.3, 0.4, 0.2, 0.1])], storey=str(s))
        for s in range(6)
    ]
    params = LearnParams(smoothing=4.0)
    at_once, step = learn(plans, params), learn(plans[:1], params)
    for plan in plans[1:]:
        step = update(step, plan, params)
    assert [r.id for r in step.rules] == [r.id for r in at_once.rules]
    assert step.p_apriori == pytest.approx(at_once.p_apriori, abs=1e-5)
    # smoothed with the first storey's a-priori probabilities, not with those of all
    assert step.p_relation == pytest.approx(at_once.p_relation, abs=0.02)
    assert (step.evidence, step.partition_m) == (at_once.evidence, at_once.partition_m)
    assert [line.id for line in step.lines] == [line.id for line in at_once.lines]


def test_a_grammar_without_evidence_takes_the_storey_s_figures(make_row):
    row = [("a", 2.45), ("b", 4.8), ("a", 2.45)]
    found = update(replace(grammar(), evidence=0.0), make_row(row), WALKED)
    assert found.p_apriori == pytest.approx([2 / 3, 1 / 3, 0], abs=1e-6)
    assert found.rules[0].parts[0].width_m == pytest.approx(2.45)
    assert np.isfinite(found.p_relation).all()
    assert found.p_relation.sum(axis=1) == pytest.approx(np.ones(3))


def test_lines_given_by_hand_stay_and_learnt_ones_follow_the_building(make_row):
    plan = make_row([("a", 2.4)] * 4)
    assert [line.id for line in update(grammar(), plan, WALKED).lines] == ["l"]
    learnt = learn([plan], WALKED)
    again = make_row([("a", 2.4)] * 5)  # the same storey, mapped anew
    lines = update(learnt, again, WALKED).lines
    assert [line.start for line in lines] == [line.start for line in survey(again, WALKED).lines]
    other = make_row([("a", 2.4)] * 5, building="other")
    assert update(learnt, other, WALKED).lines == ()


def test_a_plan_teaches_once(make_row):
    plan = make_row([("a", 2.4), ("b", 4.8)])
    once = update(grammar(), plan, WALKED)
    with pytest.raises(MapSenseError, match="grammar 'g' was learnt from building 'b', storey '1'"):
        update(once, plan, WALKED)
    with pytest.raises(ValueError, match="weight: expected more than 0"):
        update(grammar(), plan, WALKED, weight=0.0)
