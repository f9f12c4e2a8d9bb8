"""What the tests of flows share."""

import importlib
from pathlib import Path

import pytest

from tests.flows import command


@pytest.fixture
def mapsense(tmp_path, monkeypatch):
    """Return what runs the command in an empty folder: its exit code, stdout and stderr."""
    monkeypatch.chdir(tmp_path)
    return command.mapsense


@pytest.fixture
def toy(prefect_server, monkeypatch):
    """The toy pipeline: three stages, as of scans of numbers."""
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    return importlib.import_module("toy.pipeline")


@pytest.fixture
def scans(tmp_path):
    """Two scans of the toy pipeline."""
    paths = []
    for name, n in (("one", 10), ("two", 20)):
        path = tmp_path / f"{name}.txt"
        path.write_text(str(n))
        paths.append(str(path))
    return paths
