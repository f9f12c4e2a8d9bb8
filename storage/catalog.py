"""SQL over everything a store holds: views made in memory, thrown away after.

The Parquet files are the truth; nothing is kept here that could be lost or locked, so any number
of readers may ask while flows write. A view of a stored thing (`planes`, `rooms`, ...) shows what
the last successful run of each storey made or took from the cache; the same name with `_all` shows
every artifact there is. `runs` and `stages` are histories and show everything.
"""

import importlib
import pkgutil
from collections.abc import Mapping
from dataclasses import dataclass, field
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


class QueryError(MapSenseError):
    """A query that cannot be answered, and why."""


@dataclass(frozen=True)
class NamedQuery:
    """A query that comes with MapSense."""

    name: str
    about: str
    sql: str


@dataclass
class Catalog:
    """The views of one store."""

    connection: duckdb.DuckDBPyConnection
    problems: list[str] = field(default_factory=list)
    """files that were left out, and why"""

    def query(self, name_or_sql: str, params: Mapping[str, Any] | None = None) -> pa.Table:
        """Return the answer to a named query or to SQL; `$name` in it stands for a parameter."""
        named = {query.name: query.sql for query in named_queries()}
        sql = named.get(name_or_sql.strip(), name_or_sql)
        if " " not in sql.strip() and "\n" not in sql.strip():
            raise QueryError(
                f"'{sql}' is no named query; there are {', '.join(sorted(named))}, or write SQL"
            )
        try:
            answer = self.connection.sql(sql, params=dict(params) if params else None)
            return pa.table({}) if answer is None else answer.to_arrow_table()
        except duckdb.Error as error:
            raise QueryError(f"the query failed: {_sentence(error)}") from error


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
    """Return the answer to a named query or to SQL over a store; see `open_catalog` for more."""
    return open_catalog(store).query(name_or_sql, params)


def open_catalog(store: Path | str) -> Catalog:
    """Return the views over a store as it is now; a file that is no table of ours is left out.

    Arrow reads the files, DuckDB only sees the tables: its access to files is switched off for
    good, so no SQL can write, change or remove anything in the store, or read beside it.
    """
    root = Path(store)
    catalog = Catalog(duckdb.connect(":memory:"))
    catalog.connection.execute("set TimeZone = 'UTC'")
    catalog.connection.execute("set enable_external_access = false")
    for table, schema in HISTORIES.items():
        catalog.connection.register(table, _dataset(root, table, schema, None, catalog).to_table())
    current = _current(catalog.connection)
    for kind in _all_kinds():
        for name, only in ((kind.table, current), (f"{kind.table}_all", None)):
            catalog.connection.register(
                name, _dataset(root, kind.table, kind.schema, only, catalog)
            )
    catalog.connection.execute("set lock_configuration = true")
    catalog.problems = sorted(set(catalog.problems))
    return catalog


def _all_kinds() -> list[Kind[Any]]:
    """Return every stored thing: each module of this package registers its own."""
    for module in pkgutil.iter_modules(storage.__path__):
        if module.name != "catalog":
            importlib.import_module(f"storage.{module.name}")
    return [kind for kind in kinds() if kind.type.__module__.startswith("storage.")]


def _current(connection: duckdb.DuckDBPyConnection) -> set[str]:
    """Return the artifacts of each storey's last successful run."""
    mapped = ", ".join(f"'{state}'" for state in runs.MAPPED)
    rows = connection.sql(
        f"""
        with last as (
          select id from runs where state in ({mapped})
          qualify row_number() over (partition by building, storey order by started_at desc, id) = 1
        )
        select distinct unnest(outputs) from stages join last on stages.run = last.id
        """
    ).fetchall()
    return {uri for (uri,) in rows}


def _dataset(
    root: Path, table: str, schema: pa.Schema, only: set[str] | None, catalog: Catalog
) -> ds.Dataset:
    """Return one table's files as one table, its place in the building as columns."""
    sound = []
    paths = sorted(path.relative_to(root).as_posix() for path in root.glob(f"{table}/**/*.parquet"))
    for path in paths:
        if only is None or path in only:
            problem = _problem(root / path, table, schema)
            if problem is None:
                sound.append(path)
            else:
                catalog.problems.append(f"{root / path}: {problem}; left out")
    partitions = [pa.field(name, pa.string()) for name in PARTITIONS if name not in schema.names]
    whole = pa.schema([*partitions, *schema])
    if not sound:
        return ds.dataset(whole.empty_table())
    return ds.dataset(
        [str(root / path) for path in sound],
        schema=whole,
        format="parquet",
        partitioning=ds.partitioning(pa.schema(partitions), flavor="hive"),
        partition_base_dir=str(root / table),
    )


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
