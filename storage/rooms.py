"""The rooms of a storey's initial model."""

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import shapely
from numpy.typing import NDArray

from storage.artifacts import Kind, column, register, schema
from storage.geo import with_geometry


@dataclass(frozen=True, eq=False)
class Rooms:
    """n rooms; entry i is one room everywhere. Building frame, metres."""

    polygons: NDArray[np.object_]
    """(n,), shapely polygons of the inner wall faces, counter-clockwise"""
    floor_m: NDArray[np.float64]
    """(n,), NaN where no floor was seen"""
    ceiling_m: NDArray[np.float64]
    """(n,), NaN where no ceiling was seen"""
    seen: NDArray[np.float64]
    """(n,), share of the area in which floor or ceiling was seen"""
    walled: NDArray[np.float64]
    """(n,), share of the outline along which a wall was seen"""
    scans: tuple[tuple[int, ...], ...]
    """the scans that saw each room, by their place in the storey's list"""

    def __len__(self) -> int:
        return len(self.polygons)


SCHEMA = with_geometry(
    schema(
        "rooms",
        [
            column("room", pa.int32(), "number of the room"),
            column("area_m2", pa.float64(), "area within the inner wall faces"),
            column("floor_m", pa.float64(), "height of the floor", nullable=True),
            column("ceiling_m", pa.float64(), "height of the ceiling", nullable=True),
            column("seen_share", pa.float64(), "share of the area whose floor or ceiling was seen"),
            column("walled_share", pa.float64(), "share of the outline where a wall was seen"),
            column("scans", pa.list_(pa.int32()), "scans that saw it, by place in the storey"),
            column("geometry", pa.binary(), "WKB polygon"),
        ],
    ),
    "geometry",
    "Polygon",
)


def to_table(rooms: Rooms) -> pa.Table:
    """Return one row per room."""
    return pa.table(
        [
            pa.array(np.arange(len(rooms), dtype=np.int32)),
            pa.array(shapely.area(rooms.polygons)),
            pa.array(rooms.floor_m, from_pandas=True),
            pa.array(rooms.ceiling_m, from_pandas=True),
            pa.array(rooms.seen),
            pa.array(rooms.walled),
            pa.array([list(s) for s in rooms.scans], pa.list_(pa.int32())),
            pa.array(shapely.to_wkb(rooms.polygons), pa.binary()),
        ],
        schema=SCHEMA,
    )


def from_table(table: pa.Table) -> Rooms:
    """Return the rooms a table holds."""
    return Rooms(
        polygons=shapely.from_wkb(np.array(table["geometry"].to_pylist(), object)),
        floor_m=table["floor_m"].to_numpy().astype(float),
        ceiling_m=table["ceiling_m"].to_numpy().astype(float),
        seen=table["seen_share"].to_numpy(),
        walled=table["walled_share"].to_numpy(),
        scans=tuple(tuple(s) for s in table["scans"].to_pylist()),
    )


ROOMS = register(Kind("rooms", Rooms, SCHEMA, to_table, from_table))
