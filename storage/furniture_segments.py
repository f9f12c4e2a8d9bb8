"""What may be furniture: level segments, their hulls, boxes and features."""

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import shapely
from numpy.typing import NDArray

from storage.artifacts import Kind, column, register, schema
from storage.geo import with_geometry


@dataclass(frozen=True, eq=False)
class FurnitureSegments:
    """n segments; entry i is one possible piece everywhere. Building frame, metres."""

    names: tuple[str, ...]
    """of the features"""
    features: NDArray[np.float64]
    """(n, k), NaN where one is unknown"""
    footprints: NDArray[np.object_]
    """(n,), shapely polygons: oriented boxes of the whole pieces"""
    hulls: NDArray[np.object_]
    """(n,), shapely polygons: concave hulls of what was seen"""
    surface_m: NDArray[np.float64]
    """(n,), height of the level surface"""
    top_m: NDArray[np.float64]
    """(n,), height of the highest part"""
    base_m: NDArray[np.float64]
    """(n,), height at which it begins: the floor's, or that of the table it stands on"""
    rooms: NDArray[np.int32]
    """(n,), row of Rooms"""

    def __len__(self) -> int:
        return len(self.footprints)


SCHEMA = with_geometry(
    schema(
        "furniture_segments",
        [
            column("surface_m", pa.float64(), "height of the level surface"),
            column("top_m", pa.float64(), "height of the highest part"),
            column("base_m", pa.float64(), "height at which it begins"),
            column("room", pa.int32(), "number of its room"),
            column("features", pa.list_(pa.float64()), "in the order the metadata names them"),
            column("hull", pa.binary(), "WKB polygon: concave hull of what was seen"),
            column("geometry", pa.binary(), "WKB polygon: box of the whole piece"),
        ],
    ),
    "geometry",
    "Polygon",
)


def to_table(segments: FurnitureSegments) -> pa.Table:
    """Return one row per segment."""
    metadata = SCHEMA.metadata | {b"mapsense.features": ",".join(segments.names).encode()}
    return pa.table(
        [
            pa.array(segments.surface_m, pa.float64()),
            pa.array(segments.top_m, pa.float64()),
            pa.array(segments.base_m, pa.float64()),
            pa.array(segments.rooms, pa.int32()),
            pa.array(list(segments.features), pa.list_(pa.float64())),
            pa.array(shapely.to_wkb(segments.hulls), pa.binary()),
            pa.array(shapely.to_wkb(segments.footprints), pa.binary()),
        ],
        schema=SCHEMA.with_metadata(metadata),
    )


def from_table(table: pa.Table) -> FurnitureSegments:
    """Return the segments a table holds."""
    names = tuple(table.schema.metadata[b"mapsense.features"].decode().split(","))
    rows = table["features"].to_pylist()
    return FurnitureSegments(
        names=names,
        features=np.array(rows, float).reshape(len(rows), len(names)),
        footprints=shapely.from_wkb(np.array(table["geometry"].to_pylist(), object)),
        hulls=shapely.from_wkb(np.array(table["hull"].to_pylist(), object)),
        surface_m=table["surface_m"].to_numpy(),
        top_m=table["top_m"].to_numpy(),
        base_m=table["base_m"].to_numpy(),
        rooms=table["room"].to_numpy(),
    )


FURNITURE_SEGMENTS = register(
    Kind("furniture_segments", FurnitureSegments, SCHEMA, to_table, from_table)
)
