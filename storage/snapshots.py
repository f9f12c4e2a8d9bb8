"""The snapshots of one scan: when and from where the depth sensor looked."""

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from storage.artifacts import Kind, column, register, schema


@dataclass(frozen=True, eq=False)
class Snapshots:
    """k snapshots; row i is one snapshot in every array. k is 0 for a cloud without poses."""

    times: NDArray[np.float64]
    """(k,), seconds"""
    positions: NDArray[np.float64]
    """(k, 3), metres, building frame: where the sensor was"""
    rotations: NDArray[np.float64]
    """(k, 4), unit quaternion (a, b, c, d), device frame -> building frame"""
    points: NDArray[np.int64]
    """(k,), points the snapshot saw"""

    def __len__(self) -> int:
        return len(self.times)


SCHEMA = schema(
    "snapshots",
    [
        column("snapshot", pa.int32(), "index within the scan"),
        column("time_s", pa.float64(), "time of the snapshot"),
        column("x_m", pa.float64(), "position of the sensor, building frame"),
        column("y_m", pa.float64(), "position of the sensor, building frame"),
        column("z_m", pa.float64(), "position of the sensor, building frame"),
        column("qa", pa.float64(), "unit quaternion, scalar part, device -> building frame"),
        column("qb", pa.float64(), "unit quaternion, i"),
        column("qc", pa.float64(), "unit quaternion, j"),
        column("qd", pa.float64(), "unit quaternion, k"),
        column("points", pa.int64(), "points seen"),
    ],
)


def none() -> Snapshots:
    """Return the snapshots of a cloud that has none."""
    return Snapshots(np.empty(0), np.empty((0, 3)), np.empty((0, 4)), np.empty(0, np.int64))


def to_table(snapshots: Snapshots) -> pa.Table:
    """Return one row per snapshot."""
    k = len(snapshots)
    return pa.table(
        [
            pa.array(np.arange(k, dtype=np.int32)),
            pa.array(snapshots.times),
            *(pa.array(snapshots.positions[:, axis]) for axis in range(3)),
            *(pa.array(snapshots.rotations[:, part]) for part in range(4)),
            pa.array(snapshots.points),
        ],
        schema=SCHEMA,
    )


def from_table(table: pa.Table) -> Snapshots:
    """Return the snapshots a table holds."""
    stack = lambda names: np.stack([table[n].to_numpy() for n in names], axis=1)  # noqa: E731
    return Snapshots(
        times=table["time_s"].to_numpy(),
        positions=stack(("x_m", "y_m", "z_m")),
        rotations=stack(("qa", "qb", "qc", "qd")),
        points=table["points"].to_numpy(),
    )


SNAPSHOTS = register(Kind("snapshots", Snapshots, SCHEMA, to_table, from_table))
