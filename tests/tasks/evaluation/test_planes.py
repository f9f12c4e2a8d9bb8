"""Planes against true surfaces: rooms whose every number is known, and a simulated scan."""

from dataclasses import replace
from hashlib import sha256
from itertools import permutations
from math import radians

import numpy as np
import pytest
import shapely
from shapely import LineString, Polygon, box
from shapely.affinity import rotate

from storage.artifacts import Place, read, write
from storage.plan import Plan, PlanFurniture, PlanOpening, PlanRoom
from storage.plan_geojson import write_plan
from storage.plane_detections import PLANE_DETECTIONS, from_table, to_table
from storage.points import PointCloud
from storage.segments import KINDS, Raster, Segments
from storage.snapshots import none
from storage.sources import Source
from tasks.evaluation.matching import Pairs, assign
from tasks.evaluation.planes import PlaneQualityParams, evaluate_planes, match_planes
from tasks.evaluation.surfaces import true_surfaces
from tasks.surfaces.filtering import FilterParams, extract_segments
from tasks.surfaces.hough import HoughParams, detect_planes

DEFAULT = PlaneQualityParams()
ROOM = PlanRoom("r", box(0, 0, 5, 4), floor_m=0.0, ceiling_m=2.5)
BOX = Plan("b", "0", rooms=(ROOM,))


def wall(start, stop, low=0.0, high=2.5, side=False):
    """A vertical segment; its normal points to the left of its line."""
    start, stop = np.array(start, float), np.array(stop, float)
    length = np.hypot(*(stop - start))
    dx, dy = (stop - start) / length
    normal = np.array((-dy, dx, 0.0))
    hull = box(0, low, length, high)
    return ("vertical", normal, normal[:2] @ start, side, np.array([start, stop]), hull)


def flat(polygon, z, tilt=0.0, side=0):
    """A horizontal segment, tilted about the y axis at x = 0; `side` 1 or -1 if it is known."""
    normal = np.array((np.sin(tilt), 0.0, np.cos(tilt))) * (side or 1)
    offset = normal[2] * z
    return ("horizontal", normal, offset, bool(side), np.full((2, 2), np.nan), polygon)


def segments(*rows):
    n = len(rows)
    return Segments(
        cell_m=0.1,
        kinds=np.array([KINDS.index(row[0]) for row in rows], np.int8),
        normals=np.array([row[1] for row in rows]).reshape(-1, 3),
        offsets=np.array([row[2] for row in rows], float),
        side_known=np.array([row[3] for row in rows], bool),
        lines=np.array([row[4] for row in rows]).reshape(-1, 2, 2),
        heights=np.zeros((n, 2)),
        areas=np.array([row[5].area for row in rows], float),
        inliers=np.zeros(n, np.int64),
        rms=np.zeros(n),
        hulls=tuple(shapely.to_wkb(row[5]) for row in rows),
        rasters=(Raster((0.0, 0.0), np.ones((1, 1), bool)),) * n,
    )


def points_on(plan, spacing=0.04):
    """Points all over the true surfaces of a plan."""
    parts = []
    for surface in true_surfaces(plan, 0.0, 0.3):
        a0, b0, a1, b1 = surface.area.bounds
        a, b = np.meshgrid(np.arange(a0, a1, spacing), np.arange(b0, b1, spacing))
        inside = shapely.contains_xy(surface.area, a, b)
        ab = np.column_stack([a[inside], b[inside]])
        parts.append(surface.origin + ab[:, :1] * surface.u + ab[:, 1:] * surface.v)
    return np.concatenate(parts)


SHELL = (
    flat(box(0, 0, 5, 4), 0.0),
    flat(box(0, 0, 5, 4), 2.5),
    wall((0, 0), (5, 0)),
    wall((5, 0), (5, 4)),
    wall((5, 4), (0, 4)),
    wall((0, 4), (0, 0)),
)
SEEN = points_on(BOX)


def rows_of(found, part="match"):
    true, seg = found.true_ids != "", found.found >= 0
    which = {"match": true & seg, "miss": true & ~seg, "false": seg & ~true}[part]
    return np.flatnonzero(which)


