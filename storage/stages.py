"""What each run of a stage cost, and how it ended: one row per stage and run, cached ones too.

Each process keeps a file per flow run and storey and writes it anew with each row, atomically: a
killed run loses no row of a stage that had ended, a reader never meets a row twice, and files are
far fewer than rows. A file that is full is followed by another, so that a row costs the same
however many came before it.
"""

import os
import socket
import threading
from collections import defaultdict
from dataclasses import dataclass, field, fields
from datetime import datetime
from hashlib import sha256
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from storage.artifacts import Place, column, replace_table, schema
from storage.errors import MapSenseError, redacted
from storage.remote import refresh, share


@dataclass(frozen=True)
class StageRow:
    """One run of one stage."""

    id: str
    run: str
    scan: str | None
    stage: str
    key: str
    outcome: str
    wall_s: float
    cpu_s: float
    peak_memory_mb: float | None
    rows_in: int
    rows_out: int
    points_in: int
    points_out: int
    error: str | None
    started_at: datetime
    outputs: tuple[str, ...] = ()


SCHEMA = schema(
    "stages",
    [
        column("id", pa.string(), "the task run"),
        column("run", pa.string(), "the run of the storey, as in table runs"),
        column("scan", pa.string(), "the scan; null for a stage over all scans", nullable=True),
        column("stage", pa.string(), "name of the stage"),
        column("key", pa.string(), "cache key: code, versions, parameters and inputs"),
        column("outcome", pa.string(), "computed, cached or failed"),
        column("wall_s", pa.float64(), "reading inputs, computing and writing; looking up a hit"),
        column("cpu_s", pa.float64(), "processor time of the stage, in all its threads"),
        column(
            "peak_memory_mb",
            pa.float64(),
            "greatest resident memory of the whole process while the stage ran, sampled; "
            "stages that ran beside it count too; null if cached or not known",
            nullable=True,
        ),
        column("rows_in", pa.int64(), "rows of all input tables"),
        column("rows_out", pa.int64(), "rows of all output tables"),
        column("points_in", pa.int64(), "rows of input tables 'points'"),
        column("points_out", pa.int64(), "rows of output tables 'points'"),
        column("error", pa.string(), "first line of the error; null if none", nullable=True),
        column("started_at", pa.timestamp("us", tz="UTC"), "when the stage was asked for"),
        column("outputs", pa.list_(pa.string()), "artifacts, relative to the store"),
    ],
)

FULL_ROWS = 256
"""Rows of a file that is followed by another."""


@dataclass
class _Written:
    """What this process has written of a run."""

    rows: list[StageRow] = field(default_factory=list)
    writing: threading.Lock = field(default_factory=threading.Lock)
    sharing: threading.Lock = field(default_factory=threading.Lock)
    shared: dict[Path, int] = field(default_factory=dict)
    """rows there were when a file was put where others see it"""


_written: dict[tuple[str, str, str], _Written] = defaultdict(_Written)
_mutex = threading.Lock()


def append(place: Place, row: StageRow) -> None:
    """Add a row to the file this process keeps for the place's run and storey."""
    folder = place.model_copy(update={"scan": None}).folder("stages")
    with _mutex:
        written = _written[place.store, folder, place.run]
    with written.writing:
        written.rows.append(row)
        count = len(written.rows)
        full = (count - 1) // FULL_ROWS
        path = Path(place.store) / folder / f"{place.run}-{_process()}.{full:04d}.parquet"
        replace_table(path, to_table(written.rows[full * FULL_ROWS :]))
    with written.sharing:
        if written.shared.get(path, 0) < count:
            with written.writing:
                count = len(written.rows)  # those that others wrote meanwhile go with it
            share(place.store, path)
            written.shared[path] = count


def of_run(place: Place) -> list[StageRow]:
    """Return the rows of one run of a storey, in the order they ended in."""
    uri = place.model_copy(update={"scan": None}).folder("stages")
    refresh(place.store, uri)
    folder = Path(place.store) / uri
    files = sorted(folder.glob(f"{place.run}-*.parquet"))
    return [row for file in files for row in from_table(pq.read_table(file, partitioning=None))]


def forget(place: Place) -> None:
    """Drop what this process keeps of a run that has ended."""
    folder = place.model_copy(update={"scan": None}).folder("stages")
    with _mutex:
        _written.pop((place.store, folder, place.run), None)


def _process() -> str:
    """Return a name of this process: a run's stages may be spread over several, on any machine."""
    return f"{sha256(socket.gethostname().encode()).hexdigest()[:6]}{os.getpid()}"


def reason(error: BaseException) -> str:
    """Return why something failed, in one line: what is not meant for people, with its type."""
    line = redacted((str(error).splitlines() or [""])[0])
    if isinstance(error, MapSenseError):
        return line
    return f"{type(error).__name__}: {line}" if line else type(error).__name__


def to_table(rows: list[StageRow]) -> pa.Table:
    """Return one row per stage run."""
    names = [field.name for field in fields(StageRow)]
    columns = {name: [getattr(row, name) for row in rows] for name in names}
    return pa.table([columns[name] for name in SCHEMA.names], schema=SCHEMA)


def from_table(table: pa.Table) -> list[StageRow]:
    """Return the rows a table holds."""
    return [StageRow(**row | {"outputs": tuple(row["outputs"])}) for row in table.to_pylist()]
