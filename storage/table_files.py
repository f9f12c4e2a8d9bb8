"""The Parquet files of a table of a store: which there are, and whether they are ours."""

import os
from collections.abc import Iterable, Iterator
from contextlib import suppress
from functools import lru_cache
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from storage.artifacts import SCHEMA_VERSION
from storage.errors import MapSenseError

PARTITIONS = ("building", "storey", "scan")
"""Columns told by folders: where in the world a file is about."""
Stamp = tuple[int, int]
"""Bytes of a file and when it was last changed, nanoseconds: another stamp is another file."""


class UnsoundFile(MapSenseError):
    """A file is no part of a table, and why."""


def find(store: Path, table: str) -> dict[str, Stamp]:
    """Return the table's files, relative to the store and sorted, with their stamps."""
    return dict(sorted(_walk(f"{store}/{table}", table)))


def is_of(table: str, uri: str) -> bool:
    """Return whether a file could be the table's.

    Rows of a history may be anybody's: they must not lead out of the table's folder.
    """
    return uri.endswith(".parquet") and uri.startswith(f"{table}/") and ".." not in uri.split("/")


def stamps(store: Path, uris: Iterable[str]) -> dict[str, Stamp]:
    """Return those of the files named that are there."""
    found = {}
    for uri in sorted(uris):
        with suppress(OSError):
            found[uri] = _stamp(os.stat(f"{store}/{uri}"))
    return found


def place(uri: str) -> dict[str, str | None]:
    """Return what the folders of a file say: building, storey and scan, None if nothing."""
    return _place(uri.rpartition("/")[0])


def opened(path: Path, table: str, schema: pa.Schema) -> pq.ParquetFile:
    """Return a file of a table, opened.

    Raises
    ------
    UnsoundFile
        If it cannot be read, is another table's or version's, or lacks a column of the schema.
    """
    try:
        file = pq.ParquetFile(path)
    except (OSError, pa.ArrowException) as error:
        raise UnsoundFile(f"cannot be read as Parquet ({_sentence(error)})") from error
    try:
        _check(file.schema_arrow, table, schema)
    except UnsoundFile:
        file.close()
        raise
    return file


def problem(path: Path, table: str, schema: pa.Schema) -> str | None:
    """Return why a file is no part of a table; None if it is."""
    try:
        opened(path, table, schema).close()
    except UnsoundFile as error:
        return str(error)
    return None


@lru_cache(maxsize=65_536)
def _place(folder: str) -> dict[str, str | None]:
    told = dict(part.split("=", 1) for part in folder.split("/")[1:] if "=" in part)
    return {name: told.get(name) for name in PARTITIONS}


def _check(found: pa.Schema, table: str, schema: pa.Schema) -> None:
    metadata = found.metadata or {}
    if (holds := metadata.get(b"mapsense.table", b"").decode()) != table:
        raise UnsoundFile(
            f"holds table '{holds}', expected '{table}'" if holds else "was not written by us"
        )
    if (version := metadata.get(b"mapsense.schema_version", b"").decode()) != SCHEMA_VERSION:
        raise UnsoundFile(f"has schema version '{version}', expected '{SCHEMA_VERSION}'")
    for column in schema:
        if column.name not in found.names or found.field(column.name).type != column.type:
            raise UnsoundFile(f"has no column '{column.name}' of type {column.type}")


def _walk(folder: str, uri: str) -> Iterator[tuple[str, Stamp]]:
    """Yield the files below a folder; what goes away meanwhile is not there."""
    try:
        entries = list(os.scandir(folder))
    except OSError:
        return
    for entry in entries:
        if entry.is_dir(follow_symlinks=False):
            yield from _walk(entry.path, f"{uri}/{entry.name}")
        elif entry.name.endswith(".parquet") and not entry.name.startswith("."):
            with suppress(OSError):
                yield f"{uri}/{entry.name}", _stamp(entry.stat())


def _stamp(status: os.stat_result) -> Stamp:
    return status.st_size, status.st_mtime_ns


def _sentence(error: Exception) -> str:
    return " ".join(str(error).split())
