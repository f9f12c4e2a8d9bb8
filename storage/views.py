"""The views of a store in one connection of DuckDB, made for one query and thrown away after.

A view of a stored thing has one row per row of an artifact and run that made or reused it: of the
artifacts of current runs, or of all there are (`_all`). What a row is of (building, storey, scan)
and the run (run, variant, seed, parameters) stand before its own columns; where a thing has a
column of such a name itself, that is the one shown.
"""

import errno
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import duckdb
import pyarrow as pa
import pyarrow.dataset as ds
import pyarrow.parquet as pq

from storage import packs, runs, stages
from storage.artifacts import Kind
from storage.errors import StoreError
from storage.read_only import ReadOnlyFiles, url
from storage.remote import obtain_all, refresh
from storage.table_files import PARTITIONS, Stamp, find, is_of, place, problem, stamps

HISTORIES = {"runs": runs.SCHEMA, "stages": stages.SCHEMA}
PARAMETERS = "parameters"
OF_RUN = ("run", "variant", "seed", "parameters")
EVERY = "_all"
"""End of the name of a view of every artifact."""
READ_ONLY = {errno.EACCES, errno.EPERM, errno.EROFS}
ATTEMPTS = 20
"""How often an index is read whose packs another merges away meanwhile."""

SETTINGS = (
    "set TimeZone = 'UTC'",
    "set python_enable_replacements = false",  # no variable of ours is a table
    "set enable_geoparquet_conversion = false",  # polygons stay WKB
    "create schema internal",
    # +- of a 95 % confidence interval of a mean: two-sided quantiles of Student's t for 1, 2, ...
    # degrees of freedom, a normal one beyond; null of a single value
    """create macro confidence95(x) as stddev_samp(x) / sqrt(count(x)) * coalesce([
      12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179,
      2.160, 2.145, 2.131, 2.120, 2.110, 2.101, 2.093, 2.086, 2.080, 2.074, 2.069, 2.064,
      2.060, 2.056, 2.052, 2.048, 2.045][count(x) - 1], 1.96)""",
)
CURRENT = """
create table internal.current as
with last as (
  select id, building, storey, variant, seed, parameters from runs
  where list_contains($mapped, state)
  qualify row_number() over (
    partition by building, storey, verb = $evaluate, variant, seed
    order by started_at desc, id desc
  ) = 1
),
made as (select run, building, storey, unnest(outputs) as uri from stages)
select distinct made.uri, made.run, last.variant, last.seed, last.parameters
from made join last
  on made.run = last.id and made.building = last.building and made.storey = last.storey
"""
LISTED = """
create table internal.listed as
with made as (select run, building, storey, unnest(outputs) as uri from stages)
select distinct made.uri, made.run, runs.variant, runs.seed, runs.parameters
from made left join runs
  on made.run = runs.id and made.building = runs.building and made.storey = runs.storey
"""
LEAVES = """
create view parameters as
with asked as (
  -- a run over several storeys is recorded for each
  select id as run, any_value(asked) as asked from runs where json_valid(asked) group by id
)
select run, fullkey[10:] as name, cast(value as varchar) as value
from asked, json_tree(asked, '$.params')
-- a list is one value
where (type != 'OBJECT' or cast(value as varchar) = '{}') and not contains(fullkey, '[')
  and fullkey != '$.params'
"""


_PLACES = pa.schema(
    [
        pa.field("uri", pa.string()),
        pa.field("file", pa.int64()),
        pa.field("path", pa.string()),
        *(pa.field(name, pa.string()) for name in PARTITIONS),
    ]
)


