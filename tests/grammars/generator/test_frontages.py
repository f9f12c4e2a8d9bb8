"""Rooms along corridors, against plans drawn with known widths."""

from dataclasses import replace

import numpy as np
import pytest
from shapely import LineString, Point, Polygon, affinity, box

from grammars.generator.corridors import find_corridors
from grammars.generator.frontages import runs, survey
from grammars.generator.params import LearnParams
from grammars.generator.reference_lines import corridor_lines
from storage.errors import MapSenseError
from storage.plan import Plan, PlanOpening, PlanRoom, PlanWall
from tasks.simulation.presets import RING_SIDES_M, preset

PARAMS = LearnParams()
SOUTH = [("office", 2.4), ("lab", 7.2), ("office", 4.8)]
NORTH = [("wc", 3.6), ("stairs", 3.6), ("office", 7.2)]


def widths(row):
    return [round(room.width_m, 9) for room in row]


def test_rooms_are_measured_between_centre_lines_in_the_line_s_direction(make_row):
    found = survey(make_row(SOUTH, NORTH), PARAMS)
    rows = {row[0].room: row for row in found.rows}
    south, north = rows["r3"], rows["r4"]  # one walks west along the south, east along the north
    assert widths(south) == [4.8, 7.2, 2.4] and widths(north) == [3.6, 3.6, 7.2]
    assert [room.class_ for room in south] == ["office", "lab", "office"]
    assert [room.depth_m for room in (*south, *north)] == pytest.approx([5.0] * 6)
    assert [room.joined for room in south] == [False, True, True]
    assert found.partitions_m == pytest.approx([0.1] * 4)


def test_lines_lie_on_the_corridor_s_faces_with_their_rooms_to_the_left(make_row):
    found = survey(make_row(SOUTH, NORTH), PARAMS)
    assert len(found.lines) == 2
    for line, row in zip(found.lines, found.rows, strict=True):
        along = np.subtract(line.end, line.start)
        assert np.linalg.norm(along) == pytest.approx(14.4 - 0.3)
        assert line.start[1] in (0.0, 2.0)
        left = np.array((-along[1], along[0]))
        assert (left[1] < 0) == (row[0].room == "r3")


def test_without_walls_the_rows_end_half_a_partition_beyond_the_rooms(make_row):
    found = survey(make_row(SOUTH, NORTH, walls=False), PARAMS)
    rows = {row[0].room: row for row in found.rows}
    # half of the outer wall's 0.3 m is missing, half of the partition's 0.1 m added
    assert widths(rows["r3"]) == [4.7, 7.2, 2.3]


@pytest.mark.parametrize("turn_deg", [0, 30, 200])
@pytest.mark.parametrize("mirrored", [False, True])
def test_a_plan_turned_and_mirrored_has_the_same_rooms(make_row, turn_deg, mirrored):
    def moved(shape):
        shape = affinity.scale(shape, -1 if mirrored else 1, 1, origin=(0, 0))
        return affinity.translate(affinity.rotate(shape, turn_deg, origin=(3, 1)), -7, 40)

    plan = make_row(SOUTH, NORTH)
    other = replace(
        plan,
        rooms=tuple(replace(r, polygon=moved(r.polygon)) for r in plan.rooms),
        walls=tuple(replace(w, line=moved(w.line)) for w in plan.walls),
    )
    before, after = (sorted(map(widths, survey(p, PARAMS).rows)) for p in (plan, other))
    if mirrored:
        before = sorted(row[::-1] for row in before)
    assert after == before  # to a nanometre


def test_a_gap_wider_than_a_wall_parts_a_row(make_row):
    plan = make_row(SOUTH)
    rooms = tuple(room for room in plan.rooms if room.id != "r2")
    (row,) = survey(replace(plan, rooms=rooms), PARAMS).rows
    assert [[room.room for room in run] for run in runs(row)] == [["r3"], ["r1"]]


def test_a_room_within_another_leaves_the_outer_one_whole(make_row):
    plan = make_row(SOUTH)
    hole = box(4.0, -2.0, 6.0, 0.0)  # out of the lab, at the corridor
    lab = replace(plan.rooms[2], polygon=plan.rooms[2].polygon - hole)
    closet = PlanRoom("r9", box(4.1, -1.9, 5.9, -0.2), "storage")
    (row,) = survey(replace(plan, rooms=(*plan.rooms[:2], lab, plan.rooms[3], closet)), PARAMS).rows
    assert widths(row) == [4.8, 7.2, 2.4]


def test_slanted_side_walls_are_followed_to_the_line():
    # two rooms whose common wall leans: its centre line meets the corridor's face at x = 4.5
    corridor = PlanRoom("r0", box(0, 0, 10, 2), "corridor")
    lean = 0.25  # x over y
    half = 0.05 * np.hypot(1, lean)
    a = Polygon([(0.1, 2.2), (4 - half + 2.2 * lean, 2.2), (4 - half + 6 * lean, 6), (0.1, 6)])
    b = Polygon([(4 + half + 2.2 * lean, 2.2), (9.9, 2.2), (9.9, 6), (4 + half + 6 * lean, 6)])
    walls = tuple(PlanWall(f"w{x}", LineString([(x, 2), (x, 6)]), 0.2) for x in (0, 10))
    plan = Plan("b", "1", (corridor, PlanRoom("a", a), PlanRoom("b", b)), walls)
    (row,) = survey(plan, PARAMS).rows
    assert widths(row) == [4.5, 5.5]
    assert survey(plan, PARAMS).partitions_m == pytest.approx([0.1])


