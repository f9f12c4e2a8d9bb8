"""The segmental decoder against enumeration of every way to read a line, written apart from it."""

from collections import Counter
from itertools import combinations, pairwise, product

import numpy as np
import pytest
from scipy import integrate, stats

from grammars.model import Grammar, Part, Rule
from storage.errors import MapSenseError
from storage.layout import HIDDEN, LINE_END
from tasks.layout.decoding.hmm import viterbi
from tasks.layout.decoding.kbest import best_decodings, rooms_of
from tasks.layout.decoding.plain import PlainParams, make_plain
from tasks.layout.decoding.posterior import (
    posterior,
    room_posteriors,
    undivided,
    wall_posteriors,
)
from tasks.layout.decoding.segmental import (
    SUREST,
    SegmentalParams,
    as_seen,
    make_segmental,
    make_walls,
)
from tasks.layout.decoding.states import Unexplained, make_states

PARAMS = SegmentalParams(rarest_run=1e-2, p_seen=0.8, spurious_per_m=0.1)


def grammar(parts, p_a, p_r):
    rules = tuple(Rule(f"r{i}", p, a) for i, (p, a) in enumerate(zip(parts, p_a, strict=True)))
    return Grammar(
        name="g", building_type="office", about="", learnt_from=(), simulated=True,
        classes=("a", "b", "c"), rules=rules, p_relation=np.array(p_r), partition_m=0.1,
        partition_spread_m=0.01,
    )  # fmt: skip


A, B = Part("a", 3.0, 0.3, 5.0, 0.2), Part("b", 4.5, 0.5)
UNIT = (Part("c", 2.0, 0.2, 4.0, 0.1), Part("a", 3.5, 0.4))
MIXED = grammar(
    [(A,), UNIT, (B,)], [0.5, 0.2, 0.3], [[0.2, 0.3, 0.5], [0.6, 0.1, 0.3], [0.7, 0.3, 0]]
)


SOME = Unexplained(0.1, 0.4)


def model(unexplained=SOME, params=PARAMS, g=MIXED):
    return make_segmental(make_states(g, g.p_relation, "kept", unexplained), params)


def line(seed, cuts=3, length=11.0):
    rng = np.random.default_rng(seed)
    depths = rng.uniform(3.5, 5.5, cuts + 1)
    depths[rng.integers(cuts + 1)] = np.nan
    return {
        "length": length,
        "cuts": np.sort(rng.uniform(1, length - 1, cuts)),
        "sigmas": rng.uniform(0.02, 0.3, cuts),
        "presence": rng.uniform(0, 1, cuts),
        "depths": depths,
        "rooms": np.array([0, *range(cuts)]),
    }


def log(x):
    return np.log(x) if x > 0 else -np.inf


def log_p_of_run(m, chain, seen, a, b):
    """Return the log p of rooms between two neighbouring dividing walls."""
    s, p, none = m.states, m.params, m.states.explained
    ends = np.array([0.0, *seen["cuts"], seen["length"]])
    sigmas = np.array([p.end_sigma_m, *seen["sigmas"], p.end_sigma_m])
    length = ends[b] - ends[a]
    if chain == (none,):
        found = stats.lognorm.logpdf(length, p.unexplained_spread, scale=p.unexplained_width_m)
    elif none in chain:
        return -np.inf
    else:
        inner = [s.log_transitions[i, j] + log(1 - p.p_seen) for i, j in pairwise(chain)]
        if sum(inner) < np.log(p.rarest_run):
            return -np.inf
        variance = sum(s.spreads[i] ** 2 for i in chain) + sigmas[a] ** 2 + sigmas[b] ** 2
        mean = sum(s.widths[i] for i in chain)
        if abs(length - mean) > m.runs.far * np.sqrt(variance):
            return -np.inf
        found = sum(inner) + stats.norm.logpdf(length, mean, np.sqrt(variance))
    for t in range(a, b) if p.depth == "used" else ():
        d, before = seen["depths"][t], seen["depths"][t - 1] if t else np.nan
        if np.isnan(d) or (t and seen["rooms"][t] == seen["rooms"][t - 1] and before == before):
            continue
        each = []
        for i in chain:
            sigma = np.hypot(s.depth_spreads[i], p.depth_sigma_m)
            fits = stats.norm.pdf(d, s.depths[i], sigma)
            u = p.p_wrong_depth
            each.append(1 / p.deepest_m if np.isnan(fits) else (1 - u) * fits + u / p.deepest_m)
        shares = [1.0] if len(chain) == 1 else [s.widths[i] for i in chain]
        found += np.log(np.average(each, weights=shares))
    return found


