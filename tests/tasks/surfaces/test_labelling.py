"""Labelling of hand-made surfaces: what is floor, ceiling and wall, and what is one wall."""

from itertools import pairwise

import numpy as np
import pytest

from storage.planes import PlaneLabels, Planes
from storage.points import PointCloud
from storage.snapshots import Snapshots, none
from tasks.surfaces.filtering import FilterParams, extract_segments
from tasks.surfaces.intersection import IntersectParams, intersect_walls
from tasks.surfaces.label_params import LabelParams
from tasks.surfaces.labelling import label_surfaces

STEP = 0.04
HEIGHT = 2.8


def level(x0, y0, x1, y1, z):
    """Return a horizontal rectangle as (corner, side, side)."""
    return (x0, y0, z), (x1 - x0, 0, 0), (0, y1 - y0, 0)


def wall(p, q, low=0.0, high=HEIGHT):
    """Return an upright rectangle over a plan line as (corner, side, side)."""
    return (*p, low), (q[0] - p[0], q[1] - p[1], 0), (0, 0, high - low)


def room(x0, y0, x1, y1, *, floor=True, ceiling=True):
    """Return the rectangles of an empty room."""
    ring = [(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)]
    low, high = level(x0, y0, x1, y1, 0.0), level(x0, y0, x1, y1, HEIGHT)
    return [low] * floor + [high] * ceiling + [wall(*ends) for ends in pairwise(ring)]


def scanned(rectangles, seen_from=None):
    """Return the segments of rectangles, whose planes and points are known exactly.

    Parameters
    ----------
    seen_from : one place for each rectangle, (x, y, z); None for a cloud without poses
    """
    xyz, normals = [], []
    for corner, u, v in np.array(rectangles, float):
        s, t = (
            (np.arange(n) + 0.5) / n
            for n in (max(2, int(np.ceil(np.linalg.norm(side) / STEP))) for side in (u, v))
        )
        s, t = (grid.reshape(-1, 1) for grid in np.meshgrid(s, t))
        xyz.append(corner + s * u + t * v)
        normals.append(np.cross(u, v) / np.linalg.norm(np.cross(u, v)))
    counts = np.array([len(part) for part in xyz])
    labels = np.repeat(np.arange(len(xyz), dtype=np.int32), counts)
    planes = Planes(
        normals=np.array(normals),
        offsets=np.array([n @ part[0] for n, part in zip(normals, xyz, strict=True)]),
        inliers=counts,
        rms=np.zeros(len(xyz)),
        origin=np.zeros(3),
    )
    snapshots = none()
    if seen_from is not None:
        k = len(seen_from)
        still = np.tile([1.0, 0, 0, 0], (k, 1))
        snapshots = Snapshots(np.arange(k, dtype=float), np.array(seen_from), still, counts)
    points = PointCloud(
        np.concatenate(xyz).astype(np.float32),
        np.zeros(3),
        None if seen_from is None else labels,
    )
    return extract_segments(points, snapshots, planes, PlaneLabels(labels), FilterParams())


def labelled(*scans, **params):
    return label_surfaces([scanned(s) for s in scans], LabelParams(**params))


def lies_on(faces, p, q, within=0.05):
    """Return which faces lie on the line through two plan points."""
    p, q = np.array(p, float), np.array(q, float)
    normal = np.array([p[1] - q[1], q[0] - p[0]]) / np.linalg.norm(q - p)
    return np.abs((faces.lines - p) @ normal).max(axis=1) < within


def test_a_bare_room_has_its_floor_its_ceiling_and_four_walls():
    faces, coverage = labelled(room(0, 0, 5, 4))
    assert coverage.floor_level_m == pytest.approx(0)
    assert coverage.ceiling_level_m == pytest.approx(HEIGHT)
    assert len(faces) == 4
    assert sorted(np.linalg.norm(np.diff(faces.lines, axis=1), axis=2).ravel()) == pytest.approx(
        [4, 4, 5, 5], abs=0.1
    )
    assert (faces.sides == 1).all()
    middles = faces.lines.mean(axis=1)
    # inwards: towards the middle of the room
    assert (((np.array([2.5, 2.0]) - middles) * faces.normals[:, :2]).sum(axis=1) > 1.9).all()
    area = len(coverage) * coverage.cell_m**2
    assert area == pytest.approx(20, rel=0.03)


