"""One-to-one matching against brute force over every way to pair."""

from itertools import combinations, permutations

import numpy as np
import pytest
import shapely
from shapely import box
from shapely.affinity import rotate

from tasks.evaluation.matching import Pairs, most_overlapping, nearest, overlapping, within


def every_matching(pairs):
    """Yield all one-to-one subsets of the pairs, as lists of their values."""
    for size in range(len(pairs) + 1):
        for some in combinations(range(len(pairs)), size):
            chosen = list(some)
            if len(set(pairs.found[chosen])) == len(set(pairs.true[chosen])) == size:
                yield pairs.values[chosen]


def drawn(rng, n_found, n_true, n):
    cells = rng.choice(n_found * n_true, n, replace=False)
    return Pairs(cells // n_true, cells % n_true, rng.random(n))


def is_one_to_one(pairs):
    return len(set(pairs.found)) == len(set(pairs.true)) == len(pairs)


@pytest.mark.parametrize("shape", [(3, 3, 6), (2, 5, 7), (5, 2, 8), (4, 4, 10), (1, 1, 1)])
def test_no_matching_of_pairs_over_the_threshold_has_a_greater_sum(shape):
    rng = np.random.default_rng(shape)
    for threshold in (0.0, 0.3, 0.5, 0.99):
        for _ in range(10):
            pairs = drawn(rng, *shape)
            taken = most_overlapping(pairs, threshold)
            over = pairs.at(pairs.values > threshold)
            best = max(values.sum() for values in every_matching(over))
            assert is_one_to_one(taken)
            assert (taken.values > threshold).all()
            assert taken.values.sum() == pytest.approx(best)


@pytest.mark.parametrize("shape", [(3, 3, 6), (2, 5, 7), (5, 2, 8), (4, 4, 10), (1, 1, 1)])
def test_no_matching_within_reach_has_more_pairs_or_as_many_that_are_nearer(shape):
    rng = np.random.default_rng(shape)
    for limit in (0.2, 0.6, 1.0):
        for _ in range(10):
            pairs = drawn(rng, *shape)
            taken = nearest(pairs, limit)
            near = pairs.at(pairs.values <= limit)
            most = max(len(values) for values in every_matching(near))
            least = min(values.sum() for values in every_matching(near) if len(values) == most)
            assert is_one_to_one(taken)
            assert len(taken) == most
            assert taken.values.sum() == pytest.approx(least)


def test_points_are_matched_as_permutations_of_all_of_them_would():
    rng = np.random.default_rng(5)
    for _ in range(20):
        found, true = rng.random((4, 2)), rng.random((5, 2))
        apart = np.linalg.norm(found[:, None] - true[None], axis=2)
        least = min(sum(apart[i, j] for i, j in enumerate(p)) for p in permutations(range(5), 4))
        taken = nearest(within(found, true, 2.0), 2.0)
        assert len(taken) == 4
        assert taken.values.sum() == pytest.approx(least)


def test_a_point_out_of_reach_never_takes_the_place_of_one_within():
    # the least sum over all: (0 -> 0.9) and (1 -> 5), whatever the reach
    found, true = np.array([[0.0, 0], [1.0, 0]]), np.array([[0.9, 0], [5.0, 0]])
    taken = nearest(within(found, true, 0.2), 0.2)
    assert (list(taken.found), list(taken.true)) == ([1], [0])


def test_points_are_within_reach_by_euclid_not_along_one_axis():
    found, true = np.array([[0.0, 0.0]]), np.array([[0.0, 3.0], [0.06, 0.08], [0.08, 0.08]])
    pairs = within(found, true, 0.1)
    assert list(pairs.true) == [1]
    assert pairs.values == pytest.approx([0.1])


def test_overlapping_rooms_are_those_a_scan_of_all_pairs_finds():
    rng = np.random.default_rng(2)
    rooms = [
        rotate(box(x, y, x + w, y + h), angle)
        for x, y, w, h, angle in rng.uniform((0, 0, 1, 1, 0), (20, 20, 5, 5, 180), (60, 5))
    ]
    found, true = rooms[:25], rooms[25:]
    slow = {
        (i, j): shapely.intersection(a, b).area / shapely.union(a, b).area
        for i, a in enumerate(found)
        for j, b in enumerate(true)
        if shapely.intersection(a, b).area > 0
    }
    pairs = overlapping(found, true)
    fast = dict(zip(zip(pairs.found, pairs.true, strict=True), pairs.values, strict=True))
    assert fast.keys() == slow.keys() and 20 < len(slow) < 25 * 35 / 2
    assert fast == pytest.approx(slow)


@pytest.mark.parametrize(("n", "m"), [(0, 2), (2, 0), (0, 0)])
def test_nothing_pairs_with_nothing(n, m):
    assert len(overlapping([box(0, 0, 1, 1)] * n, [box(0, 0, 1, 1)] * m)) == 0
    near = within(np.zeros((n, 2)), np.zeros((m, 2)), 1.0)
    assert len(nearest(near, 1.0)) == len(most_overlapping(near, 0.0)) == 0
