"""What the tests of flows share."""

import pytest

from tests.flows import command


@pytest.fixture
def mapsense(tmp_path, monkeypatch):
    """Return what runs the command in an empty folder: its exit code, stdout and stderr."""
    monkeypatch.chdir(tmp_path)
    return command.mapsense
