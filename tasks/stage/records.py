"""The cache: for each key a small JSON record, in the store, of the artifacts it led to."""

import contextlib
from pathlib import Path
from typing import Any

from prefect.results import ResultRecord  # type: ignore[attr-defined]  # has no public home

from storage.artifacts import Ref, is_sound


def folder(store: str) -> Path:
    """Return where a store keeps its cache records: the path below it is the key."""
    return Path(store) / ".cache"


def drop_unless_sound(store: str, key: str) -> None:
    """Drop the record of a key if it, or any artifact it names, is missing or damaged.

    Called while the key is locked, so that a hit is always whole: what is dropped is a miss.
    """
    path = folder(store) / key
    if path.is_file() and not _is_sound(path, store):
        with contextlib.suppress(FileNotFoundError):
            path.unlink()


def _is_sound(path: Path, store: str) -> bool:
    try:
        result: Any = ResultRecord.deserialize(path.read_bytes()).result
    except Exception:  # whatever Prefect raises on a record that was cut or is another version's
        return False
    refs = result if isinstance(result, list) else [result]
    return bool(refs) and all(isinstance(ref, Ref) and is_sound(ref, store) for ref in refs)
