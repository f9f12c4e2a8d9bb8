"""Point files to read, in each format, as other programs write them."""

from collections.abc import Callable, Iterator
from pathlib import Path

import laspy
import numpy as np
import pye57
from numpy.typing import NDArray

MILLIMETRE = 0.001

Xyz = NDArray[np.float32]


def write_ply(path: Path, xyz: Xyz, copies: int = 1) -> None:
    """Write binary float32 vertices; further copies of the cloud lie beside the first."""
    names = "".join(f"property float {axis}\n" for axis in "xyz")
    count = copies * len(xyz)
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{names}end_header\n"
    with open(path, "wb") as file:
        file.write(header.encode())
        for copy in _copies(xyz, copies):
            copy.astype("<f4").tofile(file)


def write_laz(path: Path, xyz: Xyz, copies: int = 1) -> None:
    """Write compressed whole millimetres; further copies of the cloud lie beside the first."""
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales = np.full(3, MILLIMETRE)
    with laspy.open(str(path), "w", header=header, do_compress=True) as file:
        for copy in _copies(xyz, copies):
            points = laspy.ScaleAwarePointRecord.zeros(len(copy), header=header)
            points.x, points.y, points.z = copy.astype(np.float64).T
            file.write_points(points)


def write_e57(path: Path, xyz: Xyz) -> None:
    """Write one scan."""
    axes = ("cartesianX", "cartesianY", "cartesianZ")
    with pye57.E57(str(path), mode="w") as file:
        file.write_scan_raw(dict(zip(axes, xyz.astype(np.float64).T, strict=True)))


def write_xyz(path: Path, xyz: Xyz) -> None:
    """Write text, a point a line, to the tenth of a millimetre."""
    np.savetxt(path, xyz, "%.4f")


def write_pcd(path: Path, xyz: Xyz) -> None:
    """Write binary float32."""
    lines = (
        "VERSION 0.7", "FIELDS x y z", "SIZE 4 4 4", "TYPE F F F", "COUNT 1 1 1",
        f"WIDTH {len(xyz)}", "HEIGHT 1", "VIEWPOINT 0 0 0 1 0 0 0", f"POINTS {len(xyz)}",
        "DATA binary\n",
    )  # fmt: skip
    with open(path, "wb") as file:
        file.write("\n".join(lines).encode())
        xyz.astype("<f4").tofile(file)


WRITERS: dict[str, Callable[[Path, Xyz], None]] = {
    "ply": write_ply,
    "laz": write_laz,
    "e57": write_e57,
    "xyz": write_xyz,
    "pcd": write_pcd,
}


def _copies(xyz: Xyz, copies: int) -> Iterator[Xyz]:
    width = np.ceil(np.ptp(xyz[:, 0]) + 1)
    shift = np.array((width, 0, 0), np.float32)
    return (xyz + i * shift if i else xyz for i in range(copies))
