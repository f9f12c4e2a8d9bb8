"""Rooms end to end: clouds sampled from known room polygons become those polygons again."""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
import shapely
from scipy.optimize import linear_sum_assignment
from shapely import Polygon, affinity, box

from storage.faces import SEEN_WALL, Faces
from storage.points import PointCloud
from storage.rooms import Rooms
from storage.snapshots import Snapshots, none
from tasks.scans.raw import DEVICE, Poses
from tasks.scans.registration import register
from tasks.simulation.campaign import CampaignParams, simulate_scans
from tasks.simulation.plan import StoreyParams, make_storey
from tasks.simulation.rotations import matrices
from tasks.simulation.sensor import SensorParams
from tasks.simulation.volunteers import VolunteerParams
from tasks.surfaces.corners import room_corners
from tasks.surfaces.filtering import FilterParams, extract_segments
from tasks.surfaces.hough import HoughParams, detect_planes
from tasks.surfaces.intersection import IntersectParams, intersect_walls
from tasks.surfaces.label_params import LabelParams
from tasks.surfaces.labelling import label_surfaces
from tasks.surfaces.occupancy import OccupancyParams, occupied_space

HEIGHT = 2.7
NOISE = 0.01
DENSITY = 700
"""Points a square metre."""

RECTANGLE = box(0, 0, 5, 4)
L_SHAPE = Polygon([(0, 0), (6, 0), (6, 3), (3, 3), (3, 5.5), (0, 5.5)])
SIX_WALLS = Polygon([(0, 0), (7, 0), (7, 2.5), (5, 2.5), (5, 4.5), (0, 4.5)])
T_SHAPE = Polygon([(0, 3), (0, 5), (7, 5), (7, 3), (5, 3), (5, 0), (2, 0), (2, 3)])
TRAPEZOID = Polygon([(0, 0), (6, 0), (4.5, 4), (0, 4)])
HEXAGON = Polygon([(3 * np.cos(a), 3 * np.sin(a)) for a in np.radians(np.arange(0, 360, 60))])
SHAPES = {
    "rectangle": (RECTANGLE, (2.5, 2.0, 1.5)),
    "L": (L_SHAPE, (1.5, 1.5, 1.5)),
    "six walls": (SIX_WALLS, (2.5, 1.2, 1.5)),
    "T": (T_SHAPE, (3.5, 4.0, 1.5)),
    "trapezoid": (TRAPEZOID, (2.0, 2.0, 1.5)),
    "hexagon": (HEXAGON, (0.0, 0.0, 1.5)),
}
"""Room polygons, and a place from which all of a room's walls are seen."""


def sampled(polygon, seed, *, without=(), openings=()):
    """Return points of a room's walls, floor and ceiling with noise across each.

    Parameters
    ----------
    without : numbers of the walls that were not seen
    openings : plan areas in which the walls are open up to 2 m
    """
    rng = np.random.default_rng(seed)
    edges = [e for ring in (polygon.exterior, *polygon.interiors) for e in pairwise(ring.coords)]
    parts = []
    for number, (p, q) in enumerate(np.array(edges)):
        if number in without:
            continue
        length = np.linalg.norm(q - p)
        normal = np.array([q[1] - p[1], p[0] - q[0]]) / length
        n = int(length * HEIGHT * DENSITY)
        xy = p + rng.random((n, 1)) * (q - p)
        z = rng.uniform(0, HEIGHT, n)
        seen = np.ones(n, bool)
        for opening in openings:
            seen &= ~(shapely.contains_xy(opening, *xy.T) & (z < 2.0))
        xy += rng.normal(0, NOISE, (n, 1)) * normal
        parts.append(np.column_stack([xy, z])[seen])
    low, high = np.reshape(polygon.bounds, (2, 2))
    for z in (0.0, HEIGHT):
        n = int((high - low).prod() * DENSITY)
        xy = rng.uniform(low, high, (n, 2))
        xy = xy[shapely.contains_xy(polygon, *xy.T)]
        parts.append(np.column_stack([xy, z + rng.normal(0, NOISE, len(xy))]))
    return np.concatenate(parts)