def enumerated(m, seen, longest=3):
    """Return every reading of a line: its log p, dividing walls and rooms between them.

    Longer runs than of three rooms are rarer than PARAMS.rarest_run: 0.2 ** 3.
    """
    s, p, cuts = m.states, m.params, len(seen["cuts"])
    q = np.clip(seen["presence"], 1 - SUREST, SUREST)
    chains = [c for n in range(1, longest + 1) for c in product(range(len(s)), repeat=n)]
    runs = {
        (a, b): [(c, x) for c in chains if (x := log_p_of_run(m, c, seen, a, b)) > -np.inf]
        for a, b in combinations(range(cuts + 2), 2)
    }
    found = []
    for n in range(cuts + 1):
        for dividing in combinations(range(cuts), n):
            walls = (0, *(i + 1 for i in dividing), cuts + 1)
            base = sum(
                log(p.p_seen * q[i]) if i in dividing else log(p.spurious_per_m * (1 - q[i]))
                for i in range(cuts)
            )
            for choice in product(*(runs[pair] for pair in pairwise(walls))):
                rooms = [c for c, _ in choice]
                log_p = base + sum(x for _, x in choice) + s.log_initial[rooms[0][0]]
                log_p += sum(s.log_transitions[c[-1], d[0]] for c, d in pairwise(rooms))
                if log_p > -np.inf and s.may_end[rooms[-1][-1]]:
                    found.append((log_p, walls, tuple(rooms)))
    return sorted(found, key=lambda one: -one[0])


def as_read(m, decoding):
    runs = m.runs
    rooms = tuple(tuple(runs.states[r, : runs.counts[r]].tolist()) for r in decoding.runs)
    return tuple(decoding.walls.tolist()), rooms


MODELS = {
    "all of it": model(),
    "every room explained": model(unexplained=None),
    "depths ignored": model(params=PARAMS.model_copy(update={"depth": "ignored"})),
}


@pytest.fixture(scope="module", params=[(name, seed) for name in MODELS for seed in range(2)])
def case(request):
    name, seed = request.param
    m, seen = MODELS[name], line(seed)
    return m, seen, make_walls(m, **seen), enumerated(m, seen)


def test_the_k_best_are_the_first_of_all_readings_sorted(case):
    m, _, walls, expected = case
    found = best_decodings(m, walls, 40)
    assert [d.log_p for d in found] == pytest.approx([log_p for log_p, *_ in expected[:40]])
    for i, decoding in enumerate(found):
        near = [e[1:] for e in expected if abs(e[0] - decoding.log_p) < 1e-9]
        assert as_read(m, decoding) in near, i
    assert len({as_read(m, d) for d in found}) == 40


def test_the_best_alone_is_the_first_of_the_k_best(case):
    m, _, walls, _ = case
    assert as_read(m, best_decodings(m, walls, 1)[0]) == as_read(m, best_decodings(m, walls, 7)[0])


def test_all_readings_are_found_if_as_many_are_asked_for():
    m, seen = MODELS["every room explained"], line(3, cuts=1, length=6.0)
    expected = enumerated(m, seen)
    found = best_decodings(m, make_walls(m, **seen), len(expected) + 5)
    assert sorted(as_read(m, d) for d in found) == sorted(e[1:] for e in expected)


def test_posteriors_are_the_shares_of_all_readings(case):
    m, _, walls, expected = case
    log_p = np.array([e[0] for e in expected])
    p = np.exp(log_p - log_p.max())
    sums = posterior(m, walls)
    assert sums.log_total == pytest.approx(log_p.max() + np.log(p.sum()))
    p /= p.sum()
    divides = [sum(p[i] for i, e in enumerate(expected) if w in e[1]) for w in range(5)]
    assert sums.walls == pytest.approx(divides)
    for decoding in best_decodings(m, walls, 4):
        asked = []
        for (a, b), rooms in zip(pairwise(decoding.walls), as_read(m, decoding)[1], strict=True):
            for k, room in enumerate(rooms):
                asked.append(
                    sum(
                        p[i]
                        for i, (_, ws, chains) in enumerate(expected)
                        for pair, chain in zip(pairwise(ws), chains, strict=True)
                        if pair == (a, b)
                        and len(chain) == len(rooms)
                        and m.states.classes[chain[k]] == m.states.classes[room]
                    )
                )
        assert room_posteriors(m, walls, decoding, sums) == pytest.approx(asked)


