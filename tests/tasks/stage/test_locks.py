"""Locks by key, and the meter."""

import subprocess
import sys
import threading
import time

import pytest

from tasks.stage.locks import FlockLockManager
from tasks.stage.meter import metered


def nothing(key: str) -> None:
    """Do nothing with a key."""


@pytest.fixture
def locks(tmp_path):
    return FlockLockManager(tmp_path, nothing, nothing)


def test_a_key_has_one_holder(locks, tmp_path):
    other = FlockLockManager(tmp_path, nothing, nothing)
    assert locks.acquire_lock("a/b", "me")
    assert locks.is_lock_holder("a/b", "me")
    assert other.is_locked("a/b")
    assert not other.acquire_lock("a/b", "you", acquire_timeout=0.1)
    assert other.acquire_lock("another", "you", acquire_timeout=0.1)
    locks.release_lock("a/b", "me")
    assert other.acquire_lock("a/b", "you", acquire_timeout=0.1)


def test_only_its_holder_gives_a_lock_back(locks):
    locks.acquire_lock("key", "me")
    with pytest.raises(ValueError, match="no lock held by you"):
        locks.release_lock("key", "you")


def test_who_waits_gets_the_lock_when_it_is_given_back(locks, tmp_path):
    locks.acquire_lock("key", "me")
    other = FlockLockManager(tmp_path, nothing, nothing)
    threading.Timer(0.1, locks.release_lock, ("key", "me")).start()
    assert other.acquire_lock("key", "you", acquire_timeout=5)


def test_a_killed_holder_holds_nothing(locks, tmp_path):
    code = (
        "import os, sys; from pathlib import Path; from tasks.stage.locks import FlockLockManager\n"
        "FlockLockManager(Path(sys.argv[1]), print, print).acquire_lock('key', 'it')\n"
        "os.kill(os.getpid(), 9)"
    )
    killed = subprocess.run([sys.executable, "-c", code, str(tmp_path)], capture_output=True)
    assert killed.returncode == -9
    assert locks.acquire_lock("key", "me", acquire_timeout=1)


def test_what_is_done_at_locking_is_done_under_the_lock(tmp_path):
    seen = []

    def see(key: str) -> None:
        seen.append((key, locks.is_locked(key)))

    locks = FlockLockManager(tmp_path, see, see)
    locks.acquire_lock("key", "me")
    assert seen == [("key", True)]
    locks.release_lock("key", "me")
    assert seen == [("key", True)] * 2
    assert not locks.is_locked("key")


def test_a_failure_at_giving_back_gives_the_lock_back(tmp_path):
    def fail(key: str) -> None:
        raise OSError("no")

    locks = FlockLockManager(tmp_path, nothing, fail)
    locks.acquire_lock("key", "me")
    with pytest.raises(OSError, match="no"):
        locks.release_lock("key", "me")
    assert not locks.is_locked("key")


def test_a_failure_at_locking_gives_the_lock_back(tmp_path):
    def fail(key: str) -> None:
        raise OSError("no")

    locks = FlockLockManager(tmp_path, fail, nothing)
    with pytest.raises(OSError, match="no"):
        locks.acquire_lock("key", "me")
    assert not locks.is_locked("key")


def test_the_meter_tells_work_from_waiting():
    with metered() as cost:
        time.sleep(0.1)
    assert cost.wall_s >= 0.1
    assert cost.cpu_s < 0.05


def test_the_meter_sees_memory_in_passing():
    with metered() as before:
        pass
    with metered() as cost:
        block = bytearray(200_000_000)
        block[::4096] = b"x" * len(block[::4096])
        time.sleep(0.1)
        del block
    assert before.peak_memory_mb is not None
    assert cost.peak_memory_mb is not None
    assert cost.peak_memory_mb > before.peak_memory_mb + 150
