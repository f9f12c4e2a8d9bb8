"""3DTK scans: `NAME.3d` text in centimetres, left-handed and y up, with `NAME.pose` beside it."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from storage.errors import InputError
from tasks.scans.raw import Chunk, Convention, Poses, RawCloud, Sensor, compact, size_of
from tasks.scans.text import read_text

CONVENTION = Convention(up="y", scale=0.01, handed="left")
SENSOR = Sensor(up=(0, 1, 0), back=(0, 0, -1))  # x right, y up, z forward


def read_threedtk(path: Path) -> RawCloud:
    """Return the points of one `.3d` file, or of all in a folder, registered by their poses.

    Each file with a pose is a snapshot; 3DTK stores no times, so their order stands in for
    seconds. A single file without a pose has no snapshot.
    """
    files = scans_of(path)
    if len(files) == 1 and not pose_of(files[0]).is_file():
        raw = read_text(files[0])
        return RawCloud(raw.chunks, raw.points_read, convention=CONVENTION)
    clouds = [read_text(file) for file in files]
    positions, rotations = zip(*(_pose(pose_of(file)) for file in files), strict=True)
    chunks = [
        Chunk(compact(chunk.xyz @ rotations[index].T + positions[index]), index)
        for index, cloud in enumerate(clouds)
        for chunk in cloud.chunks
    ]
    times = np.arange(float(len(files)))
    poses = Poses(times, np.array(positions), np.array(rotations), SENSOR)
    read = sum(cloud.points_read for cloud in clouds)
    note = "3DTK files hold no times: the order of the scans stands in for seconds."
    notes = (note,) if len(files) > 1 else ()
    return RawCloud(chunks, read, poses=poses, convention=CONVENTION, notes=notes)


def scans_of(path: Path) -> list[Path]:
    """Return the `.3d` files of a folder by name, or the file itself."""
    return sorted(path.glob("*.3d")) if path.is_dir() else [path]


def pose_of(scan: Path) -> Path:
    """Return where the pose of a `.3d` file lies."""
    return scan.with_suffix(".pose")


def _pose(path: Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return position (3,), centimetres, and rotation (3, 3) of a pose file.

    The file holds the position and three angles in degrees, about x, y and z; the rotation is
    their product Rx Ry Rz (3DTK's `EulerToMatrix4`).
    """
    size_of(path)
    try:
        values = np.array([float(word) for word in path.read_text("ascii", "replace").split()])
    except ValueError:
        values = np.empty(0)
    if values.shape != (6,) or not np.isfinite(values).all():
        raise InputError(
            path, "holds no pose", "expected position (cm) and Euler angles (degrees): six numbers"
        )
    x, y, z = np.radians(values[3:])
    return values[:3], _about(0, x) @ _about(1, y) @ _about(2, z)


def _about(axis: int, angle: float) -> NDArray[np.float64]:
    """Return the rotation by `angle` (radians) about a coordinate axis."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    turn = np.eye(3)
    turn[i, i] = turn[j, j] = np.cos(angle)
    turn[j, i] = np.sin(angle)
    turn[i, j] = -turn[j, i]
    return turn
