"""Groups of widths, against all divisions one by one."""

from itertools import combinations, pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grammars.generator.groups import group_values

FLOOR = 0.03


def description(groups, n):
    """The length of a division, as the docstring of `group_values` writes it."""
    total = 0.0
    for x in groups:
        s = max(float(np.std(x)), FLOOR)
        total += float(((x - x.mean()) ** 2).sum()) / (2 * s**2) + len(x) * np.log(s)
        total += -len(x) * np.log(len(x) / n) + 1.5 * np.log(n)
    return total


@settings(max_examples=60, deadline=None)
@given(st.lists(st.integers(0, 200), min_size=1, max_size=9, unique=True))
def test_no_other_division_is_shorter(steps):
    values = np.array(steps) / 20
    labels = group_values(values, FLOOR)
    x, n = np.sort(values), len(values)
    divisions = (np.split(x, cuts) for k in range(n) for cuts in combinations(range(1, n), k))
    least = min(description(division, n) for division in divisions)
    found = [values[labels == g] for g in range(labels.max() + 1)]
    assert description(found, n) == pytest.approx(least)
    assert all(a.max() < b.min() for a, b in pairwise(found))


def test_widths_of_three_modules_are_three_groups_in_any_order():
    rng = np.random.default_rng(1)
    modules = rng.integers(1, 4, 60)
    labels = group_values(2.4 * modules + rng.normal(0, 0.02, 60), FLOOR)
    assert labels.tolist() == (modules - 1).tolist()


def test_equal_widths_stay_together_and_none_give_none():
    assert group_values(np.full(5, 3.6), FLOOR).tolist() == [0] * 5
    assert group_values(np.array([3.6]), FLOOR).tolist() == [0]
    assert len(group_values(np.empty(0), FLOOR)) == 0
