"""The scan bundle: a folder with the tables of points and snapshots as Parquet."""

import json
import os
import shutil
import uuid
from pathlib import Path
from typing import Literal, get_args

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from storage.artifacts import SCHEMA_VERSION
from storage.errors import InputError, StoreError
from storage.points import POINTS, PointCloud
from storage.snapshots import SNAPSHOTS, Snapshots
from tasks.scans.poses import matrices_from_quaternions
from tasks.scans.raw import (
    DEVICE,
    METRES_Z_UP,
    ROWS,
    Chunk,
    Poses,
    RawCloud,
    in_chunks,
    library_errors,
)
from tasks.scans.raw import size_of as _size_of
from tasks.scans.registration import register

POINTS_FILE = "points.parquet"
SNAPSHOTS_FILE = "snapshots.parquet"

PointsFrame = Literal["building", "device"]
"""The frame of a bundle's points: registered already, or still each snapshot's own."""

_FRAME = b"mapsense.frame"
_SIMULATED = b"mapsense.simulated"
_UNIT = 1e-3  # rounding of a stored quaternion; more is a mistake of the writer


def read_bundle(folder: Path) -> RawCloud:
    """Return the points and poses of a scan bundle, the points registered by their poses."""
    points, snapshots = folder / POINTS_FILE, folder / SNAPSHOTS_FILE
    table = _read(snapshots, SNAPSHOTS.schema)
    poses = _poses(snapshots, SNAPSHOTS.from_table(table)) if table.num_rows else None
    table = _read(points, POINTS.schema)
    _check_origin(points, table)
    _check_nulls(points, table)
    frame = _frame(points, table)
    simulated = (table.schema.metadata or {}).get(_SIMULATED) == b"true"
    cloud = POINTS.from_table(table)
    del table
    _check_links(points, cloud, poses)
    chunks = _chunks(cloud) if frame == "building" else _registered(points, cloud, poses)
    return RawCloud(chunks, len(cloud), poses=poses, convention=METRES_Z_UP, simulated=simulated)


def write_bundle(
    folder: Path,
    cloud: PointCloud,
    snapshots: Snapshots,
    frame: PointsFrame = "building",
    *,
    simulated: bool = False,
) -> None:
    """Write a scan bundle: a reader sees all of it, the one before it, or nothing.

    Parameters
    ----------
    folder : Path
        Becomes the bundle, best named NAME.scan; a bundle already there is replaced.
    cloud : PointCloud
    snapshots : Snapshots
        Of 0 rows if the cloud has none.
    frame : "building" or "device"
        Whether the points are registered, or in the device frame of their snapshot.
    simulated : bool
        Written beside the points: all that is made of them says so.

    Raises
    ------
    ValueError
        If points of the device frame have no snapshots, or an origin.
    StoreError
        If the folder cannot be written.
    """
    if frame == "device" and (cloud.snapshot is None or not len(snapshots) or cloud.origin.any()):
        raise ValueError("cloud: points of the device frame need snapshots, and no origin")
    temporary = folder.parent / f".{folder.name}-{os.getpid()}-{uuid.uuid4().hex[:12]}"
    try:
        temporary.mkdir(parents=True)
        points = POINTS.to_table(cloud)
        about = {_FRAME: frame.encode(), _SIMULATED: b"true" if simulated else b"false"}
        points = points.replace_schema_metadata(points.schema.metadata | about)
        _write(temporary / POINTS_FILE, points, POINTS.write_options)
        _write(temporary / SNAPSHOTS_FILE, SNAPSHOTS.to_table(snapshots), SNAPSHOTS.write_options)
        _put_in_place(temporary, folder)
    except OSError as error:
        raise StoreError(
            f"{folder}: cannot write the scan bundle ({error.strerror or error}); "
            "choose a writable folder with free space"
        ) from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _write(path: Path, table: pa.Table, options: dict | None) -> None:
    with open(path, "wb") as file:
        pq.write_table(table, file, **({"compression": "zstd"} | (options or {})))
        file.flush()
        os.fsync(file.fileno())


def _put_in_place(temporary: Path, folder: Path) -> None:
    if folder.exists():
        if not {path.name for path in folder.iterdir()} <= {POINTS_FILE, SNAPSHOTS_FILE}:
            raise OSError("the folder is there and holds other files")
        # a folder cannot be renamed onto a full one: the old one steps aside first
        os.rename(folder, temporary / "before")
        os.rename(temporary / POINTS_FILE, temporary / "before" / POINTS_FILE)
        os.rename(temporary / SNAPSHOTS_FILE, temporary / "before" / SNAPSHOTS_FILE)
        os.rename(temporary / "before", folder)
    else:
        os.rename(temporary, folder)