def test_a_box_room_has_six_surfaces_of_the_sizes_one_expects():
    surfaces = {s.id: s for s in true_surfaces(BOX, 0.0, 0.3)}
    assert {s.class_ for s in surfaces.values()} == {"floor", "ceiling", "wall"}
    assert sorted(s.area.area for s in surfaces.values()) == pytest.approx(
        [10, 10, 12.5, 12.5, 20, 20]
    )
    centre = np.array((2.5, 2.0, 1.25))
    for s in surfaces.values():
        middle = s.at(shapely.get_coordinates(s.area.centroid)[0])
        # every normal points to the middle of the room
        assert s.normal @ (centre - middle) > 0
        assert np.cross(s.u, s.v) @ s.normal == pytest.approx(1) or s.class_ != "floor"


def test_openings_are_cut_out_of_the_faces_on_both_sides_and_of_no_other():
    rooms = (ROOM, PlanRoom("s", box(5.2, 0, 8, 4), floor_m=0.0, ceiling_m=2.5))
    door = PlanOpening("d", LineString([(5.1, 1), (5.1, 1.9)]), 0.0, 2.0, rooms=("r", "s"))
    window = PlanOpening("w", LineString([(1, 4.1), (2, 4.1)]), 0.9, 2.1)
    unknown = PlanOpening("u", LineString([(1, -0.1), (2, -0.1)]))
    plan = Plan("b", "0", rooms=rooms, doors=(door, unknown), windows=(window,))
    bare = {s.id: s.area.area for s in true_surfaces(replace(plan, doors=(), windows=()), 0, 0.3)}
    cut = {s.id: s.area.area for s in true_surfaces(plan, 0, 0.3)}
    lost = sorted(round(bare[i] - cut[i], 6) for i in bare if bare[i] - cut[i] > 1e-9)
    assert lost == [1.2, 1.8, 1.8]


def test_edges_that_go_straight_on_are_one_face_and_a_column_has_faces_that_look_outwards():
    column = [(2, 1), (2, 2), (3, 2), (3, 1)]
    outline = Polygon([(0, 0), (2, 0), (5, 0), (5, 4), (0, 4)], [column])
    plan = Plan("b", "0", rooms=(replace(ROOM, polygon=outline),))
    walls = [s for s in true_surfaces(plan, 0.0, 0.3) if s.class_ == "wall"]
    assert len(walls) == 8
    middle = np.array((2.5, 1.5, 0.0))
    inner = [s for s in walls if s.area.area == pytest.approx(2.5)]
    assert len(inner) == 4
    assert all(s.normal @ (s.origin - middle) > 0 for s in inner)


def test_a_room_of_unknown_ceiling_has_a_floor_alone_and_little_surfaces_are_left_out():
    low = replace(ROOM, ceiling_m=None)
    assert [s.id for s in true_surfaces(Plan("b", "0", rooms=(low,)), 0.0, 0.3)] == ["r/floor"]
    assert len(true_surfaces(BOX, 11.0, 0.3)) == 4


def test_perfect_planes_are_all_found_exactly():
    found = match_planes(SEEN, segments(*SHELL), BOX, DEFAULT)
    assert len(found) == len(rows_of(found)) == 6
    assert found.iou == pytest.approx(np.ones(6))
    assert found.angle_rad == pytest.approx(np.zeros(6), abs=1e-9)
    assert found.offset_m == pytest.approx(np.zeros(6), abs=1e-9)
    assert np.all(found.seen > 0.95)
    assert sorted(found.classes) == ["ceiling", "floor", *["wall"] * 4]


@pytest.mark.parametrize("degrees", [0.01, 1.0, 4.9])
def test_the_angle_and_the_offset_of_a_tilted_floor_are_those_of_trigonometry(degrees):
    tilt = radians(degrees)
    # through z = 0.02 at x = 0; in the middle, x = 2.5, it lies tan(tilt) * 2.5 lower
    low = 0.02
    params = PlaneQualityParams(offset_m=0.5)
    found = match_planes(SEEN, segments(flat(box(0, 0, 5, 4), low, tilt)), BOX, params)
    (row,) = rows_of(found)
    assert found.true_ids[row] == "r/floor"
    assert found.angle_rad[row] == pytest.approx(tilt, rel=1e-6)
    height = low - np.tan(tilt) * 2.5
    assert found.offset_m[row] == pytest.approx(-height * np.cos(tilt), abs=1e-9)


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(("shift", "hit"), [(0.049, True), (-0.049, True), (0.051, False)])
def test_a_wall_farther_off_than_the_limit_is_missed_and_false(shift, hit, turned):
    # the sign of a normal whose side is not known says nothing
    ends = [(0, shift), (5, shift)][:: -1 if turned else 1]
    found = match_planes(SEEN, segments(wall(*ends)), BOX, DEFAULT)
    at = [row for row in range(len(found)) if found.found[row] == 0]
    assert (found.true_ids[at[0]] != "") is hit
    if hit:
        # towards the room is +y: the true wall lies before one at a negative y
        assert found.offset_m[at[0]] == pytest.approx(-shift)
    else:
        assert found.classes[at[0]] == "vertical"
    assert len(rows_of(found, "miss")) == 6 - hit


