"""The compressed cloud of one scan, as it goes on the air."""

from dataclasses import dataclass

import pyarrow as pa

from storage.artifacts import Kind, column, register, schema


@dataclass(frozen=True)
class Stream:
    """A self-describing octree stream, and what its header says."""

    data: bytes
    """header, payload and checksum: all of what is sent"""
    profile: str
    """low, medium, high; other for a leaf size of no profile"""
    leaf_m: float
    """edge of a leaf, metres"""
    points: int
    """points that were encoded"""
    cells: int
    """leaves, which are the points it decodes to"""


SCHEMA = schema(
    "streams",
    [
        column("profile", pa.string(), "resolution profile of the codec"),
        column("leaf_m", pa.float64(), "edge of a leaf"),
        column("points", pa.int64(), "points encoded"),
        column("cells", pa.int64(), "occupied leaves: the points it decodes to"),
        column("bytes", pa.int64(), "length of the stream"),
        column("data", pa.large_binary(), "the stream: header, payload, checksum"),
    ],
)


def to_table(stream: Stream) -> pa.Table:
    """Return one row."""
    row = {
        "profile": stream.profile,
        "leaf_m": stream.leaf_m,
        "points": stream.points,
        "cells": stream.cells,
        "bytes": len(stream.data),
        "data": stream.data,
    }
    return pa.Table.from_pylist([row], schema=SCHEMA)


def from_table(table: pa.Table) -> Stream:
    """Return the stream a table holds."""
    (row,) = table.to_pylist()
    del row["bytes"]
    return Stream(**row)


STREAMS = register(
    Kind(
        "streams",
        Stream,
        SCHEMA,
        to_table,
        from_table,
        # entropy coded already: compressing again costs time and gains nothing
        write_options={"compression": "none", "use_dictionary": False},
    )
)
