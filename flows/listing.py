"""The scans that lie at a source now: which there are, and whether anybody still writes them.

Nothing is read but names, sizes and times: a look at a folder of a thousand scans takes no longer
than to list it.
"""

import glob
import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path, PurePosixPath

from storage.errors import InputError
from tasks.scans.formats import files_of, folder_format, is_scan_file
from tasks.scans.raw import unreadable

TEMPORARY = (".tmp", ".temp", ".part", ".partial", ".crdownload", ".filepart", "~")
"""Ends of names under which others write what is not yet whole."""


@dataclass(frozen=True)
class Listed:
    """A scan at its source."""

    url: str
    """a path, or an address such as s3://bucket/key"""
    stamp: str
    """hash of the names, sizes and times of its files: it stays as long as they do"""
    changed_at: float
    """when the last of them was written, seconds since 1970"""
    is_whole: bool
    """no file of it has a temporary name"""

    @property
    def name(self) -> str:
        """Return what people call it."""
        return PurePosixPath(self.url).name


def is_temporary(name: str) -> bool:
    """Return whether a name is one that others give to what they still write."""
    return name.startswith(".") or name.lower().endswith(TEMPORARY)


def is_remote(source: str) -> bool:
    """Return whether a source is an address rather than a path."""
    return "://" in source


def list_local(source: str) -> list[Listed]:
    """Return the scans at a path, sorted by it.

    Parameters
    ----------
    source : str
        A scan file, a folder of one scan or of scans, or a pattern (`*`, `**`) of such.

    Raises
    ------
    InputError
        If what is named, without a pattern, is not there or cannot be read.
    """
    named = [source]
    if glob.has_magic(source):
        named = sorted(glob.glob(source, recursive=True))
    scans = dict.fromkeys(scan for path in named for scan in _scans_in(Path(path)))
    found = (_listed(scan) for scan in scans)
    return [scan for scan in found if scan is not None]


def _scans_in(path: Path) -> Iterator[Path]:
    try:
        path.stat()
        if not path.is_dir():
            entries: Iterable[Path] = (path,)
        elif folder_format(path) is not None:
            entries = (path,)
        else:
            entries = sorted(path.iterdir())
        for entry in entries:
            if not is_temporary(entry.name) and _is_scan(entry):
                yield entry
    except OSError as error:
        raise unreadable(path, error) from error


def _is_scan(entry: Path) -> bool:
    return folder_format(entry) is not None if entry.is_dir() else is_scan_file(entry)


def _listed(scan: Path) -> Listed | None:
    """Return a scan with the state of its files; None if it went away meanwhile."""
    try:
        files = sorted(_files(scan))
        states = [(file, os.stat(file)) for file in files]
        # the change time: unlike the time of modification nobody can set it back
        changed_at = max(state.st_ctime for state in (*(s for _, s in states), os.stat(scan)))
    except FileNotFoundError:
        return None
    except OSError as error:
        raise unreadable(scan, error) from error
    parts = [(os.path.relpath(f, scan), s.st_size, s.st_mtime_ns) for f, s in states]
    is_whole = not any(file.name.lower().endswith(TEMPORARY) for file in files)
    return Listed(str(scan), stamp_of(parts), changed_at, is_whole)


def _files(scan: Path) -> list[Path]:
    if not scan.is_dir():
        try:
            return files_of(scan)
        except InputError:
            return [scan]
    return [Path(folder) / name for folder, _, names in os.walk(scan) for name in names]


def stamp_of(parts: Iterable[tuple[str, int, object]]) -> str:
    """Return one text for the names, sizes and times of files."""
    text = "\n".join(f"{name}\0{size}\0{time}" for name, size, time in parts)
    return sha256(text.encode(errors="surrogateescape")).hexdigest()[:24]