@pytest.mark.parametrize(
    "thing",
    [
        level(2, 2, 2.6, 2.6, 3.1),
        level(2, 2, 2.6, 2.6, -0.4),
        level(1, 1, 2.4, 1.8, 0.74),
        level(1, 1, 1.6, 1.6, 2.3),
    ],
    ids=["light well above", "hole below", "table", "hanging lamp"],
)
def test_small_levels_do_not_become_floor_or_ceiling(thing):
    _, coverage = labelled([*room(0, 0, 5, 4), thing])
    assert coverage.floor_level_m == pytest.approx(0, abs=1e-6)
    assert coverage.ceiling_level_m == pytest.approx(HEIGHT, abs=1e-6)
    assert np.nanmin(coverage.floor_m) > -0.31 and np.nanmax(coverage.floor_m) < 0.31
    assert np.nanmin(coverage.ceiling_m) > 1.89


def test_a_lamp_above_and_a_hole_below_together_do_not_win():
    things = [level(2, 2, 2.6, 2.6, 3.3), level(3, 2, 3.6, 2.6, -0.5)]
    _, coverage = labelled([*room(0, 0, 5, 4), *things])
    assert coverage.floor_level_m == pytest.approx(0, abs=1e-6)
    assert coverage.ceiling_level_m == pytest.approx(HEIGHT, abs=1e-6)
    assert np.nanmax(coverage.ceiling_m) == pytest.approx(HEIGHT, abs=1e-6)
    assert np.nanmin(coverage.floor_m) == pytest.approx(0, abs=1e-6)


def test_a_lowered_ceiling_over_a_part_of_the_room_stays_ceiling():
    rectangles = room(0, 0, 5, 4, ceiling=False)
    rectangles += [level(0, 0, 5, 2.5, HEIGHT), level(0, 2.5, 5, 4, 2.4)]
    _, coverage = labelled(rectangles)
    assert coverage.ceiling_level_m == pytest.approx(HEIGHT)
    deep = coverage.centres()[:, 1] > 2.7
    assert coverage.ceiling_m[deep] == pytest.approx(np.full(deep.sum(), 2.4))


def test_a_cloud_with_only_a_ceiling_gets_no_floor():
    upper = [wall(p, q, 1.4) for p, q in [((0, 0), (5, 0)), ((5, 0), (5, 4)), ((5, 4), (0, 4))]]
    _, coverage = labelled([level(0, 0, 5, 4, HEIGHT), *upper])
    assert coverage.floor_level_m is None
    assert np.isnan(coverage.floor_m).all()
    assert coverage.ceiling_level_m == pytest.approx(HEIGHT)
    assert coverage.ceiling_m == pytest.approx(np.full(len(coverage), HEIGHT))


def test_a_suspended_part_of_the_ceiling_is_no_floor():
    upper = [wall(p, q, 1.4) for p, q in [((0, 0), (5, 0)), ((5, 0), (5, 4)), ((5, 4), (0, 4))]]
    suspended = level(1, 1, 4, 3, HEIGHT - 0.6)
    _, coverage = labelled([level(0, 0, 5, 4, HEIGHT), suspended, *upper])
    assert coverage.floor_level_m is None
    assert coverage.ceiling_level_m == pytest.approx(HEIGHT)


def test_a_cloud_with_only_a_floor_gets_no_ceiling():
    faces, coverage = labelled(room(0, 0, 5, 4, ceiling=False))
    assert coverage.ceiling_level_m is None
    assert np.isnan(coverage.ceiling_m).all()
    assert coverage.floor_level_m == pytest.approx(0)
    assert len(faces) == 4


