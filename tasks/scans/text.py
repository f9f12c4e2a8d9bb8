"""Clouds as text: XYZ, TXT, CSV, ASC and PTS files."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from storage.errors import InputError
from tasks.scans.raw import Chunk, RawCloud, compact, size_of
from tasks.scans.rows import Block, blocks, parse, with_spaces, without_comments

_HEAD = 1 << 16
_NAMES = re.compile(r"(?:coord(?:inate)?_?)?([xyz])(?:_?(?:m|mm|cm|coord(?:inate)?))?")
_DECIMAL_COMMA = re.compile(rb"[+-]?\d+,\d+(?:[eE][+-]?\d+)?")
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"


@dataclass(frozen=True)
class Layout:
    """How a text file's rows are laid out."""

    skip: int
    """lines before the first row"""
    n_columns: int
    wanted: tuple[int, int, int]
    decimal_commas: bool
    promised: int | None
    """rows the file says it has (PTS)"""


def read_text(path: Path) -> RawCloud:
    """Return the points of a text file with x, y and z in columns.

    Parameters
    ----------
    path : Path
        Lines of numbers separated by blanks, tabs, commas or semicolons; further columns,
        comments (`#`, `//`), a header line and a line with the number of points may be there.
    """
    size_of(path)
    layout = layout_of(path)
    chunks = []
    with open(path, "rb") as file:
        for _ in range(layout.skip):
            file.readline()
        for block in blocks(file, first_line=layout.skip + 1):
            xyz = _coordinates(path, block, layout)
            if len(xyz):
                chunks.append(Chunk(xyz))
    n = sum(len(chunk.xyz) for chunk in chunks)
    if layout.promised is not None and n != layout.promised:
        raise InputError(
            path,
            f"its first line promises {layout.promised} points, it holds {n}",
            "it is cut or joined from several: export it again",
        )
    return RawCloud(chunks, points_read=n)


def layout_of(path: Path) -> Layout:
    """Return the layout of a text file by its first lines, or raise InputError."""
    header: list[str] | None = None
    promised = None
    for number, line in enumerate(_first_lines(path)):
        fields, decimal_commas = _fields(line)
        if not fields:
            continue
        if len(fields) == 1 and fields[0].isdigit() and promised is None:
            promised = int(fields[0])
        elif header is None and not _is_number(fields[0]):
            header = _column_names(line)
        else:
            wanted = _wanted(path, header, len(fields), number + 1)
            return Layout(number, len(fields), wanted, decimal_commas, promised)
    raise InputError(
        path, "holds no line with three coordinates", "expected lines 'x y z', one per point"
    )


def _coordinates(path: Path, block: Block, layout: Layout) -> NDArray[np.floating]:
    text = with_spaces(without_comments(block.text), layout.decimal_commas)
    clean = Block(text, block.first_line)
    return compact(parse(path, clean, layout.n_columns, layout.wanted))


def _first_lines(path: Path) -> list[bytes]:
    with open(path, "rb") as file:
        head = file.read(_HEAD)
    if b"\0" in head:
        raise InputError(path, "holds binary data, expected text", "name the format by its suffix")
    return without_comments(head.removeprefix(_BYTE_ORDER_MARK)).split(b"\n")


def _fields(line: bytes) -> tuple[list[bytes], bool]:
    """Return a line's fields, and whether its commas are decimal points."""
    apart = line.replace(b";", b" ").split()
    several = len(apart) >= 3 and b"," in line
    decimal_commas = several and all(_DECIMAL_COMMA.fullmatch(part) for part in apart[:3])
    return with_spaces(line, decimal_commas).split(), decimal_commas


def _column_names(line: bytes) -> list[str]:
    """Return a header line's names; they may hold blanks if something else separates them."""
    separator = next((mark for mark in (b";", b",", b"\t") if mark in line), None)
    return [
        name.decode("utf-8", "replace").strip(" \"'\r").lower() for name in line.split(separator)
    ]


def _wanted(
    path: Path, header: list[str] | None, n_columns: int, line: int
) -> tuple[int, int, int]:
    if n_columns < 3:
        raise InputError(
            path,
            f"line {line} has {n_columns} columns, expected at least x, y and z",
            "separate the coordinates by blanks, tabs, commas or semicolons",
        )
    found: dict[str, int] = {}
    for column, name in enumerate(header or []):
        if match := _NAMES.fullmatch(re.sub(r"[^a-z_]", "", name)):
            found.setdefault(match[1], column)
    if len(found) == 3 and max(found.values()) < n_columns:
        return found["x"], found["y"], found["z"]
    return 0, 1, 2


def _is_number(field: bytes) -> bool:
    try:
        float(field)
    except ValueError:
        return False
    return True