class Views:
    """A connection with the views a query needs.

    Parameters
    ----------
    tell : told of each file that is left out, and why
    """

    def __init__(
        self,
        store: Path,
        kinds: Mapping[str, Kind[Any]],
        named: Mapping[str, str],
        tell: Callable[[str], None],
    ) -> None:
        self.store, self._named, self._tell = store, named, tell
        self._kinds = kinds
        self._files = ReadOnlyFiles(store)
        self.connection = duckdb.connect(":memory:")
        self.connection.register_filesystem(self._files)
        for setting in SETTINGS:
            self.connection.execute(setting)
        self._made: set[str] = set()
        self._views = {*HISTORIES, PARAMETERS, *kinds, *(f"{k}{EVERY}" for k in kinds)}

    def close(self) -> None:
        """Throw the views away."""
        self.connection.close()
        self._files.close()

    def provide(self, sql: str) -> None:
        """Make the views a query may need, and those they need: each takes a look at its files."""
        code = re.sub(r"(?m)^\s*--.*$", "", sql.lower())
        words = set(re.findall(r"\w+", code))
        if words & {"show", "information_schema", "duckdb_views", "duckdb_columns"}:
            words |= self._views | set(self._named)
        for name in sorted(words & self._views):
            self._make(name)
        for name in sorted(words & set(self._named) - self._views):
            if name not in self._made:
                self._made.add(name)
                self.provide(self._named[name])
                self.connection.execute(f"create view {name} as {self._named[name]}")

    def lock(self) -> None:
        """Leave nothing to SQL but to read the files of the views, for good."""
        allowed = ", ".join(_text(name) for name in self._files.urls)
        self.connection.execute(f"set allowed_paths = [{allowed}]")
        self.connection.execute("set enable_external_access = false")
        self.connection.execute("set lock_configuration = true")

    def _make(self, name: str) -> None:
        if name in self._made:
            return
        self._made.add(name)
        if name in HISTORIES:
            self._make_history(name)
        elif name == PARAMETERS:
            self._make("runs")
            self.connection.execute(LEAVES)
        else:
            self._make_kind(name)

    def _make_history(self, table: str) -> None:
        """Make the view of a history: its files are rewritten while a run goes on."""
        schema = HISTORIES[table]
        if table == "stages":
            self._make("runs")  # first: of a run that has ended there all stages are there
        refresh(self.store, table)
        known = find(self.store, table)
        inside = self._packed(table, schema, known)
        left = [uri for uri in known if uri not in inside]
        self._put(f"{table}_files", _places(inside, []))
        self._put(f"{table}_left", self._read(table, schema, self._sound(left, table, schema)))
        columns = _columns(PARTITIONS, schema, "p.", "d.")
        parts = [f"select {_columns(PARTITIONS, schema)} from internal.{table}_left"]
        if inside:
            parts.append(_packed_rows(inside, columns, f"{table}_files"))
        self.connection.execute(f"create view {table} as {' union all '.join(parts)}")

    def _make_kind(self, name: str) -> None:
        kind = self._kinds.get(name) or self._kinds[name.removesuffix(EVERY)]
        every = name != kind.table
        listing = self._listing(every)
        if every:
            refresh(self.store, kind.table)
            known = find(self.store, kind.table)
        else:
            named = self.connection.execute(
                f"select distinct uri from {listing} where starts_with(uri, $start)",
                {"start": f"{kind.table}/"},
            ).fetchall()
            uris = [uri for (uri,) in named if is_of(kind.table, uri)]
            obtain_all(self.store, uris)
            known = stamps(self.store, uris)
        inside = self._packed(kind.table, kind.schema, known)
        left = [uri for uri in known if uri not in inside]
        sound = self._sound(left, kind.table, kind.schema)
        self._put(f"{name}_files", _places(inside, sound))
        self.connection.execute(
            f"create table internal.{name}_rows as select p.*, l.* exclude (uri) "
            f"from internal.{name}_files p {'left' if every else ''} join {listing} l "
            "on p.uri = l.uri"
        )
        for uri in sound:
            self._files.allow(uri)
        columns = _columns((*PARTITIONS, *OF_RUN), kind.schema, "p.", "d.")
        parts = []
        if inside:
            parts.append(_packed_rows(inside, columns, f"{name}_rows"))
        if sound:
            parts.append(_left_rows(sound, columns, f"{name}_rows"))
        if not parts:
            self._put(f"{name}_none", kind.schema.empty_table())
            parts.append(
                f"select {columns} from internal.{name}_none d, internal.{name}_rows p where false"
            )
        self.connection.execute(f"create view {name} as {' union all '.join(parts)}")

    def _listing(self, every: bool) -> str:
        """Return the name of the table of artifacts and the runs they are of."""
        name = "internal.listed" if every else "internal.current"
        if name not in self._made:
            self._made.add(name)
            self._make("stages")
            params = {"mapped": list(runs.MAPPED), "evaluate": runs.EVALUATE}
            self.connection.execute(LISTED if every else CURRENT, None if every else params)
        return name

    def _packed(
        self, table: str, schema: pa.Schema, known: dict[str, Stamp]
    ) -> dict[str, packs.Packed]:
        """Return the files that are read from packs; packs first if many are in none."""
        inside = self._held(table, schema, known)
        if len(packs.unpacked(known, inside)) < packs.ENOUGH:
            return inside
        try:
            packs.pack(self.store, table, schema, self._settled(table))
        except (OSError, StoreError, pa.ArrowException) as error:
            # a store that is only to be read is read file by file
            if getattr(error, "errno", None) not in READ_ONLY:
                folder = self.store / packs.FOLDER
                self._tell(f"{folder}: cannot pack files ({error}); delete the folder")
            return inside
        return self._held(table, schema, known)

    def _held(
        self, table: str, schema: pa.Schema, known: dict[str, Stamp]
    ) -> dict[str, packs.Packed]:
        """Return the files that packs hold, and keep these packs while the connection lives."""
        for _ in range(ATTEMPTS):
            inside = packs.read_index(self.store, table, schema).live(known)
            try:
                for name in {packed.pack for packed in inside.values()}:
                    self._files.hold(name)
            except FileNotFoundError:
                continue
            return inside
        return {}

    def _settled(self, table: str) -> Callable[[str], bool]:
        """Return what says of a table's file whether it stays as it is."""
        if table == "runs":
            return self._has_ended
        if table != "stages":
            return lambda _: True
        ended = self.connection.execute(
            "select building, storey, id from runs where ended_at is not null"
        ).fetchall()
        known = set(ended)

        def of_ended_run(uri: str) -> bool:
            about = place(uri)
            run, _, _ = Path(uri).stem.rpartition("-")  # then comes the process
            return (about["building"], about["storey"], run) in known

        return of_ended_run

    def _has_ended(self, uri: str) -> bool:
        try:
            ends = pq.read_table(self.store / uri, columns=["ended_at"], partitioning=None)
        except (OSError, pa.ArrowException):
            return False
        return ends.num_rows > 0 and ends["ended_at"].null_count == 0

    def _sound(self, uris: Iterable[str], table: str, schema: pa.Schema) -> list[str]:
        """Return the files that are the table's; the others are told."""
        sound = []
        for uri in uris:
            wrong = problem(self.store / uri, table, schema)
            if wrong is None:
                sound.append(uri)
            else:
                self._tell(f"{self.store / uri}: {wrong}; left out")
        return sound

    def _read(self, table: str, schema: pa.Schema, uris: list[str]) -> pa.Table:
        """Return the rows of files that may be rewritten any time: each is opened once."""
        partitions = [p for p in PARTITIONS if p not in schema.names]
        whole = pa.schema([*(pa.field(name, pa.string()) for name in partitions), *schema])
        if not uris:
            return whole.empty_table()
        return ds.dataset(
            [str(self.store / uri) for uri in uris],
            schema=whole,
            format="parquet",
            partitioning=ds.partitioning(
                pa.schema([whole.field(name) for name in partitions]), flavor="hive"
            ),
            partition_base_dir=str(self.store / table),
        ).to_table()

    def _put(self, name: str, table: pa.Table) -> None:
        """Make a table of our own."""
        self.connection.register("_given", table)
        self.connection.execute(f"create table internal.{name} as from _given")
        self.connection.unregister("_given")


