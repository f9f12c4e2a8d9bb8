"""Leases: what a lock is to one machine, to several; one file system in memory stands between."""

import time

import fsspec
import pytest

from storage import leases
from storage.leases import is_leased, leased, wait_for
from storage.remote import REMOTE


@pytest.fixture(autouse=True)
def _shared(address: str) -> None:
    """Every test has an address."""


def test_a_lease_counts_while_it_is_held() -> None:
    assert not is_leased("b/1/run")
    with leased("b/1/run/x"):
        assert is_leased("b/1/run/x")
        assert is_leased("b/1/run")
        assert not is_leased("b/1/runs")
        assert not is_leased("b/2/run")
    assert not is_leased("b/1/run")


def test_one_whose_holder_died_lapses(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    fsspec.filesystem("memory").pipe_file(f"{address}/.leases/b/1/run/x", b"")
    assert is_leased("b/1/run/x")
    later = time.time() + leases.LASTS_S + 2
    monkeypatch.setattr(leases.time, "time", lambda: later)
    assert not is_leased("b/1/run/x")


def test_one_that_is_held_for_long_is_renewed(
    address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(leases, "RENEWED_S", 0.01)
    puts: list[str] = []
    put = leases.Remote.put
    monkeypatch.setattr(
        leases.Remote, "put", lambda at, path, name: puts.append(name) or put(at, path, name)
    )
    with leased("b/1/run/x"):
        end = time.monotonic() + 10
        while len(puts) < 3 and time.monotonic() < end:
            time.sleep(0.01)
    assert len(puts) >= 3
    assert not is_leased("b/1/run/x")


def test_who_waits_goes_on_once_it_is_given_back(monkeypatch: pytest.MonkeyPatch) -> None:
    held = iter([True, True, False])
    monkeypatch.setattr(leases, "is_leased", lambda name: next(held))
    monkeypatch.setattr(leases, "POLL_S", 0.0)
    wait_for("b/1/pruning")
    assert next(held, None) is None


def test_without_an_address_nobody_holds_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(REMOTE)
    with leased("b/1/run/x"):
        assert not is_leased("b/1/run/x")
