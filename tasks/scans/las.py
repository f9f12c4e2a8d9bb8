"""LAS and LAZ clouds, a million points at a time."""

from os import SEEK_END
from pathlib import Path
from struct import unpack, unpack_from
from typing import Any

import laspy
import lazrs
import numpy as np

from storage.errors import InputError
from tasks.scans.raw import METRES_Z_UP, ROWS, Chunk, RawCloud, compact, library_errors, size_of

_LASZIP = 22204  # the record that describes the compression
_HEADER = 375  # bytes of the longest header, that of version 1.4
_RECORD, _RECORD_BEHIND = 54, 60  # least bytes of a variable length record


def read_las(path: Path) -> RawCloud:
    """Return the points of a LAS or LAZ file; those marked as withheld are left out."""
    size = size_of(path)
    _check_records(path, size)
    with library_errors(path, "LAS"), laspy.open(str(path)) as file:
        promised = file.header.point_count
        check = _check_chunks if file.header.are_points_compressed else _check_size
        check(path, size, file.header)
        parts = [_chunk(points) for points in file.chunk_iterator(ROWS)]
    read = sum(n for _, n in parts)
    if read != promised:
        raise _cut(path, promised, read)
    chunks = [chunk for chunk, _ in parts]
    kept = sum(len(chunk.xyz) for chunk in chunks)
    return RawCloud(chunks, promised, read - kept, convention=METRES_Z_UP)


def _check_records(path: Path, size: int) -> None:
    """Raise unless the header's counts of records fit into the file: laspy reads them all."""
    with open(path, "rb") as file:
        header = file.read(_HEADER)
    if not header.startswith(b"LASF"):
        raise InputError(path, "does not start with 'LASF'", "it is no LAS file: export it again")
    (header_size,) = unpack_from("<H", header.ljust(_HEADER, b"\0"), 94)
    start, n_records = unpack_from("<II", header.ljust(_HEADER, b"\0"), 96)
    fits = header_size <= start <= size and n_records * _RECORD <= start - header_size
    if header[24:26] >= b"\x01\x04":  # from version 1.4 on there are some behind the points
        n_behind = unpack_from("<I", header.ljust(_HEADER, b"\0"), 243)[0]
        fits = fits and n_behind * _RECORD_BEHIND <= size
    if not fits:
        raise InputError(
            path,
            f"the header's sizes and its {n_records} records do not fit into {size} bytes",
            "it is damaged or cut: copy it again",
        )


def _chunk(points: Any) -> tuple[Chunk, int]:
    xyz = np.stack([points.x, points.y, points.z], axis=1)
    withheld = np.asarray(points.withheld, bool)
    return Chunk(compact(xyz[~withheld] if withheld.any() else xyz)), len(xyz)


def _check_size(path: Path, size: int, header: Any) -> None:
    width = header.point_format.size
    held = (size - header.offset_to_point_data) // width
    if held < header.point_count:
        raise _cut(path, header.point_count, max(held, 0))


def _check_chunks(path: Path, size: int, header: Any) -> None:
    """Raise unless the table of compressed chunks fits: lazrs allocates by it, and aborts."""
    record = next((vlr for vlr in header.vlrs if vlr.record_id == _LASZIP), None)
    with open(path, "rb") as file:
        file.seek(header.offset_to_point_data)
        table = int.from_bytes(file.read(8), "little", signed=True)
        if table == -1:  # written as a stream: the table's place stands at the end
            file.seek(-8, SEEK_END)
            table = int.from_bytes(file.read(8), "little", signed=True)
        if record is None or not header.offset_to_point_data < table < size:
            raise InputError(path, "has no table of chunks", "it is cut: copy it again")
        file.seek(table)
        _, n_chunks = unpack("<II", file.read(8).ljust(8, b"\0"))
        if n_chunks > size:
            raise InputError(path, f"promises {n_chunks} chunks", "it is damaged: copy it again")
        file.seek(header.offset_to_point_data)
        layout = lazrs.LazVlr(record.record_data_bytes())
        chunks = lazrs.read_chunk_table(file, layout)
    points, held = (sum(column) for column in zip(*chunks, strict=True)) if chunks else (0, 0)
    largest = max((n for n, _ in chunks), default=0)
    too_large = held > size or largest > max(header.point_count, ROWS)
    if too_large or layout.item_size() != header.point_format.size:
        raise InputError(path, "its table of chunks is damaged", "copy it again")
    if points < header.point_count:
        raise _cut(path, header.point_count, points)


def _cut(path: Path, promised: int, held: int) -> InputError:
    return InputError(
        path,
        f"the header promises {promised} points, the file holds {held}",
        "it is cut: copy it again",
    )
