"""Bigrams and their smoothing, against counts by hand and pairs left out one by one."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grammars.generator.relations import (
    OWN_NATS,
    STRENGTHS,
    best_strengths,
    count_pairs,
    relate,
    rounded,
)


def test_pairs_are_counted_within_rows_and_not_across_what_no_rule_explains():
    counts = count_pairs([[0, 1, 0], [1, 1, -1, 0], [2], []], 3)
    assert counts.tolist() == [[0, 1, 0], [1, 1, 0], [0, 0, 0]]


def test_unseen_neighbours_get_the_share_of_their_a_priori_probability():
    pairs = np.array([[2.0, 1.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 0.0]])
    p = np.array([0.5, 0.3, 0.2])
    expected = [
        [(2 + 2 * 0.5) / 5, (1 + 2 * 0.3) / 5, 2 * 0.2 / 5],
        [2 * 0.5 / 6, (4 + 2 * 0.3) / 6, 2 * 0.2 / 6],
        p.tolist(),
    ]
    assert relate(pairs, p, 2.0) == pytest.approx(np.array(expected))


def slow_strengths(rows, p, both):
    """Leave one pair out at a time, all of its readings, and predict each reading from the rest."""
    seen = [(a, b) for row in rows for a, b in pairwise(row)]
    n = len(p)
    scores = np.zeros((len(STRENGTHS), n))
    for left, (a, b) in enumerate(seen):
        counts = np.zeros((n, n))
        for other, (c, d) in enumerate(seen):
            if other != left:
                counts[c, d] += 1
                counts[d, c] += both
        for i, j in ((a, b), (b, a)) if both else ((a, b),):
            predicted = [(counts[i, j] + k * p[j]) / (counts[i].sum() + k) for k in STRENGTHS]
            scores[:, i] += np.log(predicted)
    total = np.round(scores.sum(axis=1), 9)
    common = max(i for i in range(len(STRENGTHS)) if total[i] == total.max())
    found = []
    for row in np.round(scores.T, 9):
        own = max(i for i in range(len(STRENGTHS)) if row[i] == row.max())
        found.append(STRENGTHS[own if row[own] - row[common] >= OWN_NATS else common])
    return found


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.lists(st.integers(0, 3), min_size=2, max_size=12), min_size=1, max_size=5),
    st.booleans(),
)
def test_strengths_are_those_that_predict_pairs_left_out_best(rows, both):
    read = [r for row in rows for r in ((row, row[::-1]) if both else (row,))]
    p = np.bincount([r for row in rows for r in row], minlength=4) + 0.5
    p = p / p.sum()
    found = best_strengths(count_pairs(read, 4), p, both)
    assert found.tolist() == slow_strengths(rows, p, both)


def test_what_always_follows_is_believed_and_chance_is_not():
    # an assistant is always beside executives; offices and stores follow at random
    rng = np.random.default_rng(1)
    rows = [[0, 1, 0, *(rng.integers(2, 5, 12).tolist())] for _ in range(4)]
    p = np.bincount([r for row in rows for r in row], minlength=5) / sum(map(len, rows))
    pairs = count_pairs([r for row in rows for r in (row, row[::-1])], 5)
    relation = relate(pairs, p, best_strengths(pairs, p, both=True))
    assert relation[1, 0] > 0.9
    assert relation[2, 2:] == pytest.approx(p[2:], abs=0.12)


@settings(max_examples=100, deadline=None)
@given(st.lists(st.integers(0, 10**7), min_size=1, max_size=40).filter(any))
def test_rounded_probabilities_sum_to_one_and_are_near(weights):
    p = np.array(weights) / sum(weights)
    found = rounded(p)
    assert sum(round(x * 10**6) for x in found) == 10**6
    assert found == pytest.approx(p, abs=1.01e-6) and (found >= 0).all()
