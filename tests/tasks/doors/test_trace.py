"""Images of the walls of two rooms with an open and a shut door, scanned from known places."""

import os

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from shapely import box

from storage.layout_rooms import LayoutRooms
from storage.layout_walls import LayoutWalls
from storage.points import PointCloud
from storage.rooms import Rooms
from storage.snapshots import Snapshots, none
from storage.wall_images import EMPTY, NOT_SEEN, OCCLUDED, OCCUPIED
from storage.walls import Walls
from tasks.doors.trace import TraceParams, trace_layout_walls, trace_walls
from tasks.doors.viewpoints import ViewParams

HIGH, THICK, HEAD = 2.5, 0.2, 2.0
SOUTH, NORTH = box(0, 0, 5, 3), box(0, 3 + THICK, 5, 6)
OPEN, SHUT = (1.0, 1.9), (3.2, 4.1)
"""Doorways of the wall between the rooms: from, to along x. The shut one's leaf lies against its
north face: 12 cm behind the south one, 4 cm behind the north one."""
LEAF = 3.12, 3.16
CUPBOARD = 0.1, 0.8, 3.7, 1.2
"""In the north room, before that wall: from, to along x; front; height."""
ALL_ROUND = TraceParams(view=ViewParams(view_across_rad=6.28, reach_m=8.0))


def sheet(corner, u, v, step=0.02):
    """Return points all over a rectangle."""
    corner, u, v = (np.array(w, float) for w in (corner, u, v))
    n, m = (max(int(np.linalg.norm(w) / step), 1) for w in (u, v))
    s, t = ((np.arange(k) + 0.5)[:, None, None] / k for k in (n, m))
    return (corner + s * u + t.swapaxes(0, 1) * v).reshape(-1, 3)


def storey():
    """Return the points of both rooms."""
    parts = []
    for y in (3.0, 3.0 + THICK):  # both faces of the wall between, doorways left out
        face = sheet((0, y, 0), (5, 0, 0), (0, 0, HIGH))
        x, z = face[:, 0], face[:, 2]
        hole = (z < HEAD) & (((x > OPEN[0]) & (x < OPEN[1])) | ((x > SHUT[0]) & (x < SHUT[1])))
        parts.append(face[~hole])
    for door in (OPEN, SHUT):
        parts += [sheet((x, 3, 0), (0, THICK, 0), (0, 0, HEAD)) for x in door]
        parts.append(sheet((door[0], 3, HEAD), (door[1] - door[0], 0, 0), (0, THICK, 0)))
    parts += [sheet((SHUT[0], y, 0), (SHUT[1] - SHUT[0], 0, 0), (0, 0, HEAD)) for y in LEAF]
    for y0, y1 in ((0, 3), (3 + THICK, 6)):
        parts += [sheet((x, y0, 0), (0, y1 - y0, 0), (0, 0, HIGH)) for x in (0, 5)]
        parts += [sheet((0, y0, z), (5, 0, 0), (0, y1 - y0, 0)) for z in (0, HIGH)]
    parts += [sheet((0, y, 0), (5, 0, 0), (0, 0, HIGH)) for y in (0, 6)]
    x0, x1, front, top = CUPBOARD
    parts.append(sheet((x0, front, 0), (x1 - x0, 0, 0), (0, 0, top)))
    parts.append(sheet((x0, 3 + THICK, top), (x1 - x0, 0, 0), (0, front - 3 - THICK, 0)))
    parts.append(sheet((x1, 3 + THICK, 0), (0, front - 3 - THICK, 0), (0, 0, top)))
    xyz = np.concatenate(parts)
    noise = np.random.default_rng(0).normal(0, 0.004, xyz.shape)
    return PointCloud((xyz + noise).astype(np.float32), np.zeros(3))


def model():
    polygons = np.empty(2, object)
    polygons[:] = [SOUTH, NORTH]
    known = np.zeros(2), np.full(2, HIGH), np.ones(2), np.ones(2)
    walls = Walls(
        lines=np.array([[[0, 3 + THICK / 2], [5, 3 + THICK / 2]], [[0, 0], [5, 0]]], float),
        thickness_m=np.array([THICK, np.nan]),
        base_m=np.array([0.0, np.nan]),
        top_m=np.array([HIGH, np.nan]),
        rooms=np.array([[0, 1], [0, -1]], np.int32),
        seen=np.ones(2),
    )
    return Rooms(polygons, *known, ((0,), (0,))), walls


def snapshots(azimuth=90.0):
    at = [(x, y, 1.5) for y in (0.8, 1.6, 4.6, 5.4) for x in (0.7, 1.5, 2.5, 3.6, 4.4)]
    turn = Rotation.from_euler("xz", [90, azimuth - 90], degrees=True).as_quat(scalar_first=True)
    k = len(at)
    return Snapshots(np.arange(k) * 1.0, np.array(at), np.tile(turn, (k, 1)), np.full(k, 9000))


