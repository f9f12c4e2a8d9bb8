"""The comparison of the demo, and the plan made of tables."""

from dataclasses import replace

import numpy as np
import pytest
from shapely import LineString, box

from flows.demo import BUILDING, STOREY, compare_objects, compare_rooms, small_campaign
from flows.model import Made, initial_plan, with_furniture, with_openings
from storage.furniture import Furniture
from storage.openings import Openings
from storage.plan import Plan, PlanOpening, PlanRoom, PlanWall
from storage.plan_geojson import read_plan, write_plan
from storage.rooms import Rooms
from storage.walls import Walls
from tasks.device.quality import QualityParams, assess
from tasks.simulation.campaign import simulate_scan
from tasks.simulation.mesh import storey_mesh
from tasks.simulation.plan import StoreyParams, make_storey
from tasks.simulation.sensor import Scene


def plan(*boxes):
    rooms = tuple(PlanRoom(f"r{i}", box(*b), name=f"Room {i}") for i, b in enumerate(boxes))
    return Plan("b", "0", rooms)


def test_rooms_are_matched_by_what_they_share():
    truth = plan((0, 0, 4, 5), (4, 0, 8, 5), (20, 0, 24, 5))
    mapped = plan((4, 0, 8, 5), (0, 0, 3, 5))
    first, second, missed = compare_rooms(truth, mapped)
    assert (first.truth_m2, first.mapped_m2, first.iou) == (20, 15, 0.75)
    assert (second.mapped_m2, second.iou) == (20, 1.0)
    assert (missed.mapped_m2, missed.iou) == (None, 0.0)


def test_a_mapped_room_matches_one_room_only():
    first, second = compare_rooms(plan((0, 0, 4, 5), (4, 0, 6, 5)), plan((0, 0, 6, 5)))
    assert first.iou == pytest.approx(20 / 30, abs=1e-3)
    assert (second.mapped_m2, second.iou) == (None, 0.0)


def test_rooms_are_matched_at_the_greatest_iou_in_all_not_the_greatest_area_shared():
    # the hall shares most, 30 m2, with the first mapped room; then the office would have none
    truth = plan((0, 0, 10, 5), (-4, 0, 0, 5))
    mapped = plan((-4, 0, 6, 5), (6, 0, 10, 5))
    hall, office = compare_rooms(truth, mapped)
    assert (hall.mapped_m2, hall.iou) == (20, 0.4)
    assert (office.mapped_m2, office.iou) == (50, 0.4)


def test_a_storey_of_which_nothing_was_mapped_has_only_missed_rooms():
    (missed,) = compare_rooms(plan((0, 0, 4, 5)), plan())
    assert missed.as_json() == {
        "room": "r0",
        "name": "Room 0",
        "truth_m2": 20.0,
        "mapped_m2": None,
        "iou": 0.0,
    }


def test_objects_are_counted_by_what_is_there_what_was_found_and_what_is_both():
    def door(name, x):
        line = LineString([(x, 0), (x + 0.9, 0)])
        return PlanOpening(name, line, sill_m=0.0, head_m=2.0, state="open")

    truth = replace(plan((0, 0, 8, 5)), doors=(door("d0", 1), door("d1", 4)))
    mapped = replace(plan((0, 0, 8, 5)), doors=(door("d0", 1.1), door("d1", 6), door("d2", 2.5)))
    doors, *others = compare_objects(truth, mapped)
    assert doors == {"object": "door", "true": 2, "found": 3, "matched": 1}
    assert [(o["true"], o["found"], o["matched"]) for o in others] == [(0, 0, 0)] * 3


def test_the_demos_volunteers_pass_the_quality_gate():
    truth = make_storey(StoreyParams(seed=0), BUILDING, STOREY)
    scene = Scene(storey_mesh(truth))
    for index in (0, len(truth.rooms)):
        scan = simulate_scan(scene, truth, index, small_campaign(0, 2 * len(truth.rooms)))
        assert assess(scan.snapshots, QualityParams()).accepted


def test_a_plan_keeps_what_is_unknown_unknown(tmp_path):
    nan = np.nan
    rooms = Rooms(
        polygons=np.array([box(0, 0, 4, 5), box(4, 0, 8, 5)]),
        floor_m=np.array([0.0, nan]),
        ceiling_m=np.array([2.5, nan]),
        seen=np.ones(2),
        walled=np.ones(2),
        scans=((0, 2), ()),
    )
    walls = Walls(
        lines=np.array([[[4.0, 0], [4, 5]], [[0, 0], [4, 0]]]),
        thickness_m=np.array([0.1, nan]),
        base_m=np.array([0.0, nan]),
        top_m=np.array([2.5, nan]),
        rooms=np.array([[0, 1], [0, -1]], np.int32),
        seen=np.ones(2),
    )
    made = initial_plan(rooms, walls, Made("b", "0", ["a", "b", "c"], notes=["a note"]))
    write_plan(made, tmp_path / "plan.geojson")
    made = read_plan(tmp_path / "plan.geojson")
    assert [room.scans for room in made.rooms] == [("a", "c"), ()]
    assert [(room.floor_m, room.ceiling_m) for room in made.rooms] == [(0.0, 2.5), (None, None)]
    assert [wall.rooms for wall in made.walls] == [("r0", "r1"), ("r0",)]
    assert [wall.thickness_m for wall in made.walls] == [0.1, None]
    assert made.notes == ("a note",)


def test_doors_windows_and_furniture_are_read_back_as_they_were_found(tmp_path):
    openings = Openings(
        kinds=np.array(["door", "door", "window"]),
        lines=np.array([[[1.0, 0], [2, 0]], [[4, 1], [4, 2]], [[0, 3], [0, 4.5]]]),
        sill_m=np.array([0.0, 0.0, 0.9]),
        head_m=np.array([2.0, 2.1, 2.2]),
        walls=np.array([0, 1, 2], np.int32),
        rooms=np.array([[0, -1], [0, 1], [0, -1]], np.int32),
        states=np.array(["open", "unknown", ""]),
        confidences=np.array([0.9, 0.6, 0.7]),
    )
    furniture = Furniture(
        footprints=np.array([box(1, 1, 2, 1.8), box(5, 1, 5.5, 1.5)], object),
        classes=np.array(["table", "chair"]),
        base_m=np.zeros(2),
        top_m=np.array([0.72, 0.9]),
        rooms=np.array([0, -1], np.int32),
        confidences=np.array([0.8, 0.5]),
    )
    lines = [((0, 0), (4, 0)), ((4, 0), (4, 5)), ((0, 0), (0, 5))]
    walls = tuple(PlanWall(f"w{i}", LineString(line)) for i, line in enumerate(lines))
    bare = replace(plan((0, 0, 4, 5), (4, 0, 8, 5)), walls=walls)
    write_plan(with_furniture(with_openings(bare, openings), furniture), tmp_path / "plan.geojson")
    found = read_plan(tmp_path / "plan.geojson")
    assert [(d.state, d.wall, d.rooms) for d in found.doors] == [
        ("open", "w0", ("r0",)),
        ("unknown", "w1", ("r0", "r1")),
    ]
    (window,) = found.windows
    assert (window.state, window.sill_m, window.head_m, window.confidence) == (None, 0.9, 2.2, 0.7)
    assert window.line.length == pytest.approx(1.5)
    assert [(p.class_, p.room, p.top_m) for p in found.furniture] == [
        ("table", "r0", 0.72),
        ("chair", None, 0.9),
    ]
