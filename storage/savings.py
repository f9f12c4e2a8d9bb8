"""How much less energy MapSense takes than a baseline, with its interval over the seeds."""

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from storage.artifacts import Kind, column, register, schema
from storage.columns import from_columns, to_columns


@dataclass(frozen=True, eq=False)
class Savings:
    """r savings; entry i is one in every array. Shares of the baseline's energy, simulated."""

    series: NDArray[np.str_]
    """(r,), as in `Energy`"""
    storeys: NDArray[np.str_]
    """(r,)"""
    n_queries: NDArray[np.int64]
    """(r,)"""
    baselines: NDArray[np.str_]
    """(r,), one of BASELINES"""
    n_seeds: NDArray[np.int64]
    """(r,), seeds averaged over"""
    savings: NDArray[np.float64]
    """(r,), mean over the seeds of 1 - E_MapSense / E_baseline; NaN if a baseline took nothing"""
    low: NDArray[np.float64]
    """(r,), lower end of the 95 % interval of that mean; NaN for fewer than two seeds"""
    high: NDArray[np.float64]
    """(r,), upper end"""
    unanswered: NDArray[np.float64]
    """(r,), queries MapSense gave up, mean over the seeds: a saving by not answering is none"""
    baseline_unanswered: NDArray[np.float64]
    """(r,), queries the baseline gave up"""

    def __len__(self) -> int:
        return len(self.baselines)


_COLUMNS = {
    "series": column("series", pa.string(), "queries (Fig. 19a) or storey (Fig. 19b)"),
    "storeys": column("storey", pa.string(), "storey whose rooms were asked for"),
    "n_queries": column("n_queries", pa.int64(), "sensing queries accumulated"),
    "baselines": column("baseline", pa.string(), "GraMap or No Processing"),
    "n_seeds": column("n_seeds", pa.int64(), "seeds averaged over"),
    "savings": column("saving", pa.float64(), "share saved, mean over seeds", nullable=True),
    "low": column("saving_low95", pa.float64(), "lower end, 95 % interval", nullable=True),
    "high": column("saving_high95", pa.float64(), "upper end, 95 % interval", nullable=True),
    "unanswered": column("unanswered", pa.float64(), "queries MapSense gave up, mean"),
    "baseline_unanswered": column(
        "baseline_unanswered", pa.float64(), "queries the baseline gave up, mean"
    ),
}
SCHEMA = schema("savings", list(_COLUMNS.values()), **{"mapsense.origin": "simulated"})


def to_table(savings: Savings) -> pa.Table:
    """Return one row per saving."""
    return to_columns(savings, _COLUMNS, SCHEMA)


def from_table(table: pa.Table) -> Savings:
    """Return the savings a table holds."""
    return Savings(**from_columns(table, _COLUMNS))


SAVINGS = register(Kind("savings", Savings, SCHEMA, to_table, from_table))
