"""Stored things that are nothing but columns: one array per field, one field per column."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray


def to_columns(value: Any, columns: Mapping[str, pa.Field], schema: pa.Schema) -> pa.Table:
    """Return the table of a dataclass of arrays; NaN becomes null in a nullable column.

    Parameters
    ----------
    columns : the column of each field of `value`, in the order of `schema`
    """
    arrays = [
        pa.array(getattr(value, name), field.type, from_pandas=field.nullable)
        for name, field in columns.items()
    ]
    return pa.table(arrays, schema=schema)


def from_columns(table: pa.Table, columns: Mapping[str, pa.Field]) -> dict[str, NDArray[Any]]:
    """Return the arrays of a table by field; text as numpy's, null numbers as NaN."""
    return {name: _array(table[field.name]) for name, field in columns.items()}


def _array(chunks: pa.ChunkedArray) -> NDArray[Any]:
    if pa.types.is_string(chunks.type):
        return np.array(chunks.to_pylist(), np.str_)
    return chunks.to_numpy()
