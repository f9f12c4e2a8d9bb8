"""SQL over everything a store holds: views made in memory, thrown away after.

The Parquet files are the truth; nothing is kept here that could be lost or locked, so any number
of readers may ask while flows write. A view of a stored thing (`planes`, `rooms`, ...) shows what
the last successful run of each storey, and the last evaluation of it, made or took from the cache;
the same name with `_all` shows every artifact there is. `runs` and `stages` are histories and show
everything.
"""

import importlib
import logging
import pkgutil
import re
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import duckdb
import pyarrow as pa
import pyarrow.dataset as ds
import pyarrow.parquet as pq

import storage
from storage import runs, stages
from storage.artifacts import SCHEMA_VERSION, Kind, kinds
from storage.errors import MapSenseError

PARTITIONS = ("building", "storey", "scan")
HISTORIES = {"runs": runs.SCHEMA, "stages": stages.SCHEMA}


CURRENT = """
with last as (
  select id from runs where list_contains($mapped, state)
  qualify row_number() over (
    partition by building, storey, verb = $evaluate order by started_at desc, id desc
  ) = 1
)
select distinct unnest(outputs) from stages join last on stages.run = last.id
"""
log = logging.getLogger(__name__)


class QueryError(MapSenseError):
    """A query that cannot be answered, and why."""


@dataclass(frozen=True)
class NamedQuery:
    """A query that comes with MapSense."""

    name: str
    about: str
    sql: str


class Catalog:
    """The views of one store, each made when a query first names it.

    Arrow reads the files, DuckDB only sees the tables: its access to files is switched off for
    good, so no SQL can write, change or remove anything in the store, or read beside it.
    """

    def __init__(self, store: Path | str) -> None:
        self.store = Path(store)
        self.problems: list[str] = []
        """files that were left out, and why"""
        self._connection = duckdb.connect(":memory:")
        for setting in ("TimeZone = 'UTC'", "enable_external_access = false"):
            self._connection.execute(f"set {setting}")
        self._connection.execute("set lock_configuration = true")
        for table, schema in HISTORIES.items():
            self._connection.register(table, self._dataset(table, schema, None).to_table())
        self._kinds = {kind.table: kind for kind in _all_kinds()}
        self._views = {*self._kinds, *(f"{table}_all" for table in self._kinds)}

    def query(self, name_or_sql: str, params: Mapping[str, Any] | None = None) -> pa.Table:
        """Return the answer to a named query or to SQL; `$name` in it stands for a parameter."""
        sql = _sql(name_or_sql)
        self._make_views(sql)
        try:
            answer = self._connection.sql(sql, params=dict(params) if params else None)
            return pa.table({}) if answer is None else answer.to_arrow_table()
        except duckdb.Error as error:
            raise QueryError(f"the query failed: {_sentence(error)}") from error

    def _make_views(self, sql: str) -> None:
        """Make the views a query may need: looking at every file of a store takes its time."""
        words = set(re.findall(r"\w+", sql.lower()))
        asks_for_tables = words & {"show", "information_schema", "duckdb_views", "duckdb_columns"}
        for name in sorted(self._views if asks_for_tables else self._views & words):
            kind = self._kinds.get(name) or self._kinds[name.removesuffix("_all")]
            only = self._current() if name == kind.table else None
            self._connection.register(name, self._dataset(kind.table, kind.schema, only))
            self._views.discard(name)

    def _current(self) -> set[str]:
        """Return the artifacts of each storey's last successful run."""
        params = {"mapped": list(runs.MAPPED), "evaluate": runs.EVALUATE}
        rows = self._connection.sql(CURRENT, params=params).fetchall()
        return {uri for (uri,) in rows}

    def _dataset(self, table: str, schema: pa.Schema, only: set[str] | None) -> ds.Dataset:
        """Return one table's files as one table, its place in the building as columns."""
        found = self.store.glob(f"{table}/**/*.parquet")
        paths = sorted(path.relative_to(self.store).as_posix() for path in found)
        sound = [
            str(self.store / path)
            for path in paths
            if (only is None or path in only) and self._is_sound(self.store / path, table, schema)
        ]
        partitions = [
            pa.field(name, pa.string()) for name in PARTITIONS if name not in schema.names
        ]
        whole = pa.schema([*partitions, *schema])
        if not sound:
            return ds.dataset(whole.empty_table())
        return ds.dataset(
            sound,
            schema=whole,
            format="parquet",
            partitioning=ds.partitioning(pa.schema(partitions), flavor="hive"),
            partition_base_dir=str(self.store / table),
        )

    def _is_sound(self, path: Path, table: str, schema: pa.Schema) -> bool:
        problem = _problem(path, table, schema)
        if problem is not None and (told := f"{path}: {problem}; left out") not in self.problems:
            self.problems.append(told)
        return problem is None


def named_queries() -> list[NamedQuery]:
    """Return the queries that come with MapSense, by name."""
    found = []
    for file in files("storage").joinpath("queries").iterdir():
        if file.name.endswith(".sql"):
            sql = file.read_text(encoding="utf-8")
            about = sql.splitlines()[0].removeprefix("--").strip()
            found.append(NamedQuery(file.name.removesuffix(".sql"), about, sql))
    return sorted(found, key=lambda query: query.name)


def run_query(
    store: Path | str, name_or_sql: str, params: Mapping[str, Any] | None = None
) -> pa.Table:
    """Return the answer to a named query or to SQL over a store.

    Files that are no tables of ours are left out and named in the log; `Catalog` lists them.
    """
    catalog = Catalog(store)
    answer = catalog.query(name_or_sql, params)
    for problem in catalog.problems:
        log.warning(problem)
    return answer


def _sql(name_or_sql: str) -> str:
    named = {query.name: query.sql for query in named_queries()}
    text = name_or_sql.strip()
    if text not in named and len(text.split()) < 2:
        raise QueryError(
            f"'{text}' is no named query; there are {', '.join(sorted(named))}, or write SQL"
        )
    return named.get(text, text)


def _all_kinds() -> list[Kind[Any]]:
    """Return every stored thing: each module of this package registers its own."""
    for module in pkgutil.iter_modules(storage.__path__):
        if module.name != "catalog":
            importlib.import_module(f"storage.{module.name}")
    return [kind for kind in kinds() if kind.type.__module__.startswith("storage.")]


def _problem(path: Path, table: str, schema: pa.Schema) -> str | None:
    """Return why a file is no part of a table; None if it is."""
    try:
        found = pq.read_schema(path)
    except (OSError, pa.ArrowException) as error:
        return f"cannot be read as Parquet ({_sentence(error)})"
    metadata = found.metadata or {}
    if (holds := metadata.get(b"mapsense.table", b"").decode()) != table:
        return f"holds table '{holds}', expected '{table}'" if holds else "was not written by us"
    if (version := metadata.get(b"mapsense.schema_version", b"").decode()) != SCHEMA_VERSION:
        return f"has schema version '{version}', expected '{SCHEMA_VERSION}'"
    for column in schema:
        if column.name not in found.names or found.field(column.name).type != column.type:
            return f"has no column '{column.name}' of type {column.type}"
    return None


def _sentence(error: Exception) -> str:
    return " ".join(str(error).split())
