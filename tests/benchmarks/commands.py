"""The command line as benchmarks run it: what a user would type."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any


def mapsense(*arguments: str) -> str:
    """Run a command and return what it printed; what it says of its progress is shown.

    Raises
    ------
    SystemExit
        If it fails, with what it said.
    """
    program = str(Path(sys.executable).with_name("mapsense"))
    quiet = subprocess.PIPE if arguments[0] == "query" else None
    done = subprocess.run([program, *arguments], stdout=subprocess.PIPE, stderr=quiet, check=False)
    if done.returncode:
        said = f": {done.stderr.decode()}" if done.stderr else ""
        raise SystemExit(f"mapsense {arguments[0]}: exit code {done.returncode}{said}")
    return done.stdout.decode()


def ask(store: Path, sql: str) -> list[dict[str, Any]]:
    """Return the rows that a query of a store has."""
    printed = mapsense("query", sql, "--store", str(store), "--format", "json")
    rows: list[dict[str, Any]] = json.loads(printed)
    return rows
