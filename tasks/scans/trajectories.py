"""Trajectories: poses with times, and the pose nearest to a time."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from storage.errors import InputError
from tasks.scans.poses import matrices_from_quaternions, nearest_rotations
from tasks.scans.raw import size_of, unreadable

UNIT_EXACT = 1e-3
"""Quaternions this near to unit length are merely rounded."""
UNIT_ROUGH = 0.05
"""Quaternions this near to unit length are normalised, with a note."""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """k camera poses in the file's frame, by time."""

    times: NDArray[np.float64]
    """(k,), seconds, strictly ascending"""
    positions: NDArray[np.float64]
    """(k, 3), file unit"""
    rotations: NDArray[np.float64]
    """(k, 3, 3), camera frame -> file frame"""
    notes: tuple[str, ...] = ()


def read_trajectory(path: Path) -> Trajectory:
    """Return the poses of a text file with lines `t tx ty tz qx qy qz qw`."""
    lines, rows = _rows(path)
    quaternions, notes = _unit(path, lines, rows[:, [7, 4, 5, 6]])
    times = rows[:, 0]
    order = np.argsort(times, kind="stable")
    if (np.diff(times) < 0).any():
        notes.append(f"{path.name} is not in order of time: sorted.")
    repeated = np.diff(times[order], prepend=-np.inf) == 0
    if repeated.any():
        notes.append(f"{repeated.sum()} poses of {path.name} repeat a time: the first one is used.")
    order = order[~repeated]
    rotations = matrices_from_quaternions(quaternions[order])
    return Trajectory(times[order], rows[order, 1:4], rotations, tuple(notes))


def nearest_poses(
    times: NDArray[np.float64], trajectory: Trajectory, max_gap: float
) -> NDArray[np.int64]:
    """Return, per time, the index of the nearest pose in time, -1 if none is near enough.

    Parameters
    ----------
    times : (n,) float
        Seconds.
    trajectory : Trajectory
        Of at least one pose.
    max_gap : float
        Greatest distance in time, seconds.
    """
    after = np.searchsorted(trajectory.times, times).clip(1, max(len(trajectory.times) - 1, 1))
    last = len(trajectory.times) - 1
    before, after = after - 1, np.minimum(after, last)
    earlier = np.abs(times - trajectory.times[before])
    later = np.abs(times - trajectory.times[after])
    nearest = np.where(later < earlier, after, before)
    return np.where(np.minimum(earlier, later) <= max_gap, nearest, -1)


def read_matrix(path: Path, shape: tuple[int, int]) -> NDArray[np.float64]:
    """Return a small matrix written as text, row by row."""
    size_of(path)
    try:
        matrix = np.loadtxt(path, ndmin=2, delimiter=None)
    except (ValueError, UnicodeDecodeError) as error:
        raise InputError(path, "holds no matrix of numbers", _shaped(shape)) from error
    if matrix.shape != shape:
        raise InputError(path, f"holds a matrix of shape {matrix.shape}", _shaped(shape))
    return matrix


def read_pose(path: Path) -> NDArray[np.float64] | None:
    """Return a camera-to-world matrix (4, 4), None if the file says that tracking was lost."""
    pose = read_matrix(path, (4, 4))
    if not np.isfinite(pose).all():
        return None
    rotation = nearest_rotations(pose[None, :3, :3])[0]
    if np.abs(rotation - pose[:3, :3]).max() > UNIT_ROUGH or np.abs(pose[3] - [0, 0, 0, 1]).max():
        raise InputError(path, "the matrix is no rotation and translation", "correct the pose")
    pose[:3, :3] = rotation
    return pose


def looks_like_trajectory(rows: NDArray[np.float64]) -> bool:
    """Return whether rows of 8 numbers end in unit quaternions."""
    if rows.ndim != 2 or rows.shape[1] != 8:
        return False
    return bool((np.abs(np.linalg.norm(rows[:, 4:], axis=1) - 1) < UNIT_ROUGH).all())


def _rows(path: Path) -> tuple[list[int], NDArray[np.float64]]:
    """Return each pose's line number and its eight numbers."""
    size_of(path)
    lines, rows = [], []
    try:
        text = path.read_text("utf-8", "replace")
    except OSError as error:
        raise unreadable(path, error) from error
    for number, line in enumerate(text.splitlines(), 1):
        fields = line.partition("#")[0].replace(",", " ").split()
        if fields:
            lines.append(number)
            rows.append(_numbers(path, number, fields))
    if not rows:
        raise InputError(path, "holds no pose", "expected lines 't tx ty tz qx qy qz qw'")
    return lines, np.array(rows)


def _numbers(path: Path, number: int, fields: list[str]) -> list[float]:
    try:
        row = [float(field) for field in fields]
    except ValueError:
        row = []
    if len(row) != 8 or not np.isfinite(row).all():
        raise InputError(
            path,
            f"line {number} has {len(fields)} columns or a value that is no finite number",
            "expected 't tx ty tz qx qy qz qw'",
        )
    return row


def _unit(
    path: Path, lines: list[int], quaternions: NDArray[np.float64]
) -> tuple[NDArray[np.float64], list[str]]:
    lengths = np.linalg.norm(quaternions, axis=1)
    wrong = np.flatnonzero(np.abs(lengths - 1) > UNIT_ROUGH)
    if len(wrong):
        raise InputError(
            path,
            f"line {lines[wrong[0]]} has a quaternion of length {lengths[wrong[0]]:.4g}",
            "expected unit length: correct or remove the line",
        )
    rough = int((np.abs(lengths - 1) > UNIT_EXACT).sum())
    notes = [f"{rough} quaternions of {path.name} were off unit length: normalised."]
    return quaternions / lengths[:, None], notes if rough else []


def _shaped(shape: tuple[int, int]) -> str:
    return f"expected {shape[0]} lines of {shape[1]} numbers"
