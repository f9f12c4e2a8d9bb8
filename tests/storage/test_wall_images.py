"""Images of walls become a table and come back as they were, byte for byte."""

import numpy as np
import pytest

from storage import artifacts
from storage.artifacts import Place
from storage.wall_images import WALL_IMAGES, WallImages, to_table


def images(f):
    rng = np.random.default_rng(f)
    angles = rng.uniform(0, 2 * np.pi, f)
    shapes = [(i + 1, 2 * i + 3) for i in range(f)]
    depths = [rng.normal(size=s).astype(np.float32) for s in shapes]
    for depth in depths:
        depth[0, 0] = np.nan
    return WallImages(
        pixel_m=0.04,
        walls=np.arange(f, dtype=np.int32),
        rooms=np.arange(f, dtype=np.int32) + 3,
        opposite=np.arange(f, dtype=np.int32) - 1,
        origins=rng.normal(size=(f, 2)),
        axes=np.column_stack([np.cos(angles), np.sin(angles)]),
        base_m=rng.normal(size=f),
        labels=tuple(rng.integers(0, 4, s).astype(np.uint8) for s in shapes),
        depths=tuple(depths),
        empty=tuple(rng.integers(0, 256, s).astype(np.uint8) for s in shapes),
        rays=np.arange(f, dtype=np.int64) + 2**40,
    )


@pytest.mark.parametrize("f", [0, 1, 4])
def test_images_come_back_from_the_store_as_they_were(f, tmp_path):
    place = Place(store=str(tmp_path), run="r", building="b", storey="1")
    before = images(f)
    ref = artifacts.write(WALL_IMAGES, before, place)
    after = artifacts.read(WALL_IMAGES, ref, tmp_path)
    assert ref.rows == len(after) == f
    assert after.pixel_m == before.pixel_m
    for name in ("walls", "rooms", "opposite", "origins", "axes", "base_m", "rays"):
        was, now = getattr(before, name), getattr(after, name)
        assert now.dtype == was.dtype
        np.testing.assert_array_equal(now, was)
    for name in ("labels", "depths", "empty"):
        for was, now in zip(getattr(before, name), getattr(after, name), strict=True):
            assert now.dtype == was.dtype
            np.testing.assert_array_equal(now, was)


def test_no_face_on_the_other_side_is_null():
    assert to_table(images(3))["opposite"].to_pylist() == [None, 0, 1]


def test_normals_point_to_the_left_of_the_axes():
    some = images(4)
    x, y = some.axes.T
    u, v = some.normals().T
    np.testing.assert_allclose(x * v - y * u, 1)
    np.testing.assert_allclose(x * u + y * v, 0, atol=1e-12)
