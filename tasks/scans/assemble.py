"""From raw points to the cloud: turned, scaled, cropped, finite, relative to an origin."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from storage.errors import InputError
from storage.points import PointCloud
from tasks.scans.raw import ROWS, Chunk, RawCloud

SAMPLE = 50_000
"""Points that stand for the cloud where its extent is judged."""
RUN = 64
"""Neighbouring points taken at a time for the sample: whole pages of a mapped file."""
FAR = 1000.0
"""A bulk of points further out than this, metres, is stored relative to an origin of its own."""
REACH = 2_000_000.0
"""Greatest distance from the origin, metres, that whole millimetres in 32 bits can hold."""
FEWEST = 4
"""Fewer points span no volume."""

_ABSURD = 1e4  # times the median distance from the middle; far points of a scan reach some 1e2
_THIN = 1e-4  # metres; points this near to one line (or to each other) show nothing of a room


@dataclass(frozen=True, eq=False)
class Frame:
    """How file coordinates become building coordinates: building = scale * turn @ file."""

    turn: NDArray[np.float64]
    """(3, 3), file axes -> building axes"""
    scale: float
    """metres per file unit"""

    @property
    def is_identity(self) -> bool:
        """Whether file coordinates are building coordinates."""
        return self.scale == 1 and np.array_equal(self.turn, np.eye(3))

    def apply(self, xyz: NDArray[np.floating]) -> NDArray[np.float64]:
        """Return (m, 3) building coordinates, metres, of file coordinates."""
        # what is not finite, or becomes so, is dropped later
        with np.errstate(invalid="ignore", over="ignore"):
            return (xyz.astype(np.float64) @ self.turn.T) * self.scale


@dataclass(frozen=True, eq=False)
class Assembled:
    """The cloud, and what was left out of it."""

    cloud: PointCloud
    not_finite: int
    too_far: int
    cropped: int
    seen: NDArray[np.int64]
    """(k,), points each snapshot saw, the cropped ones included"""


def sample_of(chunks: list[Chunk]) -> NDArray[np.float64]:
    """Return some 50,000 finite points (m, 3) spread evenly over the cloud, file frame."""
    n = sum(len(chunk.xyz) for chunk in chunks)
    if n <= SAMPLE:
        return _near(_finite([chunk.xyz for chunk in chunks]))
    step = n * RUN // SAMPLE
    parts, passed = [], 0
    for chunk in chunks:
        starts = np.arange(-passed % step, len(chunk.xyz), step)
        rows = (starts[:, None] + np.arange(min(RUN, step))).ravel()
        parts.append(chunk.xyz[rows[rows < len(chunk.xyz)]])
        passed += len(chunk.xyz)
    sample = _finite(parts)
    if len(sample) == 0:  # nearly nothing is finite: look at all of it
        sample = _finite([chunk.xyz for chunk in chunks])
    return _near(sample)


def _finite(parts: list[NDArray[np.floating]]) -> NDArray[np.float64]:
    finite = [part[np.isfinite(part).all(axis=1)].astype(np.float64) for part in parts]
    return np.concatenate(finite) if finite else np.empty((0, 3))


def _near(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the points without those that stand for nothing seen, such as -1e10."""
    if len(points) == 0:
        return points
    with np.errstate(over="ignore"):
        distance = np.abs(points - np.median(points, axis=0)).max(axis=1)
    return points[distance <= _ABSURD * np.median(distance)]


