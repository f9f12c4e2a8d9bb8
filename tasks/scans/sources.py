"""From the paths a person names to the scans in them."""

import os
import re
import stat
from collections.abc import Iterable, Sequence
from hashlib import sha256
from pathlib import Path

from storage.artifacts import check_name
from storage.errors import InputError
from storage.sources import Source
from tasks.scans.formats import KNOWN, files_of, folder_format, format_of, is_scan_file
from tasks.scans.raw import unreadable

_LONGEST = 120  # a name may have 128 characters; some are left to make it unique
_BLOCK = 1 << 20


def find_sources(paths: Sequence[Path]) -> tuple[list[Source], list[InputError]]:
    """Return the scans under `paths`, sorted by name, and what is wrong with the others.

    Parameters
    ----------
    paths : sequence of Path
        Scan files, folders of one scan (depth sequence, bundle, 3DTK), or folders of scans: a
        storey, each scan file and scan folder in it a source. What is no scan is passed over in
        a folder and an error if named itself.

    Returns
    -------
    tuple of list
        Sources with names unique regardless of case, and one error for each path at fault.
    """
    sources: dict[str, Source] = {}
    errors: list[InputError] = []
    for path in paths:
        try:
            found = _scans_in(path)
        except InputError as error:
            errors.append(error)
            continue
        for scan in found:
            place = os.path.realpath(scan)
            try:
                if place not in sources:
                    sources[place] = fingerprint(scan)
            except InputError as error:
                errors.append(error)
    return _unique(sources.values()), errors


def fingerprint(path: Path) -> Source:
    """Return the source at `path`, named by its stem, with the hash of its files.

    Raises
    ------
    InputError
        If the path is missing, cannot be read or is of no known format.
    """
    format_of(path)
    digest, size = sha256(), 0
    for file in files_of(path):
        try:
            status = file.stat()
            if not stat.S_ISREG(status.st_mode):  # reading a pipe would never end
                raise InputError(file, "is no regular file", "replace it by a file")
            length = status.st_size
            # name and length first, so that no two sets of files give the same stream
            digest.update(f"{_relative(file, path)}\0{length}\0".encode())
            with open(file, "rb") as stream:
                while block := stream.read(_BLOCK):
                    digest.update(block)
        except OSError as error:
            raise unreadable(file, error) from error
        size += length
    return Source(name=_name(path), path=str(path), sha256=digest.hexdigest(), size_bytes=size)


def _scans_in(path: Path) -> list[Path]:
    try:
        if not path.is_dir() or folder_format(path) is not None:
            return [path]
        entries = sorted(entry for entry in path.iterdir() if not entry.name.startswith("."))
        scans = [entry for entry in entries if _is_scan(entry)]
    except OSError as error:
        raise unreadable(path, error) from error
    if not scans:
        raise InputError(
            path, "the folder holds no scan", f"expected files {KNOWN} or scan folders"
        )
    return scans


def _is_scan(entry: Path) -> bool:
    return folder_format(entry) is not None if entry.is_dir() else is_scan_file(entry)


def _relative(file: Path, scan: Path) -> str:
    """Return a file's name within its scan; of a single file only what follows its stem."""
    if scan.is_dir():
        return Path(os.path.relpath(file, scan)).as_posix()
    return "" if file == scan else file.suffix


def _name(path: Path) -> str:
    path = path.absolute()
    stem = path.name if path.is_dir() and path.suffix != ".scan" else path.stem
    name = re.sub(r"\.{2,}", ".", re.sub(r"[^A-Za-z0-9_.-]+", "_", stem)).lstrip(".-")
    return check_name(name[:_LONGEST].rstrip(".") or "scan")


def _unique(sources: Iterable[Source]) -> list[Source]:
    """Return the sources sorted by name; of equal names all but the first get a number."""
    taken: set[str] = set()
    named = []
    for source in sorted(sources, key=lambda s: (_natural(s.name), s.path)):
        name, number = source.name, 1
        while name.casefold() in taken:
            number += 1
            name = f"{source.name}_{number}"
        taken.add(name.casefold())
        named.append(source.model_copy(update={"name": name}))
    return sorted(named, key=lambda source: _natural(source.name))


def _natural(name: str) -> list[tuple[int, str]]:
    """Return a key that sorts scan2 before scan10."""
    parts = re.split(r"(\d+)", name.casefold())
    return [(int(part), part) if part.isdigit() else (0, part) for part in parts] + [(0, name)]
