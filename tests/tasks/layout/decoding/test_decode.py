"""The stage: rooms drawn from a grammar are found again in what was seen of their walls."""

from dataclasses import fields

import numpy as np
import pytest
from scipy.stats import lognorm, norm

from grammars.model import Grammar, Part, Rule
from storage.layout import HIDDEN, LINE_END
from storage.observations import Observations
from tasks.layout.decoding.decode import DecodeParams, decode
from tasks.layout.decoding.segmental import SegmentalParams

EXECUTIVE = Part("executive", 4.8, 0.2, 5.5, 0.2)
RULES = (
    Rule("office", (Part("office", 2.9, 0.15, 5.0, 0.2),), 0.45),
    Rule("double", (Part("double", 4.1, 0.2, 5.0, 0.2),), 0.25),
    Rule("store", (Part("store", 1.9, 0.1, 3.0, 0.3),), 0.15),
    Rule("unit", (EXECUTIVE, Part("assistant", 2.4, 0.15, 5.0, 0.2), EXECUTIVE), 0.15),
)
P_R = np.array(
    [[0.7, 0.1, 0.1, 0.1], [0.2, 0.5, 0.2, 0.1], [0.3, 0.5, 0.0, 0.2], [0.6, 0.2, 0.1, 0.1]]
)


def grammar(rules=RULES, p_r=P_R):
    return Grammar(
        name="g", building_type="office", about="", learnt_from=(), simulated=True,
        classes=("office", "double", "store", "executive", "assistant"), rules=rules,
        p_relation=p_r, partition_m=0.1, partition_spread_m=0.01,
    )  # fmt: skip


def observed(lines):
    """Return observations of (length, cuts, sigmas, presence, depths) of each line."""
    count = len(lines)
    lengths = np.array([line[0] for line in lines], float).reshape(-1)
    bounds = [np.array([0.0, *line[1], line[0]]) for line in lines]
    of_cut = np.repeat(np.arange(count), [len(line[1]) for line in lines])

    def joined(arrays):
        return np.concatenate([np.empty(0), *arrays])

    return Observations(
        line_ids=np.array([f"rls{i}" for i in range(count)], np.str_),
        starts=np.zeros((count, 2)),
        ends=np.column_stack([lengths, np.zeros(count)]),
        end_sigma_m=np.full((count, 2), np.nan),
        end_faces_m=np.full((count, 2, 2), np.nan),
        lines=of_cut,
        cut_m=joined([line[1] for line in lines]),
        sigma_m=joined([line[2] for line in lines]),
        faces_m=np.full((len(of_cut), 2), np.nan),
        scans=np.ones(len(of_cut), np.int64),
        presence=joined([line[3] for line in lines]),
        interval_lines=np.repeat(np.arange(count), [len(b) - 1 for b in bounds]),
        from_m=joined([b[:-1] for b in bounds]),
        to_m=joined([b[1:] for b in bounds]),
        rooms=np.full(sum(len(b) - 1 for b in bounds), -1),
        depth_m=joined([line[4] for line in lines]),
    )


def seen(length, *cuts, presence=0.5):
    """Return a line whose walls were seen well, and nothing else known."""
    count = len(cuts)
    return length, cuts, np.full(count, 0.03), np.full(count, presence), np.full(count + 1, np.nan)


def drawn(rng, missing, spurious, length=35.0, sure=0.5):
    """Return the walls and classes of a line drawn from the grammar, and what was seen of it."""
    rooms, rule = [], None
    while sum(width for width, _ in rooms) < length:
        rule = rng.choice(4, p=grammar().p_apriori if rule is None else P_R[rule])
        rooms += [(rng.normal(p.width_m, p.spread_m), p.class_) for p in RULES[rule].parts]
    bounds = np.cumsum([0.0] + [width for width, _ in rooms])
    kept = bounds[1:-1][rng.random(len(bounds) - 2) >= missing]
    sigmas = rng.uniform(0.02, 0.1, len(kept))
    others = rng.uniform(0.3, bounds[-1] - 0.3, rng.binomial(len(bounds) - 2, spurious))
    cuts = np.concatenate([kept + rng.normal(0, sigmas), others])
    order = np.argsort(cuts)
    sigmas = np.concatenate([sigmas, np.full(len(others), 0.05)])[order]
    presence = np.full(len(cuts), sure)
    line = (bounds[-1], cuts[order], sigmas, presence, np.full(len(cuts) + 1, np.nan))
    return line, bounds, [class_ for _, class_ in rooms]


