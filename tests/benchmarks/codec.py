"""The octree codec against Draco and LAZ, on the same cells."""

import io
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import DracoPy
import laspy
import numpy as np
from harness import BenchmarkError, Case, Measured, Prepared, measure
from numpy.typing import NDArray
from report import Column, Report, Table, Target

from storage.points import PointCloud
from storage.streams import Stream
from tasks.device import cells
from tasks.device.codec import decode, encode_leaves
from tasks.scans.read import ReadParams, read_scan
from tasks.scans.sources import fingerprint
from tasks.simulation.clouds import furnished_room

Cells = NDArray[np.int32]
"""(n, 3), different from each other, from 0 on"""

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
ROOM = "simulated room"
ROOM_POINTS = 2_000_000
REAL = {
    "laser scan of an office": "tls_office_1/sample2_raw.ply",
    "Kinect, a room": "pcl_room_scans/room_scan1.pcd",
    "iPad, a ceiling": "ipad_lidar_ceilings/pix4d_database_560_db.ply",
}
"""Clouds beside the project, measured where they are."""
SIZES_UM = (10_000, 20_000)
BITS = {10_000: 3.30, 20_000: 1.30}
"""Targets for the room, bits for each occupied cell."""
LONGEST_S = 0.5
ROUNDS = 3
DRACO_LEVEL = 7
"""Above it Draco chooses other settings by itself and gains nothing here."""

OURS, DRACO, LAZ = "ours", "Draco", "LAZ"
COLUMNS = (
    Column("case", "coder"), Column("bits", "bits a cell", "{:.2f}"),
    Column("megabytes", "MB", "{:.3f}"),
    Column("encode_s", "encode s", "{:.3f}"), Column("encode_ratio", "ours / theirs", "{:.2f}"),
    Column("decode_s", "decode s", "{:.3f}"), Column("decode_ratio", "ours / theirs", "{:.2f}"),
    Column("encode_mb", "peak MB, encode", "{:.0f}"),
    Column("decode_mb", "decode", "{:.0f}"),
)  # fmt: skip
NOTES = [
    "All coders get the same occupied cells and must return exactly these. Ours starts from all",
    "points (cells found and sorted within its time) and ends with points; Draco and LAZ start",
    f"from the different cells, in Morton order. Draco: level {DRACO_LEVEL}, as many bits as",
    "the cells have. LAZ: lazrs.",
]


@dataclass(frozen=True)
class Coder:
    """How to write a cloud's cells and read them."""

    name: str
    start: Callable[[PointCloud, int], Any]
    """what encoding begins with; not timed"""
    encode: Callable[[Any], Any]
    decode: Callable[[Any], Any]
    size: Callable[[Any], int]
    cells: Callable[[Any], NDArray[Any]]
    """the cells decoded, from any start and in any order"""


def codec(quick: bool) -> Report:
    """Measure bits, time and memory; quick runs each coder once and leaves out the real clouds."""
    report = Report("Octree codec: bits for each occupied cell", notes=list(NOTES))
    for leaf_um in SIZES_UM:
        found = _compare(ROOM, leaf_um, 1 if quick else ROUNDS)
        report.tables.append(_table(f"{ROOM}, {ROOM_POINTS:,} points", leaf_um, found))
        report.targets += _targets(leaf_um, found)
    for name, path in {} if quick else REAL.items():
        if (DATA / path).is_file():
            found = _compare(name, SIZES_UM[0], ROUNDS)
            report.tables.append(_table(name, SIZES_UM[0], found))
            least = min(found[rival]["bits"] for rival in (DRACO, LAZ))
            ratio = found[OURS]["bits"] / least
            report.targets.append(Target(f"{name}: bits / the better rival's", ratio, 1, "x"))
    return report


def _table(name: str, leaf_um: int, found: dict[str, dict[str, Any]]) -> Table:
    count = found[OURS]["cells"]
    title = f"{name}, {leaf_um / 1e4:g} cm: {count:,} cells"
    return Table(title, COLUMNS, list(found.values()))


def _targets(leaf_um: int, found: dict[str, dict[str, Any]]) -> list[Target]:
    ours, size = found[OURS], f"{ROOM}, {leaf_um / 1e4:g} cm"
    return [
        Target(f"{size}: bits a cell", ours["bits"], BITS[leaf_um]),
        Target(f"{size}: encode", ours["encode_s"], LONGEST_S, " s", of_time=True),
        Target(f"{size}: decode", ours["decode_s"], LONGEST_S, " s", of_time=True),
        Target(f"{size}: bits / Draco", ours["bits"] / found[DRACO]["bits"], 0.85, "x"),
    ]


