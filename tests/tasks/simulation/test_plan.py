"""Simulated storeys of all layouts: plans that could be built."""

from functools import cache

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from storage.plan import Plan
from storage.plan_geojson import from_geojson, to_geojson
from tasks.simulation.layouts.double_loaded import DoubleLoadedParams
from tasks.simulation.layouts.units import UNITS
from tasks.simulation.openings import OpeningParams
from tasks.simulation.plan import LAYOUTS, StoreyParams, make_storey
from tasks.simulation.presets import PRESETS, RING_SIDES_M, preset

STOREYS = [(layout, seed) for layout in LAYOUTS for seed in (0, 1)]
STOREYS += [(name, None) for name in PRESETS]


@cache
def storey(name: str, seed: int | None) -> Plan:
    """Return a storey of a layout and a seed, or a preset."""
    if seed is None:
        return preset(name)
    return make_storey(StoreyParams(layout=name, seed=seed, yaw_rad=0.2 * seed), "demo", "1")


def outlines(plan: Plan) -> np.ndarray:
    return np.array([room.polygon for room in plan.rooms])


def bodies(plan: Plan) -> np.ndarray:
    """Return the walls' footprints as flat-ended strips."""
    return np.array([w.line.buffer(w.thickness_m / 2, cap_style="flat") for w in plan.walls])


def assert_could_be_built(plan: Plan) -> None:
    rooms, walls = outlines(plan), bodies(plan)
    assert all(room.is_valid and room.is_simple for room in rooms)
    # rooms are as far apart as the thinnest wall: they do not touch, let alone overlap
    apart = shapely.distance(rooms[:, None], rooms[None]) + np.eye(len(rooms))
    assert apart.min() > 0.1
    tree = shapely.STRtree(walls)
    i, j = tree.query(rooms)
    assert shapely.area(shapely.intersection(rooms[i], walls[j])).sum() < 1e-3
    assert_walls_lie_between_their_rooms(plan)
    assert_doors_reach_every_room(plan)
    assert_openings_lie_on_their_walls(plan)
    assert_furniture_fits(plan)


def assert_walls_lie_between_their_rooms(plan: Plan) -> None:
    rooms = {room.id: room.polygon for room in plan.rooms}
    for wall in plan.walls:
        assert len(wall.rooms) in (1, 2)
        middle = wall.line.interpolate(0.5, normalized=True)
        for room in wall.rooms:
            # the nearest face is half the thickness away
            assert rooms[room].distance(middle) == pytest.approx(wall.thickness_m / 2, abs=2e-3)


def assert_doors_reach_every_room(plan: Plan) -> None:
    reached = {plan.rooms[0].id}
    for _ in plan.rooms:
        reached |= {r for door in plan.doors if reached & set(door.rooms) for r in door.rooms}
    assert reached == {room.id for room in plan.rooms}


def assert_openings_lie_on_their_walls(plan: Plan) -> None:
    walls = {wall.id: wall for wall in plan.walls}
    for door in plan.doors:
        assert set(door.rooms) == set(walls[door.wall].rooms) and len(door.rooms) == 2
        assert door.state in ("open", "ajar", "shut")
        assert min(round(door.line.length - w, 6) for w in OpeningParams().doors_m) <= 0 < 0.75
    for window in plan.windows:
        assert len(walls[window.wall].rooms) == 1
        assert 0.6 <= window.line.length <= 1.5 + 1e-9
    openings = (*plan.doors, *plan.windows)
    for opening in openings:
        wall = walls[opening.wall]
        assert wall.line.buffer(1e-6).contains(opening.line)
        assert opening.line.distance(wall.line.boundary) > 0.3
    lines = np.array([opening.line for opening in openings])
    apart = shapely.distance(lines[:, None], lines[None])
    assert (apart + np.eye(len(lines))).min() > 0.3


def assert_furniture_fits(plan: Plan) -> None:
    rooms = {room.id: room.polygon for room in plan.rooms}
    assert all(rooms[f.room].contains(f.footprint) for f in plan.furniture)
    assert all(0 <= f.base_m < f.top_m <= 2.8 for f in plan.furniture)
    footprints = np.array([f.footprint for f in plan.furniture])
    tree = shapely.STRtree(footprints)
    for i, j in tree.query(footprints).T:
        a, b = plan.furniture[i], plan.furniture[j]
        over = min(a.top_m, b.top_m) - max(a.base_m, b.base_m) > 1e-9
        if i < j and over and a.footprint.intersection(b.footprint).area > 1e-6:
            # the back of a chair under a table stays out
            assert {a.class_, b.class_} == {"table", "chair"}
            table, seat = (a, b) if a.class_ == "table" else (b, a)
            assert seat.footprint.difference(table.footprint).area > 0.2 * seat.footprint.area


@pytest.mark.parametrize(("name", "seed"), STOREYS)
def test_a_storey_could_be_built(name, seed):
    assert_could_be_built(storey(name, seed))


@settings(max_examples=6, deadline=None, derandomize=True)
@given(layout=st.sampled_from(LAYOUTS), seed=st.integers(3, 2**31))
def test_so_could_a_storey_of_any_seed(layout, seed):
    assert_could_be_built(make_storey(StoreyParams(layout=layout, seed=seed), "demo", "1"))


