"""One isolated Prefect server for a whole test run; only tests that ask for it pay for it."""

import os
from collections.abc import Iterator
from pathlib import Path
from unittest import mock

import pytest

from flows.server import SETTINGS, empty_database

# before the first import of prefect and numpy; the server's process inherits them
for name, value in SETTINGS.items():
    os.environ.setdefault(name, value)
os.environ.pop("PREFECT_API_URL", None)
for name in [name for name in os.environ if name.startswith("MAPSENSE_")]:
    del os.environ[name]


@pytest.fixture(scope="session")
def prefect_home(pytestconfig: pytest.Config) -> Path:
    """A folder with a migrated, empty database, kept between test runs."""
    home = pytestconfig.cache.mkdir("prefect")
    empty_database(home)
    return home


@pytest.fixture(scope="session")
def prefect_server(tmp_path_factory: pytest.TempPathFactory, prefect_home: Path) -> Iterator[str]:
    """Prefect's API; with Prefect's own harness, which drains logs and events at the end."""
    home = tmp_path_factory.mktemp("prefect")
    (home / "db").mkdir()
    (home / "db" / "prefect-test.db").write_bytes(empty_database(prefect_home).read_bytes())

    from prefect.settings import (
        PREFECT_API_URL,
        PREFECT_FLOWS_HEARTBEAT_FREQUENCY,
        PREFECT_HOME,
        PREFECT_LOGGING_LEVEL,
        PREFECT_LOGGING_TO_API_ENABLED,
        temporary_settings,
    )
    from prefect.testing import utilities

    changed = {
        PREFECT_HOME: home,
        PREFECT_FLOWS_HEARTBEAT_FREQUENCY: None,  # a second for every flow otherwise
        PREFECT_LOGGING_TO_API_ENABLED: False,
        PREFECT_LOGGING_LEVEL: "ERROR",
    }
    # the harness puts its database into mkdtemp(); here it finds one already migrated
    found = mock.patch.object(utilities, "mkdtemp", return_value=str(home / "db"))
    with (
        temporary_settings(changed),
        found,
        utilities.prefect_test_harness(server_startup_timeout=120),
    ):
        yield PREFECT_API_URL.value()


@pytest.fixture
def address(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """An address in memory that every store shares meanwhile: stores are as on several machines."""
    import fsspec

    from storage import remote

    url = "memory://bucket/prefix"
    monkeypatch.setenv(remote.REMOTE, url)
    remote._gone_until.clear()
    memory = fsspec.filesystem("memory")
    yield url
    memory.store.clear()
    memory.pseudo_dirs[:] = [""]