def hidden_walls(m, chain, seen, a, b):
    """Return mean and deviation of the walls within rooms, the length between two walls given.

    Of the normal variables (error of the first wall, widths, error of the second) those that add
    up to the length: conditioned by their covariance.
    """
    s, p = m.states, m.params
    ends = np.array([0.0, *seen["cuts"], seen["length"]])
    sigmas = np.array([p.end_sigma_m, *seen["sigmas"], p.end_sigma_m])
    mean = np.array([0.0, *s.widths[list(chain)], 0.0])
    covariance = np.diag([sigmas[a], *s.spreads[list(chain)], sigmas[b]]) ** 2
    upto = np.tri(len(chain) + 2)[1:-2]
    whole = np.ones(len(mean))
    gain = upto @ covariance @ whole / (whole @ covariance @ whole)
    at = ends[a] + upto @ mean + gain * (ends[b] - ends[a] - mean.sum())
    left = upto @ covariance @ upto.T - np.outer(gain, whole @ covariance @ upto.T)
    return list(zip(at, np.sqrt(np.diag(left)), strict=True))


@pytest.mark.parametrize("near_m", [0.2, 0.6])
def test_walls_posteriors_are_those_of_all_readings_that_have_one_there(case, near_m):
    m, seen, walls, expected = case
    p = np.exp(np.array([e[0] for e in expected]))
    p /= p.sum()
    sums = posterior(m, walls)
    ends = np.array([0.0, *seen["cuts"], seen["length"]])
    divides, of_run = np.zeros(len(ends)), Counter()
    for q, (_, ws, chains) in zip(p, expected, strict=True):
        divides[list(ws)] += q
        for pair, chain in zip(pairwise(ws), chains, strict=True):
            of_run[(*pair, chain)] += q
    # weight, mean and deviation of every hidden wall of every reading
    all_hidden = np.array(
        [
            (q, *wall)
            for (a, b, chain), q in of_run.items()
            for wall in hidden_walls(m, chain, seen, a, b)
        ]
    )
    weight, mean, sigma = all_hidden.T
    hidden = 0
    for decoding in best_decodings(m, walls, 12):
        rooms = rooms_of(m, walls, decoding)
        found = wall_posteriors(m, walls, rooms, sums, near_m)
        assert found[[0, -1]].tolist() == [1, 1]
        for k, (cut, at) in enumerate(zip(rooms.cuts, rooms.bounds_m, strict=True)):
            if cut >= 0:
                assert found[k] == pytest.approx(divides[cut + 1])
            elif cut == HIDDEN:
                hidden += 1
                low, high = at - near_m, at + near_m
                near = stats.norm.cdf(high, mean, sigma) - stats.norm.cdf(low, mean, sigma)
                asked = divides[1:-1][np.abs(ends[1:-1] - at) <= near_m].sum() + weight @ near
                assert found[k] == pytest.approx(min(asked, 1), abs=1e-9)
        for k, (low, high) in enumerate(pairwise(rooms.bounds_m)):
            within = [i + 1 for i, c in enumerate(seen["cuts"]) if low < c < high]
            whole = undivided(walls, rooms, sums)[k]
            assert whole == pytest.approx(1 - divides[within].max(initial=0.0), abs=1e-9)
    assert hidden


def test_without_a_grammar_a_line_is_as_probable_as_its_rooms_unexplained():
    m = MODELS["all of it"]
    none = m.states.explained
    for seed in range(3):
        seen = line(seed)
        expected = enumerated(m, seen, longest=1)
        log_p = next(x for x, ws, cs in expected if len(ws) == 5 and cs == ((none,),) * 4)
        chain = m.states.log_initial[none] + 3 * m.states.log_transitions[none, none]
        assert as_seen(m, make_walls(m, **seen)) == pytest.approx(log_p - chain)


def test_where_a_hidden_wall_stands_is_summed_over():
    """One wall missed: the run's density is the integral over where it may be, its mean that."""
    m = model(None, SegmentalParams(end_sigma_m=0.0, depth="ignored"))
    seen = line(0, cuts=0, length=8.0) | {"depths": np.full(1, np.nan), "rooms": np.zeros(1)}
    walls = make_walls(m, **seen)
    found = next(d for d in best_decodings(m, walls, 50) if as_read(m, d)[1] == ((0, 3),))
    at = lambda x: stats.norm.pdf(x, 3.0, 0.3) * stats.norm.pdf(8.0 - x, 4.5, 0.5)  # noqa: E731
    density, first = (integrate.quad(f, 0, 8, epsabs=1e-12)[0] for f in (at, lambda x: x * at(x)))
    states = m.states
    prior = states.log_initial[0] + states.log_transitions[0, 3] + np.log(0.1)
    assert found.log_p == pytest.approx(prior + np.log(density))
    rooms = rooms_of(m, walls, found)
    assert rooms.bounds_m == pytest.approx([0.0, first / density, 8.0])
    assert rooms.cuts.tolist() == [LINE_END, HIDDEN, LINE_END]


