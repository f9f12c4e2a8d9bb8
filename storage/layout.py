"""Which rooms stand along each reference line, as decoded by the grammar: best and runners-up."""

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from storage.artifacts import Kind, column, register, schema
from storage.columns import from_columns, to_columns

HIDDEN, LINE_END = -1, -2
"""What a boundary is that is no observed cut: a wall nobody saw, or the end of the line."""


@dataclass(frozen=True, eq=False)
class Layout:
    """n decoded rooms; entry i is one room in every array.

    Rows run line by line, within a line hypothesis by hypothesis, within one from start to end:
    the rooms of a hypothesis fill the line. Positions are metres along the line from its start.
    """

    line_ids: NDArray[np.str_]
    """(n,), reference line"""
    hypotheses: NDArray[np.int64]
    """(n,), 0 the most probable sequence of the line, 1 the next, ..."""
    orders: NDArray[np.int64]
    """(n,), place of the room in its sequence, from 0"""
    from_m: NDArray[np.float64]
    """(n,), axis of the wall it begins at"""
    to_m: NDArray[np.float64]
    """(n,), axis of the wall it ends at"""
    from_cuts: NDArray[np.int64]
    """(n,), which of the line's observed cuts that wall is, from 0; HIDDEN or LINE_END"""
    to_cuts: NDArray[np.int64]
    """(n,), the same of the wall at its end"""
    classes: NDArray[np.str_]
    """(n,), class of the room; '' unexplained"""
    rules: NDArray[np.str_]
    """(n,), id of the rule; '' unexplained"""
    parts: NDArray[np.int64]
    """(n,), place of the room in its rule's unit, from 0"""
    widths_m: NDArray[np.float64]
    """(n,), width that the rule gives the room; NaN unexplained"""
    spreads_m: NDArray[np.float64]
    """(n,), standard deviation of that width; NaN unexplained"""
    posteriors: NDArray[np.float64]
    """(n,), probability, given all of the line's observations, of a room of this class here"""
    from_posteriors: NDArray[np.float64]
    """(n,), the same that a wall stands where the room begins, whatever rooms are beside it; 1 for
    the line's end. A decoder that takes every observed wall for one says what is observed of it"""
    to_posteriors: NDArray[np.float64]
    """(n,), the same of where it ends"""
    undivided: NDArray[np.float64]
    """(n,), the same that an observed wall within the room divides nothing, of the wall of which
    that is least probable; 1 without any"""
    gains: NDArray[np.float64]
    """(n,), logarithm of how much more probable the line's observations are by the grammar than if
    all observed walls divided rooms of any kind; the same for all rooms of a line"""
    log_p: NDArray[np.float64]
    """(n,), log probability of the hypothesis and the observations together, up to a constant of
    the line; -inf where no sequence of rules has a probability"""

    def __len__(self) -> int:
        return len(self.line_ids)

    @property
    def explained(self) -> NDArray[np.bool_]:
        """(n,), whether a rule explains the room."""
        return self.rules != ""


_COLUMNS = {
    "line_ids": column("line", pa.string(), "reference line"),
    "hypotheses": column("hypothesis", pa.int64(), "0: the most probable sequence of the line"),
    "orders": column("order", pa.int64(), "place in the sequence"),
    "from_m": column("from_m", pa.float64(), "axis of the wall it begins at, along the line"),
    "to_m": column("to_m", pa.float64(), "axis of the wall it ends at, along the line"),
    "from_cuts": column("from_cut", pa.int64(), "observed wall there; -1 hidden, -2 line's end"),
    "to_cuts": column("to_cut", pa.int64(), "observed wall there; -1 hidden, -2 line's end"),
    "classes": column("class", pa.string(), "null: unexplained", nullable=True),
    "rules": column("rule", pa.string(), "null: unexplained", nullable=True),
    "parts": column("part", pa.int64(), "place in the rule's unit"),
    "widths_m": column("width_m", pa.float64(), "by the rule; null: unexplained", nullable=True),
    "spreads_m": column("spread_m", pa.float64(), "deviation of that width", nullable=True),
    "posteriors": column("posterior", pa.float64(), "probability of a room of this class here"),
    "from_posteriors": column("from_posterior", pa.float64(), "probability of a wall there"),
    "to_posteriors": column("to_posterior", pa.float64(), "probability of a wall there"),
    "undivided": column("undivided", pa.float64(), "probability that no wall seen within divides"),
    "gains": column("gain", pa.float64(), "log odds of the grammar against none, of the line"),
    "log_p": column("log_p", pa.float64(), "of the hypothesis and the observations"),
}
SCHEMA = schema("layout", list(_COLUMNS.values()))
_TEXTS = ("class", "rule")


def to_table(layout: Layout) -> pa.Table:
    """Return one row per decoded room."""
    table = to_columns(layout, _COLUMNS, SCHEMA)
    for name in _TEXTS:
        texts = [text or None for text in table[name].to_pylist()]
        table = _with(table, name, pa.array(texts, pa.string()))
    return table


def from_table(table: pa.Table) -> Layout:
    """Return the rooms a table holds."""
    for name in _TEXTS:
        table = _with(table, name, table[name].fill_null(""))
    return Layout(**from_columns(table, _COLUMNS))


def _with(table: pa.Table, name: str, values: pa.Array | pa.ChunkedArray) -> pa.Table:
    return table.set_column(table.schema.get_field_index(name), table.schema.field(name), values)


LAYOUT = register(Kind("layout", Layout, SCHEMA, to_table, from_table))