@pytest.fixture(scope="module")
def cloud():
    return storey()


@pytest.fixture(scope="module")
def images(cloud):
    return trace_walls(*model(), [cloud], [snapshots()], ALL_ROUND)


def pixels(images, face):
    """Return x and z of the pixels' middles of a face along x."""
    i, j = (np.arange(n) + 0.5 for n in images.labels[face].shape)
    x = images.origins[face, 0] + images.axes[face, 0] * i * images.pixel_m
    return np.broadcast_arrays(x[:, None], (images.base_m[face] + j * images.pixel_m)[None])


def expected(x, z, margin):
    """Return where a wall face of the two rooms must be empty, and where it must not."""
    inside = (x > OPEN[0] + margin) & (x < OPEN[1] - margin) & (z < HEAD - margin)
    outside = (x < OPEN[0] - margin) | (x > OPEN[1] + margin) | (z > HEAD + margin)
    return inside & (z > margin), outside


def test_each_wall_piece_has_a_face_for_each_of_its_rooms(images):
    assert images.walls.tolist() == [0, 0, 1] and images.rooms.tolist() == [0, 1, 0]
    assert images.opposite.tolist() == [1, 0, -1]
    np.testing.assert_allclose(images.origins[:, 1], [3.0, 3.0 + THICK, 0.0], atol=0.005)
    np.testing.assert_allclose(images.base_m, 0)  # the other walls' where it is not known
    assert {label.shape for label in images.labels} == {(125, 62)}
    assert (images.rays > 125 * 62).all()


@pytest.mark.parametrize("face", [0, 1])
def test_an_open_door_is_empty_and_the_wall_around_it_is_not(images, face):
    x, z = pixels(images, face)
    inside, outside = expected(x, z, 0.08)
    label = images.labels[face]
    assert (label[inside] == EMPTY).mean() > 0.99
    assert (label[outside] == EMPTY).mean() < 0.002
    assert (images.empty[face][inside] > 127).mean() > 0.99
    assert np.nanmedian(images.depths[face][inside]) > 0.5  # the next room


@pytest.mark.parametrize(("face", "recess"), [(0, 0.12), (1, 0.04)])
def test_a_shut_door_is_occupied_and_recessed(images, face, recess):
    x, z = pixels(images, face)
    leaf = (x > SHUT[0] + 0.08) & (x < SHUT[1] - 0.08) & (z < HEAD - 0.08) & (z > 0.08)
    wall = (x > 2.1) & (x < 3.1)
    assert (images.labels[face][leaf] == OCCUPIED).mean() > 0.99
    assert np.nanmedian(images.depths[face][leaf]) == pytest.approx(recess, abs=0.01)
    assert np.nanmedian(images.depths[face][wall]) == pytest.approx(0, abs=0.005)


def test_what_stands_before_a_wall_hides_it(images):
    x, z = pixels(images, 1)
    x0, x1, front, top = CUPBOARD
    behind = (x > x0 + 0.2) & (x < x1 - 0.3) & (z < top - 0.5)
    assert (images.labels[1][behind] == OCCLUDED).all()
    assert np.median(images.depths[1][behind]) < -0.3
    assert front > 3 + THICK + 0.3 and not (images.labels[0] == OCCLUDED)[x < 1].any()


def test_a_room_without_snapshots_is_looked_at_from_its_inside(cloud):
    found = trace_walls(*model(), [cloud], [none()], ALL_ROUND)
    for face in (0, 1):
        inside, outside = expected(*pixels(found, face), 0.08)
        assert (found.labels[face][inside] == EMPTY).mean() > 0.95
        assert (found.labels[face][outside] == EMPTY).mean() < 0.005


def test_a_wall_no_snapshot_looked_at_is_not_seen_rather_than_empty(cloud):
    south_only = cloud.xyz[cloud.xyz[:, 1] > 0.5]  # nothing of the wall at y = 0 was scanned
    found = trace_walls(
        *model(), [PointCloud(south_only, np.zeros(3))], [snapshots(90)], TraceParams()
    )
    assert (found.labels[2] == NOT_SEEN).all() and found.rays[2] == 0
    assert (found.labels[0] == EMPTY).any()


def test_a_face_that_stands_beside_its_plan_is_traced_where_it_stands(cloud, images):
    rooms, walls = model()
    off = 0.12
    moved = Walls(
        walls.lines + np.array([0, off]),
        walls.thickness_m,
        walls.base_m,
        walls.top_m,
        walls.rooms,
        walls.seen,
    )
    found = trace_walls(rooms, moved, [cloud], [snapshots()], ALL_ROUND)
    assert found.origins[0, 1] == pytest.approx(3.0, abs=0.01)
    assert (found.labels[0] == images.labels[0]).mean() > 0.97