def test_rooms_fill_the_line_whatever_was_seen():
    m = MODELS["all of it"]
    for seed in range(10):
        walls = make_walls(m, **line(seed, cuts=6, length=20.0))
        for decoding in best_decodings(m, walls, 5):
            rooms = rooms_of(m, walls, decoding)
            assert rooms.bounds_m[[0, -1]].tolist() == [0.0, 20.0]
            assert (np.diff(rooms.bounds_m) > 0).all()
            seen = rooms.cuts >= 0
            assert (rooms.bounds_m[seen] == walls.at[rooms.cuts[seen] + 1]).all()


def test_where_no_wall_is_missed_or_imagined_it_is_the_plain_model():
    rng = np.random.default_rng(3)
    g = grammar(
        [(Part("a", w, 1.0),) for w in rng.uniform(2, 8, 5)],
        rng.dirichlet(np.ones(5)),
        rng.dirichlet(np.ones(5), 5),
    )
    params = SegmentalParams(p_seen=1.0, spurious_per_m=0.0, end_sigma_m=0.0, depth="ignored")
    m = model(None, params, g)
    plain = make_plain(m.states, PlainParams(sigma_m=1.0)).model
    differences = []
    for seed in range(10):
        seen = line(seed, cuts=6, length=30.0) | {
            "sigmas": np.zeros(6),
            "presence": np.full(6, 0.9),
        }
        widths = np.diff([0.0, *seen["cuts"], 30.0])
        paths, log_p = viterbi(plain, widths[None], np.array([7]))
        best = best_decodings(m, make_walls(m, **seen), 1)[0]
        assert m.runs.states[best.runs, 0].tolist() == paths[0].tolist()
        differences.append(best.log_p - log_p[0])
    assert differences == pytest.approx([6 * np.log(0.9)] * 10)


def test_a_mirrored_line_is_read_mirrored_where_order_has_no_direction():
    pairs = np.array([[3.0, 1, 2], [1, 0, 2], [2, 2, 1]])
    p_a = pairs.sum(axis=1) / pairs.sum()
    palindrome = (Part("c", 2.0, 0.2, 4.0, 0.1), Part("a", 3.5, 0.4), Part("c", 2.0, 0.2, 4.0, 0.1))
    g = grammar([(A,), palindrome, (B,)], p_a, pairs / pairs.sum(axis=1)[:, None])
    # which runs are too rare to try depends on the direction
    m = model(g=g, params=PARAMS.model_copy(update={"rarest_run": 1e-6}))
    for seed in range(20):
        seen = line(seed, cuts=6, length=20.0) | {"rooms": np.arange(7)}
        back = {k: v[::-1] for k, v in seen.items() if k != "length"} | {"length": 20.0}
        back["cuts"] = 20.0 - back["cuts"]
        one, two = make_walls(m, **seen), make_walls(m, **back)
        best, mirrored = best_decodings(m, one, 1)[0], best_decodings(m, two, 1)[0]
        assert mirrored.log_p == pytest.approx(best.log_p)
        assert (7 - mirrored.walls[::-1]).tolist() == best.walls.tolist()
        rooms, turned = rooms_of(m, one, best), rooms_of(m, two, mirrored)
        classes = [m.states.classes[s] for s in rooms.states]
        assert [m.states.classes[s] for s in turned.states[::-1]] == classes
        assert posterior(m, two).walls[::-1] == pytest.approx(posterior(m, one).walls, abs=1e-5)


def test_an_impossible_line_has_no_decoding_and_no_posterior():
    g = grammar([UNIT], [1.0], [[1.0]])
    m = model(None, SegmentalParams(p_seen=1.0), g)  # a unit of two, and no wall to part it
    walls = make_walls(m, **line(0, cuts=0, length=5.5) | {"rooms": np.zeros(1)})
    assert best_decodings(m, walls, 3) == []
    sums = posterior(m, walls)
    assert sums.log_total == -np.inf and sums.walls.tolist() == [0.0, 0.0]


def test_a_grammar_with_too_many_ways_to_fill_a_gap_is_refused():
    even = np.full((60, 60), 1 / 60)
    g = grammar([(A,)] * 60, even[0], even)
    with pytest.raises(MapSenseError, match="rarest_run"):
        model(params=SegmentalParams(p_seen=0.5), g=g)
