"""Reading scans and storing points, against the libraries people would call."""

import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import laspy
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pye57
from files import WRITERS, write_laz, write_ply
from harness import BenchmarkError, Case, Measured, Prepared, measure
from numpy.typing import NDArray
from report import TIMES, Column, Report, Table, Target

from storage import artifacts
from storage.points import POINTS, PointCloud
from storage.sources import Source
from tasks.scans.read import ReadParams, read_scan
from tasks.simulation.clouds import furnished_floor
from tasks.simulation.sensor import load_open3d

ROUNDS = 5
HUGE = 50_000_000
MIDDLE_M = 0.001
"""Both readers' clouds have their middle at the same place, metres."""

COLUMNS = (
    Column("format", "format"), Column("points", "points", "{:,}"), Column("case", "reader"),
    *TIMES, Column("ratio", "ours / theirs", "{:.2f}"),
    Column("above_mb", "peak MB above start", "{:.0f}"),
)  # fmt: skip
STORE_COLUMNS = (
    Column("case", "columns"), Column("megabytes", "MB", "{:.1f}"),
    Column("size_ratio", "/ zstd default", "{:.2f}"),
    Column("write_s", "write s", "{:.3f}"), Column("read_s", "read s", "{:.3f}"),
)  # fmt: skip
MEMORY_COLUMNS = (
    Column("format", "format"), Column("points", "points", "{:,}"),
    Column("file_mb", "file MB", "{:.0f}"), *TIMES,
    Column("peak_mb", "MB in all", "{:.0f}"), Column("above_mb", "above start", "{:.0f}"),
)  # fmt: skip


def open3d_tensor(path: Path) -> NDArray[np.floating]:
    """Read by Open3D's tensor reader."""
    return load_open3d().t.io.read_point_cloud(str(path)).point.positions.numpy()


def open3d_legacy(path: Path) -> NDArray[np.floating]:
    """Read by Open3D's legacy reader."""
    return np.asarray(load_open3d().io.read_point_cloud(str(path)).points)


def laspy_whole(path: Path) -> NDArray[np.floating]:
    """Read the whole file by laspy."""
    return laspy.read(str(path)).xyz


def pye57_scan(path: Path) -> NDArray[np.floating]:
    """Read the only scan by pye57."""
    with pye57.E57(str(path)) as file:
        scan = file.read_scan(0, ignore_missing_fields=True)
    return np.stack([scan[f"cartesian{axis}"] for axis in "XYZ"], axis=1)


def numpy_text(path: Path) -> NDArray[np.floating]:
    """Read by numpy.loadtxt."""
    return np.loadtxt(path, np.float32)


@dataclass(frozen=True)
class Format:
    """A format, how many points to read of it, and who else can."""

    suffix: str
    points: int
    rival: Callable[[Path], NDArray[np.floating]]
    rival_name: str
    bound: float | None = None
    """Target: our time as a share of the rival's."""


FORMATS = (
    Format("ply", 5_000_000, open3d_tensor, "Open3D tensor", 0.2),
    Format("laz", 2_000_000, laspy_whole, "laspy, whole file"),
    Format("e57", 2_000_000, pye57_scan, "pye57"),
    Format("pcd", 2_000_000, open3d_legacy, "Open3D legacy"),
    Format("xyz", 1_000_000, numpy_text, "numpy.loadtxt"),
)


def readers(quick: bool) -> Report:
    """Measure reading each format, and the store's Parquet files."""
    report = Report("Readers and the store: float32 points of a storey, files in the page cache")
    rounds = 1 if quick else ROUNDS
    rows = []
    with TemporaryDirectory() as folder:
        for format_ in FORMATS:
            found = _read(Path(folder), format_, rounds)
            ours, rival = found.values()
            ratio = ours.ratio(rival)
            rows += [m.row() | {"format": format_.suffix.upper()} for m in found.values()]
            rows[-2]["ratio"] = ratio
            if format_.bound is not None:
                what = f"{format_.suffix.upper()}: time / {format_.rival_name}"
                report.targets.append(Target(what, ratio, format_.bound, "x", of_time=True))
        report.tables.append(Table("reading", COLUMNS, rows))
        stored, size = _store(Path(folder), rounds)
    report.tables.append(stored)
    report.targets.append(Target("Parquet points: bytes / zstd default", size, 0.5, "x"))
    report.notes = [
        "Ours ends with the registered, checked cloud (read_scan); theirs with an (n, 3) array.",
        "Ours stores whole millimetres, hashes the file when writing and when reading.",
    ]
    return report


def _read(folder: Path, format_: Format, rounds: int) -> dict[str, Measured]:
    path = folder / f"points.{format_.suffix}"
    WRITERS[format_.suffix](path, furnished_floor(format_.points, seed=0)[0])
    ours = Case("ours", partial(prepare_read, read_ours, path))
    rival = Case(format_.rival_name, partial(prepare_read, format_.rival, path), rival=True)
    found = measure(ours, [rival], rounds)
    path.unlink()
    a, b = (m.figures for m in found.values())
    apart = np.abs(np.subtract(a["middle"], b["middle"])).max()
    if not a["points"] == b["points"] == format_.points or apart > MIDDLE_M:
        raise BenchmarkError(f"{format_.suffix}: ours read {a}, {format_.rival_name} {b}")
    return found


