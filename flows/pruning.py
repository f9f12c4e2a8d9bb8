"""The verb `prune`: a store without what no current result needs."""

import json
import sys
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from flows.answers import existing_store, print_table
from flows.verbs import checked_name
from storage.errors import MapSenseError
from storage.pruning import Pruned, prune
from storage.retention import Keep


def prune_store(
    store: Path | None,
    building: str | None,
    keep_runs: int,
    older_than: float | None,
    dry_run: bool,
    as_json: bool,
) -> int:
    """Remove what no current result needs, and say what it was."""
    root = existing_store(store)
    if building is not None:
        checked_name(building)
    pruned = prune(root, _keep(keep_runs, older_than), building, dry_run=dry_run)
    if as_json:
        print(json.dumps(_as_json(pruned, dry_run), indent=1))
    else:
        _print(pruned, dry_run)
    for name in pruned.in_use:
        print(f"mapsense: {name}: left as it is, a run goes on there", file=sys.stderr)
    for name in pruned.unknown:
        print(f"mapsense: {name}: left as it is, no run of it is recorded", file=sys.stderr)
    return 0


def _keep(runs: int, older_than: float | None) -> Keep:
    if runs < 1:
        raise MapSenseError(f"--keep-runs {runs}: expected at least 1")
    if older_than is None:
        return Keep(runs)
    try:
        return Keep(runs, datetime.now(UTC) - timedelta(days=older_than))
    except (OverflowError, ValueError) as error:
        raise MapSenseError(f"--older-than {older_than}: expected a number of days") from error


def _as_json(pruned: Pruned, dry_run: bool) -> dict[str, Any]:
    return {
        "dry_run": dry_run,
        "removed": {
            what: {"files": files, "bytes": pruned.bytes[what]}
            for what, files in sorted(pruned.files.items())
        },
        "bytes": pruned.bytes.total(),
        "kept": {"artifacts": pruned.kept, "bytes": pruned.kept_bytes},
        "in_use": pruned.in_use,
        "unknown": pruned.unknown,
    }


def _print(pruned: Pruned, dry_run: bool) -> None:
    import pyarrow as pa

    if pruned.files:
        rows = [
            {"removed": what, "files": files, "MB": f"{pruned.bytes[what] / 1e6:.1f}"}
            for what, files in sorted(pruned.files.items())
        ]
        print_table(pa.Table.from_pylist(rows))
    would = "would be " if dry_run else ""
    print(
        f"{pruned.bytes.total() / 1e6:.1f} MB {would}removed; {pruned.kept} artifacts of "
        f"{pruned.kept_bytes / 1e6:.1f} MB are needed"
    )
