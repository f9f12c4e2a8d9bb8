"""Depths of a face's points against the surfaces they were drawn from."""

import numpy as np
import pytest

from storage.points import PointCloud
from tasks.doors.rays import Canvas
from tasks.doors.relief import layered, relief, standing

ANGLE = np.radians(25)
AXIS = np.array([np.cos(ANGLE), np.sin(ANGLE)])
CANVAS = Canvas(np.array([30.0, -7.0, 0.1]), AXIS, (75, 50), 0.04)
"""3 m long and 2 m high."""


def cloud(depth_of, n=40_000, noise=0.005, origin=(20.0, 0.0, 0.0)):
    rng = np.random.default_rng(0)
    along, up = rng.uniform(0, 3, n), rng.uniform(0, 2, n)
    depth = depth_of(along, up) + rng.normal(0, noise, n)
    at = CANVAS.origin[:2] + along[:, None] * AXIS - depth[:, None] * CANVAS.normal
    xyz = np.column_stack([at, CANVAS.origin[2] + up]) - np.array(origin)
    return PointCloud(xyz.astype(np.float32), np.array(origin))


def leaf(along, up):
    return np.where((along > 1) & (along < 2) & (up < 1.6), 0.06, 0.0)


def test_a_leaf_recessed_by_centimetres_shows_at_its_depth():
    layers = layered([cloud(leaf)], [CANVAS], 0.5)
    image = relief(layers, 0, 0.0, 0.1, 0.3)
    along, up = np.meshgrid(*((np.arange(n) + 0.5) * 0.04 for n in CANVAS.shape), indexing="ij")
    clear = (np.abs(along - 1) > 0.05) & (np.abs(along - 2) > 0.05) & (np.abs(up - 1.6) > 0.05)
    error = (image - leaf(along, up))[clear]
    assert np.isfinite(error).all()
    assert np.abs(error).max() < 0.015 and np.abs(error).mean() < 0.005


@pytest.mark.parametrize("off", [-0.15, -0.04, 0.0, 0.13])
def test_a_face_stands_where_most_of_its_pixels_have_points(off):
    layers = layered([cloud(lambda s, z: leaf(s, z) + off)], [CANVAS], 0.5)
    stands = standing(layers, 0, 0.2, 0.2)
    assert stands == pytest.approx(off, abs=0.01)
    assert np.nanmedian(relief(layers, 0, stands, 0.1, 0.3)) == pytest.approx(0, abs=0.01)


def test_of_two_surfaces_the_room_sees_the_nearer_one_though_the_other_is_denser():
    here, there = cloud(lambda s, _: 0 * s, 40_000), cloud(lambda s, _: 0 * s + 0.15, 50_000)
    image = relief(layered([here, there], [CANVAS], 0.5), 0, 0.0, 0.1, 0.3)
    assert np.mean(np.abs(image) < 0.02) > 0.95


def test_pixels_without_points_and_points_out_of_range_have_no_depth():
    clouds = [cloud(lambda s, _: np.where(s < 1, 0.0, np.where(s < 2, 0.25, -0.3)))]
    image = relief(layered(clouds, [CANVAS], 0.5), 0, 0.0, 0.1, 0.2)
    assert np.isfinite(image[:24]).mean() > 0.99 and np.isnan(image[26:]).all()
    empty = layered([], [CANVAS], 0.5)
    assert standing(empty, 0, 0.2, 0.2) == 0
    assert np.isnan(relief(empty, 0, 0.0, 0.1, 0.2)).all()


def test_each_face_gets_its_own_points():
    across = Canvas(np.array([33.0, -9.0, 0.0]), np.array([0.0, 1.0]), (100, 60), 0.04)
    alone = layered([cloud(leaf)], [CANVAS], 0.3)
    both = layered([cloud(leaf)], [across, CANVAS], 0.3)
    np.testing.assert_array_equal(both.counts[1], alone.counts[0])
    np.testing.assert_array_equal(both.counts[0], layered([cloud(leaf)], [across], 0.3).counts[0])
    assert alone.counts[0].sum() == 40_000