def seen_in(xyz, origin=(0.0, 0.0, 0.0), seen_from=None, snapshot=None):
    """Return segments and occupied space of points, the origin of their cloud added."""
    origin = np.array(origin)
    snapshots = none()
    if seen_from is not None:
        k = len(seen_from)
        snapshot = np.zeros(len(xyz), int) if snapshot is None else snapshot
        snapshots = Snapshots(
            np.arange(k, dtype=float),
            np.array(seen_from, float) + origin,
            np.tile([1.0, 0, 0, 0], (k, 1)),
            np.bincount(snapshot, minlength=k),
        )
        snapshot = snapshot.astype(np.int32)
    cloud = PointCloud(np.ascontiguousarray(xyz, np.float32), origin, snapshot)
    planes, labels = detect_planes(cloud, HoughParams())
    segments = extract_segments(cloud, snapshots, planes, labels, FilterParams())
    return segments, occupied_space(cloud, OccupancyParams())


def modelled(*scans):
    """Return rooms, walls and corners of what was seen in some scans."""
    segments, space = zip(*scans, strict=True)
    faces, coverage = label_surfaces(list(segments), LabelParams())
    return intersect_walls(faces, coverage, list(space), IntersectParams())


def rooms_of(xyz):
    return modelled(seen_in(xyz))[0]


def iou(a, b):
    return a.intersection(b).area / a.union(b).area


def corners_of(polygon):
    return np.array(polygon.exterior.coords)[:-1]


def farthest_corner(polygon, truth):
    """Return the greatest distance between corners matched one to one; their number must agree."""
    found, true = corners_of(polygon), corners_of(truth)
    assert len(found) == len(true)
    away = np.linalg.norm(found[:, None] - true[None], axis=2)
    return away[linear_sum_assignment(away)].max()


def assert_is(polygon, truth, area=0.015, metres=0.05):
    assert polygon.area == pytest.approx(truth.area, rel=area)
    assert farthest_corner(polygon, truth) < metres


def assert_disjoint_simple(rooms):
    assert all(p.geom_type == "Polygon" and p.is_valid and p.is_simple for p in rooms.polygons)
    assert all(not p.interiors for p in rooms.polygons)
    for i, a in enumerate(rooms.polygons):
        for b in rooms.polygons[i + 1 :]:
            assert a.intersection(b).area < 1e-6


@pytest.mark.parametrize("posed", [True, False], ids=["poses", "no poses"])
@pytest.mark.parametrize("shape", SHAPES)
def test_a_sampled_room_becomes_its_own_polygon(shape, posed):
    truth, place = SHAPES[shape]
    seen = seen_in(sampled(truth, 1), seen_from=[place] if posed else None)
    rooms, walls, corners = modelled(seen)
    assert len(rooms) == 1
    assert_is(rooms.polygons[0], truth)
    assert_disjoint_simple(rooms)
    assert rooms.floor_m[0] == pytest.approx(0, abs=0.005)
    assert rooms.ceiling_m[0] == pytest.approx(HEIGHT, abs=0.005)
    assert rooms.seen[0] > 0.97 and rooms.walled[0] > 0.95
    assert rooms.scans == ((0,),)
    # one wall per side, seen from one side only
    assert len(walls) == len(corners) == len(corners_of(truth))
    assert np.linalg.norm(np.diff(walls.lines, axis=1), axis=2).sum() == pytest.approx(
        truth.length, rel=0.01
    )
    assert np.isnan(walls.thickness_m).all() and (walls.rooms[:, 1] == -1).all()
    assert (walls.seen > 0.9).all()
    for ends, height in ((corners.lower, 0.0), (corners.upper, HEIGHT)):
        assert ends[:, 2] == pytest.approx(np.full(len(corners), height), abs=0.005)
        away = np.linalg.norm(ends[:, None, :2] - corners_of(truth)[None], axis=2)
        assert away[linear_sum_assignment(away)].max() < 0.05


