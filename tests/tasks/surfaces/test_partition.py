"""Which cells are indoors, and which of them are one room, against counting out all ways."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tasks.surfaces.partition import indoors, join_open

cost = st.integers(0, 5000).map(lambda units: units / 1000)
"""Whole thousandths: the solver's own unit, so that nothing is lost by rounding."""


@st.composite
def problems(draw):
    """Return costs of n <= 8 cells, and edges between them and to the outdoors."""
    n = draw(st.integers(1, 8))
    costs = [np.array(draw(st.lists(cost, min_size=n, max_size=n))) for _ in range(2)]
    ends = st.tuples(st.integers(0, n - 1), st.integers(-1, n - 1)).filter(lambda e: e[0] != e[1])
    edges = draw(st.lists(ends, max_size=16))
    left, right = np.array(edges, int).reshape(-1, 2).T
    cut = np.array(draw(st.lists(cost, min_size=len(edges), max_size=len(edges))), float)
    return *costs, left, right, cut


def cost_of(inside, outside_cost, inside_cost, left, right, cut_cost):
    with_outdoors = np.append(inside, False)
    limit = with_outdoors[left] != with_outdoors[right]
    return outside_cost[~inside].sum() + inside_cost[inside].sum() + cut_cost[limit].sum()


@settings(max_examples=150, deadline=None)
@given(problems())
def test_no_other_choice_of_cells_costs_less(problem):
    n = len(problem[0])
    chosen = indoors(*problem)
    assert chosen.shape == (n,) and chosen.dtype == bool
    every = (np.array(choice) for choice in itertools.product([False, True], repeat=n))
    least = min(cost_of(choice, *problem) for choice in every)
    assert cost_of(chosen, *problem) == pytest.approx(least, abs=1e-9)


def test_an_unseen_cell_between_seen_ones_is_indoors_unless_walled_off():
    outside, inside = np.array([5.0, 0, 5]), np.array([0.0, 0.5, 0])
    left, right = np.array([0, 1]), np.array([1, 2])
    assert indoors(outside, inside, left, right, np.array([1.0, 1.0])).all()
    assert indoors(outside, inside, left, right, np.array([0.1, 0.1])).tolist() == [1, 0, 1]


ALL = np.ones(3, bool)


def joined(members, borders, open_share=0.3):
    """Return the rooms of cells with (left, right, length, open length) borders."""
    left, right, length, open_length = np.array(borders, float).reshape(-1, 4).T
    ends = left.astype(int), right.astype(int)
    return join_open(members, *ends, length, open_length, open_share).tolist()


@pytest.mark.parametrize(
    ("borders", "rooms"),
    [
        ([], [0, 1, 2]),
        # four metres of wall with a door of 0.9 m; nothing at all between the other two
        ([(0, 1, 4, 0.9), (1, 2, 3, 3)], [0, 1, 1]),
        ([(0, 1, 4, 4), (1, 2, 4, 4)], [0, 0, 0]),
        # cell 2 is open to 0 over a metre, but a wall parts it from the room that 0 and 1 make
        ([(0, 1, 3, 3), (0, 2, 1, 0.9), (1, 2, 4, 0)], [0, 0, 2]),
        # two pieces of one border count as one: 0.9 of 4 m, although the door alone is open
        ([(0, 1, 0.9, 0.9), (0, 1, 3.1, 0)], [0, 1, 2]),
        ([(1, 0, 0.9, 0.9), (0, 1, 3.1, 0)], [0, 1, 2]),
        # to the outdoors
        ([(0, -1, 5, 5), (1, -1, 5, 5), (0, 1, 2, 2)], [0, 0, 2]),
    ],
    ids=[
        "no borders",
        "doorway",
        "hall",
        "walled off",
        "border in pieces",
        "pieces either way round",
        "outdoors",
    ],
)
def test_a_doorway_does_not_join_and_an_open_border_does(borders, rooms):
    assert joined(ALL, borders) == rooms


def test_cells_outdoors_join_nothing():
    members = np.array([True, False, True])
    assert joined(members, [(0, 1, 2, 2), (1, 2, 2, 2)]) == [0, -1, 2]


@pytest.mark.parametrize(("share", "rooms"), [(0.29, [0, 1, 2]), (0.31, [0, 0, 2])])
def test_the_share_of_open_border_decides(share, rooms):
    assert joined(ALL, [(0, 1, 10, 10 * share)]) == rooms


def test_the_order_of_the_borders_does_not_matter():
    borders = [(0, 1, 4, 0.9), (1, 2, 3, 3), (0, 2, 4, 1.5)]
    results = {tuple(joined(ALL, list(order))) for order in itertools.permutations(borders)}
    assert len(results) == 1