def test_images_are_the_same_for_any_number_of_threads_and_for_shuffled_points(
    cloud, images, monkeypatch
):
    monkeypatch.setattr(os, "cpu_count", lambda: 5)
    order = np.random.default_rng(0).permutation(len(cloud))
    parts = [PointCloud(cloud.xyz[part], cloud.origin) for part in np.array_split(order, 3)]
    again = trace_walls(*model(), parts, [snapshots()], ALL_ROUND)
    for name in ("labels", "depths", "empty"):
        for was, now in zip(getattr(images, name), getattr(again, name), strict=True):
            np.testing.assert_array_equal(now, was)


def test_the_walls_of_a_corrected_plan_are_traced_alike(cloud, images):
    rooms, walls = model()
    no = np.array(["", ""])
    layout = LayoutRooms(rooms, no, no, np.full(2, np.nan), ((0,), (1,)), no)
    found = trace_layout_walls(layout, LayoutWalls(walls), [cloud], [snapshots()], ALL_ROUND)
    for was, now in zip(images.labels, found.labels, strict=True):
        np.testing.assert_array_equal(now, was)


def test_a_storey_without_walls_or_without_points_has_nothing_to_show():
    rooms, walls = model()
    none_of = Walls(
        np.empty((0, 2, 2)), np.empty(0), np.empty(0), np.empty(0),
        np.empty((0, 2), np.int32), np.empty(0),
    )  # fmt: skip
    assert len(trace_walls(rooms, none_of, [], [], TraceParams())) == 0
    blank = trace_walls(rooms, walls, [], [], TraceParams())
    assert all((label == NOT_SEEN).all() for label in blank.labels)


def thinned(cloud, spacing):
    """Return one point of each cube of this edge, as scans are thinned out before they are sent."""
    shuffled = np.random.default_rng(1).permutation(cloud.xyz)
    # walls run through the middle of cubes: noise would put a wall between cubes into both
    cubes = np.floor(shuffled / spacing + 0.5)
    _, first = np.unique(cubes, axis=0, return_index=True)
    return PointCloud(shuffled[first], cloud.origin)


@pytest.mark.parametrize("eyes", [none(), snapshots()], ids=["assumed places", "snapshots"])
def test_pixels_and_voxels_of_a_thin_scan_are_as_coarse_as_its_points(cloud, eyes):
    found = trace_walls(*model(), [thinned(cloud, 0.1)], [eyes], ALL_ROUND)
    assert found.pixel_m == pytest.approx(0.1, abs=0.02)
    inside, outside = expected(*pixels(found, 0), 0.12)
    assert (found.labels[0][inside] == EMPTY).mean() > 0.95
    assert (found.labels[0][outside] == EMPTY).mean() < 0.1


def test_finer_voxels_than_points_are_full_of_holes(cloud):
    finer = ALL_ROUND.model_copy(update={"per_spacing": 0.01})
    found = trace_walls(*model(), [thinned(cloud, 0.1)], [snapshots()], finer)
    _, outside = expected(*pixels(found, 0), 0.12)
    assert found.pixel_m == ALL_ROUND.pixel_m
    assert (found.labels[0][outside] == EMPTY).mean() > 0.3


def test_of_points_further_apart_than_a_door_can_be_seen_in_nothing_is_said(cloud):
    found = trace_walls(*model(), [thinned(cloud, 0.35)], [snapshots()], ALL_ROUND)
    assert all((label == NOT_SEEN).all() for label in found.labels)
    assert (found.rays == 0).all()


def test_holes_of_a_wall_that_was_not_scanned_say_nothing_where_places_are_assumed(cloud):
    x, y, z = cloud.xyz.T
    between = (y > 2.9) & (y < 3.3) & (x < 3) & (z > 0.05) & (z < HIGH - 0.05)
    gone = PointCloud(cloud.xyz[~between], cloud.origin)
    images, holes = {}, {}
    for name, eyes in (("assumed", none()), ("known", snapshots())):
        images[name] = trace_walls(*model(), [gone], [eyes], ALL_ROUND)
        holes[name] = (images[name].labels[0] == EMPTY).mean()
    assert holes["assumed"] == 0 and holes["known"] > 0.3
    label, depth, empty = (s[0] for s in (
        images["assumed"].labels, images["assumed"].depths, images["assumed"].empty))  # fmt: skip
    assert (label == NOT_SEEN).mean() > 0.3 and (label == OCCUPIED).any()
    assert np.isnan(depth[label == NOT_SEEN]).all() and not empty[label == NOT_SEEN].any()


def test_a_wall_scanned_from_one_side_alone_keeps_its_holes_on_both(cloud):
    _, y, z = cloud.xyz.T
    north_face = (y > 3.15) & (y < 3.25) & (z > HEAD + 0.05) & (z < HIGH - 0.05)
    half = PointCloud(cloud.xyz[~north_face], cloud.origin)
    found = trace_walls(*model(), [half], [none()], ALL_ROUND)
    for face in (0, 1):
        inside, _ = expected(*pixels(found, face), 0.08)
        assert (found.labels[face][inside] == EMPTY).mean() > 0.9