def read_ours(path: Path) -> NDArray[np.floating]:
    """Read by this project's reader, as the stage does."""
    size = path.stat().st_size
    source = Source(name="scan", path=str(path), sha256="0" * 64, size_bytes=size)
    return read_scan(source, ReadParams())[0].xyz


def prepare_read(read: Callable[[Path], NDArray[np.floating]], path: Path) -> Prepared:
    """Return a reader whose libraries are loaded and whose file is in the page cache."""
    read(path)
    return Prepared(lambda: read(path), _describe)


def _describe(xyz: NDArray[np.floating]) -> dict[str, Any]:
    return {"points": len(xyz), "middle": xyz.mean(axis=0, dtype=np.float64).tolist()}


def _store(folder: Path, rounds: int) -> tuple[Table, float]:
    """Return the table of the store and the ratio of sizes."""
    n = FORMATS[0].points
    rows: dict[str, dict[str, Any]] = {"ours": {}, "zstd default": {}}
    for step, prepares in (
        ("write_s", (prepare_store, prepare_parquet)),
        ("read_s", (prepare_load, prepare_load_parquet)),
    ):
        ours, default = (
            Case(name, partial(prepare, folder / f"{step}-{i}", n), rival=name != "ours")
            for i, (name, prepare) in enumerate(zip(rows, prepares, strict=True))
        )
        for name, m in measure(ours, [default], rounds).items():
            rows[name] |= m.row() | {step: m.median_s}
    size = rows["ours"]["megabytes"] / rows["zstd default"]["megabytes"]
    rows["ours"]["size_ratio"] = size
    return Table(f"storing {n:,} points as Parquet", STORE_COLUMNS, list(rows.values())), size


def _place(folder: Path) -> artifacts.Place:
    return artifacts.Place(store=str(folder), run="r", building="b", storey="s", scan="x")


def _cloud(n: int) -> PointCloud:
    return PointCloud(furnished_floor(n, seed=0)[0], np.zeros(3))


def prepare_store(folder: Path, n: int) -> Prepared:
    """Return writing into the store."""
    cloud, place = _cloud(n), _place(folder)
    artifacts.write(POINTS, cloud, place)
    return Prepared(
        lambda: artifacts.write(POINTS, cloud, place),
        lambda ref: {"megabytes": (folder / ref.uri).stat().st_size / 1e6},
    )


def prepare_load(folder: Path, n: int) -> Prepared:
    """Return reading from the store."""
    ref = artifacts.write(POINTS, _cloud(n), _place(folder))
    return Prepared(lambda: artifacts.read(POINTS, ref, folder))


def prepare_parquet(folder: Path, n: int) -> Prepared:
    """Return writing float32 columns with pyarrow's zstd and its other defaults, synced."""
    xyz, path = _cloud(n).xyz, folder / "points.parquet"
    folder.mkdir()

    def run() -> None:
        with open(path, "wb") as file:
            pq.write_table(_columns(xyz), file, compression="zstd")
            file.flush()
            os.fsync(file.fileno())

    run()
    return Prepared(run, lambda _: {"megabytes": path.stat().st_size / 1e6})


def prepare_load_parquet(folder: Path, n: int) -> Prepared:
    """Return reading float32 columns into one array."""
    prepare_parquet(folder, n)
    path = folder / "points.parquet"

    def run() -> NDArray[np.float32]:
        table = pq.read_table(path)
        return np.stack([table[axis].to_numpy() for axis in "xyz"], axis=1)

    return Prepared(run)


def _columns(xyz: NDArray[np.float32]) -> pa.Table:
    return pa.table({axis: np.ascontiguousarray(xyz[:, i]) for i, axis in enumerate("xyz")})


def memory(quick: bool) -> Report:
    """Measure the peak of reading 50 million points; takes a minute and 2 GB of disk."""
    rows, targets = [], []
    n = HUGE // 10 if quick else HUGE
    with TemporaryDirectory() as folder:
        xyz = furnished_floor(n // 10, seed=0)[0]
        for suffix, write in (("ply", write_ply), ("laz", write_laz)):
            path = Path(folder) / f"points.{suffix}"
            write(path, xyz, copies=10)
            case = Case("ours", partial(prepare_huge, path))
            (ours,) = measure(case, rounds=1).values()
            size = path.stat().st_size / 1e6
            path.unlink()
            rows.append(ours.row() | {"format": suffix.upper(), "file_mb": size})
            peak = None if ours.peak_mb is None else ours.peak_mb / 1000
            targets.append(Target(f"{suffix.upper()}: peak of the whole process", peak, 6, " GB"))
    title = f"Memory: reading {n / 1e6:.0f} million points on a computer with 8 GB"
    note = "The pages of a mapped file (PLY) count although the system may drop them."
    return Report(title, [Table("ours", MEMORY_COLUMNS, rows)], targets, [note])


def prepare_huge(path: Path) -> Prepared:
    """Return our reader, cold: nothing that an earlier run freed is there to be used again."""
    return Prepared(lambda: read_ours(path), _describe)
