"""Locks on files by flock(2): the kernel drops a lock when its process dies.

A lock file that nobody holds may be removed at any time: who takes a lock looks again whether its
file is still the one of that name, and takes the new one if not.
"""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from storage.errors import StoreError

FOLDER = ".locks"
"""Folder of a store's lock files."""


def take(path: Path, *, shared: bool = False, wait: bool = False) -> int | None:
    """Take the lock of a file, which is made if need be.

    Parameters
    ----------
    shared : with others who take it shared; else alone
    wait : until it is free

    Returns
    -------
    int, optional
        Descriptor that holds it until it is closed; None if others hold it.
    """
    while True:
        path.parent.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        try:
            if not _lock(descriptor, shared, wait):
                os.close(descriptor)
                return None
            if _is_at(descriptor, path):
                return descriptor
        except BaseException:
            os.close(descriptor)
            raise
        os.close(descriptor)  # removed meanwhile: it keeps nobody out


@contextmanager
def held(path: Path, *, shared: bool = False) -> Iterator[None]:
    """Wait for a lock and hold it meanwhile; StoreError if its file cannot be written."""
    try:
        descriptor = take(path, shared=shared, wait=True)
    except OSError as error:
        raise StoreError(
            f"{path.parent}: cannot write there ({error.strerror}); make the store writable, or "
            "choose another with --store"
        ) from error
    assert descriptor is not None  # it waited
    try:
        yield
    finally:
        os.close(descriptor)


def is_held(path: Path) -> bool:
    """Return whether anyone holds the lock of a file alone."""
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_CLOEXEC)
    except OSError:
        return False
    try:
        return not _lock(descriptor, shared=True, wait=False)
    finally:
        os.close(descriptor)


def remove_unused(path: Path, *, dry_run: bool = False) -> bool:
    """Remove a lock file that nobody holds; return whether it was, or with `dry_run` would be."""
    descriptor = os.open(path, os.O_RDWR | os.O_CLOEXEC)
    try:
        if not _lock(descriptor, shared=False, wait=False) or not _is_at(descriptor, path):
            return False
        if not dry_run:
            path.unlink()
        return True
    finally:
        os.close(descriptor)


def _lock(descriptor: int, shared: bool, wait: bool) -> bool:
    how = fcntl.LOCK_SH if shared else fcntl.LOCK_EX
    try:
        fcntl.flock(descriptor, how if wait else how | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _is_at(descriptor: int, path: Path) -> bool:
    """Return whether a file opened is the one that has the name now."""
    try:
        return os.path.samestat(os.fstat(descriptor), os.stat(path))
    except FileNotFoundError:
        return False
