"""Where a storey's results lie, and the summary a run has left among them."""

import json
from pathlib import Path
from typing import Any

FILE = "summary.json"


def results_folder(store: str, building: str, storey: str, out: str | None) -> Path:
    """Return the folder of a storey's results: the one asked for, or its own in the store."""
    return Path(out) if out is not None else Path(store) / "plans" / building / storey


def read_summary(folder: Path, run: str) -> dict[str, Any] | None:
    """Return the summary a run has left in a folder; None if it left none that can be read."""
    try:
        summary: dict[str, Any] = json.loads((folder / FILE).read_text("utf-8"))
    except (OSError, ValueError):
        return None
    return summary if summary.get("run") == run else None