def origin_of(sample: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the origin (3,) for a cloud by its sample in the building frame, metres.

    Zeros unless the bulk reaches further than a kilometre; then the bulk's lower end, in whole
    metres.
    """
    low, high = np.quantile(sample, (0.01, 0.99), axis=0)
    if max(np.abs(low).max(), np.abs(high).max()) <= FAR:
        return np.zeros(3)
    origin: NDArray[np.float64] = np.floor(low)
    return origin


def assemble(
    path: Path,
    raw: RawCloud,
    frame: Frame,
    origin: NDArray[np.float64],
    crop: tuple[float, ...] | None,
) -> Assembled:
    """Return the cloud of the raw points; empties `raw.chunks` on the way to save memory.

    Parameters
    ----------
    path : Path
        The scan, named in errors.
    raw : RawCloud
    frame : Frame
    origin : (3,) float
        Metres, building frame.
    crop : (6,) float, optional
        xmin, ymin, zmin, xmax, ymax, zmax, metres, building frame.
    """
    n = sum(len(chunk.xyz) for chunk in raw.chunks)
    k = len(raw.poses) if raw.poses is not None else 0
    xyz = np.empty((n, 3), np.float32)
    snapshot = np.empty(n, np.int32) if k and _has_links(raw) else None
    seen = np.zeros(k, np.int64)
    dropped = np.zeros(3, np.int64)  # not finite, too far, cropped
    end = 0
    raw.chunks.reverse()
    while raw.chunks:
        chunk = raw.chunks.pop()
        for start in range(0, len(chunk.xyz), ROWS):
            part = _part(chunk, start)
            m = len(part.xyz)
            kept, losses, valid = _place(part.xyz, frame, origin, crop, xyz[end : end + m])
            dropped += losses
            if snapshot is not None and part.snapshot is not None:
                _link(part.snapshot, m, valid, kept, snapshot[end:], seen)
            end += m - int(losses.sum())
    cloud = PointCloud(_cut(xyz, end), origin, None if snapshot is None else _cut(snapshot, end))
    check_shape(path, cloud, crop is not None and dropped[2] > 0)
    return Assembled(cloud, int(dropped[0]), int(dropped[1]), int(dropped[2]), seen)


def check_shape(path: Path, cloud: PointCloud, cropped: bool) -> None:
    """Raise InputError unless the cloud has points enough that lie on no single line."""
    n = len(cloud)
    if n < FEWEST:
        where = " inside the crop box" if cropped else ""
        remedy = "widen 'crop'" if cropped else "check the export and its unit"
        raise InputError(
            path, f"holds {n} usable points{where}, expected {FEWEST} at least", remedy
        )
    for points in (cloud.xyz[:: max(1, n // 1000)], cloud.xyz):
        centred = points - points.mean(axis=0, dtype=np.float64)
        spread = np.sqrt(np.maximum(np.linalg.eigvalsh(centred.T @ centred / len(points)), 0))
        if spread[1] > max(_THIN, 1e-6 * spread[2]):
            return  # the few of the first round mostly show it
    shape = "are all the same" if spread[2] <= _THIN else "all lie on one line"
    raise InputError(path, f"its {n} points {shape}", "check the export and its unit")


def _has_links(raw: RawCloud) -> bool:
    return all(chunk.snapshot is not None for chunk in raw.chunks)


def _part(chunk: Chunk, start: int) -> Chunk:
    stop, links = start + ROWS, chunk.snapshot
    return Chunk(
        chunk.xyz[start:stop], links if isinstance(links, int | None) else links[start:stop]
    )


def _place(
    raw: NDArray[np.floating],
    frame: Frame,
    origin: NDArray[np.float64],
    crop: tuple[float, ...] | None,
    out: NDArray[np.float32],
) -> tuple[NDArray[np.bool_] | None, NDArray[np.int64], NDArray[np.bool_] | None]:
    """Write the kept points to the start of `out`.

    Returns which rows were kept and which were valid (None: all), and the counts of rows not
    finite, too far and cropped.
    """
    none = np.zeros(3, np.int64)
    if crop is None and frame.is_identity and not origin.any():
        with np.errstate(over="ignore"):
            out[...] = raw
        # two extremes answer for all: a NaN makes both NaN
        if not len(out) or max(out.max(), -out.min()) <= REACH:
            return None, none, None
    points = frame.apply(raw) - origin
    finite = np.isfinite(points).all(axis=1)
    near: NDArray[np.bool_] = np.logical_and(finite, (np.abs(points) <= REACH).all(axis=1))
    kept = near.copy()
    if crop is not None:
        box = np.array(crop).reshape(2, 3) - origin
        kept &= ((points >= box[0]) & (points <= box[1])).all(axis=1)
    counts = np.array([len(raw), finite.sum(), near.sum(), kept.sum()])
    out[: counts[3]] = points[kept]
    return kept, counts[:-1] - counts[1:], near


def _link(
    links: NDArray[np.int32] | int,
    m: int,
    valid: NDArray[np.bool_] | None,
    kept: NDArray[np.bool_] | None,
    out: NDArray[np.int32],
    seen: NDArray[np.int64],
) -> None:
    """Write the snapshots of the kept points to the start of `out` and count the valid ones."""
    rows = np.full(m, links, np.int32) if isinstance(links, int) else links
    seen += np.bincount(rows if valid is None else rows[valid], minlength=len(seen))
    of_kept = rows if kept is None else rows[kept]
    out[: len(of_kept)] = of_kept


def _cut(array: NDArray, end: int) -> NDArray:
    """Return the rows up to `end`, without the memory of many that follow."""
    return array[:end].copy() if end < 0.9 * len(array) else array[:end]