def right(layout, i, bounds, classes):
    """Return which rooms of the best sequence of a line are true, to half a metre."""
    mine = (layout.line_ids == f"rls{i}") & (layout.hypotheses == 0)
    true = np.column_stack([bounds[:-1], bounds[1:]])
    found = np.column_stack([layout.from_m[mine], layout.to_m[mine]])
    near = (np.abs(found[:, None] - true) < 0.5).all(axis=2)
    return (near & (layout.classes[mine][:, None] == np.array(classes))).any(axis=1)


def recall(truth, params):
    layout = decode(observed([line for line, *_ in truth]), grammar(), params)
    hits = [right(layout, i, *rest).sum() for i, (_, *rest) in enumerate(truth)]
    return sum(hits) / sum(len(classes) for *_, classes in truth)


def one(layout, hypothesis=0):
    """Return class, cuts and place of the rooms of the only line."""
    mine = layout.hypotheses == hypothesis
    return (
        layout.classes[mine].tolist(),
        [int(layout.from_cuts[mine][0]), *layout.to_cuts[mine].tolist()],
        [layout.from_m[mine][0], *layout.to_m[mine]],
    )


def test_a_missed_wall_and_a_spurious_one_are_told_from_the_others():
    # office | office | double | unit of three, with the wall at 2.9 missed and one seen at 7.6
    line = seen(21.9, 5.8, 7.6, 9.9, 14.7, 17.1)
    classes, cuts, places = one(decode(observed([line]), grammar(), DecodeParams()))
    assert classes == ["office", "office", "double", "executive", "assistant", "executive"]
    assert cuts == [LINE_END, HIDDEN, 0, 2, 3, 4, LINE_END]
    assert places == pytest.approx([0, 2.9, 5.8, 9.9, 14.7, 17.1, 21.9])


def test_rooms_say_which_rule_and_which_part_of_its_unit_they_are():
    layout = decode(observed([seen(12.0, 4.8, 7.2)]), grammar(), DecodeParams(hypotheses=1))
    assert layout.rules.tolist() == ["unit"] * 3
    assert layout.parts.tolist() == [0, 1, 2] == layout.orders.tolist()
    assert layout.widths_m.tolist() == [4.8, 2.4, 4.8]
    assert layout.spreads_m.tolist() == [0.2, 0.15, 0.2]
    assert (layout.posteriors > 0.5).all() and (layout.posteriors <= 1).all()


def test_a_room_that_no_rule_fits_keeps_what_was_seen():
    line = seen(9.5, 2.9, 6.6, presence=0.9)  # 3.7 m: an office and a third
    offices = grammar((RULES[0],), np.ones((1, 1)))
    layout = decode(observed([line]), offices, DecodeParams(hypotheses=1))
    assert layout.classes.tolist() == ["office", "", "office"]
    assert layout.rules[1] == "" and np.isnan([layout.widths_m[1], layout.spreads_m[1]]).all()
    assert (layout.from_m[1], layout.to_m[1]) == (2.9, 6.6)


def test_depth_tells_apart_what_width_does_not():
    wide = [Rule(c, (Part(c, 3.0, 0.2, d, 0.2),), 0.5) for c, d in (("office", 5), ("double", 3))]
    even = grammar(tuple(wide), np.full((2, 2), 0.5))
    depths = np.array([3.0, 5.0, 3.0])
    line = (*seen(9.0, 3.0, 6.0)[:4], depths)
    assert one(decode(observed([line]), even, DecodeParams()))[0] == ["double", "office", "double"]
    ignored = DecodeParams(segmental=SegmentalParams(depth="ignored"))
    blind = decode(observed([line]), even, ignored)
    assert blind.posteriors[blind.hypotheses == 0] == pytest.approx([0.5] * 3, abs=0.05)


