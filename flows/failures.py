"""What failed in a run: which stage, of which scan, and why."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from flows.summaries import read_summary, results_folder
from storage.artifacts import Place
from storage.runs import Run
from storage.stages import of_run


@dataclass(frozen=True)
class Failure:
    """A part of a run that failed."""

    scan: str | None
    """None: what failed is about all scans"""
    stage: str | None
    """None: it failed before any stage"""
    reason: str

    def as_json(self) -> dict[str, Any]:
        """Return it for programs."""
        return asdict(self)

    def __str__(self) -> str:
        return " ".join(part for part in (self.stage, self.scan) if part) or "all"


def failures_of(store: str, run: Run) -> list[Failure]:
    """Return what failed in a run and was not made up for in it."""
    place = Place(store=store, run=run.id, building=run.building, storey=run.storey)
    last = {(row.scan, row.stage): row for row in of_run(place)}
    failed = [
        Failure(row.scan, row.stage, row.error or "unknown")
        for row in last.values()
        if row.outcome == "failed"
    ]
    known = {failure.scan for failure in failed}
    skipped = (Failure(scan, None, why) for scan, why in _skipped(store, run))
    return failed + [failure for failure in skipped if failure.scan not in known]


def with_failures(
    store: str, runs: Sequence[Run], scan: str | None, stage: str | None
) -> list[Run]:
    """Return the runs in which a scan, or a stage, failed; None: any."""
    if scan is None and stage is None:
        return list(runs)
    return [
        run
        for run in runs
        if any(
            scan in (None, failure.scan, Path(failure.scan or "").name)
            and stage in (None, failure.stage)
            for failure in failures_of(store, run)
        )
    ]


def _skipped(store: str, run: Run) -> list[tuple[str, str]]:
    """Return the scans a run has left out, by its summary, and why."""
    asked = run.request()
    folder = results_folder(store, run.building, run.storey, asked.get("out"))
    summary = read_summary(folder, run.id)
    if summary is None:
        return []
    return [(skipped["scan"], skipped["reason"]) for skipped in summary["skipped"]]
