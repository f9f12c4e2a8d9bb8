"""The cache: for each key a small JSON record, in the store, of the artifacts it led to.

A record says how Prefect is to read it: by a pickle, if it says so, or by any class or module it
names. Whoever can write into a store could run code in every process that maps with it. So a
record is first read here, as plain JSON: one that is not as the stages write it is never shown to
Prefect.
"""

import contextlib
import json
from pathlib import Path
from typing import Any

from storage.artifacts import CACHE, Ref, check_name, is_sound
from storage.errors import StoreError
from storage.remote import is_held, obtain, share

REF = f"{Ref.__module__}.{Ref.__qualname__}"
SERIALIZER = {
    "type": "json",
    "jsonlib": "json",
    "object_decoder": "prefect.serializers.prefect_json_object_decoder",
    "loads_kwargs": {},
}
"""What a record may say of how to read it."""


def folder(store: str) -> Path:
    """Return where a store keeps its cache records: the path below it is the key."""
    return Path(store) / CACHE


def drop_unless_sound(store: str, key: str) -> None:
    """Drop the record of a key if it, or any artifact it names, is missing or damaged.

    Called while the key is locked, so that a hit is always whole: what is dropped is a miss. A
    record that another machine made is taken from the address it shares; its artifacts stay there
    until somebody reads them.
    """
    with contextlib.suppress(StoreError):  # not to be reached: computed anew
        obtain(store, f"{CACHE}/{key}")
    path = folder(store) / key
    if path.is_file() and not _is_sound(path, key, store):
        with contextlib.suppress(FileNotFoundError):
            path.unlink()


def hand_on(store: str, key: str) -> None:
    """Put the record of a key where other machines find it, if there is one.

    It comes after the artifacts it names. One that cannot be put is missing there: another machine
    computes the stage itself.
    """
    path = folder(store) / key
    with contextlib.suppress(StoreError, FileNotFoundError):
        share(store, path)


def _is_sound(path: Path, key: str, store: str) -> bool:
    try:
        refs = read_refs(path.read_bytes())
        named = all(ref.uri == _uri(key, ref) for ref in refs)
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return False  # cut, another version's, or nobody's
    return bool(refs) and named and all(_is_there(ref, store) for ref in refs)


def _is_there(ref: Ref, store: str) -> bool:
    try:
        return is_held(store, ref.uri) or is_sound(ref, store)
    except StoreError:
        return False


def read_refs(record: bytes) -> list[Ref]:
    """Return the references in a record.

    Raises
    ------
    ValueError, KeyError, TypeError, AttributeError
        If it is not as the stages write it.
    """
    whole = _plain(record)
    serializer = whole["metadata"]["serializer"]
    if whole.keys() != {"metadata", "result"} or any(
        serializer[name] != value for name, value in SERIALIZER.items()
    ):
        raise ValueError("is to be read in another way than JSON")
    result = _plain(whole["result"])
    return [_ref(part) for part in (result if isinstance(result, list) else [result])]


def _ref(part: dict[str, Any]) -> Ref:
    if part.keys() != {"__class__", "data"} or part["__class__"] != REF:
        raise ValueError("is no reference")
    return Ref.model_validate(part["data"])


def _uri(key: str, ref: Ref) -> str:
    """Return where the stage of a key writes an artifact: it can lead nowhere else."""
    building, storey, scan, *_ = key.split("/")
    place = f"{check_name(ref.table)}/building={building}/storey={storey}"
    of_scan = "" if scan == "_" else f"/scan={scan}"
    return f"{place}{of_scan}/{ref.sha256[:24]}.parquet"


def _plain(text: bytes | str) -> Any:
    return json.loads(text, object_pairs_hook=_once)


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return an object; ValueError if it says anything twice: others might take the other."""
    if len(found := dict(pairs)) < len(pairs):
        raise ValueError("says something twice")
    return found
