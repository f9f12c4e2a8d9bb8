"""SQL over everything a store holds: views made in memory, thrown away after.

The Parquet files are the truth; nothing is kept that could be lost or locked, so any number of
readers may ask while flows write. A view of a stored thing (`planes`, `rooms`, ...) shows what
current runs made or took from the cache: the last successful run of each storey, variant and seed,
and the last evaluation of each. The same name with `_all` shows every artifact there is, once for
each run that made or took it. Both say which run that was: run, variant, seed and parameters.
`runs` and `stages` are histories and show everything; `parameters` has a row per run, name and
value of what the run was asked to use.

The named queries are views too, by the same name, where no stored thing has it: one can ask
`select * from recall_precision where building = 'ifp'`.
"""

import importlib
import logging
import pkgutil
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import duckdb
import pyarrow as pa

import storage
from storage.artifacts import Kind, kinds
from storage.errors import MapSenseError
from storage.views import Views

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
    """What can be asked of one store: each query sees it as it is then.

    No SQL can write, change or remove anything in the store, or read beside it. Readers may leave
    small files packed into few in a folder of their own, `.catalog`, which can be deleted.
    """

    def __init__(self, store: Path | str) -> None:
        self.store = Path(store)
        self.problems: list[str] = []
        """files that were left out, and why"""

    def query(self, name_or_sql: str, params: Mapping[str, Any] | None = None) -> pa.Table:
        """Return the answer to a named query or to SQL; `$name` in it stands for a parameter."""
        named = {query.name: query.sql for query in named_queries()}
        sql = _sql(name_or_sql, named)
        kinds = {kind.table: kind for kind in all_kinds()}
        views = Views(self.store, kinds, named, self._tell)
        try:
            views.provide(sql)
            views.lock()
            answer = views.connection.sql(sql, params=dict(params) if params else None)
            return pa.table({}) if answer is None else answer.to_arrow_table()
        except duckdb.Error as error:
            raise QueryError(f"the query failed: {_sentence(error)}") from error
        finally:
            views.close()

    def _tell(self, problem: str) -> None:
        if problem not in self.problems:
            self.problems.append(problem)


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


def _sql(name_or_sql: str, named: Mapping[str, str]) -> str:
    text = name_or_sql.strip()
    if text not in named and len(text.split()) < 2:
        raise QueryError(
            f"'{text}' is no named query; there are {', '.join(sorted(named))}, or write SQL"
        )
    return named.get(text, text)


def all_kinds() -> list[Kind[Any]]:
    """Return every stored thing: each module of this package registers its own."""
    for module in pkgutil.iter_modules(storage.__path__):
        # others would load libraries nobody asked for: those of IFC take a second
        if not module.ispkg and _registers(module.name):
            importlib.import_module(f"storage.{module.name}")
    return [kind for kind in kinds() if kind.type.__module__.startswith("storage.")]


@cache
def _registers(module: str) -> bool:
    return "= register(" in files("storage").joinpath(f"{module}.py").read_text("utf-8")


def _sentence(error: Exception) -> str:
    return " ".join(str(error).split())
