"""The most probable hypotheses of walls and rules against enumeration and closed forms."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import multivariate_normal

from storage.layout import LINE_END
from tasks.layout.extraction.model import LineFrame
from tasks.layout.placement import choice as searching
from tasks.layout.placement.choice import P_WRONG, RANGE_M, choose, chosen, fit_of
from tasks.layout.placement.decoded_rows import DecodedRow
from tasks.layout.placement.hypotheses import Hypotheses, hypotheses_of
from tasks.layout.placement.wall_kinds import Partition, face_sigma_m, partition_of
from tasks.layout.placement.widths import Chain, fuse_chain

NONE = np.nan
PARTITION = Partition(0.125, 0.005)
SIGMA = 0.01


def row(walls, widths, spread=0.02, sigma=SIGMA, ends=None):
    """Return a row of faces (lower, upper) per wall between two bare ends of the line."""
    faces = np.array([(NONE, NONE), *walls, (NONE, NONE)], float)
    if ends is not None:
        faces[[0, -1]] = ends
    centre = np.nanmean(np.where(np.isnan(faces).all(axis=1)[:, None], 0.0, faces), axis=1)
    single = np.isnan(faces).sum(axis=1) == 1
    side = np.where(np.isnan(faces[:, 1]), 1, -1)
    at = np.where(single, centre + side * PARTITION.thickness_m / 2, centre)
    length = float(at[-2] + widths[-1]) if ends is None else float(at[-1])
    at[-1] = length
    n = len(widths)
    width = np.array(widths, float)
    return DecodedRow(
        frame=LineFrame(np.zeros(2), np.array([1.0, 0.0]), length),
        decoded=np.arange(n),
        chain=Chain(at, np.full(n + 1, sigma), width, np.where(np.isnan(width), NONE, spread)),
        faces_m=faces,
        presence=np.ones(n + 1),
        cuts=np.array([LINE_END, *range(n - 1), LINE_END]),
        interval_m=np.column_stack([at[:-1], at[1:]]),
        standing=np.arange(n),
        line_faces_m=faces[1:-1],
        line_presence=np.ones(n - 1),
        depth_m=np.inf,
    )


def decided(one, fit=1.0, partition=PARTITION):
    """Return chain, hypotheses and choice of a row."""
    walls = hypotheses_of(one, partition, one.chain.sigma_m, 0.0)
    best = choose(one.chain, walls, fit)
    return chosen(one.chain, walls, best, fit), walls, best


def enumerated(chain, hypotheses, fit):
    """Return the best of all combinations: widths between walls are jointly normal."""
    best = (-np.inf,)
    n = len(chain.width_m)
    ruled = ~np.isnan(chain.width_m)
    for walls in product(*(range(len(h)) for h in hypotheses)):
        centre = np.array([h.centre_m[w] for h, w in zip(hypotheses, walls, strict=True)])
        own = np.array([h.sigma_m[w] ** 2 for h, w in zip(hypotheses, walls, strict=True)])
        prior = sum(h.log_p[w] for h, w in zip(hypotheses, walls, strict=True))
        for doubted in product(*((False, True) if r else (False,) for r in ruled)):
            holds = np.flatnonzero(ruled & ~np.array(doubted, bool))
            log_p = prior + sum(doubted) * np.log(P_WRONG / RANGE_M)
            log_p += len(holds) * np.log1p(-P_WRONG)
            if len(holds):
                steps = np.zeros((n, n + 1))
                steps[np.arange(n), np.arange(n)] = -1
                steps[np.arange(n), np.arange(n) + 1] = 1
                steps = steps[holds]
                spread = np.diag((fit * chain.spread_m[holds]) ** 2)
                covariance = steps @ np.diag(own) @ steps.T + spread
                log_p += multivariate_normal.logpdf(
                    steps @ centre, chain.width_m[holds], covariance
                )
            best = max(best, (log_p, walls, doubted))
    return best


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 4), st.sampled_from([0.3, 1.0]))
def test_the_choice_is_the_best_of_all_combinations(seed, rooms, fit):
    rng = np.random.default_rng(seed)
    at = np.concatenate([[0.0], np.cumsum(rng.uniform(2, 5, rooms))])
    width = np.diff(at) + rng.choice([0, 0.1, 0.4], rooms)
    width[rng.random(rooms) < 0.2] = NONE
    one = Chain(at, np.full(rooms + 1, 0.02), width, np.where(np.isnan(width), NONE, 0.05))
    walls = []
    for x in at:
        count = int(rng.integers(1, 4))
        walls.append(
            Hypotheses(
                x + rng.normal(0, 0.2, count), rng.uniform(0.01, 0.3, count),
                np.log(rng.dirichlet(np.ones(count))), np.full(count, 0.1), np.zeros(count),
                np.ones(count, bool),
            )
        )  # fmt: skip
    best = choose(one, walls, fit)
    log_p, combination, doubted = enumerated(one, walls, fit)
    assert best.log_p == pytest.approx(log_p, abs=1e-8)
    assert best.walls.tolist() == list(combination)
    assert best.doubted.tolist() == list(doubted)


def test_what_is_dropped_along_a_line_was_not_needed(monkeypatch):
    rng = np.random.default_rng(5)
    walls = [(x - 0.06, x + 0.06 + 0.2 * (rng.random() < 0.3)) for x in np.arange(1, 14) * 3.0]
    one = row(walls, [3.0] * 14)
    few = decided(one)[2]
    monkeypatch.setattr(searching, "KEPT", 20_000)
    every = decided(one)[2]
    assert few.walls.tolist() == every.walls.tolist()
    assert few.log_p == pytest.approx(every.log_p)


@pytest.mark.parametrize("lower", [True, False])
def test_a_shelf_before_one_face_leaves_the_wall_at_its_other_face(lower):
    faces = [(2.94, 3.0625 + 0.3), (5.94, 6.06)] if lower else [(2.64, 3.06), (5.94, 6.06)]
    right = faces[0][0] + 0.0625 if lower else faces[0][1] - 0.0625
    chain, walls, best = decided(row(faces, [3.0, 3.0, 3.0]))
    assert chain.observed_m[1] == pytest.approx(right)
    assert not walls[1].faces_right[best.walls[1]]
    assert not best.doubted.any()
    position = fuse_chain(chain).position_m[1]
    assert position == pytest.approx(right, abs=0.01)
    assert walls[1].thickness_at(int(best.walls[1]), position) == pytest.approx(0.125, abs=0.02)


def test_without_a_rule_two_faces_far_apart_are_a_thick_wall():
    chain, walls, best = decided(row([(2.9, 3.2), (5.94, 6.06)], [NONE, NONE, NONE]))
    assert chain.observed_m[1] == pytest.approx(3.05)
    assert walls[1].thickness_at(int(best.walls[1]), 3.05) == pytest.approx(0.3)
    assert walls[1].faces_right[best.walls[1]]


def test_rules_that_know_little_do_not_move_a_thick_wall_either():
    chain, _, _ = decided(row([(2.9, 3.2), (5.94, 6.06)], [2.9, 3.0, 3.0], spread=0.5))
    assert chain.observed_m[1] == pytest.approx(3.05)


@pytest.mark.parametrize("thick", [0.125, 0.24, 0.3])
@pytest.mark.parametrize("side", [0, 1])
def test_a_wall_of_which_one_face_was_seen_is_as_thick_as_the_rules_beside_it_leave(thick, side):
    face = 3.0 - thick / 2 if side == 0 else 3.0 + thick / 2
    wall = (face, NONE) if side == 0 else (NONE, face)
    one = row([wall, (5.94, 6.06)], [3.0, 3.0, 3.0], spread=0.005)
    chain, walls, best = decided(one)
    position = fuse_chain(chain).position_m[1]
    assert position == pytest.approx(3.0, abs=0.012)
    found = walls[1].thickness_at(int(best.walls[1]), position)
    assert found == pytest.approx(thick, abs=0.025)
    other = position + found / 2 * (-1 if side == 0 else 1)
    assert other == pytest.approx(face, abs=0.006)


def test_given_where_its_centre_is_a_one_faced_wall_has_the_conditional_mean_thickness():
    sigma, spread = 0.02, 0.07
    one = row([(2.9, NONE)], [3.0, 3.0], sigma=sigma)
    wall = hypotheses_of(one, Partition(0.125, spread), one.chain.sigma_m, 0.0)[1]
    # (x, t) given the face y = x - t / 2 + noise and t's prior, x's flat
    precision = np.array([[1.0, -0.5], [-0.5, 0.25]]) / sigma**2
    precision[1, 1] += 1 / spread**2
    x, t = np.linalg.solve(precision, [2.9 / sigma**2, -1.45 / sigma**2 + 0.125 / spread**2])
    covariance = np.linalg.inv(precision)
    assert wall.centre_m[0] == pytest.approx(x)
    assert wall.sigma_m[0] == pytest.approx(np.sqrt(covariance[0, 0]))
    at = 3.01
    assert wall.thickness_at(0, at) == pytest.approx(
        t + covariance[0, 1] / covariance[0, 0] * (at - x)
    )


def test_a_rule_that_no_reading_of_the_walls_explains_is_doubted():
    walls = [(2.94, 3.06), (5.94, 6.06), (8.94, 9.06)]
    chain, _, best = decided(row(walls, [3.0, 4.0, 3.0, 3.0]))
    assert best.doubted.tolist() == [False, True, False, False]
    assert chain.observed_m[1:-1] == pytest.approx([3.0, 6.0, 9.0])


def test_a_mirrored_row_gets_the_mirrored_choice():
    walls = [(2.94, 3.36), (5.94, NONE), (8.94, 9.06)]
    one = row(walls, [3.0, 3.0, 3.0, 3.0])
    length = one.frame.length
    back = replace(
        one,
        faces_m=(length - one.faces_m)[::-1, ::-1],
        chain=Chain(length - one.chain.observed_m[::-1], one.chain.sigma_m,
                    one.chain.width_m[::-1], one.chain.spread_m[::-1]),
    )  # fmt: skip
    there, here = decided(one)[0], decided(back)[0]
    assert here.observed_m == pytest.approx(length - there.observed_m[::-1])
    assert here.sigma_m == pytest.approx(there.sigma_m[::-1])


def test_the_wall_a_line_ends_at_is_read_like_any_other():
    ends = [(-0.0625, 0.0625), (8.94, NONE)]
    one = row([(2.94, 3.06), (5.94, 6.06)], [3.0, 3.0, 3.1], spread=0.005, ends=ends)
    chain, walls, best = decided(one)
    at = fuse_chain(chain).position_m[-1]
    assert at == pytest.approx(9.1, abs=0.015)
    assert walls[-1].thickness_at(int(best.walls[-1]), at) == pytest.approx(0.32, abs=0.03)


@pytest.mark.parametrize(("off_m", "low", "high"), [(0.0, 0.1, 0.5), (0.03, 0.7, 1.0)])
def test_a_storey_keeps_to_its_rules_as_closely_as_its_widths_show(off_m, low, high):
    rng = np.random.default_rng(3)
    chains, walls = [], []
    for _ in range(4):
        width = np.full(12, 3.0) + rng.normal(0, off_m, 12)
        at = np.concatenate([[0.0], np.cumsum(width)]) + rng.normal(0, 0.003, 13)
        faces = [(x - 0.0625, x + 0.0625) for x in at[1:-1]]
        one = row(faces, [3.0] * 12, spread=0.03, sigma=0.005)
        chains.append(one.chain)
        walls.append(hypotheses_of(one, PARTITION, one.chain.sigma_m, 0.0))
    assert low <= fit_of(chains, walls) <= high


def test_a_storey_tells_how_thick_its_own_partitions_are():
    rng = np.random.default_rng(0)
    thick = 0.1 + rng.normal(0, 0.01, 40)
    thick[:6] = 0.24
    walls = [(3.0 * k + 3, 3.0 * k + 3 + t) for k, t in enumerate(thick)]
    one = row(walls, [3.0] * 41, sigma=0.01)
    found = partition_of([one], 0.125, 0.05)
    assert found.thickness_m == pytest.approx(0.1, abs=0.004)
    assert found.spread_m < 0.01
    assert found.noise == pytest.approx(0.5, abs=0.2)  # 1 cm scatter, 2 cm by what faces say
    few = partition_of([row(walls[:3], [3.0] * 4)], 0.125, 0.05)
    assert (few.thickness_m, few.spread_m, few.noise) == (0.125, 0.05, 1.0)


def test_a_faces_deviation_is_what_its_centre_was_made_of():
    assert face_sigma_m(np.hypot(0.02, 0.02) / 2, 2, 0.05) == pytest.approx(0.02)
    assert face_sigma_m(np.hypot(0.02, 0.05 / 2), 1, 0.05) == pytest.approx(0.02)
