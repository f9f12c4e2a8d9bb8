"""The saving under other assumptions than those the energy model makes."""

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from storage.artifacts import Kind, column, register, schema
from storage.columns import from_columns, to_columns


@dataclass(frozen=True, eq=False)
class EnergySweep:
    """r savings; entry i is one in every array. All that is not named is as assumed. Simulated."""

    storeys: NDArray[np.str_]
    """(r,)"""
    baselines: NDArray[np.str_]
    """(r,), one of BASELINES"""
    first: NDArray[np.str_]
    """(r,), the assumption that is varied"""
    first_values: NDArray[np.float64]
    """(r,), its value, in the unit its name ends with"""
    second: NDArray[np.str_]
    """(r,), one that is varied with it; '' if none"""
    second_values: NDArray[np.float64]
    """(r,), its value; NaN if none"""
    savings: NDArray[np.float64]
    """(r,), share saved with one query per room, mean over the seeds"""

    def __len__(self) -> int:
        return len(self.baselines)


_COLUMNS = {
    "storeys": column("storey", pa.string(), "storey whose rooms were asked for"),
    "baselines": column("baseline", pa.string(), "GraMap or No Processing"),
    "first": column("first", pa.string(), "assumption varied; its unit ends its name"),
    "first_values": column("first_value", pa.float64(), "its value"),
    "second": column("second", pa.string(), "assumption varied with it; '' if none"),
    "second_values": column("second_value", pa.float64(), "its value", nullable=True),
    "savings": column("saving", pa.float64(), "share saved, one query a room", nullable=True),
}
SCHEMA = schema("energy_sweep", list(_COLUMNS.values()), **{"mapsense.origin": "simulated"})


def to_table(sweep: EnergySweep) -> pa.Table:
    """Return one row per saving."""
    return to_columns(sweep, _COLUMNS, SCHEMA)


def from_table(table: pa.Table) -> EnergySweep:
    """Return the sweep a table holds."""
    return EnergySweep(**from_columns(table, _COLUMNS))


ENERGY_SWEEP = register(Kind("energy_sweep", EnergySweep, SCHEMA, to_table, from_table))
