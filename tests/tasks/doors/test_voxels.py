"""Distances to full voxels against scipy and against counting by hand."""

import numpy as np
import pytest
from scipy import ndimage

from storage.errors import MapSenseError
from storage.points import PointCloud
from tasks.doors.voxels import FAR, distance_field

LOW, EDGE = np.array([10.0, -3.0, 0.5]), 0.05


def cloud_at(voxels, times=1, origin=(0.0, 0.0, 0.0)):
    xyz = LOW + (np.repeat(voxels, times, axis=0) + 0.5) * EDGE - np.array(origin)
    return PointCloud(xyz.astype(np.float32), np.array(origin))


@pytest.mark.parametrize("share", [0.0005, 0.01, 0.3])
@pytest.mark.parametrize("shape", [(40, 30, 20), (7, 60, 3), (1, 1, 50)])
def test_distances_are_scipys_chessboard_distances(share, shape):
    full = np.random.default_rng(1).random(shape) < share
    full[0, 0, -1] = True
    found = distance_field(
        [cloud_at(np.argwhere(full))], EDGE, 1, LOW, LOW + (np.array(shape) - 0.5) * EDGE
    )
    assert found.distances.shape == shape
    expected = ndimage.distance_transform_cdt(~full, "chessboard")
    np.testing.assert_array_equal(found.distances, np.minimum(expected, FAR))


def test_a_voxel_is_full_from_the_least_number_of_points_on_whichever_cloud_they_are():
    clouds = [
        cloud_at(np.array([[1, 1, 1], [5, 5, 5]])),
        cloud_at(np.array([[1, 1, 1]]), origin=(9.0, -2.0, 0.0)),
        cloud_at(np.array([[8, 8, 8]]), times=1000),
    ]
    full = distance_field(clouds, EDGE, 2, LOW, LOW + 0.499).distances == 0
    assert np.argwhere(full).tolist() == [[1, 1, 1], [8, 8, 8]]


def test_points_outside_the_box_are_left_out():
    outside = np.array([[-1, 3, 3], [3, 10, 3], [3, 3, -1], [1000, 3, 3]])
    found = distance_field([cloud_at(outside)], EDGE, 1, LOW, LOW + 0.499)
    assert (found.distances == FAR).all()


def test_a_storey_too_large_for_its_voxels_is_an_error_that_says_what_to_do():
    with pytest.raises(MapSenseError, match="voxel_m"):
        distance_field([], 0.01, 1, np.zeros(3), np.array([500.0, 500.0, 10.0]))
