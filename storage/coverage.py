"""Where a storey was seen from inside, its floor and ceiling, and by which scans."""

import json
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from storage.artifacts import Kind, column, register, schema


@dataclass(frozen=True, eq=False)
class Coverage:
    """k plan cells in which floor, ceiling or furniture was seen; entry i is one everywhere.

    Cell (x, y) covers [x cell_m, (x + 1) cell_m) and likewise along y, building frame.
    """

    cells: NDArray[np.int32]
    """(k, 2)"""
    floor_m: NDArray[np.float64]
    """(k,), height of the floor there; NaN where it was not seen"""
    ceiling_m: NDArray[np.float64]
    """(k,), height of the ceiling there; NaN where it was not seen"""
    scans: NDArray[np.int64]
    """(k,), number of scans that saw the cell"""
    seen_by: NDArray[np.int32]
    """(scans.sum(),), the scans that saw cell 0, then those that saw cell 1, ...: each scan by
    its place in the storey's list"""
    cell_m: float
    floor_level_m: float | None
    """the storey's floor; None if no scan saw one"""
    ceiling_level_m: float | None
    """the storey's ceiling; None if no scan saw one"""

    def __len__(self) -> int:
        return len(self.cells)

    def centres(self) -> NDArray[np.float64]:
        """Return the cells' centres, (k, 2), metres."""
        return (self.cells.astype(np.float64) + 0.5) * self.cell_m


SCHEMA = schema(
    "coverage",
    [
        column("cell_x", pa.int32(), "plan cell, times the cell size in the metadata"),
        column("cell_y", pa.int32(), "plan cell, times the cell size in the metadata"),
        column("floor_m", pa.float64(), "height of the floor, null if not seen", nullable=True),
        column("ceiling_m", pa.float64(), "height of the ceiling, null if not seen", nullable=True),
        column("scans", pa.list_(pa.int32()), "scans that saw the cell, by place in the storey"),
    ],
)


def to_table(coverage: Coverage) -> pa.Table:
    """Return one row per cell."""
    about = {
        "cell_m": coverage.cell_m,
        "floor_level_m": coverage.floor_level_m,
        "ceiling_level_m": coverage.ceiling_level_m,
    }
    metadata = SCHEMA.metadata | {b"mapsense.coverage": json.dumps(about).encode()}
    return pa.table(
        [
            pa.array(coverage.cells[:, 0]),
            pa.array(coverage.cells[:, 1]),
            pa.array(coverage.floor_m, from_pandas=True),
            pa.array(coverage.ceiling_m, from_pandas=True),
            _lists(coverage.scans, coverage.seen_by),
        ],
        schema=SCHEMA.with_metadata(metadata),
    )


def _lists(counts: NDArray[np.int64], flat: NDArray[np.int32]) -> pa.Array:
    offsets = np.concatenate(([0], np.cumsum(counts))).astype(np.int32)
    return pa.ListArray.from_arrays(offsets, pa.array(flat.astype(np.int32)))


def from_table(table: pa.Table) -> Coverage:
    """Return the coverage a table holds."""
    about = json.loads(table.schema.metadata[b"mapsense.coverage"])
    return Coverage(
        cells=np.stack([table["cell_x"].to_numpy(), table["cell_y"].to_numpy()], axis=1),
        floor_m=table["floor_m"].to_numpy(),
        ceiling_m=table["ceiling_m"].to_numpy(),
        scans=pc.list_value_length(table["scans"]).to_numpy().astype(np.int64),
        seen_by=pc.list_flatten(table["scans"]).to_numpy(),
        **about,
    )


COVERAGE = register(Kind("coverage", Coverage, SCHEMA, to_table, from_table))