@pytest.mark.parametrize(("degrees", "hit"), [(4.9, True), (5.1, False)])
def test_a_wall_turned_more_than_the_limit_is_no_match(degrees, hit):
    line = shapely.affinity.rotate(LineString([(0, 0), (5, 0)]), degrees, origin=(2.5, 0))
    found = match_planes(SEEN, segments(wall(*line.coords)), BOX, DEFAULT)
    assert len(rows_of(found)) == hit
    if hit:
        assert found.angle_rad[rows_of(found)] == pytest.approx([radians(degrees)])
        assert found.offset_m[rows_of(found)] == pytest.approx([0], abs=5e-3)


def test_a_plane_that_shares_too_little_area_is_no_match():
    # 1 m of 2.4 m of it lie on the wall of 5 m: 42 % of the smaller area
    found = match_planes(SEEN, segments(wall((4, 0), (6.4, 0))), BOX, DEFAULT)
    assert len(rows_of(found)) == 0
    half = PlaneQualityParams(overlap=0.4)
    found = match_planes(SEEN, segments(wall((4, 0), (6.4, 0))), BOX, half)
    assert found.iou[rows_of(found)] == pytest.approx([1 / 6.4])


def test_a_second_plane_on_a_surface_is_false_and_names_it():
    found = match_planes(SEEN, segments(wall((0, 0), (3, 0)), wall((3.2, 0), (5, 0))), BOX, DEFAULT)
    (match,), (false,) = rows_of(found), rows_of(found, "false")
    assert found.found[match] == 0
    assert found.iou[match] == pytest.approx(3 / 5)
    assert found.found[false] == 1
    assert found.part_of[false] == found.true_ids[match]


def test_a_known_side_tells_the_two_faces_of_a_thin_wall_apart():
    rooms = (ROOM, PlanRoom("s", box(5.04, 0, 8, 4), floor_m=0.0, ceiling_m=2.5))
    plan = Plan("b", "0", rooms=rooms)
    cloud = points_on(plan)
    # one plane in the middle of the wall, which looks to the east: to room s
    east = wall((5.02, 4), (5.02, 0), side=True)
    found = match_planes(cloud, segments(east), plan, DEFAULT)
    (row,) = rows_of(found)
    assert found.true_ids[row].startswith("s/")
    west = wall((5.02, 0), (5.02, 4), side=True)
    found = match_planes(cloud, segments(west), plan, DEFAULT)
    (row,) = rows_of(found)
    assert found.true_ids[row].startswith("r/")


def test_what_the_scan_does_not_show_is_not_missed():
    far = PlanRoom("far", box(50, 0, 55, 4), floor_m=0.0, ceiling_m=2.5)
    plan = replace(BOX, rooms=(ROOM, far))
    found = match_planes(SEEN, segments(*SHELL[:5]), plan, DEFAULT)
    assert len(rows_of(found)) == 5
    assert [found.true_ids[i][:2] for i in rows_of(found, "miss")] == ["r/"]
    # a strip of a fifth of a wall is seen
    strip = np.array([(x, 0.0, z) for x in np.arange(0, 1, 0.05) for z in np.arange(0, 2.5, 0.05)])
    assert len(match_planes(strip, segments(), BOX, DEFAULT)) == 0
    few = match_planes(strip, segments(), BOX, PlaneQualityParams(seen=0.19))
    assert few.seen == pytest.approx([0.2], abs=0.01)


def test_tables_are_neither_found_nor_false_and_a_shelf_in_the_air_is_false():
    table = PlanFurniture("t", box(1, 1, 2.4, 1.8), "table", 0.0, 0.74)
    plan = replace(BOX, furniture=(table,))
    top, shelf = flat(box(1, 1, 2.4, 1.8), 0.74), flat(box(3, 1, 4, 2), 1.4)
    found = match_planes(SEEN, segments(*SHELL, top, shelf), plan, DEFAULT)
    assert [found.found[i] for i in rows_of(found, "false")] == [7]
    assert found.classes[rows_of(found, "false")] == ["horizontal"]
    assert len(rows_of(found)) == 6


