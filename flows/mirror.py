"""A local copy of the scans at an address such as s3://bucket/prefix, brought up to date.

Readers need files. Whatever lies directly below the address is one entry: a scan file, or a folder
that is one scan. An entry is fetched again if any of its files changed, and put in place whole, so
that a copy is never half of one upload and half of the next.
"""

import json
import os
import shutil
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from hashlib import sha256
from pathlib import Path, PurePosixPath
from typing import Any

import fsspec

from flows.listing import is_temporary, stamp_of
from storage.errors import InputError, MapSenseError
from storage.files import write_whole
from storage.remote import publish

INDEX = ".fetched.json"
TIMES = ("LastModified", "last_modified", "mtime", "updated")
"""What file systems call the time of a file's last change."""


@dataclass(frozen=True)
class Mirror:
    """The copy of what lies at an address."""

    folder: Path
    waiting: tuple[str, ...]
    """entries still being written: what was fetched of them before, if anything, stays"""


@dataclass(frozen=True)
class _Entry:
    files: tuple[str, ...]
    stamp: str
    changed_at: float
    is_whole: bool


def mirror(url: str, folder: Path, settle_s: float, now: float) -> Mirror:
    """Bring the copy of an address up to date.

    Parameters
    ----------
    url : str
        Address of a folder of scans: all its credentials come from the environment.
    folder : Path
        Folder of all copies in a store; each address has its own below it. What is fetched is
        shared as the store is: stages that run on other machines read it too.
    settle_s : float
        An entry of which anything was written less than so many seconds ago is left for later.
    now : float
        Seconds since 1970.

    Raises
    ------
    InputError
        If the address cannot be read.
    """
    copy = folder / sha256(url.encode()).hexdigest()[:16]
    try:
        system, root = fsspec.core.url_to_fs(url)
        system.invalidate_cache()
        entries = _entries(system, root)
        done, waiting = _fetched(copy), []
        for name, entry in sorted(entries.items()):
            if not entry.is_whole or now - entry.changed_at < settle_s:
                waiting.append(name)
            elif done.get(name) != entry.stamp:
                _fetch(system, root, entry, copy / name)
                publish(folder.parent, copy / name)
                done[name] = entry.stamp
                _remember(copy, done)
    except MapSenseError:
        raise
    except ImportError as error:
        remedy = "install it where the worker runs"
        raise InputError(url, f"needs a package ({error})", remedy) from error
    except Exception as error:  # each file system raises errors of its own
        text = " ".join(str(error).split())[:200] or type(error).__name__
        remedy = "check the address, the network and the worker's credentials"
        raise InputError(url, f"cannot be read ({text})", remedy) from error
    for name in set(done) - set(entries):
        _remove(copy / name)
        publish(folder.parent, copy / name)
        _remember(copy, {kept: done[kept] for kept in done if kept in entries})
    copy.mkdir(parents=True, exist_ok=True)
    return Mirror(copy, tuple(waiting))


def _entries(system: Any, root: str) -> dict[str, _Entry]:
    """Return what lies directly below the root, with the state of all its files."""
    infos: Mapping[str, Any] = system.find(root, detail=True)
    groups: dict[str, list[tuple[str, int, float, str]]] = defaultdict(list)
    for path, info in infos.items():
        relative = _relative(path, root)
        changed_at = _changed_at(system, path, info)
        mark = str(info.get("ETag") or info.get("etag") or changed_at)
        groups[relative.parts[0]].append((relative.as_posix(), info["size"], changed_at, mark))
    return {
        name: _Entry(
            tuple(path for path, *_ in files),
            stamp_of((path, size, mark) for path, size, _, mark in sorted(files)),
            max(changed_at for _, _, changed_at, _ in files),
            not any(is_temporary(PurePosixPath(path).name) for path, *_ in files),
        )
        for name, files in groups.items()
        if not is_temporary(name)
    }


def _relative(path: str, root: str) -> PurePosixPath:
    """Return a file's path below the root; it must stay below any folder it is put into."""
    base = root.strip("/")
    relative = PurePosixPath(path.strip("/").removeprefix(base).lstrip("/") or Path(path).name)
    if ".." in relative.parts or relative.is_absolute() or "\\" in str(relative):
        raise InputError(path, "its name leads out of its folder", "rename it")
    return relative


def _changed_at(system: Any, path: str, info: Mapping[str, Any]) -> float:
    time = next((info[name] for name in TIMES if info.get(name) is not None), None)
    if time is None:
        time = system.modified(path)
    if isinstance(time, str):
        time = datetime.fromisoformat(time)
    return time.timestamp() if isinstance(time, datetime) else float(time)


def _fetch(system: Any, root: str, entry: _Entry, target: Path) -> None:
    """Fetch an entry beside its target and put it in place."""
    fresh = target.with_name(f".{target.name}-{os.getpid()}.tmp")
    _remove(fresh)
    try:
        for name in entry.files:
            below = PurePosixPath(name).relative_to(target.name)
            local = fresh / below if below.parts else fresh
            local.parent.mkdir(parents=True, exist_ok=True)
            single = system.isfile(root)  # the address is that of one file
            system.get_file(root if single else f"{root.rstrip('/')}/{name}", str(local))
        _remove(target)
        os.replace(fresh, target)
    finally:
        _remove(fresh)


def _fetched(copy: Path) -> dict[str, str]:
    """Return the stamps of the entries that were fetched; an index that is lost costs a fetch."""
    try:
        known = json.loads((copy / INDEX).read_text("utf-8"))
    except (OSError, ValueError):
        return {}
    return {name: stamp for name, stamp in known.items() if (copy / name).exists()}


def _remember(copy: Path, done: Mapping[str, str]) -> None:
    write_whole(copy / INDEX, json.dumps(done, indent=1, sort_keys=True).encode(), "index")


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)
