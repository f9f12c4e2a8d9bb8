"""The segments of one scan: each plane's inlier patch with its concave hull."""

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from storage.artifacts import Kind, column, register, schema

KINDS = ("vertical", "horizontal", "clutter")


@dataclass(frozen=True, eq=False)
class Raster:
    """Which square cells of a segment hold inliers.

    A vertical segment's first axis runs along its plan line from `p0`, the second up; a
    horizontal one's are x and y. Cell (i, j) covers [start + i cell, start + (i + 1) cell).
    """

    start: tuple[float, float]
    """metres: (distance from p0, height) or (x, y)"""
    cells: NDArray[np.bool_]
    """(a, b)"""


@dataclass(frozen=True, eq=False)
class Segments:
    """m segments; entry i is one segment everywhere. Building frame, metres."""

    cell_m: float
    """edge of the raster cells"""
    kinds: NDArray[np.int8]
    """(m,), index into KINDS"""
    normals: NDArray[np.float64]
    """(m, 3), unit; a vertical segment whose side is known faces its room"""
    offsets: NDArray[np.float64]
    """(m,), metres, normal . x = offset"""
    side_known: NDArray[np.bool_]
    """(m,), whether the normal points to where the sensor was"""
    lines: NDArray[np.float64]
    """(m, 2, 2), plan ends p0 and p1 of a vertical segment; NaN for others"""
    heights: NDArray[np.float64]
    """(m, 2), lowest and highest inlier (1st and 99th percentile)"""
    areas: NDArray[np.float64]
    """(m,), square metres within the concave hull"""
    inliers: NDArray[np.int64]
    """(m,), points"""
    rms: NDArray[np.float64]
    """(m,), root mean square distance of the inliers"""
    hulls: tuple[bytes, ...]
    """WKB polygon of the concave hull: a vertical segment's in (along, height), a horizontal
    one's in (x, y)"""
    rasters: tuple[Raster, ...]

    def __len__(self) -> int:
        return len(self.offsets)

    def of_kind(self, kind: str) -> NDArray[np.int64]:
        """Return the indices of the segments of one kind."""
        return np.flatnonzero(self.kinds == KINDS.index(kind))


_FLOATS = (
    ("normal_x", "unit normal"),
    ("normal_y", "unit normal"),
    ("normal_z", "unit normal"),
    ("offset_m", "normal . x, building frame"),
    ("p0_x_m", "start of a vertical segment's plan line"),
    ("p0_y_m", "start of a vertical segment's plan line"),
    ("p1_x_m", "end of a vertical segment's plan line"),
    ("p1_y_m", "end of a vertical segment's plan line"),
    ("low_m", "lowest inlier"),
    ("high_m", "highest inlier"),
    ("area_m2", "area of the concave hull"),
    ("rms_m", "root mean square distance of the inliers"),
    ("raster_a_m", "start of the raster along its first axis"),
    ("raster_b_m", "start of the raster along its second axis"),
)
SCHEMA = schema(
    "segments",
    [
        column("kind", pa.string(), "vertical, horizontal or clutter (Eq. 5)"),
        column("side_known", pa.bool_(), "the normal points to where the sensor was"),
        column("inliers", pa.int64(), "points"),
        *(column(name, pa.float64(), about) for name, about in _FLOATS),
        column("raster_rows", pa.int32(), "cells along the first axis"),
        column("raster_columns", pa.int32(), "cells along the second axis"),
        column("raster", pa.binary(), "packed bits, row by row: which cells hold inliers"),
        column("hull", pa.binary(), "WKB polygon: (along, height) or (x, y)"),
    ],
)


def to_table(segments: Segments) -> pa.Table:
    """Return one row per segment."""
    numbers = np.column_stack(
        [
            segments.normals,
            segments.offsets,
            segments.lines.reshape(-1, 4),
            segments.heights,
            segments.areas,
            segments.rms,
            np.array([r.start for r in segments.rasters], float).reshape(-1, 2),
        ]
    )
    shapes = np.array([r.cells.shape for r in segments.rasters], np.int32).reshape(-1, 2)
    columns = [
        pa.array([KINDS[k] for k in segments.kinds], pa.string()),
        pa.array(segments.side_known),
        pa.array(segments.inliers),
        *(pa.array(numbers[:, i]) for i in range(len(_FLOATS))),
        pa.array(shapes[:, 0]),
        pa.array(shapes[:, 1]),
        pa.array([np.packbits(r.cells).tobytes() for r in segments.rasters], pa.binary()),
        pa.array(segments.hulls, pa.binary()),
    ]
    metadata = SCHEMA.metadata | {b"mapsense.cell_m": repr(segments.cell_m).encode()}
    return pa.table(columns, schema=SCHEMA.with_metadata(metadata))


def from_table(table: pa.Table) -> Segments:
    """Return the segments a table holds."""
    numbers = {name: table[name].to_numpy() for name, _ in _FLOATS}

    def stack(*names: str) -> NDArray[np.float64]:
        return np.stack([numbers[n] for n in names], axis=1)

    starts = stack("raster_a_m", "raster_b_m")
    shapes = zip(table["raster_rows"].to_pylist(), table["raster_columns"].to_pylist(), strict=True)
    rasters = [
        Raster((float(a), float(b)), _unpack(bits, shape))
        for (a, b), shape, bits in zip(starts, shapes, table["raster"].to_pylist(), strict=True)
    ]
    return Segments(
        cell_m=float(table.schema.metadata[b"mapsense.cell_m"]),
        kinds=np.array([KINDS.index(k) for k in table["kind"].to_pylist()], np.int8),
        normals=stack("normal_x", "normal_y", "normal_z"),
        offsets=numbers["offset_m"],
        side_known=table["side_known"].to_numpy(),
        lines=stack("p0_x_m", "p0_y_m", "p1_x_m", "p1_y_m").reshape(-1, 2, 2),
        heights=stack("low_m", "high_m"),
        areas=numbers["area_m2"],
        inliers=table["inliers"].to_numpy(),
        rms=numbers["rms_m"],
        hulls=tuple(table["hull"].to_pylist()),
        rasters=tuple(rasters),
    )


def _unpack(bits: bytes, shape: tuple[int, int]) -> NDArray[np.bool_]:
    count = shape[0] * shape[1]
    return np.unpackbits(np.frombuffer(bits, np.uint8), count=count).astype(bool).reshape(shape)


SEGMENTS = register(Kind("segments", Segments, SCHEMA, to_table, from_table))
