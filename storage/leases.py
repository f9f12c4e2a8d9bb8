"""Leases at the address that stores share: what a lock is to one machine, a lease is to several.

A lease is an object that its holder writes anew every half a minute. Who dies stops writing, and
after three minutes the lease counts no more. The clocks of machines and service may differ by less
than that. Without an address there is nobody to hold one against.
"""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory

from storage.errors import StoreError
from storage.remote import Remote, remote

FOLDER = ".leases"
RENEWED_S, LASTS_S = 30.0, 180.0
POLL_S = 1.0


@contextmanager
def leased(name: str) -> Iterator[None]:
    """Hold a lease meanwhile.

    Raises
    ------
    StoreError
        If it cannot be put. Once it is, a renewal that fails is made up for by the next.
    """
    if (at := remote()) is None:
        yield
        return
    ended = threading.Event()
    with TemporaryDirectory(prefix="mapsense-") as folder:
        path = Path(folder) / "lease"
        path.touch()
        _renew(at, path, name)
        renewer = threading.Thread(target=_renew_until, args=(ended, at, path, name), daemon=True)
        renewer.start()
        try:
            yield
        finally:
            ended.set()
            renewer.join()
            with suppress(StoreError):  # it ends by itself
                at.remove(f"{FOLDER}/{name}")


def is_leased(name: str) -> bool:
    """Return whether anybody holds a lease of this name, or of one below it."""
    if (at := remote()) is None:
        return False
    wanted = f"{FOLDER}/{name}"
    return any(
        (held == wanted or held.startswith(f"{wanted}/"))
        and time.time() - found.changed_at < LASTS_S
        for held, found in at.find(wanted.rpartition("/")[0]).items()
    )


def wait_for(name: str) -> None:
    """Wait until nobody holds a lease of this name."""
    while is_leased(name):
        time.sleep(POLL_S)


def _renew(at: Remote, path: Path, name: str) -> None:
    at.put(path, f"{FOLDER}/{name}")


def _renew_until(ended: threading.Event, at: Remote, path: Path, name: str) -> None:
    while not ended.wait(RENEWED_S):
        with suppress(StoreError):
            _renew(at, path, name)
