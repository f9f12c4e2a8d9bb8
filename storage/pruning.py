"""Removing what no kept run needs from a store.

A storey's runs share a lock, and pruning takes it alone: a storey where a run goes on is left as
it is, and a run that begins meanwhile waits. Cache records go before the artifacts they name, the
rows of runs after both, and their records last. So pruning may be killed at any moment: what is
left over is found by the next. A store that shares an address is pruned there too: what leases are
to other machines, the lock is to this one.
"""

import os
import re
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

import pyarrow as pa

from storage import locks, packs
from storage.artifacts import CACHE, check_name
from storage.errors import StoreError
from storage.holdings import Holdings
from storage.leases import is_leased, leased
from storage.remote import is_content_named, refresh
from storage.retention import Keep, Needed, needed, stage_rows
from storage.runs import pruning_lease, read_runs, runs_lease, storey_lock

ARTIFACTS, RECORDS, STAGES, RUNS = "artifacts", "cache records", "stage rows", "run records"
TEMPORARIES, LOCKS, PACKS, FOLDERS = "temporaries", "locks", "packs", "empty folders"
RECORD = re.compile(r"[0-9a-f]{32}")
TEMPORARY = re.compile(r"\.\d+-[0-9a-f]{12}\.tmp")
HISTORIES = ("runs", "stages")
OF_STOREY = ("plans", "evaluations")
"""Folders of results by building and storey: nothing but what a kill left unfinished goes there."""


@dataclass
class Pruned:
    """What was removed, or would be."""

    files: Counter[str] = field(default_factory=Counter)
    """how many, by what they are"""
    bytes: Counter[str] = field(default_factory=Counter)
    """their bytes, by what they are"""
    kept: int = 0
    """artifacts that are needed"""
    kept_bytes: int = 0
    in_use: list[str] = field(default_factory=list)
    """storeys left as they are, since a run goes on there"""
    unknown: list[str] = field(default_factory=list)
    """storeys left as they are, since there is no record of any run"""

    def add(self, what: str, size: int) -> None:
        """Count one file removed."""
        self.files[what] += 1
        self.bytes[what] += size


def prune(store: Path, keep: Keep, building: str | None = None, *, dry_run: bool = False) -> Pruned:
    """Remove what no kept run needs, storey by storey.

    Parameters
    ----------
    building : only this one's storeys
    dry_run : remove nothing, say what would be

    Raises
    ------
    StoreError
        If a record cannot be read, so that nobody knows what is needed, or a file not removed.
    """
    pruned = Pruned()
    refresh(store, "runs")
    remover = _Remover(Holdings(store), pruned, dry_run)
    failures = _failures(store)
    for name, storey in sorted(_storeys(remover.holdings, building)):
        _prune_storey(store, name, storey, keep, remover)
    try:
        if building is None and not pruned.in_use:
            # a run that wrote one before we looked has ended: none goes on anywhere
            for path in failures:
                remover.remove(path.relative_to(store).as_posix(), RECORDS)
        for path in sorted((store / locks.FOLDER).glob("*.lock")):
            with suppress(FileNotFoundError):  # its run has ended meanwhile
                if locks.remove_unused(path, dry_run=dry_run):
                    pruned.add(LOCKS, 0)
        for folder in sorted((store / packs.FOLDER).glob("*/")):
            for size in packs.drop_stale(store, folder.name, dry_run=dry_run):
                pruned.add(PACKS, size)
    except OSError as error:
        raise _cannot_remove(error) from error
    return pruned


def _prune_storey(store: Path, building: str, storey: str, keep: Keep, remover: "_Remover") -> None:
    """Prune one storey, unless a run goes on there."""
    path = storey_lock(store, building, storey)
    lock = locks.take(path)
    if lock is None:
        remover.pruned.in_use.append(f"{building}/{storey}")
        return
    try:
        with leased(pruning_lease(building, storey)):
            if is_leased(runs_lease(building, storey)):
                remover.pruned.in_use.append(f"{building}/{storey}")
                return
            _prune_unused(store, building, storey, keep, remover)
    except OSError as error:
        raise _cannot_remove(error) from error
    finally:
        path.unlink(missing_ok=True)  # who waits for it takes the next of that name
        os.close(lock)


