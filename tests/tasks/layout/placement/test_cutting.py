"""Rooms joined, cut and moved edge by edge, against areas in closed form."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import Polygon, box
from shapely.affinity import rotate

from tasks.layout.extraction.model import LineFrame
from tasks.layout.placement.cutting import cut, joined
from tasks.layout.placement.outline import edges_of, moved

LINE = LineFrame.between(np.array([0.0, 0.0]), np.array([10.0, 0.0]))
L_SHAPE = Polygon([(0, 0), (6, 0), (6, 2), (3, 2), (3, 5), (0, 5)])
U_SHAPE = Polygon([(0, 0), (2, 0), (2, 2), (4, 2), (4, 0), (6, 0), (6, 4), (0, 4)])


def by(polygon, moves):
    """Return the moves in the order of the edges, {outward normal: metres}."""
    found = np.zeros((len(edges_of([polygon])), 2))
    for normal, metres in moves.items():
        found[edges_of([polygon]).outward @ np.array(normal) > 0.99] = metres
    return found


def only(edges, metres):
    return np.where(edges, metres, 0.0)[:, None] * np.ones(2)


def test_two_rooms_and_the_wall_between_them_make_one():
    whole = joined([box(0, 0, 3, 5), box(3.1, 0, 7, 5)], 0.5)
    assert shapely.equals(whole, box(0, 0, 7, 5))


def test_rooms_of_different_depth_join_along_their_common_wall():
    whole = joined([box(0, 0, 3, 5), box(3.1, 0, 7, 4)], 0.5)
    assert whole.area == pytest.approx(15 + 3.9 * 4 + 0.1 * 4, abs=1e-2)
    assert len(whole.interiors) == 0


def test_three_rooms_join_and_turned_ones_too():
    rooms = [box(0, 0, 3, 5), box(3.1, 0, 7, 5), box(7.2, 0, 9, 5)]
    turned = [rotate(room, 30, origin=(0, 0)) for room in rooms]
    assert joined(turned, 0.5).area == pytest.approx(45, abs=1e-2)


@pytest.mark.parametrize(
    "other", [box(3.8, 0, 7, 5), box(3.1, 5.1, 7, 9)], ids=["too far", "corner to corner"]
)
def test_rooms_that_no_wall_joins_make_none(other):
    assert joined([box(0, 0, 3, 5), other], 0.5) is None


def test_a_cut_room_has_walls_of_their_thickness_between_its_rooms():
    pieces = cut(box(0, 1, 9, 5), LINE, np.array([3.0, 6.0]), np.array([0.1, 0.2]), 1.0)
    assert [p.bounds for p in pieces] == [(0, 1, 2.95, 5), (3.05, 1, 5.9, 5), (6.1, 1, 9, 5)]


def test_a_cut_room_joins_to_what_it_was():
    whole = rotate(box(0, 1, 9, 5), 20, origin=(0, 0))
    along = np.array([np.cos(np.radians(20)), np.sin(np.radians(20))])
    frame = LineFrame.between(np.zeros(2), 10 * along)
    pieces = cut(whole, frame, np.array([4.0]), np.array([0.12]), 1.0)
    assert joined(pieces, 0.5).symmetric_difference(whole).area < 1e-2


def test_an_l_is_cut_through_its_foot():
    left, right = cut(L_SHAPE, LINE, np.array([4.0]), np.array([0.1]), 1.0)
    assert left.area == pytest.approx(L_SHAPE.area - 2 * 2.05)
    assert right.area == pytest.approx(2 * 1.95)


@pytest.mark.parametrize(
    ("room", "at"),
    [(box(0, 0, 9, 4), [9.5]), (box(0, 0, 9, 4), [0.1]), (rotate(U_SHAPE, 90), [3.0])],
    ids=["beside", "sliver", "in three"],
)
def test_a_wall_that_does_not_make_two_rooms_is_refused(room, at):
    assert cut(room, LINE, np.array(at), np.full(len(at), 0.1), 1.0) is None


def test_walls_out_of_order_are_refused():
    assert cut(box(0, 0, 9, 4), LINE, np.array([4.0, 4.05]), np.full(2, 0.1), 0.1) is None


# --- moved edges


def test_a_moved_side_makes_a_room_wider_by_as_much():
    room = moved(box(0, 0, 4, 5), by(box(0, 0, 4, 5), {(1, 0): 0.3, (-1, 0): -0.1}))
    assert room.bounds == pytest.approx((0.1, 0, 4.3, 5))


def test_only_the_moved_wall_of_an_l_moves():
    edges = edges_of([L_SHAPE])
    foot = (edges.outward[:, 0] > 0.9) & (edges.middle[:, 0] > 5)
    room = moved(L_SHAPE, only(foot, 0.5))
    assert shapely.equals(room, Polygon([(0, 0), (6.5, 0), (6.5, 2), (3, 2), (3, 5), (0, 5)]))


def test_an_oblique_wall_keeps_its_line_where_its_neighbour_moves():
    room = Polygon([(0, 0), (6, 0), (4, 4), (0, 4)])
    wider = moved(room, by(room, {(0, 1): 1.0}))
    assert shapely.equals(wider, Polygon([(0, 0), (6, 0), (3.5, 5), (0, 5)]))


def test_a_wall_is_turned_by_moving_its_ends_apart():
    room = Polygon([(0, 0), (4.2, 0), (4, 5), (0, 5)])
    tilted = edges_of([room]).outward[:, 0] > 0.9
    outward = edges_of([room]).outward[tilted][0]
    by_m = np.where(tilted[:, None], [[-0.2 / outward[0], 0.0]], 0.0)
    assert moved(room, by_m).symmetric_difference(box(0, 0, 4, 5)).area < 2e-3


def test_a_hole_moves_with_its_own_walls():
    room = box(0, 0, 9, 9).difference(box(3, 3, 6, 6))
    edges = edges_of([room])
    inner = (edges.outward[:, 0] > 0.9) & (edges.middle[:, 0] < 5)  # the hole's left side
    assert moved(room, only(inner, 0.5)).area == pytest.approx(72 + 0.5 * 3)


def test_a_step_closes_where_both_sides_come_to_lie_on_one_line():
    stepped = Polygon([(0, 0), (6, 0), (6, 4.1), (3, 4.1), (3, 4), (0, 4)])
    edges = edges_of([stepped])
    low = (edges.outward[:, 1] > 0.9) & (edges.middle[:, 0] < 3)
    assert shapely.equals(moved(stepped, only(low, 0.1)), box(0, 0, 6, 4.1))


@pytest.mark.parametrize("inwards", [4.1, 6.0])
def test_a_room_turned_inside_out_is_none(inwards):
    assert moved(box(0, 0, 4, 5), by(box(0, 0, 4, 5), {(1, 0): -inwards})) is None


def test_a_wall_moved_through_another_is_refused():
    edges = edges_of([L_SHAPE])
    step = (edges.outward[:, 1] > 0.9) & (edges.middle[:, 1] < 3)
    assert moved(L_SHAPE, only(step, -2.5)) is None


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 10_000), st.floats(0, 360))
def test_moves_turn_with_the_room(seed, angle):
    by_m = np.random.default_rng(seed).uniform(-0.4, 0.4, (6, 1)) * np.ones(2)
    plain = moved(L_SHAPE, by_m)
    turned = moved(rotate(L_SHAPE, angle, origin=(0, 0)), by_m)
    expected = rotate(plain, angle, origin=(0, 0))
    assert turned.is_valid
    assert turned.symmetric_difference(expected).area < 1e-6
