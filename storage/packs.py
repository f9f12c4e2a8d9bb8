"""Small files of a table packed into few: a cache beside the store's files.

A query over thousands of files spends its time on opening them. So a reader that meets many small
ones copies their rows into a pack, with a number for the file each row is of; what the numbers mean
is in an index. Both lie in `<store>/.catalog/<table>/` and can be deleted at any time. A row counts
only while its file is there and has the stamp it was packed with.

The index is replaced in one piece, and a pack is never changed: packs that are merged away are
deleted, and a reader that comes too late for one reads the index again. Packs are merged as in a
log-structured merge tree (O'Neil et al. 1996): with each packing those no greater than what is
added. So there are few, and a row is rewritten a few times only.
"""

import fcntl
import os
import uuid
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from storage.artifacts import SCHEMA_VERSION, replace_table
from storage.table_files import Stamp, UnsoundFile, find, opened

FOLDER, INDEX_FILE = ".catalog", "index.parquet"
FORM = "1"
"""Form of packs and index: another form is made anew."""
FILE = "_file"
"""Column of a pack: the number of the file a row is of."""
SMALL_BYTES = 1 << 20
"""Greater files are read as they are: opening them costs little against reading them."""
ENOUGH = 32
"""Small files that make a pack."""
LARGEST_BYTES = 1 << 28
"""Packs beyond it are merged no more."""
GROUP_ROWS, GROUP_BYTES = 122_880, 1 << 26
"""Rows DuckDB reads in one go, and what may be held in memory until they are written."""
_INDEX = pa.schema(
    [
        pa.field("uri", pa.string()),
        pa.field("bytes", pa.int64()),
        pa.field("mtime_ns", pa.int64()),
        pa.field("file", pa.int64()),
        pa.field("pack", pa.string()),
        pa.field("pack_bytes", pa.int64()),
    ]
)


@dataclass(frozen=True)
class Packed:
    """Where the rows of a file are."""

    stamp: Stamp
    """of the file when it was packed"""
    file: int
    """number of the file in its pack"""
    pack: str
    """name of the pack, relative to the store"""
    pack_bytes: int


@dataclass(frozen=True)
class Index:
    """What the packs of a table hold."""

    files: dict[str, Packed]
    next_number: int
    """given to no file yet: rows of files that are gone may stay in a pack"""

    def live(self, stamps: dict[str, Stamp]) -> dict[str, Packed]:
        """Return those of the files that are packed as they are now."""
        return {
            uri: self.files[uri]
            for uri, stamp in stamps.items()
            if uri in self.files and self.files[uri].stamp == stamp
        }


def read_index(store: Path, table: str, schema: pa.Schema) -> Index:
    """Return what the packs of a table hold; nothing if there are none for this schema."""
    try:
        found = pq.read_table(_folder(store, table) / INDEX_FILE, partitioning=None)
        metadata = found.schema.metadata or {}
        if metadata.get(b"form") != _form(schema) or found.column_names != _INDEX.names:
            return Index({}, 0)
        columns = [column.to_pylist() for column in found.columns]
        next_number = int(metadata[b"next_number"])
    except (OSError, pa.ArrowException, KeyError, ValueError):
        return Index({}, 0)  # it is a cache: made anew
    files = {
        uri: Packed((size, mtime_ns), file, pack, pack_bytes)
        for uri, size, mtime_ns, file, pack, pack_bytes in zip(*columns, strict=True)
    }
    sizes = {pack: _size(store / pack) for pack in set(columns[4])}
    return Index({u: p for u, p in files.items() if sizes.get(p.pack) == p.pack_bytes}, next_number)


def unpacked(stamps: dict[str, Stamp], live: dict[str, Packed]) -> list[str]:
    """Return the small files among these that no pack holds."""
    return [uri for uri, (size, _) in stamps.items() if size <= SMALL_BYTES and uri not in live]


