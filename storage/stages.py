"""What each run of a stage cost, and how it ended: one row per stage and run, cached ones too.

Each process keeps a file per flow run and storey and writes it anew with each row, atomically: a
killed run loses no row of a stage that had ended, a reader never meets a row twice, and files are
far fewer than rows. A file that is full is followed by another, so that a row costs the same
however many came before it.
"""

import os
import socket
import threading
import time
from collections import OrderedDict
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
OPEN_RUNS = 64
"""Runs whose last file a process keeps in mind: a worker of a cluster takes part in many."""


@dataclass
class _Written:
    """The file this process writes of a run, and its rows."""

    path: Path | None = None
    rows: list[StageRow] = field(default_factory=list)
    writing: threading.Lock = field(default_factory=threading.Lock)
    sharing: threading.Lock = field(default_factory=threading.Lock)
    shared: tuple[Path | None, int] = (None, 0)
    """the file that was last put where others see it, and its rows then"""


_written: OrderedDict[tuple[str, str, str], _Written] = OrderedDict()
_mutex = threading.Lock()


def append(place: Place, row: StageRow) -> None:
    """Add a row to the file this process keeps for the place's run and storey."""
    folder = place.model_copy(update={"scan": None}).folder("stages")
    key = (place.store, folder, place.run)
    with _mutex:
        written = _written.setdefault(key, _Written())
        _written.move_to_end(key)
        if len(_written) > OPEN_RUNS:  # one that comes again begins another file
            _written.popitem(last=False)
    with written.writing:
        if written.path is None or len(written.rows) >= FULL_ROWS:
            # by time, so that the files of a process are read in the order they were written in
            name = f"{place.run}-{_process()}.{time.time_ns():016x}.parquet"
            written.path, written.rows = Path(place.store) / folder / name, []
        written.rows.append(row)
        path, count = written.path, len(written.rows)
        replace_table(path, to_table(written.rows))
    with written.sharing:
        before, put = written.shared
        if before != path or put < count:
            with written.writing:
                if written.path == path:
                    count = len(written.rows)  # those that others wrote meanwhile go with it
            share(place.store, path)
            written.shared = (path, count)


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