@pytest.mark.parametrize("yaw_deg", [7, 30, 45, 77, 90, 161, 270])
def test_a_turned_room_is_the_same_room_turned(yaw_deg):
    truth = affinity.rotate(L_SHAPE, yaw_deg, origin=(0, 0))
    rooms = rooms_of(sampled(truth, 2))
    assert len(rooms) == 1
    assert_is(rooms.polygons[0], truth, area=0.01)


@pytest.mark.parametrize("wall", range(4))
def test_a_room_with_one_wall_not_seen_is_closed_where_floor_and_ceiling_end(wall):
    rooms = rooms_of(sampled(RECTANGLE, 3, without=(wall,)))
    assert len(rooms) == 1
    assert rooms.polygons[0].area == pytest.approx(RECTANGLE.area, rel=0.1)
    assert iou(rooms.polygons[0], RECTANGLE) > 0.9
    assert rooms.walled[0] < 0.85


@pytest.mark.parametrize("wall", [0, 3])
def test_an_l_shaped_room_with_one_wall_not_seen_keeps_its_area(wall):
    rooms = rooms_of(sampled(L_SHAPE, 3, without=(wall,)))
    assert len(rooms) == 1
    assert rooms.polygons[0].area == pytest.approx(L_SHAPE.area, rel=0.1)


def misplaced(xyz, rng):
    """Return points as a scan with a pose error of one centimetre and 0.2 degrees has them."""
    angle = rng.normal(0, np.radians(0.2))
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    return np.column_stack([xyz[:, :2] @ turn, xyz[:, 2]]) + rng.normal(0, 0.01, 3)


def test_three_scans_of_one_room_are_one_room():
    rng = np.random.default_rng(5)
    scans = [seen_in(misplaced(sampled(L_SHAPE, seed), rng)) for seed in range(3)]
    rooms, walls, _ = modelled(*scans)
    assert len(rooms) == 1
    assert_is(rooms.polygons[0], L_SHAPE, area=0.02)
    assert rooms.scans == ((0, 1, 2),)
    assert len(walls) == 6


def test_scans_of_three_walls_each_make_the_whole_room_together():
    scans = [seen_in(sampled(RECTANGLE, i, without=(i,))) for i in range(4)]
    rooms, _, _ = modelled(*scans)
    assert len(rooms) == 1
    assert_is(rooms.polygons[0], RECTANGLE)
    assert rooms.walled[0] > 0.95


WALL = 0.15
PAIR = (box(0, 0, 4, 4), box(4 + WALL, 0, 9, 4))
DOOR = box(3.9, 1.5, 4.3, 2.4)


def two_rooms(seed):
    """Return the points of two rooms with an open door, and which room each lies in."""
    parts = [sampled(p, seed + i, openings=(DOOR,)) for i, p in enumerate(PAIR)]
    rng = np.random.default_rng(seed)
    sill = np.column_stack([rng.uniform((4, 1.5), (4 + WALL, 2.4), (100, 2)), np.zeros(100)])
    parts.append(sill)
    return np.concatenate(parts), np.repeat([0, 1, 0], [len(p) for p in parts])


@pytest.mark.parametrize("posed", [True, False], ids=["poses", "no poses"])
def test_two_rooms_with_an_open_door_in_one_scan_are_two_rooms(posed):
    xyz, room = two_rooms(7)
    places = [(2.0, 2.0, 1.5), (6.5, 2.0, 1.5)] if posed else None
    rooms, walls, _ = modelled(seen_in(xyz, seen_from=places, snapshot=room if posed else None))
    assert len(rooms) == 2
    assert_disjoint_simple(rooms)
    assert_is(rooms.polygons[0], PAIR[1])  # the larger first
    assert_is(rooms.polygons[1], PAIR[0])
    between = (walls.rooms >= 0).all(axis=1)
    assert walls.thickness_m[between] == pytest.approx(np.full(between.sum(), WALL), abs=0.02)
    assert set(walls.rooms[between].ravel()) == {0, 1}


def test_the_scans_of_two_rooms_are_told_apart():
    scans = [seen_in(sampled(p, i)) for i, p in enumerate((*PAIR, PAIR[1]))]
    rooms, _, _ = modelled(*scans)
    assert rooms.scans == ((1, 2), (0,))


