"""PCD clouds, read by Open3D after a check of what their header promises."""

import ctypes
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from storage.errors import InputError
from tasks.scans.raw import RawCloud, in_chunks, library_errors, size_of

_LONGEST = 1 << 16  # bytes of header
_KINDS = ("ascii", "binary", "binary_compressed")
_AT_ORIGIN = "0 0 0 1 0 0 0"


def read_pcd(path: Path) -> RawCloud:
    """Return the points of a PCD file."""
    size = size_of(path)
    header, start = _header(path)
    promised = _promised(path, header)
    _check_size(path, header, promised, size - start)
    xyz = _points(path)
    if len(xyz) != promised:
        raise _cut(path, promised, f"holds {len(xyz)}")
    viewpoint = header.get("VIEWPOINT", _AT_ORIGIN)
    moved = _viewpoint(path, viewpoint) != _viewpoint(path, _AT_ORIGIN)
    note = f"The header's viewpoint ({viewpoint}) was not applied: writers disagree on its sense."
    return RawCloud(in_chunks(xyz), points_read=promised, notes=(note,) if moved else ())


def _viewpoint(path: Path, text: str) -> list[float]:
    try:
        return [float(word) for word in text.split()]
    except ValueError as error:
        raise _malformed(path, f"VIEWPOINT is {text[:60]!r}, expected numbers") from error


def _points(path: Path) -> NDArray[np.floating]:
    open3d = _open3d()
    level = open3d.utility.VerbosityLevel.Error
    with library_errors(path, "PCD"), open3d.utility.VerbosityContextManager(level):
        cloud = open3d.t.io.read_point_cloud(str(path), format="pcd")
        if "positions" not in cloud.point:
            raise ValueError("no points could be read")
        xyz: NDArray[np.floating] = cloud.point.positions.numpy()
    return xyz


def _open3d() -> Any:
    """Import Open3D late: it takes most of a second, and few scans are PCD files."""
    # Open3D links against libusb-1.0, which small systems lack; without the package the
    # system's own has to do
    with suppress(ImportError, OSError):
        import libusb_package

        ctypes.CDLL(str(libusb_package.get_library_path()), mode=ctypes.RTLD_GLOBAL)
    import open3d

    return open3d


def _header(path: Path) -> tuple[dict[str, str], int]:
    """Return the header's entries and where the data starts."""
    entries: dict[str, str] = {}
    with open(path, "rb") as file:
        while file.tell() < _LONGEST and (line := file.readline(_LONGEST)):
            key, _, value = line.decode("ascii", "replace").strip().partition(" ")
            if not key.startswith("#"):
                entries[key.upper()] = value.strip()
            if key.upper() == "DATA":
                return entries, file.tell()
    raise _malformed(path, "no line 'DATA'")


def _promised(path: Path, header: dict[str, str]) -> int:
    for key in ("FIELDS", "SIZE", "TYPE", "POINTS"):
        if key not in header:
            raise _malformed(path, f"no line '{key}'")
    if not {"x", "y", "z"} <= set(header["FIELDS"].split()):
        raise _malformed(path, f"FIELDS are {header['FIELDS']!r}, expected x, y and z among them")
    if header["DATA"].lower() not in _KINDS:
        raise _malformed(path, f"DATA is {header['DATA']!r}, expected one of {', '.join(_KINDS)}")
    if not header["POINTS"].isdigit():
        raise _malformed(path, f"POINTS is {header['POINTS']!r}, expected a number")
    return int(header["POINTS"])


def _check_size(path: Path, header: dict[str, str], promised: int, held: int) -> None:
    """Raise unless the data can hold the points: Open3D allocates before it reads."""
    row = _row_size(path, header)
    kind = header["DATA"].lower()
    if kind == "ascii":
        least = promised * 2 * len(header["FIELDS"].split()) - 1
    elif kind == "binary":
        least = promised * row
    else:
        least = _compressed_size(path, promised * row)
    if held < least:
        raise _cut(path, promised, f"has {held} bytes of them, expected at least {least}")


def _row_size(path: Path, header: dict[str, str]) -> int:
    sizes = header["SIZE"].split()
    counts = header.get("COUNT", " ".join("1" for _ in sizes)).split()
    same_length = len(sizes) == len(counts) == len(header["FIELDS"].split())
    if not same_length or not all(word.isdigit() for word in sizes + counts):
        raise _malformed(path, "FIELDS, SIZE and COUNT do not agree")
    return sum(int(size) * int(count) for size, count in zip(sizes, counts, strict=True))


def _compressed_size(path: Path, expected: int) -> int:
    """Return the bytes that follow the header: two sizes and the compressed block."""
    _, start = _header(path)
    with open(path, "rb") as file:
        file.seek(start)
        sizes = np.frombuffer(file.read(8).ljust(8, b"\0"), "<u4")
    if int(sizes[1]) != expected:
        raise _malformed(path, f"the data unpacks to {sizes[1]} bytes, expected {expected}")
    return 8 + int(sizes[0])


def _malformed(path: Path, what: str) -> InputError:
    return InputError(path, f"malformed PCD header: {what}", "export the file again as PCD")


def _cut(path: Path, promised: int, found: str) -> InputError:
    return InputError(
        path, f"the header promises {promised} points, the file {found}", "it is cut: copy it again"
    )
