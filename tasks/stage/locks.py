"""One execution per key on one machine, by flock(2): the kernel drops a lock when its process dies.

Prefect's own file lock leaves its file behind after a kill, so that the next run of that key
waits for ever, and fails on keys with a "/".
"""

import hashlib
import os
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import anyio
from prefect.locking.protocol import LockManager

from storage.locks import take

POLL_S = 0.05


class FlockLockManager(LockManager):
    """Locks keys by files in a folder; the files stay, empty, until they are pruned.

    Parameters
    ----------
    folder : Path
        Where the lock files lie.
    on_locked : callable
        Called with the key each time a lock was taken, before the cache is looked at: what it
        finds and does, no other holder of the key can disturb.
    on_release : callable
        Called with the key before its lock is given back: a record that was made is there.
    """

    def __init__(
        self, folder: Path, on_locked: Callable[[str], None], on_release: Callable[[str], None]
    ) -> None:
        self._folder, self._on_locked, self._on_release = folder, on_locked, on_release
        self._held: dict[str, tuple[str, int]] = {}  # key -> (holder, descriptor)
        self._mutex = threading.Lock()

    def __reduce__(self) -> tuple[type, tuple[Any, ...]]:  # process runners pickle it
        return FlockLockManager, (self._folder, self._on_locked, self._on_release)

    def __deepcopy__(self, memo: dict[int, Any]) -> "FlockLockManager":
        return self

    def acquire_lock(
        self,
        key: str,
        holder: str,
        acquire_timeout: float | None = None,
        hold_timeout: float | None = None,
    ) -> bool:
        """Wait for a key's lock and take it; return whether it was got in time."""
        if self.is_lock_holder(key, holder):
            return True
        if not _poll(lambda: self._take(key, holder), acquire_timeout):
            return False
        try:
            self._on_locked(key)
        except BaseException:
            self._drop(key)
            raise
        return True

    def release_lock(self, key: str, holder: str) -> None:
        """Give a lock back."""
        if not self.is_lock_holder(key, holder):
            raise ValueError(f"no lock held by {holder} for key {key}")
        try:
            self._on_release(key)
        finally:
            self._drop(key)

    def is_locked(self, key: str) -> bool:
        """Return whether anyone holds a key's lock."""
        if (descriptor := self._try(key)) is None:
            return True
        os.close(descriptor)
        return False

    def is_lock_holder(self, key: str, holder: str) -> bool:
        """Return whether `holder` holds a key's lock."""
        return self._held.get(key, (None, 0))[0] == holder

    def wait_for_lock(self, key: str, timeout: float | None = None) -> bool:
        """Wait until a key's lock is free; return whether it was in time."""
        return _poll(lambda: not self.is_locked(key), timeout)

    async def aacquire_lock(
        self,
        key: str,
        holder: str,
        acquire_timeout: float | None = None,
        hold_timeout: float | None = None,
    ) -> bool:
        """Wait for a key's lock and take it."""
        return await anyio.to_thread.run_sync(self.acquire_lock, key, holder, acquire_timeout)

    async def await_for_lock(self, key: str, timeout: float | None = None) -> bool:
        """Wait until a key's lock is free."""
        return await anyio.to_thread.run_sync(self.wait_for_lock, key, timeout)

    def _drop(self, key: str) -> None:
        with self._mutex:
            os.close(self._held.pop(key)[1])  # closing unlocks

    def _take(self, key: str, holder: str) -> bool:
        if (descriptor := self._try(key)) is None:
            return False
        with self._mutex:
            self._held[key] = (holder, descriptor)
        return True

    def _try(self, key: str) -> int | None:
        name = hashlib.sha256(key.encode()).hexdigest()[:32] + ".lock"
        return take(self._folder / name)


def _poll(ready: Callable[[], bool], timeout: float | None) -> bool:
    end = None if timeout is None else time.monotonic() + timeout
    while not ready():
        if end is not None and time.monotonic() >= end:
            return False
        time.sleep(POLL_S)
    return True