def _read(path: Path, schema: pa.Schema) -> pa.Table:
    _size_of(path)
    with library_errors(path, "Parquet"):
        _check_schema(path, pq.read_schema(path), schema)
        # one file, not a data set: a folder named a=b must add no column
        return pq.read_table(path, columns=schema.names, partitioning=None)


def _check_schema(path: Path, found: pa.Schema, expected: pa.Schema) -> None:
    metadata = found.metadata or {}
    table = (expected.metadata or {})[b"mapsense.table"].decode()
    if (holds := metadata.get(b"mapsense.table", b"").decode()) != table:
        raise _foreign(path, f"holds table {holds!r}, expected '{table}'")
    version = metadata.get(b"mapsense.schema_version", b"").decode()
    if version != SCHEMA_VERSION:
        raise _foreign(path, f"has schema version {version!r}, expected '{SCHEMA_VERSION}'")
    for field in expected:
        if field.name not in found.names:
            raise _foreign(path, f"has no column '{field.name}'")
        if (type_ := found.field(field.name).type) != field.type:
            raise _foreign(path, f"column '{field.name}' is {type_}, expected {field.type}")


def _check_origin(path: Path, table: pa.Table) -> None:
    text = (table.schema.metadata or {}).get(b"mapsense.origin_m", b"")
    try:
        origin = np.array(json.loads(text), float)
    except ValueError:
        origin = np.empty(0)
    if origin.shape != (3,) or not np.isfinite(origin).all():
        raise _foreign(path, f"metadata 'mapsense.origin_m' is {text.decode()!r}, expected [x,y,z]")


def _frame(path: Path, table: pa.Table) -> str:
    """Return the frame of the points; a bundle that says none was written registered."""
    frame = (table.schema.metadata or {}).get(_FRAME, b"building").decode("utf-8", "replace")
    if frame not in get_args(PointsFrame):
        raise _foreign(path, f"metadata 'mapsense.frame' is {frame!r}, expected building or device")
    return frame


def _check_nulls(path: Path, table: pa.Table) -> None:
    for name in ("x_mm", "y_mm", "z_mm"):
        if table[name].null_count:
            raise _foreign(path, f"column '{name}' has {table[name].null_count} empty values")
    missing = table["snapshot"].null_count
    if 0 < missing < table.num_rows:
        raise _foreign(path, f"column 'snapshot' is empty in {missing} of {table.num_rows} rows")


def _check_links(path: Path, cloud: PointCloud, poses: Poses | None) -> None:
    if cloud.snapshot is None:
        return
    k = 0 if poses is None else len(poses)
    low, high = int(cloud.snapshot.min()), int(cloud.snapshot.max())
    if low < 0 or high >= k:
        raise _foreign(
            path, f"column 'snapshot' runs from {low} to {high}, there are {k} snapshots"
        )


def _poses(path: Path, snapshots: Snapshots) -> Poses:
    lengths = np.linalg.norm(snapshots.rotations, axis=1)
    finite = np.isfinite(snapshots.positions).all(axis=1) & np.isfinite(snapshots.times)
    bad = ~(np.abs(lengths - 1) < _UNIT) | ~finite
    if bad.any():
        row = int(bad.argmax())
        raise _foreign(path, f"row {row} is no pose (quaternion length {lengths[row]:.4g})")
    rotations = matrices_from_quaternions(snapshots.rotations / lengths[:, None])
    return Poses(snapshots.times, snapshots.positions, rotations, DEVICE, snapshots.points)


def _chunks(cloud: PointCloud) -> list[Chunk]:
    far = cloud.origin.any()
    chunks, start = [], 0
    for part in in_chunks(cloud.xyz):
        stop = start + len(part.xyz)
        xyz = cloud.origin + part.xyz if far else part.xyz
        chunks.append(Chunk(xyz, None if cloud.snapshot is None else cloud.snapshot[start:stop]))
        start = stop
    return chunks


def _registered(path: Path, cloud: PointCloud, poses: Poses | None) -> list[Chunk]:
    if poses is None or cloud.snapshot is None:
        raise _foreign(path, "holds points in the device frame, but no snapshots to register by")
    if cloud.origin.any():
        raise _foreign(path, "holds points in the device frame, yet 'mapsense.origin_m' is not 0")
    starts = range(0, len(cloud), ROWS)
    links = [cloud.snapshot[start : start + ROWS] for start in starts]
    parts = [cloud.xyz[start : start + ROWS] for start in starts]
    return [Chunk(register(xyz, of, poses), of) for xyz, of in zip(parts, links, strict=True)]


def _foreign(path: Path, what: str) -> InputError:
    return InputError(path, what, "write the bundle again with this version of MapSense")
