"""The planes of one scan, and which point lies on which of them."""

import json
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from storage.artifacts import Kind, column, register, schema


@dataclass(frozen=True, eq=False)
class Planes:
    """m connected planar patches in Hesse normal form, `normal . (x - origin) = offset`.

    Row i is one patch in every array; two patches of one plane that do not touch are two rows.
    Most inliers first.
    """

    normals: NDArray[np.float64]
    """(m, 3), unit length; the sign carries no meaning"""
    offsets: NDArray[np.float64]
    """(m,), metres, relative to `origin`"""
    inliers: NDArray[np.int64]
    """(m,), points of the cloud on each patch"""
    rms: NDArray[np.float64]
    """(m,), metres, root mean square distance of the inliers"""
    origin: NDArray[np.float64]
    """(3,), metres, as the cloud's"""

    def __len__(self) -> int:
        return len(self.offsets)


@dataclass(frozen=True, eq=False)
class PlaneLabels:
    """For each point of a cloud the plane it lies on."""

    labels: NDArray[np.int32]
    """(n,), row of `Planes`, -1 for a point on none"""


PLANES_SCHEMA = schema(
    "planes",
    [
        column("normal_x", pa.float64(), "unit normal, building frame"),
        column("normal_y", pa.float64(), "unit normal, building frame"),
        column("normal_z", pa.float64(), "unit normal, building frame"),
        column("offset_m", pa.float64(), "normal . (x - origin in the metadata)"),
        column("inliers", pa.int64(), "points on the patch"),
        column("rms_m", pa.float64(), "root mean square distance of the inliers"),
    ],
)
LABELS_SCHEMA = schema(
    "plane_labels", [column("plane", pa.int32(), "row of the scan's planes, -1 for none")]
)


def planes_to_table(planes: Planes) -> pa.Table:
    """Return one row per patch."""
    origin = {b"mapsense.origin_m": json.dumps(planes.origin.tolist()).encode()}
    return pa.table(
        [
            *(pa.array(planes.normals[:, axis]) for axis in range(3)),
            pa.array(planes.offsets),
            pa.array(planes.inliers),
            pa.array(planes.rms),
        ],
        schema=PLANES_SCHEMA.with_metadata(PLANES_SCHEMA.metadata | origin),
    )


def planes_from_table(table: pa.Table) -> Planes:
    """Return the planes a table holds."""
    names = ("normal_x", "normal_y", "normal_z")
    return Planes(
        normals=np.stack([table[n].to_numpy() for n in names], axis=1),
        offsets=table["offset_m"].to_numpy(),
        inliers=table["inliers"].to_numpy(),
        rms=table["rms_m"].to_numpy(),
        origin=np.array(json.loads(table.schema.metadata[b"mapsense.origin_m"]), float),
    )


def labels_to_table(labels: PlaneLabels) -> pa.Table:
    """Return one row per point, in the order of the cloud."""
    return pa.table([pa.array(labels.labels)], schema=LABELS_SCHEMA)


def labels_from_table(table: pa.Table) -> PlaneLabels:
    """Return the labels a table holds."""
    return PlaneLabels(table["plane"].to_numpy())


PLANES = register(Kind("planes", Planes, PLANES_SCHEMA, planes_to_table, planes_from_table))
PLANE_LABELS = register(
    Kind("plane_labels", PlaneLabels, LABELS_SCHEMA, labels_to_table, labels_from_table)
)
