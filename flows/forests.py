"""The trained forests: those that come with MapSense, and any file named instead."""

from pathlib import Path
from typing import Literal, get_args

from storage.forest import open_forest
from storage.sources import Source, file_source

Kind = Literal["doors", "furniture"]
KINDS: tuple[Kind, ...] = get_args(Kind)
"""What there are classifiers of; each a component's folder below tasks/."""
_TASKS = Path(__file__).resolve().parents[1] / "tasks"


def shipped(kind: Kind) -> Path:
    """Return the file of the forest that comes with MapSense."""
    return _TASKS / kind / "forest.parquet"


def forest_source(path: Path) -> Source:
    """Return a forest as a stage's input, known by the hash of its bytes.

    Raises
    ------
    InputError
        If it is no forest, or damaged: said before anything runs.
    """
    open_forest(path)
    return file_source(path, "forest")


def used() -> list[Path]:
    """Return the forests that a mapping uses, of those that are there."""
    return [path for path in map(shipped, KINDS) if path.is_file()]
