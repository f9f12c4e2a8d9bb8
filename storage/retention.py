"""Which of a store's runs are kept, and what they need.

A run is current if it is the last successful one of its building, storey, verb, variant and seed;
one that came later and failed, or was killed, is kept too until one succeeds: running it again
takes up what it computed. Needed is what kept runs made or took from the cache, by the rows of
their stages: an input of anything kept is there too, since a stage of the same run made it or took
it. Runs that computed something needed keep their record and rows, which say what it cost.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from storage.errors import StoreError
from storage.runs import MAPPED, Run

_NO_ROWS = pa.schema(
    [
        pa.field("run", pa.string()),
        pa.field("key", pa.string()),
        pa.field("outcome", pa.string()),
        pa.field("outputs", pa.list_(pa.string())),
    ]
).empty_table()


@dataclass(frozen=True)
class Keep:
    """Which runs are kept, whatever came after them."""

    runs: int = 1
    """last successful ones of each building, storey, verb, variant and seed"""
    since: datetime | None = None
    """runs that began then or later"""

    def __post_init__(self) -> None:
        if self.runs < 1:
            raise ValueError(f"runs: expected at least 1, got {self.runs}")


@dataclass(frozen=True)
class Needed:
    """What is needed of a storey."""

    runs: frozenset[str]
    """ids of the runs whose record and rows stay"""
    keys: frozenset[str]
    """cache keys"""
    uris: frozenset[str]
    """artifacts, relative to the store"""


def kept_runs(runs: Sequence[Run], keep: Keep) -> list[Run]:
    """Return the runs of a storey that are kept, of all it has, in the order they began."""
    by_method: dict[tuple[str, str, int | None], list[Run]] = {}
    for run in runs:
        by_method.setdefault((run.verb, run.variant, run.seed), []).append(run)
    kept = set()
    for of_method in by_method.values():
        successful = 0
        for run in reversed(of_method):
            if successful < keep.runs and (run.state in MAPPED or not successful):
                kept.add(run.id)
                successful += run.state in MAPPED
    return [r for r in runs if r.id in kept or (keep.since and r.started_at >= keep.since)]


def needed(rows: Iterable[pa.Table], runs: Sequence[Run], keep: Keep) -> Needed:
    """Return what the kept runs of a storey need.

    Parameters
    ----------
    rows : `stage_rows` of every file of the storey
    runs : every run of it
    """
    kept = {run.id for run in kept_runs(runs, keep)}
    done = [
        row for row in pa.concat_tables([_NO_ROWS, *rows]).to_pylist() if row["outcome"] != "failed"
    ]
    of_kept = [row for row in done if row["run"] in kept]
    keys = frozenset(row["key"] for row in of_kept)
    uris = frozenset(uri for row in of_kept for uri in row["outputs"])
    made = {
        row["run"]
        for row in done
        if row["outcome"] == "computed" and row["key"] in keys and uris.issuperset(row["outputs"])
    }
    return Needed(frozenset(kept | (made & {run.id for run in runs})), keys, uris)


def stage_rows(path: Path) -> pa.Table:
    """Return run, key, outcome and outputs of the stages in a file.

    Raises
    ------
    StoreError
        If it is no record of stages.
    """
    schema = _NO_ROWS.schema
    try:
        return pq.read_table(path, columns=schema.names, partitioning=None).cast(schema)
    except (OSError, pa.ArrowException, ValueError, KeyError) as error:
        raise StoreError(
            f"{path}: is no record of stages ({' '.join(str(error).split())}); remove the file: "
            "what only its run knows of is computed again"
        ) from error