def _places(inside: Mapping[str, packs.Packed], left: Iterable[str]) -> pa.Table:
    """Return where the rows of each file are: its number in a pack, or its own name."""
    packed = [(uri, p.file, None, *place(uri).values()) for uri, p in inside.items()]
    alone = [(uri, None, url(uri), *place(uri).values()) for uri in left]
    columns = zip(*packed, *alone, strict=True) if packed or alone else [()] * len(_PLACES)
    return pa.table([list(column) for column in columns], schema=_PLACES)


def _columns(first: Iterable[str], schema: pa.Schema, of: str = "", own: str = "") -> str:
    """Return the columns of a view: those before its own, but what it has itself, and its own."""
    before = [f"{of}{name}" for name in first if name not in schema.names]
    return ", ".join([*before, *(f'{own}"{name}"' for name in schema.names)])


def _packed_rows(inside: Mapping[str, packs.Packed], columns: str, places: str) -> str:
    names = ", ".join(_text(url(name)) for name in sorted({p.pack for p in inside.values()}))
    return (
        f"select {columns} from read_parquet([{names}]) d "
        f"join internal.{places} p on d.{packs.FILE} = p.file"
    )


def _left_rows(uris: Iterable[str], columns: str, places: str) -> str:
    names = ", ".join(_text(url(uri)) for uri in uris)
    return (
        f"select {columns} from read_parquet([{names}], filename = '_path', "
        f"hive_partitioning = false) d join internal.{places} p on d._path = p.path"
    )


def _text(value: str) -> str:
    return "'" + value.replace("'", "''") + "'"
