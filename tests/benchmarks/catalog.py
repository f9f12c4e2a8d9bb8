"""Named queries over ten million metric rows in thousands of small files."""

import re
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import duckdb
import pyarrow as pa
from harness import BenchmarkError, Case, Prepared, _reset_peak, _resident, measure
from metric_store import Size, make_store
from report import Column, Report, Table, Target

from storage import packs
from storage.catalog import Catalog, all_kinds, named_queries
from storage.views import SETTINGS, Views

ROWS = 9_600_000
"""Detections; with rows of stages, runs, walls, energy and quality they are ten million."""
FILES = (500, 5_000)
"""Evaluations the same rows are of: as many files of each of four tables."""
QUICK_ROWS, QUICK_FILES = 240_000, (100, 400)
UNPACKED = ("area_error", "slowest", "worst_rooms")
"""Queries also asked of the small files as they are: a few tell."""
ROUNDS = 3
MOST = 4.0
"""Time of a query over thousands of small files, at most, as a share of that over few great ones,
where that takes longer than SHORT_S: else looking at the files is most of it."""
SHORT_S = 0.1
LONGEST_S = 5.0
PACKED, FEW, AS_THEY_ARE = "packed", "few great files", "small files as they are"

COLUMNS = (
    Column("case", "query"), Column("rows", "rows"), Column("packed_s", "packed s", "{:.3f}"),
    Column("few_s", "few great files s", "{:.3f}"), Column("ratio", "packed / few", "{:.2f}"),
    Column("unpacked_s", "small files s", "{:.2f}"),
    Column("packed_mb", "peak MB, packed", "{:.0f}"), Column("few_mb", "few", "{:.0f}"),
)  # fmt: skip
NOTES = [
    "Packed: `Catalog.query` as people call it, from the folder to the answer, once the small",
    "files are packed; the first line is the query that packs them. Few great files: the same rows",
    "as the views show them, run columns included, a Parquet file each, read by DuckDB alone: what",
    "is asked for and no more. Least of several runs. Memory is above what was resident before.",
]


def catalog(quick: bool) -> Report:
    """Measure each named query; quick takes fewer rows and files, once."""
    rows, files = (QUICK_ROWS, QUICK_FILES) if quick else (ROWS, FILES)
    report = Report("Catalog: named queries over small files", notes=list(NOTES))
    for count in files:
        with tempfile.TemporaryDirectory() as folder:
            store = Path(folder) / "store"
            make_store(store, Size(count, rows))
            found = compare(store, Path(folder) / "few", 1 if quick else ROUNDS)
        title = f"{rows:,} detections of {count:,} evaluations, {4 * count:,} small files"
        report.tables.append(Table(title, COLUMNS, found))
        report.targets += targets(count, found)
    return report


def targets(count: int, found: list[dict[str, Any]]) -> list[Target]:
    """Return what the figures of a store should keep."""
    asked = [row for row in found if "few_s" in row]
    ratios = [row["ratio"] for row in asked if row["few_s"] > SHORT_S]
    longest = max(row["packed_s"] for row in asked)
    what = f"{count:,} evaluations: "
    return [
        Target(
            what + "worst query / few files", max(ratios, default=None), MOST, "x", of_time=True
        ),
        Target(what + "slowest query", longest, LONGEST_S, " s", of_time=True),
    ]


def compare(store: Path, few: Path, rounds: int) -> list[dict[str, Any]]:
    """Return the figures of each query; `few` is the folder for the same rows in few files."""
    unpacked = _asked(Case(AS_THEY_ARE, partial(prepare_unpacked, store)))
    first = measure(Case("packing", partial(prepare_first, store)), rounds=1)["packing"]
    _write_few(store, few)
    packed = _asked(Case(PACKED, partial(prepare_packed, store, rounds)))
    base = _asked(Case(FEW, partial(prepare_few, few, rounds), rival=True))
    rows = [first.row() | {"case": "(packing)", "packed_s": first.median_s}]
    rows[0]["packed_mb"] = first.above_mb
    for name, ours in packed.items():
        theirs = base[name]
        if ours["rows"] != theirs["rows"]:
            raise BenchmarkError(f"{name}: {ours['rows']} rows, of few files {theirs['rows']}")
        rows.append(
            {
                "case": name,
                "rows": ours["rows"],
                "packed_s": ours["seconds"],
                "packed_mb": ours["above_mb"],
                "few_s": theirs["seconds"],
                "few_mb": theirs["above_mb"],
                "ratio": ours["seconds"] / theirs["seconds"],
                "unpacked_s": unpacked.get(name, {}).get("seconds"),
                "others": ours["others"],
            }
        )
    return rows


def _asked(case: Case) -> dict[str, dict[str, Any]]:
    measured = measure(case, rounds=1)[case.name]
    return {
        name: row | {"others": measured.others} for name, row in measured.figures["asked"].items()
    }


def prepare_first(store: Path) -> Prepared:
    """Return the first queries there are: of all tables, that packs them."""
    tables = ("runs", "detections_all", "wall_quality_all", "energy_all", "quality_all")
    asks = [f"select count(*) as n from {table}" for table in tables]
    named_queries()
    return Prepared(lambda: [Catalog(store).query(ask) for ask in asks])


def prepare_packed(store: Path, rounds: int) -> Prepared:
    """Return all named queries over a store."""
    return _all_asked(Catalog(store).query, [query.name for query in named_queries()], rounds)


def prepare_unpacked(store: Path) -> Prepared:
    """Return some queries over a store none of whose files are packed."""
    packs.ENOUGH = 1 << 60
    return _all_asked(Catalog(store).query, list(UNPACKED), 1)


def prepare_few(folder: Path, rounds: int) -> Prepared:
    """Return all named queries over the views, a file each."""
    connection = duckdb.connect(":memory:")
    for setting in SETTINGS:
        connection.execute(setting)
    for path in folder.glob("*.parquet"):
        connection.execute(f"create view {path.stem} as from read_parquet('{path}')")
    sql = {query.name: query.sql for query in named_queries()}
    return _all_asked(lambda name: connection.sql(sql[name]).to_arrow_table(), list(sql), rounds)


def _all_asked(ask: Callable[[str], pa.Table], names: list[str], rounds: int) -> Prepared:
    return Prepared(
        lambda: {name: _one_asked(ask, name, rounds) for name in names},
        lambda asked: {"asked": asked},
    )


def _one_asked(ask: Callable[[str], pa.Table], name: str, rounds: int) -> dict[str, Any]:
    """Return the least time of a query and its greatest memory, in this process."""
    seconds, above = [], []
    for _ in range(rounds):
        before = _resident("VmRSS")
        _reset_peak()
        start = time.perf_counter()
        rows = ask(name).num_rows
        seconds.append(time.perf_counter() - start)
        peak = _resident("VmHWM")
        above.append(None if peak is None or before is None else peak - before)
    known = [mb for mb in above if mb is not None]
    return {"rows": rows, "seconds": min(seconds), "above_mb": max(known, default=None)}


def _write_few(store: Path, folder: Path) -> None:
    """Write what each view shows, to a file."""
    folder.mkdir()
    kinds = {kind.table: kind for kind in all_kinds()}
    views = Views(store, kinds, {}, print)
    try:
        names = ["runs", "stages", "parameters", *kinds, *(f"{kind}_all" for kind in kinds)]
        used = set(re.findall(r"\w+", " ".join(query.sql for query in named_queries())))
        for name in [name for name in names if name in used]:
            views.provide(name)
            views.connection.execute(
                f"copy (select * from {name}) to '{folder / name}.parquet' (compression zstd)"
            )
    finally:
        views.close()
