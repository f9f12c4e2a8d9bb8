"""Rotations: quaternions, matrices, and the frames of sensor, file and building."""

import numpy as np
from numpy.typing import NDArray

from tasks.scans.raw import Poses, Sensor

AXES = {
    # rows are the building's x, y, z in file coordinates; every one turns, none mirrors
    "x": [[0, 1, 0], [0, 0, 1], [1, 0, 0]],
    "-x": [[0, 0, 1], [0, 1, 0], [-1, 0, 0]],
    "y": [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
    "-y": [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
    "z": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    "-z": [[1, 0, 0], [0, -1, 0], [0, 0, -1]],
}


def matrices_from_quaternions(quaternions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotations of unit quaternions (a, b, c, d), scalar first.

    Parameters
    ----------
    quaternions : (k, 4) float

    Returns
    -------
    (k, 3, 3) float
    """
    a, b, c, d = np.moveaxis(quaternions, -1, 0)
    rows = [
        [1 - 2 * (c * c + d * d), 2 * (b * c - a * d), 2 * (b * d + a * c)],
        [2 * (b * c + a * d), 1 - 2 * (b * b + d * d), 2 * (c * d - a * b)],
        [2 * (b * d - a * c), 2 * (c * d + a * b), 1 - 2 * (b * b + c * c)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def quaternions_from_matrices(matrices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return unit quaternions (a, b, c, d) with a >= 0.

    Parameters
    ----------
    matrices : (k, 3, 3) float
        Rotations.

    Returns
    -------
    (k, 4) float

    Notes
    -----
    The quaternion is the dominant eigenvector of Bar-Itzhack's (2000) symmetric matrix, which
    has no special case near half turns.
    """
    m = np.asarray(matrices, float).reshape(-1, 3, 3)
    K = np.empty((len(m), 4, 4))
    K[:, 1:, 1:] = m + m.transpose(0, 2, 1)
    trace = np.trace(m, axis1=1, axis2=2)
    K[:, 1:, 1:] -= trace[:, None, None] * np.eye(3)
    skew = np.stack([m[:, 2, 1] - m[:, 1, 2], m[:, 0, 2] - m[:, 2, 0], m[:, 1, 0] - m[:, 0, 1]], 1)
    K[:, 0, 1:] = K[:, 1:, 0] = skew
    K[:, 0, 0] = trace
    quaternions = np.linalg.eigh(K)[1][:, :, -1]
    return np.where(quaternions[:, :1] < 0, -quaternions, quaternions)


def nearest_rotations(matrices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotations nearest to (k, 3, 3) matrices, in the least-squares sense."""
    left, _, right = np.linalg.svd(matrices)
    turned = left @ right
    left[:, :, 2] *= np.sign(np.linalg.det(turned))[:, None]
    return left @ right


def building_from_file(up: str, handed: str) -> NDArray[np.float64]:
    """Return the (3, 3) matrix from file axes to the building's: z up, right-handed.

    Parameters
    ----------
    up : str
        The file's up: an axis with its sign, or a vector "x,y,z" in file coordinates.
    handed : str
        "right" or "left"; the building's y is mirrored for a left-handed file.
    """
    turn = np.array(AXES[up], float) if up in AXES else _shortest_turn(parse_vector(up))
    return np.diag([1.0, -1.0 if handed == "left" else 1.0, 1.0]) @ turn


def parse_vector(text: str) -> NDArray[np.float64]:
    """Return the unit vector written as "x,y,z", or raise ValueError."""
    vector = np.array([float(part) for part in text.split(",")])
    length = np.linalg.norm(vector)
    if vector.shape != (3,) or not np.isfinite(length) or length == 0:
        raise ValueError(f"expected an axis (x, -x, y, -y, z, -z) or a vector x,y,z, got {text!r}")
    return vector / length


def rotations_of_device(poses: Poses, building: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the unit quaternions (k, 4), device frame -> building frame.

    Parameters
    ----------
    poses : Poses
    building : (3, 3) float
        From file axes to the building's; may mirror.

    Notes
    -----
    Only the sensor's up and back are carried over; right = up x back, so that a mirrored
    (left-handed) file still gives a rotation, level and upright where its sensor was.
    """
    up = (building @ poses.rotations) @ _column(poses.sensor, "up")
    back = (building @ poses.rotations) @ _column(poses.sensor, "back")
    return quaternions_from_matrices(np.stack([np.cross(up, back), up, back], axis=-1))


def _column(sensor: Sensor, name: str) -> NDArray[np.float64]:
    return np.array(getattr(sensor, name), float)


def _shortest_turn(up: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotation by the least angle that takes the unit vector `up` to z."""
    if up[2] < -1 + 1e-12:
        return np.array(AXES["-z"], float)
    x, y, _ = up
    cross = np.array([[0, 0, -x], [0, 0, -y], [x, y, 0]])
    return np.eye(3) + cross + cross @ cross / (1 + up[2])
