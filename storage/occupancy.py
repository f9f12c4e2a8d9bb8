"""Which cubes of space hold points: what a scan saw, planes or not."""

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from storage.artifacts import Kind, column, register, schema


@dataclass(frozen=True, eq=False)
class Occupancy:
    """k occupied cubes of one scan, building frame.

    Cube (x, y, z) covers [x cell_m, (x + 1) cell_m) and likewise along y and z.
    """

    cubes: NDArray[np.int32]
    """(k, 3), in the order of x, then y, then z, each once"""
    cell_m: float

    def __len__(self) -> int:
        return len(self.cubes)


SCHEMA = schema(
    "occupancy",
    [
        column("cube_x", pa.int32(), "times the cell size in the metadata"),
        column("cube_y", pa.int32(), "times the cell size in the metadata"),
        column("cube_z", pa.int32(), "times the cell size in the metadata"),
    ],
)


def to_table(occupancy: Occupancy) -> pa.Table:
    """Return one row per cube."""
    columns = [pa.array(occupancy.cubes[:, axis]) for axis in range(3)]
    about = {b"mapsense.cell_m": repr(float(occupancy.cell_m)).encode()}
    return pa.table(columns, schema=SCHEMA.with_metadata(SCHEMA.metadata | about))


def from_table(table: pa.Table) -> Occupancy:
    """Return the cubes a table holds."""
    names = ("cube_x", "cube_y", "cube_z")
    return Occupancy(
        np.stack([table[n].to_numpy() for n in names], axis=1),
        float(table.schema.metadata[b"mapsense.cell_m"]),
    )


OCCUPANCY = register(Kind("occupancy", Occupancy, SCHEMA, to_table, from_table))