def _prune_unused(store: Path, building: str, storey: str, keep: Keep, remover: "_Remover") -> None:
    """Prune a storey where no run goes on, and none can begin."""
    runs = read_runs(store, building, storey)
    if not runs:
        remover.pruned.unknown.append(f"{building}/{storey}")
        return
    folder = f"stages/building={building}/storey={storey}"
    refresh(store, folder)
    of_stages = sorted(name for name in Holdings.here(store, folder) if name.endswith(".parquet"))
    rows = {name: stage_rows(store / name) for name in of_stages}
    remover.remove_from(building, storey, rows, needed(rows.values(), runs, keep))


class _Remover:
    """Removes what is not needed of a storey, in the order that a kill does no harm to."""

    def __init__(self, holdings: Holdings, pruned: Pruned, dry_run: bool) -> None:
        self.holdings, self.pruned, self.dry_run = holdings, pruned, dry_run

    def remove_from(
        self, building: str, storey: str, rows: dict[str, pa.Table], needed: Needed
    ) -> None:
        """Remove from one storey: records, artifacts, rows, then records of runs."""
        part = f"building={building}/storey={storey}"
        records = f"{CACHE}/{building}/{storey}"
        for name in self.holdings.below(records):
            is_record = RECORD.fullmatch(name.rpartition("/")[2])
            if is_record and name.removeprefix(f"{CACHE}/") not in needed.keys:
                self.remove(name, RECORDS)
        self._remove_empty(records)
        for table in sorted(self.holdings.tables() - {*HISTORIES}):
            self._remove_artifacts(f"{table}/{part}", needed)
        for name, table in rows.items():
            if not needed.runs.intersection(table["run"].to_pylist()):
                self.remove(name, STAGES)
        for name in self.holdings.below(f"runs/{part}"):
            of_run = PurePosixPath(name)
            if of_run.suffix == ".parquet" and of_run.stem not in needed.runs:
                self.remove(name, RUNS)
        results = [f"{of_storey}/{building}/{storey}" for of_storey in OF_STOREY]
        for folder in [*(f"{name}/{part}" for name in HISTORIES), *results]:
            for name in self.holdings.below(folder):
                if TEMPORARY.fullmatch(name.rpartition("/")[2]):
                    self.remove(name, TEMPORARIES)

    def _remove_artifacts(self, folder: str, needed: Needed) -> None:
        for name, size in self.holdings.below(folder).items():
            last = name.rpartition("/")[2]
            if name in needed.uris:
                self.pruned.kept += 1
                self.pruned.kept_bytes += size
            elif is_content_named(last):
                self.remove(name, ARTIFACTS)
            elif TEMPORARY.fullmatch(last):
                self.remove(name, TEMPORARIES)
        self._remove_empty(folder)

    def remove(self, name: str, what: str) -> None:
        """Remove a file, unless it is gone already, and count it."""
        with suppress(FileNotFoundError):
            self.pruned.add(what, self.holdings.remove(name, dry_run=self.dry_run))

    def _remove_empty(self, folder: str) -> None:
        """Remove a storey's folder and those in it that hold nothing.

        Not those above: a run of another storey may be about to make one of its own there.
        """
        for path, _, _ in os.walk(self.holdings.store / folder, topdown=False):
            if self.dry_run or any(os.scandir(path)):
                continue
            os.rmdir(path)
            self.pruned.add(FOLDERS, 0)


def _storeys(holdings: Holdings, building: str | None) -> set[tuple[str, str]]:
    """Return the storeys there is anything of, as building and storey."""
    found = set()
    for table in holdings.tables():
        for path in holdings.store.glob(f"{table}/building=*/storey=*"):
            name, storey = (part.partition("=")[2] for part in path.parts[-2:])
            if _is_name(name) and _is_name(storey) and building in (None, name):
                found.add((name, storey))
    return found


def _is_name(name: str) -> bool:
    try:
        return bool(check_name(name))
    except ValueError:
        return False


def _failures(store: Path) -> list[Path]:
    """Return the errors of stages that Prefect has put among the cache records, under no key."""
    with suppress(FileNotFoundError):
        return sorted(p for p in (store / CACHE).iterdir() if RECORD.fullmatch(p.name))
    return []


def _cannot_remove(error: OSError) -> StoreError:
    return StoreError(
        f"{error.filename}: cannot be pruned ({error.strerror}); make the store writable"
    )