def test_rooms_with_a_wide_passage_between_them_are_one_room():
    whole = Polygon([(0, 0), (9, 0), (9, 4), (0, 4)])
    xyz = sampled(whole, 4)
    pier = sampled(box(4, 0, 4.3, 0.6), 5)
    inside = (np.abs(pier[:, 2] - HEIGHT / 2) < HEIGHT / 2 - 0.05) & (pier[:, 1] > 0.05)
    rooms = rooms_of(np.concatenate([xyz, pier[inside]]))
    assert len(rooms) == 1
    assert rooms.polygons[0].area == pytest.approx(36, rel=0.02)


@pytest.mark.parametrize("origin", [(3.5e6, 5.4e6, 250.0), (-1.25e6, 0.0, -40.0)])
def test_a_georeferenced_cloud_gives_the_same_plan_shifted(origin):
    xyz, _ = two_rooms(9)
    near, near_walls, near_corners = modelled(seen_in(xyz))
    far, far_walls, far_corners = modelled(seen_in(xyz, origin))
    assert len(far) == len(near) == 2
    for a, b in zip(near.polygons, far.polygons, strict=True):
        assert farthest_corner(affinity.translate(b, -origin[0], -origin[1]), a) < 0.002
    assert far.floor_m - origin[2] == pytest.approx(near.floor_m, abs=1e-6)
    assert far_walls.lines - origin[:2] == pytest.approx(near_walls.lines, abs=0.002)
    assert far_corners.upper - origin == pytest.approx(near_corners.upper, abs=0.002)


def test_the_same_scans_give_the_same_model_in_any_order():
    scans = [seen_in(sampled(p, i)) for i, p in enumerate(PAIR)]
    first, second = modelled(*scans)[0], modelled(*scans[::-1])[0]
    assert first.scans == ((1,), (0,)) and second.scans == ((0,), (1,))
    for a, b in zip(first.polygons, second.polygons, strict=True):
        assert a.equals_exact(b, 1e-9)


def test_a_ceiling_alone_is_enough_for_a_room():
    xyz = sampled(RECTANGLE, 6)
    rooms = rooms_of(xyz[xyz[:, 2] > 0.2])
    assert len(rooms) == 1
    assert_is(rooms.polygons[0], RECTANGLE)
    assert np.isnan(rooms.floor_m[0])
    assert rooms.ceiling_m[0] == pytest.approx(HEIGHT, abs=0.005)


def test_corners_of_leaning_walls_are_where_the_three_planes_meet():
    lean = np.radians([2.0, -1.5, 1.0, 2.5])
    feet = np.array([(0, 0), (5, 0), (5, 4), (0, 4)], float)
    ends = np.stack([feet, np.roll(feet, -1, axis=0)], axis=1)
    flat = np.array([(0, 1), (-1, 0), (0, -1), (1, 0)], float)
    normals = np.column_stack([flat * np.cos(lean)[:, None], np.sin(lean)])
    middle = np.column_stack([ends.mean(axis=1), np.full(4, HEIGHT / 2)])
    offsets = (normals * middle).sum(axis=1)
    faces = Faces(
        normals=normals,
        offsets=offsets,
        sides=np.ones(4, np.int8),
        lines=ends,
        heights=np.tile([0.0, HEIGHT], (4, 1)),
        weights=np.ones(4),
        scans=np.ones(4, np.int64),
        profiles=tuple(np.full(50, SEEN_WALL, np.uint8) for _ in range(4)),
        bin_m=0.1,
    )
    one = np.ones(1)
    rooms = Rooms(np.array([RECTANGLE]), 0 * one, HEIGHT * one, one, one, ((0,),))
    corners = room_corners(rooms, faces)
    assert len(corners) == 4
    for found, height in ((corners.lower, 0.0), (corners.upper, HEIGHT)):
        expected = [
            np.linalg.solve(
                np.array([normals[i - 1], normals[i], [0, 0, 1]]),
                [offsets[i - 1], offsets[i], height],
            )
            for i in range(4)
        ]
        away = np.linalg.norm(found[:, None] - np.array(expected)[None], axis=2)
        assert away[linear_sum_assignment(away)].max() < 1e-9


