"""Plane detection: all surfaces of closed-form rooms, whatever the density, seed or place."""

import hashlib
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from storage.points import PointCloud
from tasks.simulation.clouds import furnished_floor, furnished_room
from tasks.surfaces.hough import HoughParams, detect_planes

SHELL = ("floor", "ceiling", "wall")
BOX = np.array([4.0, 3.0, 2.5])


def cloud(xyz) -> PointCloud:
    return PointCloud(np.ascontiguousarray(xyz, np.float32), np.zeros(3))


def rectangle(low, high, n, seed, noise=0.01):
    """Return points of a rectangle with one degenerate axis, with noise along that axis."""
    rng = np.random.default_rng(seed)
    low, high = np.array(low, float), np.array(high, float)
    off = rng.normal(0, noise, (n, 1)) * (low == high)
    return low + rng.random((n, 3)) * (high - low) + off


def box_points(seed=0, n=10_000, noise=0.01):
    """Return the six faces of an empty box with one corner in the origin."""
    faces = []
    for axis in range(3):
        for side in (0.0, BOX[axis]):
            low, high = np.zeros(3), BOX.copy()
            low[axis] = high[axis] = side
            faces.append(rectangle(low, high, n, seed + len(faces), noise))
    return np.concatenate(faces)


def box_normals_offsets():
    return np.repeat(np.eye(3), 2, axis=0), np.array([0, BOX[0], 0, BOX[1], 0, BOX[2]])


def found(planes, normals, offsets, places, degrees, metres):
    """Return for each true plane whether a row is within an angle, and a distance at a place."""
    angles = np.degrees(np.arccos(np.clip(np.abs(normals @ planes.normals.T), 0, 1)))
    away = np.abs(places @ planes.normals.T - planes.offsets)
    return ((angles < degrees) & (away < metres)).any(axis=1)


def found_shell(planes, surfaces, degrees, metres):
    rows = np.isin(surfaces.roles, SHELL)
    return found(
        planes,
        surfaces.normals[rows],
        surfaces.offsets[rows],
        surfaces.centres[rows],
        degrees,
        metres,
    )


def assert_is_the_box(planes, turn=None, shift=(0.0, 0.0, 0.0), metres=0.01):
    """Assert that there is exactly one plane per face of the (turned, shifted) box."""
    normals, offsets = box_normals_offsets()
    places = np.tile(BOX / 2, (6, 1))
    places += normals * (offsets - (places * normals).sum(axis=1))[:, None]
    if turn is not None:
        normals, places = turn.apply(normals), turn.apply(places)
    places = places + np.array(shift)
    assert len(planes) == 6
    assert found(planes, normals, offsets, places, 0.5, metres).all()


@pytest.mark.parametrize("n_points", [100_000, 500_000, 2_000_000])
def test_all_six_surfaces_of_a_furnished_room_are_found_with_every_seed(n_points):
    xyz, surfaces = furnished_room(n_points, seed=n_points, noise_m=0.01)
    for seed in range(10):
        planes, _ = detect_planes(cloud(xyz), HoughParams(seed=seed))
        shell = found_shell(planes, surfaces, degrees=1, metres=0.01)
        assert len(shell) == 6 and shell.all(), seed


def test_most_surfaces_of_a_whole_storey_are_found():
    xyz, surfaces = furnished_floor(1_000_000, seed=2)
    planes, _ = detect_planes(cloud(xyz), HoughParams())
    shell = found_shell(planes, surfaces, degrees=5, metres=0.05)
    assert len(shell) == 126
    assert shell.sum() >= 120


@pytest.mark.parametrize(("noise", "metres"), [(0.0, 1e-4), (0.005, 0.005), (0.01, 0.005)])
def test_an_empty_box_has_exactly_one_plane_per_face(noise, metres):
    planes, labels = detect_planes(cloud(box_points(noise=noise)), HoughParams())
    assert_is_the_box(planes, metres=metres)
    assert planes.rms == pytest.approx(np.full(6, noise), abs=0.1 * noise + 1e-4)
    assert (labels.labels >= 0).mean() > 0.98


@pytest.mark.parametrize(
    "many",
    [
        lambda xyz: np.tile(xyz, (4, 1)),
        lambda xyz: np.concatenate([xyz, np.tile(xyz[:1], (5000, 1))]),
        lambda xyz: np.concatenate([xyz, np.tile([[2.0, 1.5, 1.2]], (5000, 1))]),
    ],
    ids=["every point four times", "one point of a wall", "one point in mid-air"],
)
def test_thousands_of_duplicate_points_do_not_matter(many):
    planes, _ = detect_planes(cloud(many(box_points())), HoughParams())
    assert_is_the_box(planes)


@pytest.mark.parametrize(
    "xyz",
    [
        np.empty((0, 3)),
        [[1.0, 2.0, 3.0]],
        np.tile([[1.0, 2.0, 3.0]], (5000, 1)),
        np.linspace(0, 5, 5000)[:, None] * [[1.0, 0.0, 0.0]],
        np.linspace(0, 5, 5000)[:, None] * [[0.6, -0.5, 0.7]],
        rectangle((0, 0, 0), (2, 2, 0), 19, 1),
        [[0.0, 0.0, 0.0], [500.0, 0.0, 0.0]] * 50,
    ],
    ids=["none", "one", "identical", "level line", "slanting line", "nineteen", "two places"],
)
def test_a_cloud_without_a_plane_has_none_failure(xyz):
    planes, labels = detect_planes(cloud(xyz), HoughParams())
    assert len(planes) == 0
    assert planes.normals.shape == (0, 3)
    assert (labels.labels == np.full(len(xyz), -1)).all()
    assert len(labels.labels) == len(xyz)