@pytest.mark.parametrize(
    ("segment", "left_out"),
    [
        (wall((1, 0), (1, 0.9), 0.0, 1.98), True),  # the leaf, open by a right angle
        (wall((1, -0.08), (1.9, -0.08), 0.0, 1.98), True),  # shut, in a thick wall
        (wall((1, -0.2), (1, 0), 0.0, 2.0), True),  # a reveal
        (wall((1, 0.5), (2.9, 0.5), 0.0, 1.98), False),  # wider than the door
        (wall((1, 0), (1, 0.9), 0.0, 2.4), False),  # higher
        (wall((3, 1), (3, 1.9), 0.0, 1.98), False),  # elsewhere
    ],
)
def test_what_fills_an_opening_is_not_false_but_anything_larger_is(segment, left_out):
    door = PlanOpening("d", LineString([(1, -0.1), (1.9, -0.1)]), 0.0, 2.0)
    plan = replace(BOX, doors=(door,))
    params = PlaneQualityParams(least_m2=0.3, near_m=0.1)
    found = match_planes(SEEN, segments(*SHELL, segment), plan, params)
    assert len(rows_of(found)) == 6
    assert (len(rows_of(found, "false")) == 0) is left_out


def test_nothing_found_and_nothing_true_are_defined():
    assert len(match_planes(np.empty((0, 3)), segments(), Plan("b", "0"), DEFAULT)) == 0
    missed = match_planes(SEEN, segments(), BOX, DEFAULT)
    assert len(rows_of(missed, "miss")) == len(missed) == 6
    false = match_planes(SEEN, segments(*SHELL), Plan("b", "0"), DEFAULT)
    assert len(rows_of(false, "false")) == len(false) == 6


def test_matches_are_the_best_of_all_one_to_one_pairs():
    rng = np.random.default_rng(3)
    for _ in range(20):
        gains = np.where(rng.random((4, 5)) < 0.6, rng.random((4, 5)), 0.0)
        i, j = np.nonzero(gains)
        pairs = Pairs(i, j, gains[i, j])
        best = max(sum(gains[range(4), some]) for some in permutations(range(5), 4))
        assert pairs.at(assign(pairs, pairs.values)).values.sum() == pytest.approx(best)


def test_turned_rooms_and_far_origins_give_the_same_matches(tmp_path):
    turned = replace(BOX, rooms=(replace(ROOM, polygon=rotate(ROOM.polygon, 33, origin=(0, 0))),))
    write_plan(turned, tmp_path / "t.geojson")
    source = Source(
        name="t",
        path=str(tmp_path / "t.geojson"),
        sha256=sha256(b"").hexdigest(),
        size_bytes=1,
    )
    rng = np.random.default_rng(1)
    xyz = points_on(turned, 0.05) + rng.normal(0, 0.004, (len(points_on(turned, 0.05)), 3))
    shift = np.array((1.0, -2.0, 0.5))
    cloud = PointCloud((xyz - shift).astype(np.float32), shift)
    planes, labels = detect_planes(cloud, HoughParams(seed=1))
    made = extract_segments(cloud, none(), planes, labels, FilterParams())
    found = evaluate_planes(cloud, made, source, DEFAULT)
    assert len(rows_of(found)) == len(found) == 6
    assert np.max(found.angle_rad) < radians(0.1)
    assert np.max(np.abs(found.offset_m)) < 0.002
    assert np.min(found.iou) > 0.9


def test_rows_are_kept_by_the_store(tmp_path):
    found = match_planes(SEEN, segments(*SHELL[:4], flat(box(0, 0, 2, 2), 1.3)), BOX, DEFAULT)
    assert {len(rows_of(found, part)) for part in ("match", "miss", "false")} == {4, 2, 1}
    place = Place(store=str(tmp_path), run="r", building="b", storey="0", scan="s")
    again = read(PLANE_DETECTIONS, write(PLANE_DETECTIONS, found, place), str(tmp_path))
    empty = match_planes(np.empty((0, 3)), segments(), Plan("b", "0"), DEFAULT)
    for a, b in ((found, again), (empty, from_table(to_table(empty)))):
        for name in vars(a):
            np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    table = to_table(found)
    assert table["true_id"].null_count == 1
    assert table["found_segment"].null_count == 2