def _compare(name: str, leaf_um: int, rounds: int) -> dict[str, dict[str, Any]]:
    """Return coder -> its figures."""
    rows: dict[str, dict[str, Any]] = {coder.name: {"case": coder.name} for coder in CODERS}
    for step, prepare in (("encode", prepare_encode), ("decode", prepare_decode)):
        ours, *rivals = (
            Case(coder.name, partial(prepare, coder.name, name, leaf_um), coder.name != OURS)
            for coder in CODERS
        )
        measured = measure(ours, rivals, rounds)
        _check(name, measured)
        for coder, m in measured.items():
            rows[coder] |= m.row() | {f"{step}_s": m.median_s, f"{step}_mb": m.above_mb}
            if coder != OURS:
                rows[coder][f"{step}_ratio"] = measured[OURS].ratio(m)
    for row in rows.values():
        row["bits"] = 8e6 * row["megabytes"] / row["cells"]
    return rows


def _check(name: str, measured: dict[str, Measured]) -> None:
    sums = {coder: m.figures.get("sums") for coder, m in measured.items()}
    if any(found != sums[OURS] for found in sums.values()):
        raise BenchmarkError(f"{name}: the coders returned different cells: {sums}")


def prepare_encode(coder_name: str, name: str, leaf_um: int) -> Prepared:
    """Return a coder that is warm, and its input."""
    coder = _coder(coder_name)
    _warm_up(coder)
    start = coder.start(load(name), leaf_um)
    return Prepared(
        lambda: coder.encode(start), lambda coded: {"megabytes": coder.size(coded) / 1e6}
    )


def prepare_decode(coder_name: str, name: str, leaf_um: int) -> Prepared:
    """Return a decoder that is warm, and its input."""
    coder = _coder(coder_name)
    _warm_up(coder)
    coded = coder.encode(coder.start(load(name), leaf_um))

    def judge(decoded: Any) -> dict[str, Any]:
        found = coder.cells(decoded).astype(np.int64)
        found -= found.min(axis=0)
        mixed = found @ np.array([1, 1 << 21, 1 << 42])
        return {"cells": len(found), "sums": [int(mixed.sum()), int((mixed % 1_000_003).sum())]}

    return Prepared(lambda: coder.decode(coded), judge)


def _warm_up(coder: Coder) -> None:
    xyz = furnished_room(20_000, seed=1)[0]
    coder.decode(coder.encode(coder.start(PointCloud(xyz, np.zeros(3)), SIZES_UM[0])))


def _coder(name: str) -> Coder:
    return next(coder for coder in CODERS if coder.name == name)


def load(name: str) -> PointCloud:
    """Return a cloud by its name."""
    if name == ROOM:
        return PointCloud(furnished_room(ROOM_POINTS, seed=0)[0], np.zeros(3))
    return read_scan(fingerprint(DATA / REAL[name]), ReadParams())[0]


def different_cells(points: PointCloud, leaf_um: int) -> Cells:
    """Return the occupied cells, from 0 on, in Morton order."""
    at = np.floor((points.origin + points.xyz) / (leaf_um / 1e6)).astype(np.int64)
    at -= at.min(axis=0)
    keys = cells.morton_keys(at.astype(np.float32), np.zeros(3), 1.0, np.zeros(3, np.int64))
    return cells.morton_cells(np.unique(keys)).astype(np.int32)


def _cells_of_centres(points: tuple[PointCloud, float]) -> NDArray[Any]:
    cloud, leaf = points
    return np.floor((cloud.origin + cloud.xyz) / leaf)


def _decode_ours(stream: Stream) -> tuple[PointCloud, float]:
    return decode(stream), stream.leaf_m


def _encode_draco(at: Cells) -> bytes:
    bits = int(at.max()).bit_length()
    return bytes(
        DracoPy.encode(
            at.astype(np.float32),
            quantization_bits=bits,
            compression_level=DRACO_LEVEL,
            quantization_range=2**bits - 1,
            quantization_origin=[0.0, 0.0, 0.0],
        )
    )


def _encode_laz(at: Cells) -> bytes:
    header = laspy.LasHeader(point_format=0, version="1.2")
    header.scales, header.offsets = np.ones(3), np.zeros(3)
    file = laspy.LasData(header)
    file.X, file.Y, file.Z = at.T
    out = io.BytesIO()
    file.write(out, do_compress=True, laz_backend=laspy.LazBackend.Lazrs)
    return out.getvalue()


def _decode_laz(data: bytes) -> Cells:
    file = laspy.read(io.BytesIO(data), laz_backend=laspy.LazBackend.Lazrs)
    return np.stack([file.X, file.Y, file.Z], axis=1)


CODERS = (
    Coder(
        OURS,
        start=lambda points, leaf_um: (points, leaf_um),
        encode=lambda start: encode_leaves(*start),
        decode=_decode_ours,
        size=lambda stream: len(stream.data),
        cells=_cells_of_centres,
    ),
    Coder(
        DRACO,
        start=different_cells,
        encode=_encode_draco,
        decode=DracoPy.decode,
        size=len,
        cells=lambda cloud: np.rint(cloud.points),
    ),
    Coder(
        LAZ,
        start=different_cells,
        encode=_encode_laz,
        decode=_decode_laz,
        size=len,
        cells=lambda at: at,
    ),
)