def pack(store: Path, table: str, schema: pa.Schema, settled: Callable[[str], bool]) -> None:
    """Pack the small files of a table that no pack holds, if they are enough.

    Does nothing while another does it.

    Parameters
    ----------
    settled : says of a file whether it will stay as it is

    Raises
    ------
    OSError, StoreError
        If the folder of the packs cannot be written.
    """
    folder = _folder(store, table)
    folder.mkdir(parents=True, exist_ok=True)
    with _alone(folder) as alone:
        if not alone:
            return
        stamps = find(store, table)
        index = read_index(store, table, schema)
        live = index.live(stamps)
        new = [uri for uri in unpacked(stamps, live) if settled(uri)]
        if len(new) >= ENOUGH:
            packing = _Packing(store, table, schema, index, live)
            packing.add({uri: stamps[uri] for uri in new})


def drop_stale(store: Path, table: str, *, dry_run: bool = False) -> list[int]:
    """Remove the packs of a table that hold rows of files that are gone, or that nobody knows.

    Does nothing while another packs.

    Returns
    -------
    list of int
        The bytes of each; with `dry_run` they stay.
    """
    folder = _folder(store, table)
    with _alone(folder) as alone:
        if not alone:
            return []
        stamps = find(store, table)
        live: dict[str, bool] = {}
        for uri, stamp, name in _packed_files(folder):
            live[name] = live.get(name, True) and stamps.get(uri) == stamp
        dropped = []
        for path in [*folder.glob("*.parquet"), *folder.glob(".*.tmp")]:
            if path.name != INDEX_FILE and not live.get(f"{FOLDER}/{table}/{path.name}"):
                dropped.append(path.stat().st_size)
                if not dry_run:
                    path.unlink(missing_ok=True)
        return dropped


def _packed_files(folder: Path) -> list[tuple[str, Stamp, str]]:
    """Return each file an index names, its stamp and its pack; none of an index that is unsound."""
    columns = ["uri", "bytes", "mtime_ns", "pack"]
    try:
        rows = pq.read_table(folder / INDEX_FILE, columns=columns, partitioning=None).to_pylist()
    except (OSError, pa.ArrowException, ValueError, KeyError):
        return []  # it is a cache: made anew
    return [(row["uri"], (row["bytes"], row["mtime_ns"]), row["pack"]) for row in rows]


class _Packing:
    """One pack being made."""

    def __init__(
        self, store: Path, table: str, schema: pa.Schema, index: Index, live: dict[str, Packed]
    ) -> None:
        self.store, self.table, self.schema = store, table, schema
        self.index, self.live = index, live
        self.numbers: dict[str, tuple[Stamp, int]] = {}

    def add(self, new: dict[str, Stamp]) -> None:
        """Write a pack of new files and of the packs to be merged with them; then the index."""
        folder = _folder(self.store, self.table)
        merged = self._to_be_merged(sum(size for size, _ in new.values()))
        path = folder / f"{uuid.uuid4().hex}.parquet"
        _write(path, self.schema, self._rows(new, merged))
        if self.numbers:
            name, size = f"{FOLDER}/{self.table}/{path.name}", path.stat().st_size
            kept = {u: p for u, p in self.index.files.items() if p.pack not in merged}
            added = {u: Packed(s, number, name, size) for u, (s, number) in self.numbers.items()}
            index = Index(kept | added, self.index.next_number + len(new))
            _write_index(self.store, self.table, self.schema, index)
            used = {Path(p.pack).name for p in index.files.values()} | {INDEX_FILE}
        else:
            used = {Path(p.pack).name for p in self.index.files.values()} | {INDEX_FILE}
        for file in folder.glob("*.parquet"):
            if file.name not in used:
                file.unlink(missing_ok=True)

    def _to_be_merged(self, new_bytes: int) -> set[str]:
        """Return the packs no greater than what is added, and those most of which is gone."""
        packs: dict[str, int] = {}
        rest: Counter[str] = Counter()
        for packed in self.index.files.values():
            packs[packed.pack] = packed.pack_bytes
            rest[packed.pack] -= 1
        for packed in self.live.values():
            rest[packed.pack] += 2
        merged, total = set(), new_bytes
        for name, size in sorted(packs.items(), key=lambda pack: pack[1]):
            if rest[name] < 0 or size <= min(total, LARGEST_BYTES):
                merged.add(name)
                total += size
        return merged

    def _rows(self, new: dict[str, Stamp], merged: set[str]) -> Iterator[pa.Table]:
        """Yield the rows of new files, and those of merged packs whose files are there."""
        for number, (uri, stamp) in enumerate(new.items(), self.index.next_number):
            try:
                with opened(self.store / uri, self.table, self.schema) as file:
                    rows = file.read(columns=self.schema.names, use_threads=False)
            except (UnsoundFile, OSError, pa.ArrowException):
                continue  # a reader who asks for it is told why
            self.numbers[uri] = stamp, number
            yield _plain(rows, self.schema).append_column(
                FILE, pa.repeat(pa.scalar(number, pa.int64()), rows.num_rows)
            )
        if not self.numbers:
            return
        again = {u: (p.stamp, p.file) for u, p in self.live.items() if p.pack in merged}
        self.numbers |= again
        numbers = pa.array([number for _, number in again.values()], pa.int64())
        for name in sorted(merged):
            with pq.ParquetFile(self.store / name) as file:
                for batch in file.iter_batches(GROUP_ROWS):
                    rows = pa.Table.from_batches([batch])
                    yield rows.filter(pc.is_in(rows[FILE], numbers))


