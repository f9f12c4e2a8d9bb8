"""What the stores of several machines share: an address each gives to and takes from.

A store is a folder. With `MAPSENSE_REMOTE=s3://bucket/prefix` whatever is written into it is put
there too, under the same name, and what it lacks is taken from there: so any machine goes on where
another stopped, and the folder may be lost. An object is put whole or not at all. An artifact is
named by its content and never changes; histories and plans are written anew by the run they are
of, and a copy is as new as its object if it has its size and time.

Credentials come from the environment, as the client of the address reads them (AWS_ACCESS_KEY_ID,
AWS_ENDPOINT_URL, ...). Without the setting, nothing here does anything.
"""

import os
import re
import time
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from storage.errors import StoreError
from storage.files import temporary_in

T = TypeVar("T")

REMOTE = "MAPSENSE_REMOTE"
PAUSES_S = (1.0, 4.0)
"""Waited before what failed is tried again; the client itself has tried several times then."""
GONE_S = 60.0
"""After an address failed for good, nothing is asked of it for so long: all would wait in turn."""
FINAL = (FileNotFoundError, PermissionError, ImportError)
"""What no second attempt changes."""
THREADS = 8
"""Objects fetched at once."""
_gone_until: dict[str, float] = {}
CONTENT_NAMED = re.compile(r"[0-9a-f]{24}\.parquet")


@dataclass(frozen=True)
class Object:
    """What is known of an object without fetching it."""

    size: int
    changed_at: float
    """whole seconds since 1970, by the clock of the service"""


class Remote:
    """The objects below an address."""

    def __init__(self, url: str) -> None:
        self.url = url

    @property
    def _at(self) -> tuple[Any, str]:
        return _opened(self.url)

    def put(self, path: Path, name: str) -> Object | None:
        """Put a file under a name; return the object as it is then, unless it never changes."""

        def attempt() -> Object | None:
            system, root = self._at
            system.put_file(str(path), f"{root}/{name}")
            return None if is_content_named(name) else _object(system.info(f"{root}/{name}"))

        return self._tried(f"{name} cannot be put", attempt)

    def get(self, name: str, path: Path) -> Object:
        """Fetch an object into a file; FileNotFoundError if there is none of that name."""

        def attempt() -> Object:
            system, root = self._at
            found = _object(system.info(f"{root}/{name}"))
            system.get_file(f"{root}/{name}", str(path))
            return found

        return self._tried(f"{name} cannot be fetched", attempt)

    def find(self, folder: str) -> dict[str, Object]:
        """Return the objects below a folder, by their names."""

        def attempt() -> dict[str, Object]:
            system, root = self._at
            found = system.find(f"{root}/{folder}", detail=True)
            below = root.strip("/")
            return {
                path.strip("/").removeprefix(below).lstrip("/"): _object(info)
                for path, info in sorted(found.items())
            }

        found = self._tried(f"{folder} cannot be listed", attempt)
        return {name: about for name, about in found.items() if _is_inside(name)}

    def holds(self, name: str) -> bool:
        """Return whether there is an object of a name."""

        def attempt() -> bool:
            system, root = self._at
            return bool(system.isfile(f"{root}/{name}"))

        return self._tried(f"{name} cannot be looked for", attempt)

    def remove(self, name: str) -> None:
        """Remove an object, if there is one of that name."""

        def attempt() -> None:
            system, root = self._at
            with suppress(FileNotFoundError):
                system.rm_file(f"{root}/{name}")

        self._tried(f"{name} cannot be removed", attempt)

    def _tried(self, what: str, attempt: Callable[[], T]) -> T:
        if time.monotonic() < _gone_until.get(self.url, 0.0):
            raise self._error(what, "it was out of reach a moment ago")
        for pause in (*PAUSES_S, None):
            try:
                return attempt()
            except FileNotFoundError:
                raise
            except Exception as error:  # each client raises errors of its own
                final = isinstance(error, FINAL)
                if pause is None or final:
                    if not final:
                        _gone_until[self.url] = time.monotonic() + GONE_S
                    text = " ".join(str(error).split())[:200] or type(error).__name__
                    raise self._error(what, text) from error
                time.sleep(pause)
        raise AssertionError("the last attempt returns or raises")

    def _error(self, what: str, why: str) -> StoreError:
        return StoreError(
            f"{self.url}: {what} ({why}); check the address, the network and the credentials in "
            "the environment, then run again: nothing is lost"
        )


def remote() -> Remote | None:
    """Return what this process's stores share, None if they share nothing."""
    url = os.environ.get(REMOTE, "")
    return Remote(url.rstrip("/")) if url else None


def share(store: Path | str, *paths: Path) -> None:
    """Put files of a store at its address; what lies elsewhere is nobody's but ours."""
    if (at := remote()) is None:
        return
    for path in paths:
        if path.is_relative_to(store):
            before = path.stat()
            put = at.put(path, path.relative_to(store).as_posix())
            if put is not None:
                _date(path, before, put)


