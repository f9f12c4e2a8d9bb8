"""What an assumption would have to be for a wanted saving."""

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from storage.artifacts import Kind, column, register, schema
from storage.columns import from_columns, to_columns


@dataclass(frozen=True, eq=False)
class EnergyTargets:
    """r answers; entry i is one in every array. Simulated."""

    storeys: NDArray[np.str_]
    """(r,)"""
    baselines: NDArray[np.str_]
    """(r,), one of BASELINES"""
    targets: NDArray[np.float64]
    """(r,), the saving wanted, with one query per room"""
    savings: NDArray[np.float64]
    """(r,), the saving as assumed"""
    levers: NDArray[np.str_]
    """(r,), the assumption that is moved; the rest stays"""
    present: NDArray[np.float64]
    """(r,), its value as assumed, in the unit its name ends with"""
    needed: NDArray[np.float64]
    """(r,), the value nearest to that which brings the saving; NaN if none in the range does"""
    best_values: NDArray[np.float64]
    """(r,), the value of the range that saves most"""
    best_savings: NDArray[np.float64]
    """(r,), what it saves"""

    def __len__(self) -> int:
        return len(self.baselines)


_COLUMNS = {
    "storeys": column("storey", pa.string(), "storey whose rooms were asked for"),
    "baselines": column("baseline", pa.string(), "GraMap or No Processing"),
    "targets": column("target", pa.float64(), "share to be saved, one query a room"),
    "savings": column("saving", pa.float64(), "share saved as assumed", nullable=True),
    "levers": column("lever", pa.string(), "assumption moved; its unit ends its name"),
    "present": column("present", pa.float64(), "its value as assumed"),
    "needed": column("needed", pa.float64(), "value that reaches the target", nullable=True),
    "best_values": column("best_value", pa.float64(), "value that saves most", nullable=True),
    "best_savings": column("best_saving", pa.float64(), "what it saves", nullable=True),
}
SCHEMA = schema("energy_targets", list(_COLUMNS.values()), **{"mapsense.origin": "simulated"})


def to_table(targets: EnergyTargets) -> pa.Table:
    """Return one row per answer."""
    return to_columns(targets, _COLUMNS, SCHEMA)


def from_table(table: pa.Table) -> EnergyTargets:
    """Return the answers a table holds."""
    return EnergyTargets(**from_columns(table, _COLUMNS))


ENERGY_TARGETS = register(Kind("energy_targets", EnergyTargets, SCHEMA, to_table, from_table))