VARIANTS = [
    DecodeParams(),
    DecodeParams(transitions="paper"),
    DecodeParams(units="split"),
    DecodeParams(unexplained="forbidden"),
    *(DecodeParams(decoder="plain", plain={"length": x}) for x in ("free", "pruned", "within")),
    DecodeParams(decoder="plain", transitions="paper", units="split"),
]


@pytest.mark.parametrize("params", VARIANTS)
def test_every_hypothesis_fills_its_line_and_the_same_is_found_again(params):
    rng = np.random.default_rng(2)
    seen_lines = observed([drawn(rng, 0.2, 0.2)[0] for _ in range(6)])
    layout, again = (decode(seen_lines, grammar(), params) for _ in range(2))
    for field in fields(layout):
        np.testing.assert_array_equal(getattr(layout, field.name), getattr(again, field.name))
    assert set(layout.line_ids) == set(seen_lines.line_ids)
    for line, length in zip(seen_lines.line_ids, seen_lines.lengths_m, strict=True):
        cuts = seen_lines.cut_m[seen_lines.lines == int(line[3:])]
        for hypothesis in range(layout.hypotheses[layout.line_ids == line].max() + 1):
            mine = (layout.line_ids == line) & (layout.hypotheses == hypothesis)
            assert layout.orders[mine].tolist() == list(range(mine.sum()))
            assert layout.from_m[mine].tolist() == [0.0, *layout.to_m[mine][:-1]]
            assert layout.to_m[mine][-1] == length and layout.to_cuts[mine][-1] == LINE_END
            assert (layout.from_m[mine] < layout.to_m[mine]).all()
            inner = layout.to_cuts[mine] >= 0
            assert (layout.to_m[mine][inner] == cuts[layout.to_cuts[mine][inner]]).all()
            assert len(set(layout.log_p[mine])) == 1
        scores = layout.log_p[layout.line_ids == line]
        assert (scores[1:] <= scores[:-1]).all()


def test_the_plain_decoder_gives_each_interval_a_rule():
    layout = decode(observed([seen(14.9, 2.9)]), grammar(), DecodeParams(decoder="plain"))
    assert layout.rules.tolist() == ["office", "unit", "unit", "unit"]
    assert layout.from_m == pytest.approx([0, 2.9, 7.7, 10.1])
    assert layout.to_cuts.tolist() == [0, HIDDEN, HIDDEN, LINE_END]


def test_a_line_that_no_sequence_explains_is_as_it_was_observed():
    for params in (DecodeParams(decoder="plain"), DecodeParams(unexplained="forbidden")):
        layout = decode(observed([seen(1.0, 0.4)]), grammar((RULES[3],), np.ones((1, 1))), params)
        if params.decoder == "plain":
            assert layout.rules.tolist() == ["", ""] and layout.to_cuts.tolist() == [0, LINE_END]
            assert layout.posteriors.tolist() == [0, 0] and (layout.log_p == -np.inf).all()
        else:
            assert (layout.rules == "unit").all()  # far-fetched, but the only sequence allowed


def test_no_lines_have_no_rooms():
    for params in VARIANTS:
        assert len(decode(observed([]), grammar(), params)) == 0


@pytest.mark.parametrize(
    ("missing", "spurious", "least"),
    [(0.0, 0.0, 0.93), (0.1, 0.1, 0.75), (0.2, 0.2, 0.65), (0.3, 0.3, 0.45), (0.0, 0.3, 0.85)],
)
def test_the_segmental_decoder_finds_far_more_rooms_than_the_plain_one(missing, spurious, least):
    rng = np.random.default_rng(3)
    truth = [drawn(rng, missing, spurious) for _ in range(30)]
    ours = recall(truth, DecodeParams())
    plain = max(
        recall(truth, DecodeParams(decoder="plain", plain={"length": length}))
        for length in ("free", "pruned")
    )
    assert ours >= least and ours >= plain + 0.2


