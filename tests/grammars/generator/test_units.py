"""Room units by minimum description length."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grammars.generator.units import cut, find_units

OFFICE, EXECUTIVE, ASSISTANT, WC = range(4)


def rows_of(units, rng, n_rows=12, length=8):
    """Rows of units drawn one by one with equal probability."""
    drawn = [[units[i] for i in rng.integers(0, len(units), length)] for _ in range(n_rows)]
    return [tuple(type_ for unit in row for type_ in unit) for row in drawn]


def test_rooms_that_always_come_together_are_a_unit():
    together = (EXECUTIVE, ASSISTANT, EXECUTIVE)
    rows = rows_of([(OFFICE,), together, (WC,)], np.random.default_rng(2))
    found = find_units(rows, 4, 4, both=True)
    assert found.rules == ((OFFICE,), (WC,), together)


def test_rooms_drawn_one_by_one_make_no_unit():
    for seed in range(5):
        rows = rows_of([(0,), (1,), (2,), (3,)], np.random.default_rng(seed), 10, 12)
        assert all(len(rule) == 1 for rule in find_units(rows, 4, 4, both=True).rules)


def test_a_lopsided_unit_comes_with_its_mirror_image_if_lines_are_read_both_ways():
    rng = np.random.default_rng(3)
    rows = rows_of([(OFFICE,), (OFFICE,), (EXECUTIVE, ASSISTANT)], rng)
    assert (EXECUTIVE, ASSISTANT) in find_units(rows, 4, 4, both=False).rules
    both = find_units(rows, 4, 4, both=True)
    assert {(EXECUTIVE, ASSISTANT), (ASSISTANT, EXECUTIVE)} <= set(both.rules)
    mirrored = find_units([row[::-1] for row in rows], 4, 4, both=True)
    assert mirrored.rules == both.rules and mirrored.bits == pytest.approx(both.bits)


def test_the_length_of_a_description_is_that_worked_by_hand():
    # 4 rooms, 3 of type 0 and 1 of type 1; two rules of half a log2 4 each
    found = find_units([(0, 0, 1, 0)], 2, 4, both=False)
    by_hand = 3 * np.log2(4 / 3) + np.log2(4) + 2 * np.log2(4) / 2
    assert found.bits == pytest.approx(by_hand)
    assert found.rows == ((0, 0, 1, 0),)


@pytest.mark.parametrize("both", [False, True])
def test_with_units_too_the_length_is_that_of_the_two_parts(both):
    rng = np.random.default_rng(3)
    rows = rows_of([(OFFICE,), (OFFICE,), (EXECUTIVE, ASSISTANT), (WC, WC, ASSISTANT)], rng)
    found = find_units(rows, 4, 5, both)
    applied = [rule for row in found.rows for rule in row]
    counts = np.array([applied.count(i) for i in range(len(found.rules))])
    weight = 0.5 if both else 1.0
    bits = -weight * (counts * np.log2(counts / counts.sum())).sum()
    bits += len(counts) * np.log2(weight * counts.sum()) / 2
    units = {frozenset((u, u[::-1])) if both else u for u in found.rules if len(u) > 1}
    sizes = [len(next(iter(unit))) if both else len(unit) for unit in units]
    bits += sum(k * np.log2(4) + np.log2(4) for k in sizes)  # 4 types, 2 to 5 rooms
    assert len(sizes) >= 2 and found.bits == pytest.approx(bits)


def test_the_rows_of_a_reading_spell_the_rooms():
    rows = rows_of([(0,), (1, 2), (3, 1, 3)], np.random.default_rng(5))
    found = find_units(rows, 4, 4, both=True)
    spelt = [tuple(t for rule in row for t in found.rules[rule]) for row in found.rows]
    assert spelt[::2] == rows and spelt[1::2] == [row[::-1] for row in rows]


types = st.integers(0, 2)
costs = st.dictionaries(
    st.lists(types, min_size=2, max_size=3).map(tuple), st.floats(0.1, 9), max_size=5
)


@settings(max_examples=100, deadline=None)
@given(st.lists(types, max_size=7).map(tuple), costs)
def test_no_other_cutting_of_a_row_is_cheaper(row, units):
    priced = {(t,): 1.0 + t for t in range(3)} | units
    found = cut(row, priced)
    assert sum(found, ()) == row
    cheapest = min(sum(priced[part] for part in parts) for parts in cuttings(row, priced))
    assert sum(priced[part] for part in found) == pytest.approx(cheapest)


def cuttings(row, known):
    """All ways to cut a row into known parts."""
    for ends in product((False, True), repeat=max(len(row) - 1, 0)):
        parts, start = [], 0
        for i in range(1, len(row) + 1):
            if i == len(row) or ends[i - 1]:
                parts.append(row[start:i])
                start = i
        if all(part in known for part in parts):
            yield parts