@pytest.mark.parametrize(("name", "seed"), STOREYS)
def test_rooms_and_walls_fill_the_storey(name, seed):
    plan = storey(name, seed)
    reach = [
        w.line.buffer(w.thickness_m / 2 + 1e-4, cap_style="square", join_style="mitre")
        for w in plan.walls
    ]
    full = shapely.union_all([*reach, *outlines(plan)])
    # nothing is left between them but the light court of a ring
    holes = [shapely.Polygon(hole) for hole in full.interiors]
    # the strips of this test leave a few cm2 at oblique corners
    courts = [hole for hole in holes if hole.area > 5e-3]
    assert all(court.area > 20 for court in courts)
    assert len(courts) <= (1 if "ring" in name else 0)


@pytest.mark.parametrize("layout", ["small", "open_plan", "irregular"])
def test_the_same_seed_gives_the_same_bytes_and_another_seed_others(layout):
    first, again, other = (
        to_geojson(make_storey(StoreyParams(layout=layout, seed=s), "demo", "1")) for s in (7, 7, 8)
    )
    assert repr(first) == repr(again) != repr(other)


@pytest.mark.parametrize("name", ["small", "irregular", "ring"])
def test_a_storey_survives_its_file_form(name):
    written = to_geojson(storey(name, 1))
    assert to_geojson(from_geojson(written, "memory")) == written
    assert written["simulated"] is True


def test_the_small_storey_has_an_l_and_an_oblique_wall():
    plan = make_storey(StoreyParams(), "demo", "1")
    corners = [len(room.polygon.exterior.coords) - 1 for room in plan.rooms]
    assert sorted(corners) == [4] * 7 + [5, 6]
    directions = [np.diff(shapely.get_coordinates(w.line), axis=0)[0] for w in plan.walls]
    assert sum(abs(x * y) > 1e-6 for x, y in directions) == 1


def test_the_ring_presets_corridor_has_the_published_reference_lines():
    corridor = storey("ring", None).rooms[0].polygon
    ring = shapely.get_coordinates(shapely.orient_polygons(corridor).exterior)
    lengths = np.linalg.norm(np.diff(ring, axis=0), axis=1)
    start = int(np.argmin(np.abs(lengths - RING_SIDES_M[0])))
    assert np.roll(lengths, -start) == pytest.approx(RING_SIDES_M, abs=1e-6)
    assert len(corridor.interiors) == 1
    # method.md, section 5: around the corridor, in their order
    assert RING_SIDES_M == (4.77, 19.46, 4.91, 21.86, 4.91, 19.46, 4.88, 21.86)


def test_the_presets_have_table_1s_small_office_and_executives_unit():
    for name in PRESETS:
        plan = storey(name, None)
        widths = {w: [] for w in ("executive", "assistant", "office")}
        for room in plan.rooms:
            if room.class_ in widths:
                sides = shapely.get_coordinates(room.polygon.oriented_envelope.exterior)
                widths[room.class_] += np.linalg.norm(np.diff(sides, axis=0), axis=1)[:2].tolist()
        assert len(widths["executive"]) == 4 and len(widths["assistant"]) == 2
        # 2.4 m between centre lines, less a partition
        assert min(widths["office"]) == pytest.approx(2.4 - 0.125, abs=0.12)
    unit = UNITS["executives"]
    assert (unit.modules * 2.4, unit.p_apriori) == (pytest.approx(19.2), 0.04)
    assert (UNITS["small_office"].modules * 2.4, UNITS["small_office"].p_apriori) == (2.4, 0.06)
    assert sum(u.p_apriori for u in UNITS.values()) == pytest.approx(1.0)


def test_a_room_is_cut_out_of_a_bigger_one():
    storeys = [
        make_storey(
            StoreyParams(
                layout="double_loaded", double_loaded=DoubleLoadedParams(cut_outs=n, rows=ROWS)
            ),
            "demo",
            "1",
        )
        for n in (0, 1, 2)
    ]
    corners = [
        sorted((len(r.polygon.exterior.coords) - 1 for r in plan.rooms), reverse=True)[:3]
        for plan in storeys
    ]
    # a U, then an L as well
    assert corners == [[4, 4, 4], [8, 4, 4], [8, 6, 4]]
    assert [len(plan.rooms) for plan in storeys] == [9, 10, 11]


ROWS = (("seminar", "seminar", "seminar"), ("stairs", "executives", "kitchen"))


def test_the_irregular_storey_is_not_manhattan_and_has_rooms_of_six_and_more_walls():
    plan = make_storey(StoreyParams(layout="irregular", seed=1), "demo", "1")
    steps = np.array([np.diff(shapely.get_coordinates(w.line), axis=0)[0] for w in plan.walls])
    angles = np.rad2deg(np.arctan2(steps[:, 1], steps[:, 0])) % 90
    assert len(np.unique(np.round(angles, 3))) >= 3
    assert sum(len(room.polygon.exterior.coords) - 1 >= 6 for room in plan.rooms) >= 3


def test_doors_are_open_ajar_and_shut_in_the_stated_shares():
    params = StoreyParams(layout="double_loaded", openings=OpeningParams(p_state=(0.2, 0.0, 0.8)))
    states = [door.state for door in make_storey(params, "demo", "1").doors]
    share = states.count("shut") / len(states)
    assert set(states) <= {"open", "shut"}
    # four standard deviations of a binomial
    assert abs(share - 0.8) < 4 * np.sqrt(0.16 / len(states))


def test_a_row_that_its_units_do_not_fill_is_refused_failure():
    with pytest.raises(ValueError, match="modules"):
        rows = (("office",), ("kitchen", "executives", "stairs"))
        DoubleLoadedParams(modules=12, rows=rows)
    with pytest.raises(ValidationError, match="no_such"):
        DoubleLoadedParams(modules=12, rows=(("no_such",), ROWS[1]))
    with pytest.raises(KeyError, match="presets are ring, wing"):
        preset("tower")
