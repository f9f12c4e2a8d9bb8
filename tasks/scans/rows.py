"""Rows of numbers in text, a block at a time: shared by XYZ, ASCII PLY and 3DTK files."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from pyarrow import csv

from storage.errors import InputError

BLOCK = 1 << 24
"""Bytes of text parsed at a time; parsing needs about ten times as much for a moment."""

_LONGEST_LINE = 1 << 26
_COMMENT = re.compile(rb"(?:#|//)[^\n]*")
_SPACES = bytes.maketrans(b",;\t", b"   ")
_DECIMAL_COMMAS = bytes.maketrans(b",;\t", b".  ")


@dataclass(frozen=True)
class Block:
    """Whole lines of a file."""

    text: bytes
    first_line: int
    """number of its first line in the file, from 1"""


def blocks(file: BinaryIO, first_line: int = 1, size: int = BLOCK) -> Iterator[Block]:
    """Yield the rest of a file as blocks that end with a line end."""
    rest = b""
    while data := file.read(size):
        data = rest + data
        cut = data.rfind(b"\n") + 1
        if not cut and len(data) > _LONGEST_LINE:  # no text of points; its columns will be wrong
            cut = len(data)
        rest = data[cut:]
        if cut:
            yield Block(data[:cut], first_line)
            first_line += data.count(b"\n", 0, cut)
    if rest:
        yield Block(rest + b"\n", first_line)


def without_comments(text: bytes) -> bytes:
    """Return the text with `#` and `//` comments blanked and its lines kept."""
    return _COMMENT.sub(b"", text) if b"#" in text or b"//" in text else text


def with_spaces(text: bytes, decimal_commas: bool = False) -> bytes:
    """Return the text with every separator a space, and empty fields as nan."""
    if decimal_commas:
        return text.translate(_DECIMAL_COMMAS)
    for separator in (b",", b";"):
        while (empty := separator * 2) in text:
            text = text.replace(empty, separator + b"nan" + separator)
    return text.translate(_SPACES)


def parse(
    path: Path, block: Block, n_columns: int, wanted: tuple[int, int, int], limit: int | None = None
) -> NDArray[np.float64]:
    """Return columns `wanted` of the block's rows.

    Parameters
    ----------
    path : Path
        The file, named in errors.
    block : Block
        Text without comments, separated by white space.
    n_columns : int
        Columns every row must have.
    wanted : (3,) int
        Columns to return.
    limit : int, optional
        Read at most so many rows, whatever follows them.

    Returns
    -------
    (m, 3) float
    """
    text, lines, counts = _rows_of(block.text, limit)
    wrong = np.flatnonzero(counts != n_columns)
    if len(wrong):
        line = block.first_line + int(lines[wrong[0]])
        raise InputError(
            path,
            f"line {line} has {counts[wrong[0]]} columns, expected {n_columns}",
            "give every line the same columns, or export the file again",
        )
    table = _columns(text, n_columns, wanted)
    if table is not None and len(table) == len(lines):
        return table
    return _numbers(path, text, block.first_line, n_columns, wanted)


def _rows_of(text: bytes, limit: int | None) -> tuple[bytes, NDArray[np.int64], NDArray[np.uint16]]:
    """Return the text of the first rows, each row's line (from 0) and number of columns."""
    characters = np.frombuffer(text, np.uint8)
    starts = characters > 32  # white space and control characters separate
    starts[1:] &= ~starts[:-1].copy()
    ends = np.flatnonzero(characters == 10)
    begins = np.concatenate(([0], ends[:-1] + 1))
    counts = np.add.reduceat(starts, begins, dtype=np.uint16)
    lines = np.flatnonzero(counts)[:limit]
    if limit is not None and len(lines) == limit and limit > 0:
        text = text[: ends[lines[-1]] + 1]
    return text, lines, counts[lines]


def _columns(
    text: bytes, n_columns: int, wanted: tuple[int, int, int]
) -> NDArray[np.float64] | None:
    """Return the wanted columns of rows with single blanks between numbers, None of any others.

    Arrow parses several times faster than NumPy, on all cores and only what is wanted.
    """
    names = [str(column) for column in range(n_columns)]
    chosen = [names[column] for column in wanted]
    try:
        table = csv.read_csv(
            pa.BufferReader(text),
            csv.ReadOptions(column_names=names),
            csv.ParseOptions(delimiter=" ", quote_char=False),
            csv.ConvertOptions(
                column_types=dict.fromkeys(chosen, pa.float64()),
                include_columns=chosen,
                null_values=[],
            ),
        )
    except pa.ArrowInvalid:
        return None
    return np.stack([table[name].to_numpy() for name in chosen], axis=1)


def _numbers(
    path: Path, text: bytes, first_line: int, n_columns: int, wanted: tuple[int, int, int]
) -> NDArray[np.float64]:
    try:
        table = np.fromstring(text, sep=" ").reshape(-1, n_columns)
    except ValueError:  # a word among the numbers: it may stand in a column nobody wants
        return _numbers_among_words(path, text, first_line, wanted)
    return table[:, wanted]


def _numbers_among_words(
    path: Path, text: bytes, first_line: int, wanted: tuple[int, int, int]
) -> NDArray[np.float64]:
    rows = []
    for number, line in enumerate(text.split(b"\n"), first_line):
        if fields := line.split():
            try:
                rows.append([float(fields[column]) for column in wanted])
            except (ValueError, IndexError) as error:
                shown = b" ".join(fields).decode("ascii", "replace")
                raise InputError(
                    path,
                    f"line {number} holds no coordinates ('{shown[:60]}')",
                    "remove the line or start it with '#'",
                ) from error
    return np.array(rows, float).reshape(-1, 3)