def test_posteriors_are_as_high_as_rooms_are_right():
    rng = np.random.default_rng(4)
    truth = [drawn(rng, 0.1, 0.1) for _ in range(80)]
    layout = decode(observed([line for line, *_ in truth]), grammar(), DecodeParams(hypotheses=1))
    hits = np.concatenate([right(layout, i, *rest) for i, (_, *rest) in enumerate(truth)])
    sure = layout.posteriors > 0.9
    assert hits[sure].mean() > 0.9 > hits[~sure].mean() + 0.1
    assert layout.posteriors.mean() == pytest.approx(hits.mean(), abs=0.08)


def test_a_wrong_grammar_leaves_rooms_unexplained_where_they_were_seen():
    ward = tuple(Rule(f"w{i}", (Part("ward", w, 0.15),), 0.5) for i, w in enumerate((7.2, 9.5)))
    hospital = grammar(ward, np.full((2, 2), 0.5))
    truth = [drawn(np.random.default_rng(seed), 0.0, 0.0, sure=0.9) for seed in range(10)]
    layout = decode(observed([line for line, *_ in truth]), hospital, DecodeParams(hypotheses=1))
    assert (~layout.explained).mean() > 0.8
    walls = sum(len(line[1]) for line, *_ in truth)
    assert (layout.to_cuts >= 0).sum() > 0.8 * walls


def test_rooms_side_by_side_agree_on_the_wall_between_them_and_the_ends_are_sure():
    rng = np.random.default_rng(5)
    lines = [drawn(rng, 0.3, 0.2)[0] for _ in range(4)]
    for decoder in ("segmental", "plain"):
        layout = decode(observed(lines), grammar(), DecodeParams(decoder=decoder))
        inner = layout.to_cuts != LINE_END
        after = np.roll(layout.from_posteriors, -1)
        assert layout.to_posteriors[inner].tolist() == after[inner].tolist()
        assert (layout.to_posteriors[~inner] == 1).all()
        assert (layout.from_posteriors[layout.from_cuts == LINE_END] == 1).all()
        assert ((layout.undivided > 0) & (layout.undivided <= 1)).all()


def test_the_plain_decoder_says_of_observed_walls_what_is_observed():
    line = seen(9.9, 2.9, 7.0, presence=0.7)
    layout = decode(observed([line]), grammar(), DecodeParams(decoder="plain"))
    cuts = layout.to_cuts >= 0
    assert cuts.sum() == 2
    assert layout.to_posteriors[cuts].tolist() == [0.7, 0.7]


def test_a_hidden_wall_of_a_unit_is_as_probable_as_the_rules_that_have_one_there():
    rules = (RULES[0], RULES[3])
    even = np.full((2, 2), 0.5)
    params = DecodeParams(decoder="plain", near_m=0.1)
    layout = decode(observed([seen(12.0)]), grammar(rules, even), params)
    likely = [r.p_apriori * norm.pdf(12.0, r.width_m, params.plain.sigma_m) for r in rules]
    assert layout.classes.tolist() == ["executive", "assistant", "executive"]
    assert layout.to_posteriors[:-1] == pytest.approx(likely[1] / sum(likely))


def test_a_grammar_gains_what_it_explains_over_rooms_of_any_width():
    rng = np.random.default_rng(6)
    lines = observed([drawn(rng, 0.1, 0.1)[0] for _ in range(6)])
    other = tuple(
        Rule(r.id, tuple(Part(p.class_, 1.3 * p.width_m, p.spread_m) for p in r.parts), r.p_apriori)
        for r in RULES
    )
    right, wrong = (decode(lines, g, DecodeParams()) for g in (grammar(), grammar(other)))
    best = right.hypotheses == 0
    assert (right.gains[best] > 0).all()
    assert np.unique(right.gains).sum() > np.unique(wrong.gains).sum()
    one = decode(observed([seen(2.9)]), grammar(RULES[:1], np.ones((1, 1))), DecodeParams(
        unexplained="forbidden", segmental=SegmentalParams(p_seen=1.0)))  # fmt: skip
    known = RULES[0].p_apriori * norm.pdf(2.9, 2.9, np.sqrt(0.15**2 + 2 * 0.05**2))
    assert one.gains[0] == pytest.approx(np.log(known / lognorm.pdf(2.9, 0.8, scale=4.0)))