def test_corners_of_a_leaning_room_are_found_where_they_were_sampled():
    shear = 0.04  # of every metre of height, along x
    xyz = sampled(RECTANGLE, 8)
    xyz[:, 0] += shear * xyz[:, 2]
    rooms, _, corners = modelled(seen_in(xyz))
    assert len(rooms) == 1
    for ends, height in ((corners.lower, 0.0), (corners.upper, HEIGHT)):
        expected = corners_of(RECTANGLE) + np.array([shear * height, 0.0])
        away = np.linalg.norm(ends[:, None, :2] - expected[None], axis=2)
        assert away[linear_sum_assignment(away)].max() < 0.03


@cache
def demo_storey():
    """Return a simulated storey and its initial model from one scan a room and two more.

    Furnished and with drifting poses. Where shelves hide all of a wall, their faces are the wall:
    other seeds have such rooms.
    """
    plan = make_storey(StoreyParams(seed=3), "demo", "0")
    params = CampaignParams(
        scans=len(plan.rooms) + 2,
        skill=0.9,
        skill_spread=0.1,
        sensor=SensorParams(rays=6000),
        volunteer=VolunteerParams(interval_s=1.0),
    )
    seen = []
    for scan in simulate_scans(plan, params):
        snapshots, of = scan.snapshots, scan.cloud.snapshot
        poses = Poses(snapshots.times, snapshots.positions, matrices(snapshots.rotations), DEVICE)
        cloud = PointCloud(register(scan.cloud.xyz, of, poses), np.zeros(3), of)
        planes, labels = detect_planes(cloud, HoughParams())
        segments = extract_segments(cloud, snapshots, planes, labels, FilterParams())
        seen.append((segments, occupied_space(cloud, OccupancyParams())))
    return plan, *modelled(*seen)


def test_every_room_of_a_simulated_storey_is_found():
    plan, rooms, _, _ = demo_storey()
    truth = [room.polygon for room in plan.rooms]
    overlap = np.array([[iou(found, true) for true in truth] for found in rooms.polygons])
    found, true = linear_sum_assignment(-overlap)
    assert len(rooms) == len(truth) == 9
    assert overlap[found, true].min() > 0.95
    assert_disjoint_simple(rooms)


def test_the_walls_between_a_simulated_storeys_rooms_have_their_thickness():
    plan, _, walls, _ = demo_storey()
    between = np.isfinite(walls.thickness_m) & (walls.rooms >= 0).all(axis=1)
    lengths = np.linalg.norm(np.diff(walls.lines, axis=1), axis=2).ravel()
    lines = shapely.linestrings(walls.lines)
    true = np.array([wall.line for wall in plan.walls])
    nearest = shapely.distance(shapely.centroid(lines)[:, None], true[None]).argmin(axis=1)
    thickness = np.array([wall.thickness_m for wall in plan.walls])[nearest]
    off = np.abs(walls.thickness_m - thickness)[between & (lengths > 1)]
    assert len(off) >= 10
    assert np.median(off) < 0.025
    assert off.max() < 0.05


def test_a_corridor_around_a_core_of_rooms_is_a_ring():
    ring = box(0, 0, 14, 12).difference(box(1.8, 1.8, 12.2, 10.2))
    core = [box(2, 2, 7, 10), box(7.2, 2, 12, 10)]
    scans = [seen_in(sampled(p, i)) for i, p in enumerate([ring, *core])]
    rooms, walls, corners = modelled(*scans)
    assert len(rooms) == 3
    for truth in (ring, *core):
        best = max(rooms.polygons, key=lambda found: iou(found, truth))
        assert iou(best, truth) > 0.98
    assert shapely.union_all(rooms.polygons).area == pytest.approx(
        sum(p.area for p in rooms.polygons)
    )
    # its walls face the core on their inner sides, and it has corners there too
    between = np.isfinite(walls.thickness_m) & (walls.rooms >= 0).all(axis=1)
    assert walls.thickness_m[between] == pytest.approx(0.2, abs=0.03)
    assert (corners.rooms == int(np.argmax([p.area for p in rooms.polygons]))).sum() == 8
