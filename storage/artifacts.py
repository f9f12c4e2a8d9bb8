"""References to stored tables, and the only place that reads and writes them.

An artifact is one immutable Parquet file, named by the hash of its content. A stage passes a
`Ref` on, never the arrays.
"""

import os
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any, Generic, TypeVar

import pyarrow as pa
import pyarrow.parquet as pq
from pydantic import BaseModel, ConfigDict, field_validator

from storage.errors import DamagedArtifact, StoreError
from storage.files import temporary_in
from storage.remote import obtain, share

T = TypeVar("T")

SCHEMA_VERSION = "1"
CACHE = ".cache"
"""Folder of a store's cache records: which artifacts a key led to."""
NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,127}")
"""What a building, storey or scan may be called: it becomes a folder."""


class Ref(BaseModel):
    """A pointer to an immutable artifact: where it lies, what is in it, how much of it."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    uri: str
    """Path of the Parquet file relative to its store, so that a store can be moved."""
    sha256: str
    """Hash of its bytes."""
    rows: int
    """Rows in it."""
    table: str
    """The stored thing it holds."""


class Place(BaseModel):
    """Where a stage works: the store, the run, and what of the world it is about."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    store: str
    run: str
    building: str
    storey: str
    scan: str | None = None

    @field_validator("run", "building", "storey", "scan")
    @classmethod
    def _is_a_name(cls, value: str | None) -> str | None:
        if value is not None:
            check_name(value)
        return value

    def of_scan(self, scan: str) -> "Place":
        """Return the place of one scan of this storey."""
        return self.model_copy(update={"scan": check_name(scan)})

    def folder(self, table: str) -> str:
        """Return the folder a table's files of this place lie in, relative to the store."""
        folder = f"{table}/building={self.building}/storey={self.storey}"
        return f"{folder}/scan={self.scan}" if self.scan is not None else folder


def check_name(name: str) -> str:
    """Return `name` if it may name a folder of the store, else raise ValueError."""
    if not NAME.fullmatch(name) or ".." in name:
        raise ValueError(
            f"{name!r} is no usable name: letters, digits, '_', '-' and '.', "
            "not starting with '.' or '-'"
        )
    return name


@dataclass(frozen=True)
class Kind(Generic[T]):
    """How one stored thing becomes a table and back."""

    table: str
    type: type[T]
    schema: pa.Schema
    to_table: Callable[[T], pa.Table]
    from_table: Callable[[pa.Table], T]
    write_options: dict[str, Any] | None = None


_kinds: dict[type, Kind[Any]] = {}


def register(kind: Kind[T]) -> Kind[T]:
    """Make a stored thing known by its type; called once by the module that defines it."""
    _kinds[kind.type] = kind
    return kind


def kinds() -> list[Kind[Any]]:
    """Return all stored things known so far."""
    return list(_kinds.values())


def kind_of(type_: type[T]) -> Kind[T] | None:
    """Return how `type_` is stored, None if it is no stored thing."""
    return _kinds.get(type_)


def schema(table: str, fields: list[pa.Field], **extra: str) -> pa.Schema:
    """Return an Arrow schema stamped with the table's name and schema version."""
    metadata = {"mapsense.table": table, "mapsense.schema_version": SCHEMA_VERSION} | extra
    return pa.schema(fields, metadata=metadata)


def column(name: str, type_: pa.DataType, about: str, *, nullable: bool = False) -> pa.Field:
    """Return a column that says what it holds; its unit is the end of its name."""
    return pa.field(name, type_, nullable=nullable, metadata={"about": about})


def write(kind: Kind[T], value: T, place: Place) -> Ref:
    """Write `value` into the store as one Parquet file named by the hash of its content."""
    table, folder = kind.to_table(value), place.folder(kind.table)
    with _written(table, Path(place.store) / folder, kind.write_options or {}) as temporary:
        digest = _hash(temporary)
        uri = f"{folder}/{digest[:24]}.parquet"
        os.replace(temporary, Path(place.store) / uri)
    share(place.store, Path(place.store) / uri)
    return Ref(uri=uri, sha256=digest, rows=table.num_rows, table=kind.table)


def replace_table(path: Path, table: pa.Table) -> None:
    """Write a table to `path`, in place of what is there: a reader sees the old or the new."""
    with _written(table, path.parent, {}) as temporary:
        os.replace(temporary, path)


@contextmanager
def _written(table: pa.Table, folder: Path, options: dict[str, Any]) -> Iterator[Path]:
    """Write beside the target and sync; renamed within, a reader sees all of it or nothing."""
    temporary = temporary_in(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with open(temporary, "wb") as file:
            pq.write_table(table, file, **({"compression": "zstd"} | options))
            file.flush()
            os.fsync(file.fileno())
        yield temporary
    except OSError as error:
        with suppress(OSError):  # what stopped the writing may stop this too
            temporary.unlink()
        raise StoreError(
            f"{folder}: cannot write there ({error.strerror or error}); make the store "
            "writable, free space on its disk, or choose another with --store"
        ) from error


def read(kind: Kind[T], ref: Ref, store: Path | str) -> T:
    """Read the value behind a reference, after checking that it is what the reference names."""
    check(ref, store)
    path = Path(store) / ref.uri
    return kind.from_table(pq.read_table(path, partitioning=None, memory_map=True))


def check(ref: Ref, store: Path | str) -> None:
    """Raise DamagedArtifact unless the artifact is there and its bytes are the ones named.

    One that the store lacks is taken from the address it is shared at.
    """
    path = Path(store) / ref.uri
    obtain(store, ref.uri)
    try:
        found = _hash(path)
    except OSError as error:
        raise DamagedArtifact(
            f"{path}: the artifact cannot be read ({error.strerror}); run again, it is remade"
        ) from error
    if found != ref.sha256:
        raise DamagedArtifact(
            f"{path}: the artifact was changed or cut after it was written; run again, it is remade"
        )


def is_sound(ref: Ref, store: Path | str) -> bool:
    """Return whether the artifact behind a reference is there, whole."""
    try:
        check(ref, store)
    except DamagedArtifact:
        return False
    return True


def _hash(path: Path) -> str:
    digest = sha256()
    with open(path, "rb") as file:
        while block := file.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()
