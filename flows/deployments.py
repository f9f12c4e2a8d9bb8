"""The verb `deploy`: the files of buildings become deployments on a Prefect server."""

import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from flows.answers import print_table
from flows.settings import load_settings
from storage.errors import InputError, MapSenseError

FOLDER = Path("deployments")
SUFFIX = ".toml"


def deploy(
    paths: Sequence[Path],
    work_pool: str | None,
    prefect_file: Path | None,
    store: Path | None,
    check: bool,
    as_json: bool,
) -> int:
    """Register a deployment for each building's file; with `check`, only read the files."""
    settings = load_settings(store=store)
    files = building_files(paths or (FOLDER,))
    url = os.environ.get("PREFECT_API_URL")
    if not url and not check:
        raise MapSenseError(
            "PREFECT_API_URL is not set, so there is no server to deploy to: start one with "
            "'prefect server start', then export PREFECT_API_URL=http://127.0.0.1:4200/api; "
            "--check only reads the files"
        )
    from flows.deploying.building_file import read_building
    from flows.deploying.prefect_file import NAME, read_shared

    shared = read_shared(prefect_file or files[0].parent / NAME, work_pool)
    buildings = [read_building(path, settings.params) for path in files]
    _refuse_twice([(b.building, b.path) for b in buildings])
    root = str(settings.store.resolve())
    outcomes = {b.building: ("not deployed: only read", "") for b in buildings}
    others: list[str] = []
    if not check:
        outcomes, others = _registered(url or "", buildings, shared, root)
    rows = [
        {
            "building": b.building,
            "storeys": ", ".join(entry.storey for entry in b.storeys),
            "schedule": str(b.timing) if b.timing is not None else "none: runs when asked",
            "at once": b.concurrency,
            "deployment": outcomes[b.building][0],
            "note": outcomes[b.building][1],
        }
        for b in buildings
    ]
    # of files alone nobody can tell which others should be there
    left = others if any(path.is_dir() for path in paths or (FOLDER,)) else []
    _print(rows, left, shared.work_pool, root, check, as_json)
    return 0


def building_files(paths: Sequence[Path]) -> list[Path]:
    """Return the buildings' files: those named, and those in folders that are named."""
    found: dict[Path, None] = {}
    for path in paths:
        if path.is_dir():
            inside = sorted(p for p in path.glob(f"*{SUFFIX}") if not p.name.startswith("."))
            if not inside:
                raise InputError(path, f"holds no file *{SUFFIX}", "write one for each building")
            found |= dict.fromkeys(p.resolve() for p in inside)
        elif path.exists():
            found[path.resolve()] = None
        else:
            remedy = "name a building's file, or a folder of such"
            raise InputError(path, "cannot be read (No such file or directory)", remedy)
    return list(found)


def _refuse_twice(named: list[tuple[str, Path]]) -> None:
    first: dict[str, Path] = {}
    for building, path in named:
        if building in first:
            problem = f"'building' is \"{building}\", as in {first[building]}"
            raise InputError(path, problem, "give each building one file")
        first[building] = path


def _registered(
    url: str, buildings: Any, shared: Any, store: str
) -> tuple[dict[str, tuple[str, str]], list[str]]:
    from httpx import HTTPError
    from prefect.exceptions import PrefectHTTPStatusError

    from flows.deploying.register import register

    try:
        done, others = register(buildings, shared, store)
    except PrefectHTTPStatusError as error:
        detail = " ".join(error.response.text.split())[:300]
        raise MapSenseError(f"{url}: the server refused ({detail})") from error
    except (HTTPError, OSError, RuntimeError) as error:
        text = " ".join(str(error).split())[:200]
        raise MapSenseError(
            f"{url}: Prefect's server does not answer ({text}); start 'prefect server start', or "
            "correct PREFECT_API_URL"
        ) from error
    return {r.building: (r.outcome, r.note) for r in done}, others


def _print(
    rows: list[dict[str, Any]],
    left: list[str],
    pool: str,
    store: str,
    check: bool,
    as_json: bool,
) -> None:
    if as_json:
        print(json.dumps({"deployments": rows, "left": left, "pool": pool, "store": store}))
        return
    import pyarrow as pa

    print_table(pa.Table.from_pylist(rows))
    print(f"store: {store}")
    for name in left:
        print(
            f"mapsense: {name} is deployed but has no file here; to take it off the server: "
            f"prefect deployment delete {name}",
            file=sys.stderr,
        )
    if not check:
        print(f"runs wait for a worker: prefect worker start --pool {pool}")