def _write(path: Path, schema: pa.Schema, parts: Iterator[pa.Table]) -> None:
    """Write rows in groups as they come; nobody knows the file before the index names it."""
    whole = _plain(schema.empty_table(), schema).schema.append(pa.field(FILE, pa.int64()))
    with open(path, "xb") as file:
        with pq.ParquetWriter(file, whole, compression="zstd") as writer:
            for group in _groups(parts):
                writer.write_table(group, row_group_size=GROUP_ROWS)
        file.flush()
        os.fsync(file.fileno())


def _groups(parts: Iterator[pa.Table]) -> Iterator[pa.Table]:
    """Yield tables joined until they are as many rows, or bytes, as are written at once."""
    held: list[pa.Table] = []
    rows = size = 0
    for part in parts:
        held.append(part)
        rows, size = rows + part.num_rows, size + part.nbytes
        if rows >= GROUP_ROWS or size >= GROUP_BYTES:
            yield pa.concat_tables(held)
            held, rows, size = [], 0, 0
    if held:
        yield pa.concat_tables(held)


def _plain(table: pa.Table, schema: pa.Schema) -> pa.Table:
    """Return the columns of a schema and their types, without what is said about them."""
    fields = [pa.field(field.name, field.type) for field in schema]
    return table.select(schema.names).cast(pa.schema(fields))


def _write_index(store: Path, table: str, schema: pa.Schema, index: Index) -> None:
    rows = [
        {
            "uri": uri,
            "bytes": packed.stamp[0],
            "mtime_ns": packed.stamp[1],
            "file": packed.file,
            "pack": packed.pack,
            "pack_bytes": packed.pack_bytes,
        }
        for uri, packed in index.files.items()
    ]
    metadata = {"form": _form(schema), "next_number": str(index.next_number)}
    replace_table(
        _folder(store, table) / INDEX_FILE,
        pa.Table.from_pylist(rows, _INDEX.with_metadata(metadata)),
    )


def _form(schema: pa.Schema) -> bytes:
    """Return what the packs of a schema are known by."""
    columns = [f"{field.name} {field.type}" for field in schema]
    return sha256("\n".join([FORM, SCHEMA_VERSION, *columns]).encode()).hexdigest().encode()


def _folder(store: Path, table: str) -> Path:
    return store / FOLDER / table


def _size(path: Path) -> int | None:
    try:
        return path.stat().st_size
    except OSError:
        return None


@contextmanager
def _alone(folder: Path) -> Iterator[bool]:
    """Hold the lock of those who pack; False if another holds it."""
    descriptor = os.open(folder / ".lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        yield False
    else:
        yield True
    finally:
        os.close(descriptor)
