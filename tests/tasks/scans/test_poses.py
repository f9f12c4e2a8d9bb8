"""Rotations against scipy, and the frames of section 0 of the method."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tasks.scans.poses import (
    AXES,
    building_from_file,
    matrices_from_quaternions,
    nearest_rotations,
    quaternions_from_matrices,
    rotations_of_device,
)
from tasks.scans.raw import CAMERA, DEVICE, SCANNER, Poses
from tasks.scans.threedtk import SENSOR

TURNS = Rotation.random(300, random_state=1)


def roll(quaternions):
    """Eq. 1 of the paper, degrees."""
    a, b, c, d = quaternions.T
    return np.degrees(np.arctan2(2 * (a * b + c * d), 1 - 2 * (b * b + c * c)))


def poses(sensor, rotations):
    k = len(rotations)
    return Poses(np.arange(float(k)), np.zeros((k, 3)), np.asarray(rotations, float), sensor)


def test_quaternions_and_matrices_agree_with_scipy():
    scalar_first = TURNS.as_quat(canonical=True, scalar_first=True)
    assert np.allclose(quaternions_from_matrices(TURNS.as_matrix()), scalar_first)
    assert np.allclose(matrices_from_quaternions(scalar_first), TURNS.as_matrix())


def test_half_turns_are_no_special_case():
    for diagonal in ([1, -1, -1], [-1, 1, -1], [-1, -1, 1]):
        q = quaternions_from_matrices(np.diag(diagonal)[None].astype(float))
        assert np.allclose(matrices_from_quaternions(q)[0], np.diag(diagonal))


def test_the_nearest_rotation_undoes_rounding():
    rough = TURNS.as_matrix() * 1.01 + 1e-3
    assert np.allclose(nearest_rotations(rough), TURNS.as_matrix(), atol=5e-3)
    assert np.allclose(np.linalg.det(nearest_rotations(rough)), 1)


@pytest.mark.parametrize("up", AXES)
@pytest.mark.parametrize("handed", ["right", "left"])
def test_up_becomes_z_and_handedness_is_kept_or_mended(up, handed):
    matrix = building_from_file(up, handed)
    direction = np.zeros(3)
    direction["xyz".index(up[-1])] = -1 if up[0] == "-" else 1
    assert np.allclose(matrix @ direction, [0, 0, 1])
    assert np.linalg.det(matrix) == pytest.approx(1 if handed == "right" else -1)


@pytest.mark.parametrize("up", ["0.02,-0.89,-0.46", "0,0,1", "0,0,-2", "1e-9,0,-1"])
def test_a_vector_becomes_z_by_a_rotation(up):
    matrix = building_from_file(up, "right")
    vector = np.array([float(v) for v in up.split(",")])
    assert np.allclose(matrix @ vector / np.linalg.norm(vector), [0, 0, 1], atol=1e-8)
    assert np.allclose(matrix @ matrix.T, np.eye(3), atol=1e-8)
    assert np.linalg.det(matrix) == pytest.approx(1)


@pytest.mark.parametrize(
    ("sensor", "rotation", "building"),
    [
        (DEVICE, [[1, 0, 0], [0, 0, -1], [0, 1, 0]], building_from_file("z", "right")),
        # a camera that looks along y of a z-up world: its right is x, its down is -z
        (CAMERA, [[1, 0, 0], [0, 0, 1], [0, -1, 0]], building_from_file("z", "right")),
        # the first camera of a y-down world
        (CAMERA, np.eye(3), building_from_file("-y", "right")),
        (SCANNER, np.eye(3), building_from_file("z", "right")),
        (SENSOR, np.eye(3), building_from_file("y", "left")),
    ],
)
def test_upright_and_level_is_a_roll_of_90_degrees(sensor, rotation, building):
    q = rotations_of_device(poses(sensor, [rotation]), building)
    assert roll(q)[0] == pytest.approx(90)
    looks_along = -matrices_from_quaternions(q)[0, :, 2]
    assert np.allclose(looks_along, [0, 1, 0])


def test_roll_of_a_tilted_camera_is_the_published_one_turned_by_180_degrees():
    camera = TURNS.as_quat(canonical=True, scalar_first=True)
    device = rotations_of_device(poses(CAMERA, TURNS.as_matrix()), np.eye(3))
    turned = (roll(device) - roll(camera)) % 360
    assert np.allclose(turned, 180)
