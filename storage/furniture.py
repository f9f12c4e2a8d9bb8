"""The furniture of a storey: oriented boxes with a class."""

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import shapely
from numpy.typing import NDArray

from storage.artifacts import Kind, column, register, schema
from storage.geo import with_geometry

CLASSES = ("table", "chair", "other")


@dataclass(frozen=True, eq=False)
class Furniture:
    """n pieces; entry i is one piece everywhere. Building frame, metres."""

    footprints: NDArray[np.object_]
    """(n,), shapely polygons: rectangles in any direction"""
    classes: NDArray[np.str_]
    """(n,), of CLASSES"""
    base_m: NDArray[np.float64]
    """(n,), where it begins: the floor, but for what hangs on a wall"""
    top_m: NDArray[np.float64]
    """(n,), its highest part: a chair's back, not its seat"""
    rooms: NDArray[np.int32]
    """(n,), row of Rooms"""
    confidences: NDArray[np.float64]
    """(n,), 0..1, of there being such a piece"""

    def __len__(self) -> int:
        return len(self.footprints)


SCHEMA = with_geometry(
    schema(
        "furniture",
        [
            column("furniture", pa.int32(), "number of the piece"),
            column("class", pa.string(), "table, chair or other"),
            column("base_m", pa.float64(), "where it begins"),
            column("top_m", pa.float64(), "its highest part"),
            column("room", pa.int32(), "number of its room"),
            column("confidence", pa.float64(), "of there being such a piece, 0..1"),
            column("geometry", pa.binary(), "WKB polygon: its footprint"),
        ],
    ),
    "geometry",
    "Polygon",
)


def none() -> Furniture:
    """Return no furniture."""
    return Furniture(
        np.empty(0, object),
        np.empty(0, "U5"),
        np.empty(0),
        np.empty(0),
        np.empty(0, np.int32),
        np.empty(0),
    )


def to_table(furniture: Furniture) -> pa.Table:
    """Return one row per piece."""
    return pa.table(
        [
            pa.array(np.arange(len(furniture), dtype=np.int32)),
            pa.array(furniture.classes.tolist(), pa.string()),
            pa.array(furniture.base_m, pa.float64()),
            pa.array(furniture.top_m, pa.float64()),
            pa.array(furniture.rooms, pa.int32()),
            pa.array(furniture.confidences, pa.float64()),
            pa.array(shapely.to_wkb(furniture.footprints), pa.binary()),
        ],
        schema=SCHEMA,
    )


def from_table(table: pa.Table) -> Furniture:
    """Return the furniture a table holds."""
    return Furniture(
        footprints=shapely.from_wkb(np.array(table["geometry"].to_pylist(), object)),
        classes=np.array(table["class"].to_pylist(), "U5"),
        base_m=table["base_m"].to_numpy(),
        top_m=table["top_m"].to_numpy(),
        rooms=table["room"].to_numpy(),
        confidences=table["confidence"].to_numpy(),
    )


FURNITURE = register(Kind("furniture", Furniture, SCHEMA, to_table, from_table))
