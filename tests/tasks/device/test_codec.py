"""Clouds through the codec: exactly the centres of the leaves that hold points."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from storage.points import PointCloud
from tasks.device.codec import CodecParams, decode, encode, encode_leaves
from tasks.device.lattice import OutOfReach
from tasks.device.stream import CHECKSUM_BYTES, HEADER
from tasks.device.voxels import VoxelParams, voxel_grid
from tasks.simulation.clouds import furnished_room

OVERHEAD = HEADER.size + CHECKSUM_BYTES
LEAVES = {"low": 0.01, "medium": 0.005, "high": 0.001}


def cloud(xyz, origin=(0, 0, 0)):
    return PointCloud(np.array(xyz, np.float32).reshape(-1, 3), np.array(origin, float))


def leaf_centres(points, leaf):
    """Return the centres of the leaves that hold points, sorted, relative to the origin."""
    cells = np.unique(np.floor((points.origin + points.xyz) / leaf), axis=0)
    return as_rows(((cells + 0.5) * leaf - points.origin).astype(np.float32))


def as_rows(xyz):
    return sorted(map(tuple, xyz.tolist()))


def coordinates(reach):
    return arrays(
        np.float32,
        st.tuples(st.integers(0, 50), st.just(3)),
        elements=st.floats(-reach, reach, width=32),
    )


origins = st.sampled_from([(0, 0, 0), (0.0137, -7.1, 2), (512_345.678, 5_403_210.9, 310.25)])
profiles = st.sampled_from(list(LEAVES))


@settings(max_examples=200, deadline=None)
@given(st.one_of(coordinates(0.0625), coordinates(4), coordinates(900)), origins, profiles)
def test_the_decoded_points_are_the_centres_of_the_leaves(xyz, origin, profile):
    points = cloud(xyz, origin)
    found = decode(encode(points, CodecParams(profile=profile)))
    assert as_rows(found.xyz) == leaf_centres(points, LEAVES[profile])
    assert found.xyz.dtype == np.float32 and found.snapshot is None
    np.testing.assert_array_equal(found.origin, points.origin)


@settings(max_examples=100, deadline=None)
@given(coordinates(2), st.randoms(use_true_random=False), profiles)
def test_the_order_of_the_points_changes_no_byte(xyz, random, profile):
    order = list(range(len(xyz)))
    random.shuffle(order)
    params = CodecParams(profile=profile)
    assert encode(cloud(xyz), params) == encode(cloud(xyz[order]), params)


@settings(max_examples=100, deadline=None)
@given(st.one_of(coordinates(2), coordinates(900)), origins, profiles)
def test_what_was_decoded_decodes_to_itself(xyz, origin, profile):
    params = CodecParams(profile=profile)
    once = decode(encode(cloud(xyz, origin), params))
    twice = decode(encode(once, params))
    np.testing.assert_array_equal(once.xyz, twice.xyz)


@pytest.mark.parametrize("profile", LEAVES)
def test_a_room_comes_back_to_half_a_leaf(profile):
    points = cloud(furnished_room(30_000, seed=2)[0])
    stream = encode(points, CodecParams(profile=profile))
    found = decode(stream)
    assert as_rows(found.xyz) == leaf_centres(points, LEAVES[profile])
    assert (stream.profile, stream.leaf_m) == (profile, LEAVES[profile])
    assert (stream.points, stream.cells) == (30_000, len(found))


def test_points_in_one_leaf_are_one_point_and_no_points_none():
    params = CodecParams()
    points = decode(encode(cloud([[0.001, -0.001, 0.5]] * 9, (10, 20, 30)), params))
    np.testing.assert_allclose(points.xyz, [[0.005, -0.005, 0.505]], atol=1e-7)
    none = encode(cloud([], (1, 2, 3)), params)
    assert (none.points, none.cells) == (0, 0)
    assert len(decode(none)) == 0 and decode(none).origin.tolist() == [1, 2, 3]


def test_the_voxel_grid_makes_the_stream_of_a_dense_wall_smaller():
    rng = np.random.default_rng(3)
    wall = cloud(rng.uniform(0, 2, (100_000, 3)) * [1, 0, 1] + rng.normal(0, 0.01, (100_000, 1)))
    thinned = encode(voxel_grid(wall, VoxelParams()), CodecParams())
    assert len(thinned.data) < 0.7 * len(encode(wall, CodecParams()).data)


@pytest.mark.parametrize("start", [0, 1, 5])
def test_a_voxel_of_two_leaves_is_one_node_wherever_the_cloud_begins(start):
    # one of eight leaves in every voxel of a wall: three bits, and nothing for where the voxels are
    rng = np.random.default_rng(7)
    x, z = (2 * v.ravel() for v in np.meshgrid(np.arange(128), np.arange(128)))
    leaves = np.stack([x, 0 * x, z], axis=1) + rng.integers(0, 2, (len(x), 3))
    kept = leaves[leaves[:, 0] >= start]
    stream = encode(cloud((kept + 0.5) * 0.01), CodecParams())
    assert 3 <= 8 * (len(stream.data) - OVERHEAD) / stream.cells < 3.25


@pytest.mark.parametrize("profile", LEAVES)
def test_a_stray_point_at_a_kilometre_costs_some_bytes(profile):
    xyz = furnished_room(5000, seed=1)[0]
    before = encode(cloud(xyz), CodecParams(profile=profile))
    stray = encode(cloud([*xyz, [1000, -700, 300]]), CodecParams(profile=profile))
    assert stray.cells == before.cells + 1
    assert len(stray.data) < len(before.data) + 100
    assert as_rows(decode(stray).xyz) == leaf_centres(
        cloud([*xyz, [1000, -700, 300]]), LEAVES[profile]
    )


@pytest.mark.parametrize(
    ("xyz", "profile", "says"),
    [
        ([[0, 0, 0], [0, 3000, 0]], "high", "3000 m from one end to the other"),
        ([[5000, 0, 0]], "high", "5000 m from the cloud's origin"),
        ([[40_000, 0, 0]], "low", "from the cloud's origin"),
        ([[np.nan, 0, 0]], "low", "not a number"),
        ([[0, 0, np.inf], [0, 0, -np.inf]], "low", "not a number"),
    ],
)
def test_points_out_of_reach_failure(xyz, profile, says):
    with pytest.raises(OutOfReach, match=says):
        encode(cloud(xyz), CodecParams(profile=profile))


def test_a_leaf_of_no_profile_is_called_other():
    points = cloud(furnished_room(5000, seed=1)[0])
    stream = encode_leaves(points, 20_000)
    assert (stream.profile, stream.leaf_m) == ("other", 0.02)
    assert as_rows(decode(stream).xyz) == leaf_centres(points, 0.02)


def test_a_room_takes_fewer_bytes_than_dracos():
    draco = pytest.importorskip("DracoPy")
    points = cloud(furnished_room(100_000, seed=4)[0])
    stream = encode(points, CodecParams())
    cells = np.unique(np.floor(points.xyz.astype(float) / 0.01), axis=0)
    cells -= cells.min(axis=0)
    bits = int(cells.max()).bit_length()
    theirs = draco.encode(
        cells.astype(np.float32),
        quantization_bits=bits,
        compression_level=7,
        quantization_range=2**bits - 1,
        quantization_origin=[0, 0, 0],
    )
    assert stream.cells == len(cells)
    assert len(stream.data) < len(theirs)
