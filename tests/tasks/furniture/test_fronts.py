"""Tall pieces known by their fronts, and screens on tables, in rooms of known furniture."""

import numpy as np
import pytest
import shapely
from furniture_rooms import chair, cloud, floor, one_room, panel, plate

from tasks.furniture.candidates import FRONT, ON_TABLE
from tasks.furniture.features import FEATURES
from tasks.furniture.segments import FurnitureSegmentParams, find_furniture_segments

SEGMENTS = FurnitureSegmentParams()


def found(kind, *parts, rooms=None, noise=0.006):
    segments = find_furniture_segments(rooms or one_room(), [cloud(*parts, noise=noise)], SEGMENTS)
    rows = np.flatnonzero(segments.features[:, FEATURES.index("found_by")] == kind)
    return segments, rows


def iou(a, b):
    return a.intersection(b).area / a.union(b).area


@pytest.mark.parametrize(
    ("x", "y", "turn", "true"),
    [
        (3.0, 0.44, 0.0, shapely.box(2.6, 0.02, 3.4, 0.44)),
        (3.0, 4.56, np.pi, shapely.box(2.6, 4.56, 3.4, 4.98)),
        (5.56, 2.0, np.pi / 2, shapely.box(5.56, 1.6, 5.98, 2.4)),
        (0.44, 2.0, -np.pi / 2, shapely.box(0.02, 1.6, 0.44, 2.4)),
    ],
)
def test_a_cabinet_of_which_the_front_alone_is_seen_reaches_back_to_its_wall(x, y, turn, true):
    segments, rows = found(FRONT, floor(), panel(x, y, 0.8, 0.1, 1.9, turn))
    assert len(rows) == 1
    assert iou(segments.footprints[rows[0]], true) > 0.8
    assert segments.top_m[rows[0]] == pytest.approx(1.9, abs=0.04)
    assert segments.base_m[rows[0]] == 0


def test_a_run_of_equal_cabinets_is_as_many_as_fit_its_length():
    segments, rows = found(FRONT, floor(), panel(3.0, 0.44, 3.0, 0.1, 1.9))
    true = [shapely.box(x - 0.5, 0.02, x + 0.5, 0.44) for x in (2.0, 3.0, 4.0)]
    best = [max(iou(segments.footprints[row], box) for row in rows) for box in true]
    assert len(rows) == 3 and min(best) > 0.75


def test_cabinets_of_two_heights_are_two_though_they_touch():
    tall, low = panel(2.5, 0.44, 0.8, 0.1, 1.9), panel(3.4, 0.44, 1.0, 0.1, 1.5)
    segments, rows = found(FRONT, floor(), tall, low)
    assert sorted(segments.top_m[rows].round(1)) == [1.5, 1.9]


def test_an_open_shelf_shows_edges_of_boards_and_is_found_all_the_same():
    boards = [panel(3.0, 0.4, 1.0, z, z + 0.02) for z in np.arange(0.0, 2.0, 0.36)]
    files = [panel(2.8, 0.37, 0.5, z + 0.02, z + 0.27) for z in np.arange(0.0, 1.7, 0.36)]
    sides = [panel(x, 0.4, 0.04, 0.0, 1.82) for x in (2.52, 3.48)]
    segments, rows = found(FRONT, floor(), *boards, *files, *sides)
    true = shapely.box(2.5, 0.02, 3.5, 0.4)
    assert max(iou(segments.footprints[row], true) for row in rows) > 0.5


@pytest.mark.parametrize(
    ("part", "why"),
    [
        (panel(3.0, 0.3, 2.0, 0.0, 2.6), "goes on to the ceiling: a wall, or a column"),
        (panel(3.0, 0.44, 0.8, 0.1, 0.8), "low: its top is seen"),
        (panel(3.0, 2.5, 0.8, 0.1, 1.9), "in the middle of the room"),
        (panel(3.0, 0.05, 0.8, 0.1, 1.9), "the wall's own points"),
    ],
)
def test_no_front_is_seen_where_none_is(part, why):
    assert len(found(FRONT, floor(), part)[1]) == 0, why


def test_a_screen_stands_on_its_table_and_begins_there():
    screen = panel(3.0, 2.7, 0.6, 0.84, 1.2)
    segments, rows = found(ON_TABLE, floor(), plate(3, 2.5, 1.6, 0.8, 0.74), screen)
    assert len(rows) == 1
    assert iou(segments.footprints[rows[0]], shapely.box(2.7, 2.6, 3.3, 2.8)) > 0.6
    assert segments.base_m[rows[0]] == pytest.approx(0.74, abs=0.02)
    assert segments.top_m[rows[0]] == pytest.approx(1.2, abs=0.04)


def test_the_back_of_a_chair_before_a_table_stands_on_none():
    _, rows = found(ON_TABLE, floor(), plate(3, 2.5, 1.6, 0.8, 0.74), chair(3, 3.1, top=1.0))
    assert len(rows) == 0