def obtain(store: Path | str, name: str) -> bool:
    """Fetch a file that a store lacks; return whether it is there."""
    path = Path(store) / name
    if path.exists():
        return True
    if (at := remote()) is None:
        return False
    try:
        _fetch(at, name, path)
    except FileNotFoundError:
        return False
    return True


def obtain_all(store: Path | str, names: Iterable[str]) -> None:
    """Fetch those of the files named that a store lacks and its address has."""
    if remote() is not None:
        with ThreadPoolExecutor(THREADS) as threads:
            list(threads.map(lambda name: obtain(store, name), names))


def is_held(store: Path | str, name: str) -> bool:
    """Return whether a file that a store lacks is at its address."""
    at = remote()
    return at is not None and not (Path(store) / name).exists() and at.holds(name)


def refresh(store: Path | str, folder: str) -> None:
    """Bring a folder of a store up to date with its address."""
    if (at := remote()) is not None:
        _bring_up_to_date(at, Path(store), at.find(folder))


def publish(store: Path | str, path: Path) -> None:
    """Make a file or folder of a store at its address what it is here; gone, if it is gone."""
    if (at := remote()) is None:
        return
    here = _files(path)
    share(store, *here)
    names = {file.relative_to(store).as_posix() for file in here}
    for name in at.find(path.relative_to(store).as_posix()).keys() - names:
        at.remove(name)


def replicate(store: Path | str, path: Path) -> None:
    """Make a file or folder of a store what it is at its address, if it is there."""
    if (at := remote()) is None:
        return
    there = at.find(path.relative_to(store).as_posix())
    _bring_up_to_date(at, Path(store), there)
    for file in _files(path) if there else ():
        if file.relative_to(store).as_posix() not in there:
            file.unlink(missing_ok=True)


def is_content_named(name: str) -> bool:
    """Return whether a file is named by its content, so that it never changes."""
    return bool(CONTENT_NAMED.fullmatch(name.rpartition("/")[2]))


def _bring_up_to_date(at: Remote, store: Path, there: Mapping[str, Object]) -> None:
    """Fetch those of the objects that are others than their copies in a store."""

    def fetch(name: str) -> None:
        with suppress(FileNotFoundError):  # removed meanwhile
            _fetch(at, name, store / name)

    stale = [name for name, found in there.items() if _is_stale(store / name, found)]
    with ThreadPoolExecutor(THREADS) as threads:
        list(threads.map(fetch, stale))


def _is_stale(path: Path, found: Object) -> bool:
    """Return whether an object is another than its copy; what we wrote since is newer than it."""
    try:
        copy = path.stat()
    except FileNotFoundError:
        return True
    if is_content_named(path.name):
        return False
    return copy.st_mtime < found.changed_at or (
        copy.st_mtime == found.changed_at and copy.st_size != found.size
    )


def _files(path: Path) -> list[Path]:
    if path.is_dir():
        return [file for file in path.rglob("*") if file.is_file()]
    return [path] if path.exists() else []


def _fetch(at: Remote, name: str, path: Path) -> None:
    """Fetch an object beside its place, and put it there unless we wrote there meanwhile."""
    before = _stat(path)
    temporary = temporary_in(path.parent)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        found = at.get(name, temporary)
        os.utime(temporary, (found.changed_at, found.changed_at))
        if _stat(path) == before:
            os.replace(temporary, path)
    except FileNotFoundError:
        raise
    except OSError as error:
        raise StoreError(
            f"{path}: cannot be written ({error.strerror or error}); make the store writable, free "
            "space on its disk, or choose another with --store"
        ) from error
    finally:
        temporary.unlink(missing_ok=True)


def _date(path: Path, before: os.stat_result, put: Object) -> None:
    """Give a file the time of its object, unless it was written anew meanwhile."""
    with suppress(FileNotFoundError):
        if os.path.samestat(path.stat(), before):
            os.utime(path, (put.changed_at, put.changed_at))


def _stat(path: Path) -> tuple[int, int] | None:
    try:
        found = path.stat()
    except FileNotFoundError:
        return None
    return found.st_ino, found.st_mtime_ns


def _is_inside(name: str) -> bool:
    """Return whether a name stays in the store; others may write at the address too."""
    return ".." not in name.split("/") and not name.startswith("/") and "\\" not in name


@cache
def _opened(url: str) -> tuple[Any, str]:
    import fsspec

    system, root = fsspec.core.url_to_fs(url, use_listings_cache=False)
    return system, root.rstrip("/")


def _object(info: dict[str, Any]) -> Object:
    changed = next(
        info[name] for name in ("LastModified", "mtime", "updated", "created") if info.get(name)
    )
    at = changed.timestamp() if isinstance(changed, datetime) else float(changed)
    # a service may tell fractions of a second in a listing only
    return Object(int(info["size"]), float(int(at)))
