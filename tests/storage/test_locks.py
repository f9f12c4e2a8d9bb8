"""Locks on files that may be removed while nobody holds them."""

import threading
from contextlib import suppress

import pytest

from storage.errors import StoreError
from storage.locks import held, is_held, remove_unused, take


def test_a_lock_is_one_holders_or_shared(tmp_path):
    path = tmp_path / "x.lock"
    with held(path, shared=True), held(path, shared=True):
        assert take(path) is None
        assert not remove_unused(path)
        assert not is_held(path)
    with held(path):
        assert is_held(path)
        assert take(path) is None and take(path, shared=True) is None
    assert not is_held(path)
    assert remove_unused(path, dry_run=True) and path.exists()
    assert remove_unused(path) and not path.exists()
    assert not is_held(path)


def test_removing_lock_files_never_lets_two_in(tmp_path):
    path, stop = tmp_path / "x.lock", threading.Event()
    inside, most, entered = 0, 0, 0

    def enter() -> None:
        nonlocal inside, most, entered
        for _ in range(400):
            with held(path):
                inside += 1
                most = max(most, inside)
                entered += 1
                inside -= 1

    def remove() -> None:
        while not stop.is_set():
            with suppress(FileNotFoundError):
                remove_unused(path)

    workers = [threading.Thread(target=enter) for _ in range(3)]
    remover = threading.Thread(target=remove)
    for thread in (remover, *workers):
        thread.start()
    for worker in workers:
        worker.join()
    stop.set()
    remover.join()
    assert (most, entered) == (1, 1200)


def test_a_folder_that_cannot_be_made_is_a_store_error_failure(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(StoreError, match="cannot write there"), held(tmp_path / "file" / "x.lock"):
        pass
