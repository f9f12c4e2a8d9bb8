"""Redundant rectangles, openings at one place, rooms linked, states of leaves."""

import numpy as np
import pytest
from shapely import box

from storage.candidates import FEATURES, Candidates
from storage.walls import Walls
from tasks.doors.crosscheck import CrossCheckParams, distinct, on_walls
from tasks.doors.merging import MergingParams, Rectangles, iou, per_door, per_wall
from tasks.doors.states import StateParams, states
from tasks.doors.topology import TopologyParams, doors_of_rooms, rooms_beside

PARAMS = MergingParams()
EMPTY_SHARES, FULL_SHARES = (0.1, 0.9, 0.0), (0.9, 0.1, 0.0)


def scattered(centres, n=12, seed=0, shares=EMPTY_SHARES):
    """Return rectangles of a door's size scattered by centimetres about places along a wall."""
    rng = np.random.default_rng(seed)
    begin = np.repeat(centres, n) - 0.45 + rng.normal(0, 0.04, n * len(centres))
    boxes = np.column_stack([begin, begin + 0.9, 0 * begin, 0 * begin + 2])
    return Rectangles(
        boxes, rng.uniform(0.4, 0.9, len(boxes)), np.tile(shares, (len(boxes), 1)).astype(float)
    )


def test_iou_is_shapelys():
    rng = np.random.default_rng(1)
    corners = np.sort(rng.uniform(0, 3, (40, 2, 2)), axis=2).reshape(40, 4)
    polygons = [box(a, c, b, d) for a, b, c, d in corners]
    expected = [p.intersection(polygons[0]).area / p.union(polygons[0]).area for p in polygons]
    assert iou(corners[0], corners) == pytest.approx(expected)


def test_a_wall_with_three_doors_keeps_three_each_the_mean_of_its_rectangles():
    rectangles = scattered([1.0, 2.2, 6.0])
    clusters, means = per_door(rectangles, PARAMS)
    assert len(means) == 3
    for centre, some in zip((1.0, 2.2, 6.0), np.split(clusters, 3), strict=True):
        assert len(set(some)) == 1
        members = rectangles.boxes[clusters == some[0]]
        weights = rectangles.scores[clusters == some[0]] ** 2
        assert means[some[0]] == pytest.approx(np.average(members, axis=0, weights=weights))
        assert means[some[0]][:2].mean() == pytest.approx(centre, abs=0.03)


def test_one_rectangle_is_its_own_mean():
    one = Rectangles(np.array([[1.0, 2, 0, 2]]), np.array([0.7]), np.array([EMPTY_SHARES]))
    for merge in (per_door, per_wall):
        clusters, means = merge(one, PARAMS)
        assert clusters.tolist() == [0]
        assert means == pytest.approx(one.boxes)


def test_the_papers_way_keeps_the_emptiest_of_a_wall_alone():
    shut, open_ = scattered([1.0], shares=FULL_SHARES), scattered([5.0], seed=1)
    both = Rectangles(
        np.concatenate([shut.boxes, open_.boxes]),
        np.concatenate([shut.scores, open_.scores]),
        np.concatenate([shut.shares, open_.shares]),
    )
    clusters, means = per_wall(both, PARAMS)
    assert (clusters[:12] == -1).all() and (clusters[12:] == 0).all()
    assert means.shape == (1, 4) and means[0, :2].mean() == pytest.approx(5.0, abs=0.05)
    ours, _ = per_door(both, PARAMS)
    assert len(set(ours)) == 2


def line(x, y, width=0.9, turn_deg=0.0):
    along = width / 2 * np.array([np.cos(np.deg2rad(turn_deg)), np.sin(np.deg2rad(turn_deg))])
    return [np.array([x, y]) - along, np.array([x, y]) + along]


