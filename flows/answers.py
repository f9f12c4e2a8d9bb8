"""What the command line answers from the store alone."""

import csv
import json
import math
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import IO, Any

import pyarrow as pa
import pyarrow.parquet as pq

from flows.failures import Failure, failures_of
from flows.settings import load_settings
from storage.errors import MapSenseError, StoreError
from storage.runs import Run, goes_on, last_runs, read_runs

SHOWN = 5
"""Failures of a run that a table names."""


def ask(what: str | None, store: Path | None, form: str, out: Path | None) -> int:
    """Answer a query, or list the named ones."""
    from storage.catalog import Catalog, named_queries

    if what is None:
        print_table(
            pa.table(
                {
                    "query": [query.name for query in named_queries()],
                    "answers": [query.about for query in named_queries()],
                }
            )
        )
        return 0
    catalog = Catalog(existing_store(store))
    answer = catalog.query(what)
    for problem in catalog.problems:
        print(f"mapsense: {problem}", file=sys.stderr)
    if form == "parquet" and out is None:
        raise MapSenseError("--format parquet needs a file: add --out FILE")
    if out is None:
        write_answer(answer, form, sys.stdout)
        return 0
    try:
        if form == "parquet":
            pq.write_table(answer, out)
        else:
            with open(out, "w", encoding="utf-8", newline="") as file:
                write_answer(answer, form, file)
    except OSError as error:
        raise MapSenseError(f"{out}: cannot be written ({error.strerror or error})") from error
    return 0


def make_report(store: Path | None, out: Path, building: str | None) -> int:
    """Write the figures and the page of a store."""
    from flows.report.page import write_report

    print(write_report(existing_store(store), out, building))
    return 0


def show_status(building: str | None, storey: str | None, store: Path | None, as_json: bool) -> int:
    """Show the last run of each storey, and what failed in it."""
    root = existing_store(store)
    last = last_runs(read_runs(root, building, storey))
    rows = [_status(str(root), run) for run in last]
    for row, run in zip(rows, last, strict=True):
        failed = failures_of(str(root), run)
        row["failed"] = [f.as_json() for f in failed] if as_json else _listed(failed)
    if as_json:
        print(json.dumps(rows, indent=1, default=str))
    elif rows:
        print_table(pa.Table.from_pylist(rows))
    else:
        print(f"{root}: no storey was mapped")
    return 0


def _status(store: str, run: Run) -> dict[str, Any]:
    seconds = None
    if run.ended_at is not None:
        seconds = round((run.ended_at - run.started_at).total_seconds(), 1)
    elif goes_on(store, run):
        seconds = round((datetime.now(UTC) - run.started_at).total_seconds(), 1)
    return {
        "building": run.building,
        "storey": run.storey,
        "state": state_now(store, run),
        "started_at": f"{run.started_at:%Y-%m-%d %H:%M:%S}Z",
        "seconds": seconds,
        "message": run.message,
        "run": run.id,
    }


def _listed(failed: list[Failure]) -> str:
    """Return failures for a table: the first few, for a message tells the reasons."""
    names = [str(failure) for failure in failed[:SHOWN]]
    more = len(failed) - len(names)
    return ", ".join(names + ([f"{more} more"] if more else []))


def state_now(store: str, run: Run) -> str:
    """Return a run's state; one whose process died without a word was interrupted."""
    return "interrupted" if run.state == "running" and not goes_on(store, run) else run.state


def write_answer(answer: pa.Table, form: str, file: IO[str]) -> None:
    """Write an answer as a table for people, JSON or CSV."""
    if form == "json":
        rows = [{name: _json(value) for name, value in row.items()} for row in answer.to_pylist()]
        json.dump(rows, file, indent=1, default=_plain, allow_nan=False)
        file.write("\n")
    elif form == "csv":
        writer = csv.writer(file)
        writer.writerow(answer.column_names)
        writer.writerows(
            [_plain(value) if isinstance(value, bytes) else value for value in row.values()]
            for row in answer.to_pylist()
        )
    else:
        print_table(answer, file)


def print_answers(answers: dict[str, pa.Table], as_json: bool) -> None:
    """Print several tables by title, or all as one JSON object."""
    if as_json:
        print(json.dumps({k: v.to_pylist() for k, v in answers.items()}, indent=1, default=str))
        return
    for title, table in answers.items():
        print(f"\n{title}")
        print_table(table)


def print_table(table: pa.Table, file: IO[str] | None = None) -> None:
    """Print a table for people."""
    from rich.console import Console
    from rich.table import Table

    shown = Table(box=None, pad_edge=False, header_style="bold")
    for field in table.schema:
        number = pa.types.is_floating(field.type) or pa.types.is_integer(field.type)
        shown.add_column(field.name, justify="right" if number else "left", overflow="fold")
    for row in table.to_pylist():
        shown.add_row(*(_text(value) for value in row.values()))
    target = file or sys.stdout
    # in a pipe or a file a line is as long as it needs to be
    Console(file=target, width=None if target.isatty() else 10_000, highlight=False).print(
        shown, markup=False
    )


def _text(value: Any) -> str:
    if value is None:
        return "–"
    if isinstance(value, datetime):
        return f"{value:%Y-%m-%d %H:%M:%S}"
    return str(_plain(value)) if isinstance(value, bytes) else str(value)


def _json(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _plain(value: Any) -> str:
    return value.hex() if isinstance(value, bytes) else str(value)


def existing_store(store: Path | None) -> Path:
    """Return the folder of a store that is there, else raise StoreError."""
    settings = load_settings(store=store)
    root = settings.store
    if settings.remote is not None:
        root.mkdir(parents=True, exist_ok=True)  # filled from there
    if not root.is_dir():
        raise StoreError(f"{root}: there is no store; name one with --store, or map a storey first")
    return root
