"""The voxel grid against a slow second version and against Open3D."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial import cKDTree

from storage.points import PointCloud
from tasks.device.codec import CodecParams
from tasks.device.lattice import OutOfReach
from tasks.device.stream import PROFILE_LEAVES_UM
from tasks.device.voxels import VoxelParams, centroids, voxel_grid
from tasks.simulation.clouds import furnished_room

EDGE = 0.02


def cloud(xyz, origin=(0, 0, 0)):
    return PointCloud(np.array(xyz, np.float32).reshape(-1, 3), np.array(origin, float))


def slow(points, edge):
    """Return voxel -> mean of its points relative to the origin."""
    found = {}
    for xyz in points.xyz.astype(float):
        found.setdefault(tuple(np.floor((points.origin + xyz) / edge)), []).append(xyz)
    return {voxel: np.mean(inside, axis=0) for voxel, inside in found.items()}


coordinates = arrays(
    np.float32, st.tuples(st.integers(0, 40), st.just(3)), elements=st.floats(-3, 3, width=32)
)
origins = st.sampled_from([(0, 0, 0), (0.013, -7.1, 2), (512_345.67, 5_403_210.9, 310.25)])


@settings(max_examples=150, deadline=None)
@given(coordinates, origins, st.sampled_from([0.02, 0.5, 3.0]))
def test_each_occupied_voxel_has_the_mean_of_its_points(xyz, origin, edge):
    points = cloud(xyz, origin)
    found, expected = voxel_grid(points, VoxelParams(edge_m=edge)), slow(points, edge)
    assert len(found) == len(expected)
    assert found.xyz.dtype == np.float32 and (found.origin == points.origin).all()
    if expected:
        away, one = cKDTree(list(expected.values())).query(found.xyz)
        assert away.max() < 1e-6
        assert len(set(one)) == len(expected)


@pytest.mark.parametrize("edge", [0.02, 0.05])
def test_it_is_open3ds_grid_where_that_has_the_same_corner(edge):
    open3d = pytest.importorskip("open3d")
    points = cloud(furnished_room(100_000, seed=3)[0])
    vectors = open3d.utility.Vector3dVector(points.xyz.astype(float))
    theirs = np.asarray(open3d.geometry.PointCloud(vectors).voxel_down_sample(edge).points)
    # theirs begins half a voxel below the least coordinates
    ours = centroids(points, edge, points.xyz.min(axis=0).astype(float) - edge / 2)
    assert len(ours) == len(theirs)
    away, one = cKDTree(theirs).query(ours)
    assert len(np.unique(one)) == len(theirs)
    assert away.max() < 2e-6


def test_what_else_a_scan_saw_changes_no_voxel():
    near = furnished_room(20_000, seed=1)[0]
    alone = voxel_grid(cloud(near), VoxelParams()).xyz
    far = near + np.float32([100, 0, 0])
    together = voxel_grid(cloud(np.concatenate([far, near])), VoxelParams()).xyz
    np.testing.assert_array_equal(together[together[:, 0] < 50], alone)


def test_the_order_of_the_points_changes_neither_voxels_nor_their_order():
    xyz = furnished_room(20_000, seed=1)[0]
    there, back = (voxel_grid(cloud(p), VoxelParams()).xyz for p in (xyz, xyz[::-1]))
    np.testing.assert_allclose(there, back, atol=1e-6)
    again = voxel_grid(cloud(xyz), VoxelParams()).xyz
    np.testing.assert_array_equal(there, again)


def test_snapshots_are_not_kept_and_no_points_give_none():
    seen = PointCloud(np.zeros((2, 3), np.float32), np.ones(3), np.array([0, 1], np.int32))
    assert voxel_grid(seen, VoxelParams()).snapshot is None
    none = voxel_grid(cloud([], (1, 2, 3)), VoxelParams())
    assert len(none) == 0 and none.origin.tolist() == [1, 2, 3]


def test_a_stray_point_at_a_kilometre_is_one_more_voxel():
    xyz = furnished_room(20_000, seed=1)[0]
    before = len(voxel_grid(cloud(xyz), VoxelParams()))
    stray = np.float32([[1000, -1000, 500]])
    after = voxel_grid(cloud(np.concatenate([stray, xyz])), VoxelParams())
    assert len(after) == before + 1
    assert (after.xyz == stray).all(axis=1).sum() == 1


@pytest.mark.parametrize(
    ("xyz", "origin", "says"),
    [
        ([[0, 0, 0], [0, 1e6, 0]], (0, 0, 0), "remove stray points"),
        ([[0, 0, 0]], (0, 0, 1e18), "out of reach"),
        ([[0, 0, 0], [np.nan, 0, 0]], (0, 0, 0), "not a number"),
        ([[0, -np.inf, 0], [0, 0, 0]], (0, 0, 0), "not a number"),
    ],
)
def test_points_out_of_reach_failure(xyz, origin, says):
    with pytest.raises(OutOfReach, match=says):
        voxel_grid(cloud(xyz, origin), VoxelParams())


def test_the_usual_voxel_is_larger_than_the_usual_leaf():
    # otherwise the octree would do the thinning, and the voxel grid nothing
    assert VoxelParams().edge_m > PROFILE_LEAVES_UM[CodecParams().profile] / 1e6
