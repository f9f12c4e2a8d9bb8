"""The registered point cloud of one scan."""

import json
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from storage.artifacts import Kind, column, register, schema


@dataclass(frozen=True, eq=False)
class PointCloud:
    """n points of one scan in the building frame, z up: point i lies at `origin + xyz[i]`. Before
    registration each lies in the device frame of its snapshot."""

    xyz: NDArray[np.float32]
    """(n, 3), metres, relative to `origin`"""
    origin: NDArray[np.float64]
    """(3,), metres; zero unless the building frame is far away (georeferenced)"""
    snapshot: NDArray[np.int32] | None = None
    """(n,), index of the snapshot that saw the point; None if the scan has none"""

    def __len__(self) -> int:
        return len(self.xyz)


SCHEMA = schema(
    "points",
    [
        column("x_mm", pa.int32(), "building frame, relative to the origin in the metadata"),
        column("y_mm", pa.int32(), "building frame, relative to the origin in the metadata"),
        column("z_mm", pa.int32(), "building frame, relative to the origin in the metadata"),
        column("snapshot", pa.int32(), "snapshot that saw the point", nullable=True),
    ],
)


def to_table(points: PointCloud) -> pa.Table:
    """Return points as whole millimetres, a tenth of the finest depth sensor's noise."""
    columns = [_millimetres(points.xyz[:, axis]) for axis in range(3)]
    n = len(points)
    snapshot = pa.nulls(n, pa.int32()) if points.snapshot is None else pa.array(points.snapshot)
    origin = {"mapsense.origin_m": json.dumps(points.origin.tolist())}
    metadata = SCHEMA.metadata | {k.encode(): v.encode() for k, v in origin.items()}
    return pa.table([*columns, snapshot], schema=SCHEMA.with_metadata(metadata))


def from_table(table: pa.Table) -> PointCloud:
    """Return the cloud a table holds."""
    xyz = np.empty((table.num_rows, 3), np.float32)
    for axis, name in enumerate(("x_mm", "y_mm", "z_mm")):
        np.multiply(table[name].to_numpy(), np.float32(1e-3), out=xyz[:, axis], casting="unsafe")
    snapshot = table["snapshot"]
    whole = snapshot.null_count == 0 and table.num_rows > 0
    return PointCloud(
        xyz=xyz,
        origin=np.array(json.loads(table.schema.metadata[b"mapsense.origin_m"]), float),
        snapshot=snapshot.to_numpy().astype(np.int32, copy=False) if whole else None,
    )


def _millimetres(metres: NDArray[np.float32]) -> pa.Array:
    return pa.array(np.rint(metres * np.float64(1000)).astype(np.int32))


POINTS = register(
    Kind(
        "points",
        PointCloud,
        SCHEMA,
        to_table,
        from_table,
        # whole millimetres as deltas: half the bytes of floats (the default dictionary adds some)
        write_options={
            "use_dictionary": False,
            "column_encoding": dict.fromkeys(SCHEMA.names, "DELTA_BINARY_PACKED"),
        },
    )
)