def test_the_ring_s_outer_lines_are_those_published():
    found = survey(preset("ring"), PARAMS)
    lengths = [np.linalg.norm(np.subtract(line.end, line.start)) for line in found.lines]
    for published in RING_SIDES_M:
        assert min(abs(length - published) for length in lengths) < 0.005
    outer = [i for i, n in enumerate(lengths) if min(abs(n - p) for p in RING_SIDES_M) < 0.005]
    # around the corners, rooms fill the lines from end to end
    sums = [sum(widths(found.rows[i])) for i in outer]
    assert sums == pytest.approx([lengths[i] for i in outer], abs=0.01)


SHAPES = {
    "I": (box(0, 0, 20, 2), [20, 2, 20, 2]),
    "L": (Polygon([(0, 0), (12, 0), (12, 10), (10, 10), (10, 2), (0, 2)]), [12, 10, 2, 8, 10, 2]),
    "ring": (box(0, 0, 12, 10) - box(2, 2, 10, 8), [12, 10, 12, 10, 8, 6, 8, 6]),
}


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("turn_deg", [0, 41])
def test_lines_go_around_a_corridor_of_any_shape(shape, turn_deg):
    corridor, lengths = SHAPES[shape]
    turned = affinity.rotate(corridor, turn_deg, origin=(0, 0))
    lines = corridor_lines(turned, 1.0)
    found = np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1)
    assert sorted(found) == pytest.approx(sorted(lengths))
    for start, end in lines:
        along = (end - start) / np.linalg.norm(end - start)
        beside = (start + end) / 2 + 0.01 * np.array((-along[1], along[0]))
        assert not turned.buffer(1e-6).contains(Point(*beside))


@pytest.mark.parametrize("start", range(9))
def test_collinear_faces_are_one_line_wherever_the_ring_starts(start):
    # a corner on a straight side, and a pilaster 10 cm deep
    ring = [(0, 0), (5, 0), (5, 0.1), (5.2, 0.1), (5.2, 0), (8, 0), (20, 0), (20, 2), (0, 2)]
    ring = ring[start:] + ring[:start]
    lines = corridor_lines(Polygon(ring), 3.0)
    south = [line for line in lines if np.allclose(line[:, 1], 0)]
    assert len(lines) == 2 and len(south) == 1
    assert south[0][:, 0].tolist() == [20, 0]


def test_corridors_are_found_by_name(make_row):
    plan = make_row(SOUTH)
    for name in ("corridor", "Main Hallway", "circulation space"):
        rooms = (replace(plan.rooms[0], class_=name), *plan.rooms[1:])
        assert [room.id for room in find_corridors(replace(plan, rooms=rooms))] == ["r0"]


def test_corridors_without_a_name_are_found_by_shape_and_doors(make_row):
    plan = make_row(SOUTH, NORTH)
    rooms = tuple(replace(room, class_=None) for room in plan.rooms)
    assert [room.id for room in find_corridors(replace(plan, rooms=rooms))] == ["r0"]
    doors = [PlanOpening(f"d{i}", LineString([(i, 0), (i + 1, 0)])) for i in range(1, 7)]
    doors = tuple(replace(d, rooms=("r0", f"r{i}")) for i, d in enumerate(doors, 1))
    assert [r.id for r in find_corridors(replace(plan, rooms=rooms, doors=doors))] == ["r0"]
    with pytest.raises(MapSenseError, match="give the corridor the class 'corridor'"):
        find_corridors(replace(plan, rooms=rooms, doors=doors[:3]))


def test_a_plan_without_corridor_is_refused_by_name():
    plan = Plan("ifp", "4", (PlanRoom("r", box(0, 0, 4, 5)),))
    with pytest.raises(MapSenseError, match="building 'ifp', storey '4': no room is a corridor"):
        survey(plan, PARAMS)


def test_a_pointed_room_has_no_straight_rear_that_other_storeys_could_share(make_row):
    plan = make_row([("seminar", 14.4)], NORTH)
    (apart,) = (room for room in plan.rooms if room.class_ == "seminar")
    west, south, east, north = apart.polygon.bounds
    middle, shoulder = (west + east) / 2, north - 2.0
    near = 0.35 * (east - west) / 2
    # as deep a quarter from either end, deepest in the middle: an apse
    apse = Polygon(
        [(west, north), (west, shoulder), (middle - near, south), (middle + near, south),
         (east, shoulder), (east, north)]
    )  # fmt: skip
    pointed = replace(
        plan, rooms=tuple(replace(r, polygon=apse) if r is apart else r for r in plan.rooms)
    )
    for some, straight in ((plan, True), (pointed, False)):
        found = survey(some, PARAMS)
        own = [
            line
            for line, row in zip(found.lines, found.rows, strict=True)
            if row[0].class_ == "seminar"
        ]
        assert [line.space is not None for line in own] == [straight]
        assert all(line.space is not None for line in found.lines if line is not own[0])
