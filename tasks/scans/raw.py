"""What a file holds, before anything is turned, scaled or dropped."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from storage.errors import InputError

ROWS = 1 << 20
"""Points read at a time: 12 to 24 MB, small beside any cloud and large beside any overhead."""

FLOAT32_LIMIT = 1000.0
"""Coordinates below this many units lose less than 0.03 mm as float32, whatever the unit."""


@dataclass(frozen=True, eq=False)
class Chunk:
    """A run of points in the file's frame and unit."""

    xyz: NDArray[np.floating]
    """(m, 3), may be a view into the mapped file"""
    snapshot: NDArray[np.int32] | int | None = None
    """(m,) or one for all: index of the pose that saw the point; None without poses"""


@dataclass(frozen=True, eq=False)
class Sensor:
    """Which way a sensor's own axes lie: what the device frame is built from."""

    up: tuple[float, float, float]
    back: tuple[float, float, float]
    """towards the person, away from what is looked at"""


CAMERA = Sensor(up=(0, -1, 0), back=(0, 0, -1))  # x right, y down, z forward
SCANNER = Sensor(up=(0, 0, 1), back=(0, -1, 0))  # z up, taken to look along y
DEVICE = Sensor(up=(0, 1, 0), back=(0, 0, 1))


@dataclass(frozen=True, eq=False)
class Poses:
    """k poses of the sensor in the file's frame and unit."""

    times: NDArray[np.float64]
    """(k,), seconds, ascending"""
    positions: NDArray[np.float64]
    """(k, 3), file unit"""
    rotations: NDArray[np.float64]
    """(k, 3, 3), sensor frame -> file frame"""
    sensor: Sensor
    points: NDArray[np.int64] | None = None
    """(k,), points seen, if the file says so; else they are counted"""

    def __len__(self) -> int:
        return len(self.times)


@dataclass(frozen=True)
class Convention:
    """What a format's standard fixes; None is left to settings and guesses."""

    up: str | None = None
    scale: float | None = None
    """metres per unit"""
    handed: str = "right"
    levelled: bool = True
    """False if no axis of the file is known to be vertical"""


METRES_Z_UP = Convention(up="z", scale=1.0)


@dataclass(frozen=True, eq=False)
class RawCloud:
    """The points and poses of one scan as its file holds them."""

    chunks: list[Chunk]
    points_read: int
    """points in the file, those below included"""
    points_invalid: int = 0
    """points left out of `chunks`: the file itself marks them as nothing seen"""
    poses: Poses | None = None
    convention: Convention = Convention()
    notes: tuple[str, ...] = ()
    simulated: bool = False
    """whether the file itself says so"""


def compact(xyz: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return near coordinates as float32 (half the memory), far or non-finite ones unchanged."""
    if xyz.size and np.abs(xyz).max() < FLOAT32_LIMIT:
        return xyz.astype(np.float32)
    return xyz


def in_chunks(xyz: NDArray[np.floating]) -> list[Chunk]:
    """Return views of at most `ROWS` points."""
    return [Chunk(xyz[start : start + ROWS]) for start in range(0, len(xyz), ROWS)]


def size_of(path: Path) -> int:
    """Return a file's size, or raise InputError if it is missing, no file, or empty."""
    try:
        size = path.stat().st_size
    except OSError as error:
        raise unreadable(path, error) from error
    if not path.is_file():
        raise InputError(path, "is a folder, expected a file", "name the scan's file")
    if size == 0:
        raise InputError(path, "the file is empty (0 bytes)", "export or copy the scan again")
    return size


def unreadable(path: Path, error: OSError) -> InputError:
    """Return the error for a file or folder the system does not let us read."""
    reason = error.strerror or str(error)
    return InputError(path, f"cannot be read ({reason})", "check the path and its permissions")


@contextmanager
def library_errors(path: Path, what: str) -> Iterator[None]:
    """Turn whatever a format's library raises into one InputError that names the file."""
    try:
        yield
    except (InputError, MemoryError, PermissionError):
        raise
    except BaseException as error:  # libraries raise bare RuntimeError, ValueError, own types
        # a panic of a library in Rust derives from BaseException, as Ctrl-C does
        if not isinstance(error, Exception) and type(error).__name__ != "PanicException":
            raise
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise InputError(
            path, f"cannot be read as {what} ({reason})", "it is damaged or cut: export it again"
        ) from error