def test_a_thinly_seen_wall_beside_a_densely_seen_floor_is_kept():
    dense = rectangle((0, 0, 0), (3, 3, 0), 1_200_000, 1)
    thin = rectangle((0, 3, 0), (3, 3, 2), 900, 2)
    planes, labels = detect_planes(cloud(np.concatenate([dense, thin])), HoughParams())
    assert len(planes) == 2
    assert (labels.labels[-900:] == 1).mean() > 0.9


def digest_of_a_room(seed):
    """Return a digest of all that is detected in a room."""
    planes, labels = detect_planes(cloud(furnished_room(300_000, 5)[0]), HoughParams(seed=seed))
    arrays = planes.normals, planes.offsets, planes.inliers, planes.rms, planes.origin
    parts = [a.tobytes() for a in (*arrays, labels.labels)]
    return hashlib.sha256(b"".join(parts)).hexdigest()


def test_the_same_seed_gives_the_same_bytes_in_threads_side_by_side():
    alone = [digest_of_a_room(seed) for seed in (3, 4)]
    assert alone[0] != alone[1]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(digest_of_a_room, (3, 4, 3, 4)))
    assert together == alone * 2


@pytest.mark.parametrize("threads", ["1", "4"])
def test_the_bytes_do_not_depend_on_how_many_threads_libraries_may_use(threads):
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
    here = Path(__file__)
    program = f"from {here.stem} import digest_of_a_room; print(digest_of_a_room(3))"
    path = os.pathsep.join([str(here.parents[3]), str(here.parent)])
    env = os.environ | dict.fromkeys(names, threads) | {"PYTHONPATH": path}
    done = subprocess.run(
        [sys.executable, "-c", program], env=env, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == digest_of_a_room(3)


@pytest.mark.parametrize("seed", range(4))
def test_if_the_cloud_is_turned_and_shifted_the_planes_turn_and_shift_along(seed):
    turn, shift = Rotation.random(rng=seed), np.random.default_rng(seed).uniform(-20, 20, 3)
    planes, _ = detect_planes(cloud(turn.apply(box_points()) + shift), HoughParams())
    assert_is_the_box(planes, turn, shift)


def test_two_patches_of_one_plane_a_metre_apart_are_two_rows():
    left = rectangle((0, 0, 0), (2, 2, 0), 8000, 1)
    right = rectangle((3, 0, 0), (5, 2, 0), 4000, 2)
    planes, labels = detect_planes(cloud(np.concatenate([left, right])), HoughParams())
    assert len(planes) == 2
    assert np.abs(planes.normals[:, 2]) == pytest.approx([1, 1], abs=1e-3)
    assert (labels.labels[:8000] == 0).mean() > 0.98
    assert (labels.labels[8000:] == 1).mean() > 0.98


@pytest.mark.parametrize("yaw_deg", [0, 20, 45])
def test_a_wall_of_thirty_metres_is_one_plane_across_all_tiles(yaw_deg):
    turn = Rotation.from_euler("z", yaw_deg, degrees=True)
    wall = turn.apply(rectangle((0, 0, 0), (30, 0, 3), 60_000, 1))
    planes, labels = detect_planes(cloud(wall), HoughParams())
    assert len(planes) == 1
    assert (labels.labels == 0).mean() > 0.98
    assert np.abs(turn.apply([0, 1, 0]) @ planes.normals[0]) == pytest.approx(1, abs=1e-5)


def test_the_labels_agree_with_the_planes():
    xyz, _ = furnished_room(200_000, seed=8)
    planes, labels = detect_planes(cloud(xyz), HoughParams(tolerance_m=0.04))
    on = labels.labels >= 0
    own = labels.labels[on]
    assert (planes.inliers == np.bincount(own, minlength=len(planes))).all()
    assert (np.diff(planes.inliers) <= 0).all()
    assert np.linalg.norm(planes.normals, axis=1) == pytest.approx(np.ones(len(planes)))
    away = np.einsum("ij,ij->i", xyz[on].astype(float), planes.normals[own]) - planes.offsets[own]
    # the planes are fitted once more to the points so labelled
    assert np.abs(away).max() < 0.04 + 0.005
    rms = np.sqrt(np.bincount(own, away**2) / planes.inliers)
    assert planes.rms == pytest.approx(rms, abs=1e-5)


def test_points_hundreds_of_metres_away_do_not_matter():
    xyz, surfaces = furnished_room(100_000, seed=4)
    rng = np.random.default_rng(4)
    way = rng.normal(size=(1500, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    far = way * rng.uniform(100, 800, (1500, 1))
    planes, labels = detect_planes(cloud(np.concatenate([xyz, far])), HoughParams())
    assert found_shell(planes, surfaces, degrees=1, metres=0.01).all()
    assert (labels.labels[len(xyz) :] == -1).all()
    assert (labels.labels[: len(xyz)] >= 0).mean() > 0.95


def test_offsets_are_relative_to_the_origin_of_the_cloud():
    xyz = np.ascontiguousarray(box_points(), np.float32)
    origin = np.array([3.5e6, 5.4e6, 250.0])
    near, labels = detect_planes(PointCloud(xyz, np.zeros(3)), HoughParams())
    far, far_labels = detect_planes(PointCloud(xyz, origin), HoughParams())
    assert (far.origin == origin).all()
    assert (far.normals == near.normals).all() and (far.offsets == near.offsets).all()
    assert (far_labels.labels == labels.labels).all()
