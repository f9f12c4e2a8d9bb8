"""E57 files: every scan in them with its pose is a snapshot."""

from pathlib import Path
from typing import Any

import numpy as np
import pye57
from numpy.typing import NDArray
from pye57 import libe57

from storage.errors import InputError
from tasks.scans.poses import matrices_from_quaternions
from tasks.scans.raw import (
    METRES_Z_UP,
    ROWS,
    SCANNER,
    Chunk,
    Poses,
    RawCloud,
    compact,
    library_errors,
    size_of,
)

CARTESIAN = ("cartesianX", "cartesianY", "cartesianZ")
SPHERICAL = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")

_UNIT = 0.05  # a quaternion this far from unit length is rounded, not wrong


def read_e57(path: Path) -> RawCloud:
    """Return the points of all scans of an E57 file in the file's common frame.

    Points marked invalid, and those of which only the direction is known, are left out.
    """
    size_of(path)
    with library_errors(path, "E57"):
        file = libe57.ImageFile(str(path), "r")
        try:
            return _read(path, file)
        finally:
            file.close()


def _read(path: Path, file: Any) -> RawCloud:
    scans = [pye57.ScanHeader(node) for node in file.root()["data3D"]]
    posed = any(scan.has_pose() for scan in scans)
    rotations, positions = _poses(path, scans)
    chunks, read = [], 0
    for index, scan in enumerate(scans):
        for xyz in _scan(path, file, scan):
            registered = xyz @ rotations[index].T + positions[index]
            chunks.append(Chunk(compact(registered), index if posed else None))
        read += scan.point_count
    times, notes = _times(scans)
    order = np.argsort(times, kind="stable")
    poses = Poses(times[order], positions[order], rotations[order], SCANNER)
    place = np.argsort(order)
    return RawCloud(
        [Chunk(c.xyz, None if c.snapshot is None else int(place[c.snapshot])) for c in chunks],
        points_read=read,
        points_invalid=read - sum(len(chunk.xyz) for chunk in chunks),
        poses=poses if posed else None,
        convention=METRES_Z_UP,
        notes=notes if posed else (),
    )


def _scan(path: Path, file: Any, scan: Any) -> list[NDArray[np.float64]]:
    """Return a scan's valid points in its own frame, in chunks."""
    fields = set(scan.point_fields)
    names = next((names for names in (CARTESIAN, SPHERICAL) if fields.issuperset(names)), None)
    if names is None:
        raise InputError(
            path,
            f"a scan has the fields {', '.join(sorted(fields))}, no coordinates",
            "export it with cartesian or spherical coordinates",
        )
    state = "cartesianInvalidState" if names is CARTESIAN else "sphericalInvalidState"
    wanted = [*names, state] if state in fields else [*names]
    arrays = {name: np.zeros(ROWS, "b" if name == state else "d") for name in wanted}
    buffers = libe57.VectorSourceDestBuffer()
    for name, array in arrays.items():
        # converted to the array's type, and scaled integers to metres
        buffers.append(libe57.SourceDestBuffer(file, name, array, ROWS, True, True))
    reader = scan.points.reader(buffers)
    chunks = []
    while n := reader.read():
        points = np.stack([arrays[name][:n] for name in names], axis=1)
        if state in arrays:
            points = points[arrays[state][:n] == 0]
        chunks.append(points if names is CARTESIAN else _cartesian(points))
    reader.close()
    return chunks


def _cartesian(spherical: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (m, 3) points of (range, azimuth, elevation), metres and radians."""
    distance, azimuth, elevation = spherical.T
    level = distance * np.cos(elevation)
    up = distance * np.sin(elevation)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), up], axis=1)


def _poses(path: Path, scans: list[Any]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return rotations (k, 3, 3) and positions (k, 3); a scan without a pose is not moved."""
    quaternions = np.tile([1.0, 0, 0, 0], (len(scans), 1))
    positions = np.zeros((len(scans), 3))
    for index, scan in enumerate(scans):
        if scan.has_pose():
            pose = scan.node["pose"]
            if pose.isDefined("rotation"):
                quaternions[index] = [pose["rotation"][part].value() for part in "wxyz"]
            if pose.isDefined("translation"):
                positions[index] = [pose["translation"][axis].value() for axis in "xyz"]
    lengths = np.linalg.norm(quaternions, axis=1)
    bad = ~(np.abs(lengths - 1) < _UNIT) | ~np.isfinite(positions).all(axis=1)
    if bad.any():
        raise InputError(
            path,
            f"the pose of scan {int(bad.argmax())} is no rotation and translation "
            f"(quaternion length {lengths[bad.argmax()]:.3g})",
            "export it again with registered poses",
        )
    return matrices_from_quaternions(quaternions / lengths[:, None]), positions


def _times(scans: list[Any]) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Return each scan's start, seconds; their order stands in where the file has no times."""
    if all(scan.node.isDefined("acquisitionStart") for scan in scans):
        starts = [scan.acquisitionStart_dateTimeValue for scan in scans]
        if len(set(starts)) == len(starts):
            return np.array(starts, float), ()
    note = "The scans have no distinct start times: their order stands in for seconds."
    return np.arange(float(len(scans))), (note,) if len(scans) > 1 else ()
