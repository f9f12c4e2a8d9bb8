"""Fused boundaries against closed forms and numpy's least squares; the guard; modules."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grammars.model import Module
from tasks.layout.placement.guard import contradicted, fuse_guarded
from tasks.layout.placement.modules import nearest_modules, with_modules
from tasks.layout.placement.widths import Chain, Tie, fuse_chain, fuse_chains, replace_chain

NONE = np.nan


def chain(observed, sigma, width, spread=0.02):
    n = len(observed)
    width = np.array(width, float)
    return Chain(
        np.array(observed, float),
        np.broadcast_to(np.array(sigma, float), n).copy(),
        width,
        np.where(np.isnan(width), np.nan, spread),
    )


def drawn(rng, n):
    width = np.where(rng.random(n) < 0.3, np.nan, rng.uniform(2, 8, n))
    observed = np.concatenate([[0.0], np.cumsum(rng.uniform(2, 8, n))])
    spread = np.where(np.isnan(width), np.nan, rng.uniform(0.02, 0.5, n))
    return Chain(observed, rng.uniform(0.01, 1.0, n + 1), width, spread)


def least_squares(chains, ties=()):
    """Return positions and deviations from the stacked, weighted equations, one row each."""
    first = np.cumsum([0, *(len(c.observed_m) for c in chains)])
    rows, right = [], []

    def equation(terms, value, sigma):
        row = np.zeros(first[-1])
        for at, factor in terms:
            row[at] += factor / sigma
        rows.append(row)
        right.append(value / sigma)

    for c, at in zip(chains, first, strict=False):
        for k, (value, sigma) in enumerate(zip(c.observed_m, c.sigma_m, strict=True)):
            equation([(at + k, 1)], value, sigma)
        for k in np.flatnonzero(~np.isnan(c.width_m)):
            equation([(at + k + 1, 1), (at + k, -1)], c.width_m[k], c.spread_m[k])
    for t in ties:
        a, b = first[t.chain_a] + t.boundary_a, first[t.chain_b] + t.boundary_b
        equation([(b, 1), (a, -t.sign)], t.offset_m, t.sigma_m)
    matrix = np.array(rows)
    found = np.linalg.lstsq(matrix, np.array(right), rcond=None)[0]
    sigma = np.sqrt(np.diag(np.linalg.inv(matrix.T @ matrix)))
    return np.split(found, first[1:-1]), np.split(sigma, first[1:-1])


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 30))
def test_one_line_is_the_weighted_least_squares(seed, rooms):
    one = drawn(np.random.default_rng(seed), rooms)
    fused = fuse_chain(one)
    (position,), (sigma,) = least_squares([one])
    assert fused.position_m == pytest.approx(position, abs=1e-8)
    assert fused.sigma_m == pytest.approx(sigma, rel=1e-6)


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 10_000))
def test_tied_lines_are_the_weighted_least_squares_of_all(seed):
    rng = np.random.default_rng(seed)
    chains = [drawn(rng, int(n)) for n in rng.integers(2, 8, 4)]
    ties = [Tie(0, 1, 2, 1, -1.0, 9.0, 0.02), Tie(2, 2, 3, 0, 1.0, -1.5, 0.05)]
    position, sigma = least_squares(chains, ties)
    for i, fused in enumerate(fuse_chains(chains, ties)):
        assert fused.position_m == pytest.approx(position[i], abs=1e-6)
        assert fused.sigma_m == pytest.approx(sigma[i], rel=1e-5)


def test_one_room_between_known_ends_takes_the_mean_by_precision():
    fused = fuse_chain(chain([0, 4.3, 9], [1e-6, 0.1, 1e-6], [4.0, NONE], spread=0.2))
    precise, vague = 1 / 0.1**2, 1 / 0.2**2
    assert fused.position_m[1] == pytest.approx((4.3 * precise + 4.0 * vague) / (precise + vague))
    assert fused.sigma_m[1] == pytest.approx((precise + vague) ** -0.5)


def test_widths_that_do_not_add_up_share_the_difference():
    fused = fuse_chain(chain([0, 1, 2, 9.3], [1e-6, 1e3, 1e3, 1e-6], [3, 3, 3], spread=0.1))
    assert np.diff(fused.position_m) == pytest.approx([3.1, 3.1, 3.1], abs=1e-6)


def test_without_rules_the_observed_stays():
    one = chain([0, 3, 7.5], 0.05, [NONE, NONE])
    assert fuse_chain(one).position_m == pytest.approx(one.observed_m)
    assert fuse_chain(one).sigma_m == pytest.approx(one.sigma_m)


def test_replaced_widths_follow_one_another_from_the_start():
    fused = replace_chain(chain([0, 3.1, 7.5, 10], 0.05, [3.0, NONE, 2.2]))
    assert fused.position_m == pytest.approx([0, 3.0, 7.4, 9.6])
    assert (np.diff(fused.sigma_m) > 0).all()


# --- the guard

FIRM = np.ones(4, bool)
NO_DOUBT = np.zeros(12, bool)


def test_a_rule_far_from_two_firm_walls_is_refused_and_a_near_one_is_not():
    one = chain([0, 3, 6, 9], 0.03, [3.05, 3.4, NONE])
    assert contradicted(one, FIRM, limit=3).tolist() == [False, True, False]
    off = 3 * np.sqrt(2 * 0.03**2 + 0.02**2)
    beside = [chain([0, 3], 0.03, [3 + f * off]) for f in (0.99, 1.01)]
    assert [contradicted(c, FIRM[:2], 3).item() for c in beside] == [False, True]


def test_a_wall_not_well_observed_refuses_nothing():
    one = chain([0, 3, 6, 9], [0.03, 0.03, 0.3, 0.03], [3.0, 3.4, 2.6])
    firm = np.array([True, True, False, True])
    fused, (refused,) = fuse_guarded([one], [], [firm], [NO_DOUBT[:3]], 3, 0.5)
    assert not refused.any()
    assert fused[0].position_m[2] > 6.1


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from([0.0, 0.1, 1.0]))
def test_no_firm_wall_moves_beyond_the_limit(seed, error):
    rng = np.random.default_rng(seed)
    width = rng.uniform(2, 8, 12)
    one = chain(np.concatenate([[0], np.cumsum(width)]), 0.03, width + rng.normal(0, error, 12))
    firm = rng.random(13) < 0.7
    (fused,), (refused,) = fuse_guarded([one], [], [firm], [NO_DOUBT], 3, 0.5)
    assert (np.abs(fused.position_m - one.observed_m)[firm] <= 3 * 0.03 + 1e-9).all()
    if error == 0:
        assert not refused.any()


def test_a_grammar_that_most_firm_walls_contradict_has_no_say_at_all():
    observed = np.arange(6) * 3.0
    one = chain(observed, 0.03, [3.5, 2.4, 3.6, 3.02, 3.0])
    (fused,), (refused,) = fuse_guarded([one], [], [np.ones(6, bool)], [NO_DOUBT[:5]], 3, 0.5)
    assert refused.all()
    assert fused.position_m == pytest.approx(observed)
    _, (some,) = fuse_guarded([one], [], [np.ones(6, bool)], [NO_DOUBT[:5]], 3, 0.7)
    assert some.tolist() == [True, True, True, False, False]


# --- modules


def test_a_width_near_modules_keeps_to_them_and_one_between_does_not():
    module = Module(2.4, 0.03)
    width, spread = nearest_modules(np.array([4.75, 3.6, 7.3]), np.full(3, 0.05), module)
    assert width == pytest.approx([4.8, NONE, 7.2], nan_ok=True)
    assert spread == pytest.approx([0.03, NONE, 0.03], nan_ok=True)


def test_modules_speak_only_for_rooms_without_a_rule():
    one = chain([0, 4.75, 9.6], 0.05, [4.9, NONE])
    with_module = with_modules(one, Module(2.4, 0.03))
    assert with_module.width_m == pytest.approx([4.9, 4.8])
    assert with_modules(one, None) is one
