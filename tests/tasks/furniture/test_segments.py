"""Boxes of tables and chairs against the ones their points were made from."""

import numpy as np
import pytest
import shapely
from furniture_rooms import chair, cloud, floor, one_room, panel, plate

from storage.rooms import Rooms
from tasks.furniture.candidates import BACK, SEAT, TOP
from tasks.furniture.features import FEATURES
from tasks.furniture.segments import FurnitureSegmentParams, find_furniture_segments

PARAMS = FurnitureSegmentParams()


def box_of(x, y, width, depth, turn=0.0):
    shape = shapely.box(x - width / 2, y - depth / 2, x + width / 2, y + depth / 2)
    return shapely.affinity.rotate(shape, turn, origin=(x, y), use_radians=True)


def found(*parts, rooms=None):
    return find_furniture_segments(rooms or one_room(), [cloud(*parts)], PARAMS)


def of_kind(segments, *kinds):
    return np.flatnonzero(np.isin(segments.features[:, FEATURES.index("found_by")], kinds))


def ious(segments, truth, rows):
    shapes = segments.footprints[rows]
    shared = shapely.area(shapely.intersection(shapes, truth))
    return shared / (shapely.area(shapes) + truth.area - shared)


@pytest.mark.parametrize("turn", [0.0, 0.3])
def test_a_table_is_one_box_of_its_size_height_and_direction(turn):
    truth = box_of(3, 2.5, 1.6, 0.8, turn)
    segments = found(floor(), plate(3, 2.5, 1.6, 0.8, 0.74, turn))
    rows = of_kind(segments, TOP)
    assert len(rows) == 1
    assert ious(segments, truth, rows)[0] > 0.88
    assert segments.surface_m[rows[0]] == pytest.approx(0.74, abs=0.015)
    assert segments.features[rows[0], FEATURES.index("distance_m")] == pytest.approx(
        0.74, abs=0.015
    )
    assert segments.features[rows[0], FEATURES.index("area_m2")] == pytest.approx(1.28, rel=0.12)


def test_heights_count_from_the_floor_of_the_room():
    raised = plate(3, 2.5, 1.6, 0.8, 0.74 + 3.1)
    segments = found(floor() + np.array((0, 0, 3.1)), raised, rooms=one_room(floor=3.1))
    (row,) = of_kind(segments, TOP)
    assert segments.surface_m[row] == pytest.approx(3.84, abs=0.015)
    assert segments.features[row, FEATURES.index("distance_m")] == pytest.approx(0.74, abs=0.015)
    assert segments.base_m[row] == 3.1


@pytest.mark.parametrize("turn", [0.0, 0.25, np.pi / 2])
def test_a_chair_is_found_by_its_back_with_the_seat_before_it(turn):
    segments = found(floor(), chair(3, 2.5, turn))
    (row,) = of_kind(segments, BACK)
    assert ious(segments, box_of(3, 2.5, 0.48, 0.48, turn), [row])[0] > 0.75
    assert segments.surface_m[row] == pytest.approx(0.45, abs=0.03)
    assert segments.top_m[row] == pytest.approx(0.86, abs=0.03)


def test_a_chair_pushed_under_its_table_reaches_under_it():
    table = box_of(3, 2.5, 1.6, 0.8)
    shown = chair(3, 2.9 + 0.18 - 0.24)
    hidden = shapely.contains_xy(table, shown[:, 0], shown[:, 1])
    segments = found(floor(), plate(3, 2.5, 1.6, 0.8, 0.74), shown[~hidden])
    (row,) = of_kind(segments, BACK)
    assert ious(segments, box_of(3, 2.84, 0.48, 0.48), [row])[0] > 0.6


def test_touching_chairs_are_as_many_as_there_are():
    places = [1.5 + 0.48 * i for i in range(4)]
    segments = found(floor(), *(chair(x, 2.5) for x in places))
    rows = of_kind(segments, BACK)
    assert len(rows) == 4
    for x in places:
        assert ious(segments, box_of(x, 2.5, 0.48, 0.48), rows).max() > 0.7


def test_seats_without_a_back_are_told_apart_by_the_usual_size():
    segments = found(floor(), plate(2.0, 2.5, 3 * 0.48, 0.48, 0.45))
    rows = of_kind(segments, SEAT)
    assert len(rows) == 3
    for x in (1.52, 2.0, 2.48):
        assert ious(segments, box_of(x, 2.5, 0.48, 0.48), rows).max() > 0.7


def test_tables_pushed_together_are_told_apart():
    segments = found(floor(), plate(3, 2.5, 3.2, 1.6, 0.74))
    rows = of_kind(segments, TOP)
    assert len(rows) == 4
    for x in (2.2, 3.8):
        for y in (2.1, 2.9):
            assert ious(segments, box_of(x, y, 1.6, 0.8), rows).max() > 0.85


def test_a_conference_table_stays_one():
    segments = found(floor(), plate(3, 2.5, 3.0, 1.1, 0.74))
    assert len(of_kind(segments, TOP)) == 1


def test_a_top_in_two_parts_with_what_hides_between_is_one():
    hidden = box_of(3, 2.5, 0.3, 0.8)
    top = plate(3, 2.5, 1.6, 0.8, 0.74)
    top = top[~shapely.contains_xy(hidden, top[:, 0], top[:, 1])]
    segments = found(floor(but=[box_of(3, 2.5, 1.6, 0.8)]), top)
    (row,) = of_kind(segments, TOP)
    assert ious(segments, box_of(3, 2.5, 1.6, 0.8), [row])[0] > 0.88


def test_two_tables_with_the_floor_between_stay_two():
    segments = found(floor(), plate(1.5, 2.5, 1.2, 0.6, 0.74), plate(3.1, 2.5, 1.2, 0.6, 0.74))
    whole = segments.features[:, FEATURES.index("siblings")] == 1
    assert len(np.intersect1d(of_kind(segments, TOP), np.flatnonzero(whole))) == 2


def test_nothing_lower_than_the_cut_off_is_furniture():
    assert len(found(floor(), plate(3, 2.5, 1.0, 1.0, 0.2))) == 0


def test_walls_and_thin_edges_are_no_tops():
    wall = panel(3, 5.0, 6.0, 0, 2.8)
    front = panel(3, 2.5, 1.6, 0, 1.4)
    assert len(of_kind(found(floor(), wall, front), TOP)) == 0


def test_a_storey_without_points_or_rooms_has_no_segments():
    none = Rooms(np.empty(0, object), *(np.empty(0) for _ in range(4)), ())
    segments = found(floor(), rooms=none)
    assert len(segments) == 0 and segments.features.shape == (0, len(FEATURES))
    assert len(found(np.empty((0, 3)))) == 0


def test_several_scans_of_one_table_are_one_box():
    parts = [
        cloud(floor(), plate(3 + dx, 2.5, 1.6, 0.8, 0.74 + dz), seed=i)
        for i, (dx, dz) in enumerate([(0, 0), (0.02, 0.015), (-0.02, -0.01)])
    ]
    segments = find_furniture_segments(one_room(), parts, PARAMS)
    assert len(of_kind(segments, TOP)) == 1


def test_the_same_points_give_the_same_segments():
    parts = [floor(), chair(3, 2.5, 0.2), plate(1.5, 1.5, 1.4, 0.7, 0.74)]
    a, b = found(*parts), found(*parts)
    assert a.features.tobytes() == b.features.tobytes()
    assert shapely.to_wkb(a.footprints).tolist() == shapely.to_wkb(b.footprints).tolist()
