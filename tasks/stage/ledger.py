"""Rows of the `stages` table: who asked for what, and what came of it."""

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

from storage import stages
from storage.artifacts import Place, Ref
from storage.stages import StageRow
from tasks.stage import elsewhere
from tasks.stage.meter import Cost

Watcher = Callable[[Place, StageRow], None]


@dataclass
class Asked:
    """What a task run was asked for, known since its key was made."""

    place: Place
    stage: str
    key: str
    inputs: list[Ref]
    error: Exception | None = None
    """why there is no key"""
    started_at: datetime = field(default_factory=lambda: datetime.now(UTC))
    clock: float = field(default_factory=time.perf_counter)


_asked: dict[str, Asked] = {}
_watchers: list[Watcher] = []
_mutex = threading.Lock()


def remember(task_run: str, asked: Asked) -> None:
    """Keep what a task run was asked for until it has ended."""
    with _mutex:
        _asked[task_run] = asked


def recall(task_run: str) -> Asked:
    """Return what a task run was asked for."""
    with _mutex:
        return _asked[task_run]


def forget(task_run: str) -> Asked | None:
    """Return what a task run was asked for, for the last time."""
    with _mutex:
        return _asked.pop(task_run, None)


@contextmanager
def watched(watcher: Watcher) -> Iterator[None]:
    """Call `watcher` with each row written by this process meanwhile, or for it: for progress."""
    _watchers.append(watcher)
    try:
        yield
    finally:
        _watchers.remove(watcher)


def computed(task_run: str, asked: Asked, cost: Cost, outputs: Sequence[Ref]) -> None:
    """Write the row of a stage that ran."""
    _write(asked, _row(task_run, asked, "computed", cost, outputs))


def failed(task_run: str, asked: Asked, cost: Cost, error: BaseException) -> None:
    """Write the row of a stage that failed."""
    _write(asked, _row(task_run, asked, "failed", cost, (), stages.reason(error)))


def cached(task_run: str, asked: Asked, outputs: Sequence[Ref]) -> None:
    """Write the row of a stage whose result was there; its time is that of the look-up."""
    cost = Cost(wall_s=time.perf_counter() - asked.clock)
    _write(asked, _row(task_run, asked, "cached", cost, outputs))


def _row(
    task_run: str,
    asked: Asked,
    outcome: str,
    cost: Cost,
    outputs: Sequence[Ref],
    error: str | None = None,
) -> StageRow:
    return StageRow(
        id=task_run,
        run=asked.place.run,
        scan=asked.place.scan,
        stage=asked.stage,
        key=asked.key,
        outcome=outcome,
        wall_s=cost.wall_s,
        cpu_s=cost.cpu_s,
        peak_memory_mb=cost.peak_memory_mb,
        rows_in=_rows(asked.inputs),
        rows_out=_rows(outputs),
        points_in=_rows(asked.inputs, "points"),
        points_out=_rows(outputs, "points"),
        error=error,
        started_at=asked.started_at,
        outputs=tuple(ref.uri for ref in outputs),
    )


def _rows(refs: Sequence[Any], table: str | None = None) -> int:
    return sum(ref.rows for ref in refs if table is None or ref.table == table)


def tell(place: Place, row: StageRow) -> None:
    """Tell a row to who watches this process."""
    for watcher in list(_watchers):
        watcher(place, row)


def _write(asked: Asked, row: StageRow) -> None:
    stages.append(asked.place, row)
    tell(asked.place, row)
    elsewhere.send(asked.place, row)
