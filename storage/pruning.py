"""Removing what no kept run needs from a store.

A storey's runs share a lock, and pruning takes it alone: a storey where a run goes on is left as
it is, and a run that begins meanwhile waits. Cache records go before the artifacts they name, the
rows of runs after both, and their records last. So pruning may be killed at any moment: what is
left over is found by the next.
"""

import os
import re
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import pyarrow as pa

from storage import locks, packs
from storage.artifacts import check_name
from storage.errors import StoreError
from storage.retention import Keep, Needed, needed, stage_rows
from storage.runs import read_runs, storey_lock

CACHE = ".cache"
"""Folder of the cache records of a store."""
ARTIFACTS, RECORDS, STAGES, RUNS = "artifacts", "cache records", "stage rows", "run records"
TEMPORARIES, LOCKS, PACKS, FOLDERS = "temporaries", "locks", "packs", "empty folders"
ARTIFACT = re.compile(r"[0-9a-f]{24}\.parquet")
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
    remover = _Remover(store, pruned, dry_run)
    failures = _failures(store)
    for name, storey in sorted(_storeys(store, building)):
        _prune_storey(store, name, storey, keep, remover)
    try:
        if building is None and not pruned.in_use:
            # a run that wrote one before we looked has ended: none goes on anywhere
            for path in failures:
                remover.remove(path, RECORDS)
        for path in sorted((store / locks.FOLDER).glob("*.lock")):
            with suppress(FileNotFoundError):  # its run has ended meanwhile
                if locks.remove_unused(path, dry_run=dry_run):
                    pruned.add(LOCKS, 0)
        for table in sorted(_names(store / packs.FOLDER)):
            for size in packs.drop_stale(store, table, dry_run=dry_run):
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
        runs = read_runs(store, building, storey)
        if not runs:
            remover.pruned.unknown.append(f"{building}/{storey}")
            return
        of_stages = _files(store / "stages" / f"building={building}" / f"storey={storey}")
        rows = {file: stage_rows(file) for file in of_stages if file.suffix == ".parquet"}
        remover.remove_from(building, storey, rows, needed(rows.values(), runs, keep))
    except OSError as error:
        raise _cannot_remove(error) from error
    finally:
        path.unlink(missing_ok=True)  # who waits for it takes the next of that name
        os.close(lock)


class _Remover:
    """Removes what is not needed of a storey, in the order that a kill does no harm to."""

    def __init__(self, store: Path, pruned: Pruned, dry_run: bool) -> None:
        self.store, self.pruned, self.dry_run = store, pruned, dry_run

    def remove_from(
        self, building: str, storey: str, rows: dict[Path, pa.Table], needed: Needed
    ) -> None:
        """Remove from one storey: records, artifacts, rows, then records of runs."""
        part = f"building={building}/storey={storey}"
        cache = self.store / CACHE
        for path in _files(cache / building / storey):
            key = path.relative_to(cache).as_posix()
            if RECORD.fullmatch(path.name) and key not in needed.keys:
                self.remove(path, RECORDS)
        self._remove_empty(cache / building / storey)
        for table in sorted(_names(self.store) - {*HISTORIES}):
            self._remove_artifacts(self.store / table / part, needed)
        for path, table in rows.items():
            if not needed.runs.intersection(table["run"].to_pylist()):
                self.remove(path, STAGES)
        for path in _files(self.store / "runs" / part):
            if path.suffix == ".parquet" and path.stem not in needed.runs:
                self.remove(path, RUNS)
        results = [self.store / name / building / storey for name in OF_STOREY]
        for folder in [*(self.store / name / part for name in HISTORIES), *results]:
            for path in _files(folder):
                if TEMPORARY.fullmatch(path.name):
                    self.remove(path, TEMPORARIES)

    def _remove_artifacts(self, folder: Path, needed: Needed) -> None:
        for path in _files(folder):
            if path.relative_to(self.store).as_posix() in needed.uris:
                self.pruned.kept += 1
                self.pruned.kept_bytes += path.stat().st_size
            elif ARTIFACT.fullmatch(path.name):
                self.remove(path, ARTIFACTS)
            elif TEMPORARY.fullmatch(path.name):
                self.remove(path, TEMPORARIES)
        self._remove_empty(folder)

    def remove(self, path: Path, what: str) -> None:
        """Remove a file, unless it is gone already, and count it."""
        with suppress(FileNotFoundError):
            size = path.lstat().st_size
            if not self.dry_run:
                path.unlink()
            self.pruned.add(what, size)

    def _remove_empty(self, folder: Path) -> None:
        """Remove a storey's folder and those in it that hold nothing.

        Not those above: a run of another storey may be about to make one of its own there.
        """
        for path, _, _ in os.walk(folder, topdown=False):
            if self.dry_run or any(os.scandir(path)):
                continue
            os.rmdir(path)
            self.pruned.add(FOLDERS, 0)


def _storeys(store: Path, building: str | None) -> set[tuple[str, str]]:
    """Return the storeys there is anything of, as building and storey."""
    found = set()
    for table in _names(store):
        for path in store.glob(f"{table}/building=*/storey=*"):
            name, storey = (part.partition("=")[2] for part in path.parts[-2:])
            if _is_name(name) and _is_name(storey) and building in (None, name):
                found.add((name, storey))
    return found


def _is_name(name: str) -> bool:
    try:
        return bool(check_name(name))
    except ValueError:
        return False


def _names(folder: Path) -> set[str]:
    """Return the names of the folders in a folder, links and hidden ones aside."""
    with suppress(FileNotFoundError), os.scandir(folder) as entries:
        return {
            entry.name
            for entry in entries
            if entry.is_dir(follow_symlinks=False) and not entry.name.startswith(".")
        }
    return set()


def _failures(store: Path) -> list[Path]:
    """Return the errors of stages that Prefect has put among the cache records, under no key."""
    with suppress(FileNotFoundError):
        return sorted(p for p in (store / CACHE).iterdir() if RECORD.fullmatch(p.name))
    return []


def _files(folder: Path) -> Iterator[Path]:
    """Yield the files in a folder and those below it, sorted; no link is followed."""
    for path, folders, names in os.walk(folder):
        folders.sort()
        yield from (Path(path, name) for name in sorted(names))


def _cannot_remove(error: OSError) -> StoreError:
    return StoreError(
        f"{error.filename}: cannot be pruned ({error.strerror}); make the store writable"
    )
