"""Parameters as people write them: `--set hough.gamma_cell=25`, one over another."""

import json
from collections.abc import Mapping
from typing import Any

from storage.errors import MapSenseError


def assigned(assignments: list[str]) -> dict[str, Any]:
    """Return `hough.gamma_cell=25` and the like as nested parameters."""
    nested: dict[str, Any] = {}
    for assignment in assignments:
        path, found, value = assignment.partition("=")
        *parents, name = path.strip().split(".")
        if not found or not parents:
            raise MapSenseError(
                f"--set {assignment}: expected STAGE.NAME=VALUE, as hough.gamma_cell=25"
            )
        inner = nested
        for parent in parents:
            inner = inner.setdefault(parent, {})
        inner[name] = _value(value)
    return nested


def merged(one: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, Any]:
    """Return nested parameters with those of `other` over those of `one`."""
    both = dict(one)
    for name, value in other.items():
        inner = both.get(name)
        if isinstance(inner, Mapping) and isinstance(value, Mapping):
            value = merged(inner, value)
        both[name] = value
    return both


def _value(text: str) -> Any:
    """Return a value written as JSON, or else the text itself."""
    try:
        return json.loads(text)
    except json.JSONDecodeError:
        return text
