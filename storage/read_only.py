"""Files of a store as DuckDB may have them: those named, and to be read only.

DuckDB guards files by their names, and a file it may read it may also write: `copy` replaces it.
Through this file system it reads what it was told of, and has no way to write anything.
"""

import os
import threading
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NoReturn

from fsspec import AbstractFileSystem

PROTOCOL = "mapsense"


class ReadOnlyFiles(AbstractFileSystem):
    """The files of a store that were allowed by name."""

    protocol = PROTOCOL
    cachable = False  # one for each connection, gone with it

    def __init__(self, store: Path) -> None:
        super().__init__()
        self._store = store
        self._open: dict[str, int] = {}
        self._allowed: set[str] = set()

    @property
    def urls(self) -> list[str]:
        """What DuckDB is to call the files allowed."""
        return [url(name) for name in sorted(self._allowed)]

    def allow(self, name: str) -> None:
        """Allow a file, relative to the store, to be read."""
        self._allowed.add(name)

    def hold(self, name: str) -> None:
        """Allow a file, and keep it though others delete it; FileNotFoundError if it is gone."""
        if name not in self._open:
            self._open[name] = os.open(self._store / name, os.O_RDONLY | os.O_CLOEXEC)
        self._allowed.add(name)

    def close(self) -> None:
        """Let go of the files held."""
        for descriptor in self._open.values():
            os.close(descriptor)
        self._open.clear()
        self._allowed.clear()

    def open(self, path: str, mode: str = "rb", **kwargs: Any) -> "File":
        """Return a file to be read."""
        if mode != "rb":
            raise PermissionError(f"{path}: is to be read only")
        name = self._name(path)
        if name in self._open:
            return File(os.dup(self._open[name]))
        return File(os.open(self._store / name, os.O_RDONLY | os.O_CLOEXEC))

    def info(self, path: str, **kwargs: Any) -> dict[str, Any]:
        """Return name, type and size of a file."""
        with self.open(path) as file:
            return {"name": path, "type": "file", "size": file.size}

    def exists(self, path: str, **kwargs: Any) -> bool:
        """Return whether a file may be read."""
        return str(self._strip_protocol(path)) in self._allowed

    def isfile(self, path: str) -> bool:
        """Return whether a file may be read."""
        return self.exists(path)

    def glob(self, path: str, **kwargs: Any) -> list[str]:
        """Return the one file of that name: no character stands for others."""
        return [path] if self.exists(path) else []

    def modified(self, path: str) -> datetime:
        """Return one time for all: what may be read stays as it is while a connection lives."""
        return datetime.fromtimestamp(0, UTC)

    def _refuse(self, *args: Any, **kwargs: Any) -> NoReturn:
        raise PermissionError("the store is to be read only")

    rm = rm_file = _rm = mv = cp_file = mkdir = makedirs = rmdir = touch = pipe_file = _refuse

    def _name(self, path: str) -> str:
        name = str(self._strip_protocol(path))
        if name not in self._allowed:
            raise PermissionError(f"{path}: is none of the files that may be read")
        return name


class File:
    """A file DuckDB reads from several threads, each of which seeks and then reads."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._at = threading.local()
        self.size = os.fstat(descriptor).st_size

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Go to a place in the file, for this thread."""
        start = {os.SEEK_SET: 0, os.SEEK_CUR: self.tell(), os.SEEK_END: self.size}[whence]
        self._at.place = start + offset
        return start + offset

    def tell(self) -> int:
        """Return where this thread is in the file."""
        return getattr(self._at, "place", 0)

    def read(self, size: int = -1) -> bytes:
        """Return the bytes that follow."""
        start = self.tell()
        data = os.pread(self._descriptor, size if size >= 0 else self.size, start)
        self._at.place = start + len(data)
        return data

    def close(self) -> None:
        """Close the file."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1

    def __enter__(self) -> "File":
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def __del__(self) -> None:
        self.close()


def url(name: str) -> str:
    """Return what DuckDB calls a file of the store."""
    return f"{PROTOCOL}://{name}"
