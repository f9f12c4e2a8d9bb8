"""PLY clouds: text and binary of either byte order, mapped instead of read where possible."""

import mmap
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from storage.errors import InputError
from tasks.scans.ply_header import Header, cut, read_header
from tasks.scans.ply_lists import coordinates_among_lists, end_of
from tasks.scans.raw import ROWS, Chunk, RawCloud, compact, in_chunks, size_of
from tasks.scans.rows import Block, blocks, parse

VALID = ("valid", "is_valid")
INVALID = ("invalid", "is_invalid", "invalid_state")
"""Vertex properties by which writers mark points: zero in the first or non-zero in the second
kind is a point that was not seen."""


def read_ply(path: Path) -> RawCloud:
    """Return the vertices of a PLY file; other properties and elements are passed over."""
    size_of(path)
    header = read_header(path)
    chunks, invalid = _binary(path, header) if header.order else (_text(path, header), 0)
    _, vertices = header.up_to_vertices()
    return RawCloud(chunks, points_read=vertices.count, points_invalid=invalid)


def _binary(path: Path, header: Header) -> tuple[list[Chunk], int]:
    before, vertices = header.up_to_vertices()
    if vertices.count == 0:
        return [], 0
    with open(path, "rb") as file:
        data = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    start = header.size
    for element in before:
        start = end_of(path, data, start, element, header.order)
    if vertices.has_lists:
        return in_chunks(coordinates_among_lists(path, data, start, vertices, header.order)), 0
    row = vertices.dtype(header.order)
    if start + vertices.count * row.itemsize > len(data):
        held = (len(data) - start) // row.itemsize
        raise cut(path, vertices.count, f"holds {max(held, 0)}")
    return _vertices(np.ndarray(vertices.count, row, data, start))


def _vertices(rows: NDArray[Any]) -> tuple[list[Chunk], int]:
    """Return the coordinates of the rows, as views if the layout allows, and the rows dropped."""
    names = rows.dtype.names or ()
    flag = next((name for name in names if name.lower() in VALID + INVALID), None)
    if flag is None and (view := _view(rows)) is not None:
        return in_chunks(view), 0
    chunks, invalid = [], 0
    for start in range(0, len(rows), ROWS):
        part = rows[start : start + ROWS]
        if flag is not None:
            part = part[(part[flag] != 0) == (flag.lower() in VALID)]
        invalid += min(ROWS, len(rows) - start) - len(part)
        xyz = np.stack([part[name] for name in "xyz"], axis=1)
        chunks.append(Chunk(compact(xyz.astype(np.result_type(xyz, np.float32)))))
    return chunks, invalid


def _view(rows: NDArray[Any]) -> NDArray[np.floating] | None:
    """Return x, y and z as one strided view, None if they are no evenly spaced floats."""
    fields = rows.dtype.fields
    assert fields is not None
    (x, at), (y, after), (z, last) = (fields[name][:2] for name in "xyz")
    if not (x == y == z and x.kind == "f" and last - after == after - at):
        return None
    xyz: NDArray[np.floating] = np.ndarray(
        (len(rows), 3), x, rows, at, (rows.dtype.itemsize, after - at)
    )
    return xyz


def _text(path: Path, header: Header) -> list[Chunk]:
    before, vertices = header.up_to_vertices()
    if vertices.has_lists:
        raise InputError(
            path, "text vertices with list properties", "export the vertices without lists"
        )
    names = [p.name for p in vertices.properties]
    wanted = (names.index("x"), names.index("y"), names.index("z"))
    chunks, left = [], vertices.count
    with open(path, "rb") as file:
        file.seek(header.size)
        line = _skip_rows(file, header.lines + 1, sum(element.count for element in before))
        for block in blocks(file, line):
            if left == 0:
                break
            xyz = parse(path, Block(block.text, block.first_line), len(names), wanted, limit=left)
            left -= len(xyz)
            chunks.append(Chunk(compact(xyz)))
    if left:
        raise cut(path, vertices.count, f"holds {vertices.count - left}")
    return chunks


def _skip_rows(file: Any, line: int, rows: int) -> int:
    """Read past rows that are not blank; return the number of the next line."""
    while rows:
        text = file.readline()
        if not text:
            break
        line += 1
        rows -= bool(text.strip())
    return line
