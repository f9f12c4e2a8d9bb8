"""The simulated storey: a plan that could be built."""

from itertools import combinations

import numpy as np
import pytest
import shapely

from storage.plan import Plan
from storage.plan_geojson import from_geojson, to_geojson
from tasks.simulation.plan import StoreyParams, make_storey

SEEDS = (0, 1, 2, 3)


def storey(seed: int) -> Plan:
    return make_storey(StoreyParams(seed=seed, yaw_rad=0.2 * seed), "demo", "1")


@pytest.mark.parametrize("seed", SEEDS)
def test_rooms_are_valid_and_apart_by_their_walls(seed):
    plan = storey(seed)
    assert len(plan.rooms) == 9
    assert all(room.polygon.is_valid for room in plan.rooms)
    for a, b in combinations(plan.rooms, 2):
        assert a.polygon.distance(b.polygon) > 0.119


@pytest.mark.parametrize("seed", SEEDS)
def test_rooms_and_walls_fill_the_storey_without_overlap(seed):
    plan = storey(seed)
    walls = shapely.union_all(
        [w.line.buffer(w.thickness_m / 2, cap_style="square") for w in plan.walls]
    )
    rooms = shapely.union_all([room.polygon for room in plan.rooms])
    assert walls.intersection(rooms).area < 1e-3
    assert not walls.union(rooms).buffer(1e-4).interiors


def test_one_room_is_an_l_and_one_has_an_oblique_wall():
    plan = make_storey(StoreyParams(), "demo", "1")
    corners = [len(room.polygon.exterior.coords) - 1 for room in plan.rooms]
    assert sorted(corners) == [4] * 7 + [5, 6]
    directions = [np.diff(shapely.get_coordinates(w.line), axis=0)[0] for w in plan.walls]
    assert sum(abs(x * y) > 1e-6 for x, y in directions) == 1


@pytest.mark.parametrize("seed", SEEDS)
def test_each_door_lies_on_its_wall_and_links_the_rooms_on_both_sides(seed):
    plan = storey(seed)
    walls = {wall.id: wall for wall in plan.walls}
    rooms = {room.id: room.polygon for room in plan.rooms}
    for door in plan.doors:
        wall = walls[door.wall]
        assert wall.line.buffer(1e-6).contains(door.line)
        assert door.line.length == pytest.approx(0.9)
        assert set(door.rooms) == set(wall.rooms) and len(door.rooms) == 2
        for room in door.rooms:
            near = rooms[room].distance(door.line.centroid)
            assert near == pytest.approx(wall.thickness_m / 2, abs=1e-3)
    assert {room for door in plan.doors for room in door.rooms} == set(rooms)


@pytest.mark.parametrize("seed", SEEDS)
def test_windows_lie_on_outer_walls_and_openings_do_not_meet(seed):
    plan = storey(seed)
    outer = {wall.id: wall.line for wall in plan.walls if len(wall.rooms) == 1}
    assert all(outer[n.wall].buffer(1e-6).contains(n.line) for n in plan.windows)
    for a, b in combinations((*plan.doors, *plan.windows), 2):
        assert a.line.distance(b.line) > 0.3


@pytest.mark.parametrize("seed", SEEDS)
def test_furniture_stands_in_its_room_and_apart(seed):
    plan = storey(seed)
    rooms = {room.id: room.polygon for room in plan.rooms}
    assert {f.class_ for f in plan.furniture} == {"table", "chair", "other"}
    assert all(rooms[f.room].contains(f.footprint) for f in plan.furniture)
    for a, b in combinations(plan.furniture, 2):
        assert a.footprint.distance(b.footprint) > 0.01


def test_the_same_seed_gives_the_same_plan_and_it_survives_its_file_form():
    written = to_geojson(storey(2))
    assert written == to_geojson(storey(2)) != to_geojson(storey(3))
    assert to_geojson(from_geojson(written, "memory")) == written
    assert written["simulated"] is True