def test_a_cloud_with_neither_has_no_levels_and_no_coverage():
    faces, coverage = labelled([wall((0, 0), (4, 0))])
    assert coverage.floor_level_m is None and coverage.ceiling_level_m is None
    assert len(coverage) == 0
    assert len(faces) == 1


def without_planes():
    """Return the segments of a cloud without points."""
    no = np.empty(0)
    return extract_segments(
        PointCloud(np.empty((0, 3), np.float32), np.zeros(3)),
        none(),
        Planes(np.empty((0, 3)), no, np.empty(0, np.int64), no, np.zeros(3)),
        PlaneLabels(np.empty(0, np.int32)),
        FilterParams(),
    )


@pytest.mark.parametrize("count", [0, 1, 2])
def test_no_scan_and_scans_without_planes_give_nothing(count):
    faces, coverage = label_surfaces([without_planes()] * count, LabelParams())
    assert len(faces) == 0 and len(coverage) == 0
    assert coverage.floor_level_m is None and coverage.ceiling_level_m is None
    rooms, walls, corners = intersect_walls(faces, coverage, [], IntersectParams())
    assert (len(rooms), len(walls), len(corners)) == (0, 0, 0)


@pytest.mark.parametrize(
    ("thing", "ends"),
    [
        (wall((2.5, 0.5), (2.5, 3.5), 0, 1.1), ((2.5, 0), (2.5, 4))),
        (wall((1, 2), (3, 2), 0, 1.6), ((0, 2), (5, 2))),
        (wall((1.5, 0), (1.5, 0.9), 0, 2.0), ((1.5, 0), (1.5, 1))),
        (wall((1.5, 0), (1.9, 0.8), 0.01, 2.0), ((1.5, 0), (1.9, 0.8))),
        (wall((1, 2), (2.2, 2), 0, 1.9), ((0, 2), (5, 2))),
    ],
    ids=["waist-high", "higher than eyes", "door leaf", "door leaf ajar", "cupboard"],
)
def test_what_ends_far_below_the_ceiling_is_no_wall(thing, ends):
    faces, _ = labelled([*room(0, 0, 5, 4), thing])
    assert len(faces) == 4
    assert not lies_on(faces, *ends).any()


def test_a_wall_across_the_room_is_a_wall():
    faces, _ = labelled([*room(0, 0, 5, 4), wall((2.5, 0), (2.5, 4))])
    assert lies_on(faces, (2.5, 0), (2.5, 4)).sum() == 1


def turned(length, degrees, at):
    """Return the ends of a plan line of a length that starts somewhere in some direction."""
    angle = np.radians(degrees)
    return at, (at[0] + length * np.cos(angle), at[1] + length * np.sin(angle))


@pytest.mark.parametrize(
    ("gap", "degrees", "length", "count"),
    [
        (0.1, 0, 2.0, 1),
        (0.15, 0, 2.0, 1),
        (0.35, 0, 2.0, 2),
        (0.1, 5, 0.6, 1),
        (0.1, 14, 0.3, 2),
        (0.1, 90, 2.0, 2),
    ],
)
def test_segments_nearer_than_eps_wall_and_turned_less_than_eps_norm_are_one(
    gap, degrees, length, count
):
    first = wall((0, 0), (3, 0))
    second = wall(*turned(length, degrees, (3 + gap, 0)))
    faces, _ = labelled([level(0, 0, 6, 3, 0), level(0, 0, 6, 3, HEIGHT), first, second])
    assert len(faces) == count


@pytest.mark.parametrize(("eps_wall", "count"), [(0.2, 2), (0.5, 1)])
def test_eps_wall_is_the_distance_up_to_which_segments_are_one(eps_wall, count):
    walls = [wall((0, 0), (2, 0)), wall((2.4, 0), (5, 0))]
    faces, _ = labelled([level(0, 0, 5, 3, 0), *walls], eps_wall=eps_wall)
    assert len(faces) == count


