"""What code counts for a stage, and what does not."""

import importlib
import sys
from concurrent.futures import ThreadPoolExecutor

import pytest

from storage import fingerprint
from storage.fingerprint import code_fingerprint
from tasks.scans.read import read_scan
from tasks.surfaces.hough import detect_planes
from tasks.surfaces.intersection import intersect_walls
from tasks.surfaces.labelling import label_surfaces

STAGE = """
from lab import helper
from lab.deep.far import factor
from storage.artifacts import Ref

def compute():
    return helper.add(1) * factor()

def other():
    return 2
"""
HELPER = """
def add(x):
    from lab.lazy import one
    return x + one()
"""
FILES = {
    "__init__.py": "",
    "stage.py": STAGE,
    "helper.py": HELPER,
    "lazy.py": "def one():\n    return 1\n",
    "late.py": "def one():\n    return 1\n",
    "deep/__init__.py": "",
    "deep/far.py": "from ..late import one\ndef factor():\n    return 3 * one()\n",
    "stranger.py": "def unrelated():\n    return 0\n",
}


@pytest.fixture
def lab(tmp_path, monkeypatch):
    """Return what writes a package's files and returns the fingerprint of one of its functions."""
    monkeypatch.syspath_prepend(str(tmp_path))

    def of(function="compute", **changes):
        for name, text in (FILES | {f"{k}.py": v for k, v in changes.items()}).items():
            (tmp_path / "lab" / name).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / "lab" / name).write_text(text)
        for name in [name for name in sys.modules if name.partition(".")[0] == "lab"]:
            del sys.modules[name]
        for cached in ("_fingerprint", "_read", "_locate"):
            getattr(fingerprint, cached).cache_clear()
        importlib.invalidate_caches()
        return code_fingerprint(getattr(importlib.import_module("lab.stage"), function))

    return of


@pytest.mark.parametrize(
    "change",
    [
        {"stage": STAGE.replace("* factor", "+ factor")},
        {"helper": HELPER.replace("x +", "x -")},
        {"lazy": "def one():\n    return 2\n"},
        {"deep/far": "from ..late import one\ndef factor():\n    return 4 * one()\n"},
        {"deep/__init__": "SWITCH = 1\n"},
        {"helper": "import open3d\n" + HELPER},
    ],
    ids=["itself", "helper", "imported in a function", "relative", "a parent package", "library"],
)
def test_code_that_counts(lab, change, monkeypatch):
    before = lab()
    monkeypatch.setitem(sys.modules, "open3d", sys)  # its version counts; it need not be loaded
    assert lab(**change) != before


@pytest.mark.parametrize(
    "change",
    [
        {"stage": '"""Docs."""\n# a comment\n' + STAGE.replace("():\n", '():\n    """Docs."""\n')},
        {"stage": STAGE.replace("helper.add(1) * factor()", "(helper.add(1)\n     * factor())")},
        {"stranger": "def unrelated():\n    return 1\n"},
    ],
    ids=["comments and docstrings", "layout", "a module nobody imports"],
)
def test_code_that_does_not_count(lab, change):
    assert lab() == lab(**change)


def test_two_functions_of_a_module_differ(lab):
    assert lab("compute") != lab("other")


def test_reading_the_imports_imports_nothing(lab):
    lab()
    assert "lab.lazy" not in sys.modules


def test_an_upgraded_library_counts(lab, monkeypatch):
    before = lab()
    monkeypatch.setattr(fingerprint, "_version", lambda library: f"{library} 99")
    assert lab() != before


def test_threads_that_ask_at_once_get_the_same_answer():
    # Python 3.11 may fail where two threads parse at the same time
    functions = [intersect_walls, detect_planes, read_scan, label_surfaces]
    expected = [code_fingerprint(function) for function in functions]
    for _ in range(3):
        fingerprint._fingerprint.cache_clear()
        fingerprint._read.cache_clear()
        with ThreadPoolExecutor(8) as pool:
            assert list(pool.map(code_fingerprint, functions * 4)) == expected * 4
