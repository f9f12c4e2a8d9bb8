"""Binary PLY elements with lists, whose rows vary in size: faces before the vertices, mostly."""

import mmap
from collections.abc import Iterator
from pathlib import Path
from struct import Struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tasks.scans.ply_header import Element, cut


def end_of(path: Path, data: mmap.mmap, start: int, element: Element, order: str) -> int:
    """Return where the rows of an element that start at `start` end."""
    if not element.has_lists:
        return start + element.count * element.dtype(order).itemsize
    if (rows := _uniform(path, data, start, element, order)) is not None:
        return start + rows.nbytes
    return max((end for _, end in _walk(path, data, start, element, order)), default=start)


def coordinates_among_lists(
    path: Path, data: mmap.mmap, start: int, vertices: Element, order: str
) -> NDArray[np.float64]:
    """Return the coordinates (n, 3) of vertices that carry lists."""
    if (rows := _uniform(path, data, start, vertices, order)) is not None:
        return np.stack([rows[axis].astype(np.float64) for axis in "xyz"], axis=1)
    column = [p.name for p in vertices.properties].index
    x, y, z = column("x"), column("y"), column("z")
    found = [(r[x], r[y], r[z]) for r, _ in _walk(path, data, start, vertices, order)]
    return np.array(found, float).reshape(-1, 3)


def _uniform(
    path: Path, data: mmap.mmap, start: int, element: Element, order: str
) -> NDArray[Any] | None:
    """Return the rows as one mapped table if every list is as long as in the first row.

    So they are in a triangle mesh, and a table is read a hundred times faster than row by row.
    """
    if element.count == 0:
        return None
    values, end = next(_walk(path, data, start, element, order))
    if start + element.count * (end - start) > len(data):
        return None
    fields: list[tuple[Any, ...]] = []
    for place, p in enumerate(element.properties):
        if p.count is None:
            fields.append((p.name, order + p.type))
        else:
            fields.append((_length(place), order + p.count))
            fields.append((p.name, order + p.type, (int(values[place]),)))
    rows: NDArray[Any] = np.ndarray(element.count, np.dtype(fields), data, start)
    for place, p in enumerate(element.properties):
        if p.count is not None and (rows[_length(place)] != int(values[place])).any():
            return None
    return rows


def _length(place: int) -> str:
    return f"length of list {place}"  # no property's name holds a blank


def _walk(
    path: Path, data: mmap.mmap, at: int, element: Element, order: str
) -> Iterator[tuple[list[float], int]]:
    """Yield each row's values, the length in place of a list, and where the row ends."""
    steps = [
        (p.count is not None, Struct(order + _code(p.count or p.type)), np.dtype(p.type).itemsize)
        for p in element.properties
    ]
    for _ in range(element.count):
        row: list[float] = []
        for is_list, first, width in steps:
            if at + first.size > len(data):
                raise cut(path, element.count, f"ends within element '{element.name}'")
            value = first.unpack_from(data, at)[0]
            row.append(value)
            if is_list and not (0 <= value <= len(data) and value == int(value)):
                raise cut(path, element.count, f"has a list of {value} in '{element.name}'")
            at += first.size + (int(value) * width if is_list else 0)
        if at > len(data):
            raise cut(path, element.count, f"ends within element '{element.name}'")
        yield row, at


def _code(type_: str) -> str:
    return np.dtype(type_).char