@pytest.mark.parametrize(("eps_norm", "count"), [(0.2, 1), (0.05, 2)])
def test_eps_norm_is_the_cross_product_up_to_which_segments_are_one(eps_norm, count):
    walls = [wall((0, 0), (3, 0)), wall(*turned(0.5, 5, (3.1, 0)))]
    faces, _ = labelled([level(0, 0, 5, 3, 0), *walls], eps_norm=eps_norm)
    assert len(faces) == count


def test_two_scans_of_one_wall_are_one_face_seen_twice():
    again = room(0.02, 0.02, 5.02, 4.02)
    faces, coverage = labelled(room(0, 0, 5, 4), again)
    assert len(faces) == 4
    assert (faces.scans == 2).all()
    assert faces.weights.sum() == pytest.approx(2 * HEIGHT * 18, rel=0.05)
    inner = (np.abs(coverage.centres() - [2.5, 2]) < [2.3, 1.8]).all(axis=1)
    assert (coverage.scans[inner] == 2).all()


@pytest.mark.parametrize("posed", [True, False], ids=["poses", "no poses"])
@pytest.mark.parametrize("thickness", [0.08, 0.12, 0.2, 0.3])
def test_the_two_faces_of_a_thin_wall_stay_two_and_are_one_wall(thickness, posed):
    left, right = room(0, 0, 4, 4), room(4 + thickness, 0, 8, 4)
    places = [(2.0, 2.0, 1.5)] * 6 + [(6.0, 2.0, 1.5)] * 6
    scan = scanned(left + right, places if posed else None)
    faces, coverage = label_surfaces([scan], LabelParams())
    west, east = (
        lies_on(faces, (x, 0), (x, 4), within=thickness / 2 - 1e-3) for x in (4, 4 + thickness)
    )
    assert west.sum() == east.sum() == 1
    assert faces.normals[west] @ faces.normals[east].T == pytest.approx(-1, abs=1e-3)
    assert faces.normals[west, 0] < 0
    rooms, walls, _ = intersect_walls(faces, coverage, [], IntersectParams())
    assert len(rooms) == 2
    between = np.flatnonzero((walls.rooms >= 0).all(axis=1))
    assert len(between) == 1
    assert walls.thickness_m[between[0]] == pytest.approx(thickness, abs=0.02)
    assert walls.lines[between[0], :, 0] == pytest.approx(np.full(2, 4 + thickness / 2), abs=0.02)
    assert np.ptp(walls.lines[between[0], :, 1]) == pytest.approx(4, abs=0.1)


def test_a_point_whose_snapshot_is_unknown_was_seen_from_the_nearest_one():
    # most snapshots, and the mean of all, lie on the other side, but farther off
    places = np.array([(1.0, 1.5, 1.4), *[(-6.0, y, 1.4) for y in (0.5, 1.0, 1.5, 2.0, 2.5)]])
    counts = np.array([1000, *[0] * 5])
    poses = Snapshots(np.arange(6.0), places, np.tile([1.0, 0, 0, 0], (6, 1)), counts)
    y, z = (grid.ravel() for grid in np.meshgrid(np.arange(0, 3, 0.1), np.arange(0, HEIGHT, 0.1)))
    xyz = np.column_stack((np.zeros(len(y)), y, z)).astype(np.float32)
    labels = PlaneLabels(np.zeros(len(xyz), np.int32))
    for normal in ([1.0, 0, 0], [-1.0, 0, 0]):
        plane = Planes(
            np.array([normal]), np.zeros(1), np.array([len(xyz)]), np.zeros(1), np.zeros(3)
        )
        for shift in (0.0, 100.0, -100.0):
            origin = np.array([shift, 0, 0])
            moved = Snapshots(poses.times, places + origin, poses.rotations, counts)
            cloud = PointCloud(xyz, origin)
            found = extract_segments(cloud, moved, plane, labels, FilterParams())
            assert found.side_known.tolist() == [True]
            assert found.normals[0] == pytest.approx([1.0, 0, 0])
            assert found.offsets[0] == pytest.approx(shift)


def test_of_a_cloud_without_poses_no_side_is_known():
    assert not scanned(room(0, 0, 4, 5)).side_known.any()