def test_of_openings_at_one_place_the_surest_stays_whichever_way_it_points():
    lines = np.array(
        [
            line(1, 0),
            line(1.1, 0.2, turn_deg=180),  # the same wall drawn from its other room
            line(3, 0),
            line(1, 0, turn_deg=90),  # in a wall across
            line(1, 1.0),  # in the next wall
            line(3.85, 0),  # beside it
        ]
    )
    sure = np.array([0.6, 0.8, 0.5, 0.4, 0.7, 0.9])
    assert distinct(lines, sure, CrossCheckParams()).tolist() == [1, 2, 3, 4, 5]
    assert distinct(lines[:0], sure[:0], CrossCheckParams()).tolist() == []


def test_what_both_faces_show_lies_at_one_place_of_the_wall(scenes):
    images, walls, _ = scenes.two_rooms(scenes.Face(5.0), scenes.Face(5.0))
    found = Candidates(
        faces=np.array([0, 1], np.int32),
        from_m=np.array([1.0, 5 - 1.9]),
        to_m=np.array([1.9, 5 - 1.0]),
        sill_m=np.zeros(2),
        head_m=np.full(2, 2.0),
        features=np.zeros((2, len(FEATURES))),
    )
    assert on_walls(found, images, walls) == pytest.approx(np.array([(1.0, 1.9, 0, 2)] * 2))


def walls_of(lines, rooms):
    n = len(lines)
    nan = np.full(n, np.nan)
    return Walls(np.array(lines, float), nan, nan, nan, np.array(rooms, np.int32), np.ones(n))


def test_a_door_links_the_rooms_of_its_wall_or_those_met_on_either_side(scenes):
    rooms = scenes.rooms_of([(0, 0.1, 5, 4), (0, -4, 5, -0.2), (8, 0, 9, 1)])
    along = [(0, 0), (5, 0)]
    # named by the wall; drawn from one room only; an outer wall
    walls = walls_of([along, along, [(0, 4.1), (5, 4.1)]], [(1, 0), (1, -1), (0, -1)])
    lines = np.array([line(2, 0), line(2, 0), line(2, 4.1)])
    found = rooms_beside(lines, np.arange(3, dtype=np.int32), walls, rooms, TopologyParams())
    assert found.tolist() == [[0, 1], [0, 1], [0, -1]]
    nothing = rooms_beside(lines[:0], np.empty(0, np.int32), walls, rooms, TopologyParams())
    assert nothing.shape == (0, 2)


def test_a_room_nobody_could_enter_gets_its_likeliest_door():
    linked = np.array([(0, 1), (0, 2), (0, 2), (0, 3), (1, -1)], np.int32)
    p = np.array([0.9, 0.2, 0.4, 0.05, 0.3])
    taken = doors_of_rooms(linked, p, 0.5, 4, TopologyParams(only_door_p=0.15))
    # room 2 by its better one; room 3's is too improbable; room 1 has one
    assert taken.tolist() == [True, False, True, False, False]
    unasked = doors_of_rooms(linked, p, 0.5, 4, TopologyParams(only_door_p=1.0))
    assert unasked.tolist() == [True, False, False, False, False]


def test_two_rooms_have_a_second_door_only_if_it_is_surer():
    linked = np.array([(0, 1), (0, 1), (0, 1), (0, 2), (0, -1), (0, -1)], np.int32)
    p = np.array([0.65, 0.9, 0.55, 0.55, 0.55, 0.52])
    taken = doors_of_rooms(linked, p, 0.5, 3, TopologyParams(second_door_p=0.6))
    # what leads nowhere known may lead to two places
    assert taken.tolist() == [True, True, False, True, True, True]
    surer = doors_of_rooms(linked, p, 0.5, 3, TopologyParams(second_door_p=0.7))
    assert surer.tolist() == [False, True, False, True, True, True]
    unasked = doors_of_rooms(linked, p, 0.5, 3, TopologyParams(second_door_p=0.0))
    assert unasked.all()


def test_a_state_is_said_where_one_stands_out():
    told = np.array([(0.8, 0.1, 0.0), (0.05, 0.2, 0.01), (0.1, 0.1, 0.5), (0.3, 0.3, 0.3)])
    assert states(told, StateParams()).tolist() == ["open", "ajar", "shut", "unknown"]
    assert len(states(told[:0], StateParams())) == 0
