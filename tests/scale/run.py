"""How time grows with scans and workers, and what a stage costs beyond its own work.

    python tests/scale/run.py
    python tests/scale/run.py --only scans --sizes 10 100 1000 --out scale.json

Three tables, of small simulated scans of furnished rooms, each scan under a name of its own:

- scans: one storey of more and more scans, in threads, on the embedded server;
- workers: a fixed campaign in 1, 2, 4 threads and in 1, 2, 4 processes of a Dask cluster;
- overhead: what a stage takes whose result is there already, with SQLite and with PostgreSQL
  below Prefect's server, in threads and on a cluster.

Figures mean something on a machine with nothing else to do. The tables of workers and overhead need
PostgreSQL, the extra `scale` and the dependency group `services`.
"""

import argparse
import json
import os
import resource
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "deployments")]

from services import Services, Wanted, services, write_scan  # noqa: E402

from flows.server import SETTINGS, empty_database  # noqa: E402
from storage.runs import read_runs  # noqa: E402

POINTS = 4_000
"""Points of a scan: few, so that what is not computing shows."""
ROOMS = 8
"""Different scans; each stands for many, under other names."""
CAMPAIGN = 24
"""Scans of the fixed campaign."""
CACHED = 40
"""Scans whose stages are looked up again."""
EMBEDDED = {"PREFECT_API_URL": "", "MAPSENSE_DASK": ""}
"""Set for a command that serves Prefect's API itself, on SQLite, and runs stages in threads."""
TIMEOUT_S = 3_600


@dataclass(frozen=True)
class Mapped:
    """A run of a storey."""

    scans: int
    stages: int
    computed: int
    run_s: float
    """from the start of its flow to its end, without that of the process"""
    cpu_s: float
    """of the command, its server and the services: what others do on the machine counts less"""
    stage_s: float
    """all stages, one after the other"""
    by_stage: dict[str, float]
    """seconds of each stage over all scans"""


def scans_of(folder: Path, count: int) -> Path:
    """Write the scans of a storey, the same few again and again."""
    rooms = [write_scan(folder / "rooms", str(n), n, POINTS) for n in range(min(ROOMS, count))]
    storey = folder / str(count)
    for number in range(count):
        shutil.copytree(rooms[number % ROOMS], storey / f"s{number:04d}.scan")
    return storey


def mapped(running: Services, scans: Path, store: Path, jobs: int, **environment: str) -> Mapped:
    """Map a storey in a process of its own, and return what it took."""
    where = ("--building", "b", "--storey", "0", "--store", str(store), "--json")
    before = _cpu_s(running)
    done = running.mapsense(
        *("map", str(scans), *where, "--jobs", str(jobs)), timeout_s=TIMEOUT_S, **environment
    )
    cpu_s = _cpu_s(running) - before
    costs = json.loads(done.stdout)["stages"]
    run = read_runs(store, "b", "0")[-1]
    assert run.ended_at is not None
    return Mapped(
        scans=len(list(scans.iterdir())),
        stages=sum(cost["computed"] + cost["cached"] for cost in costs.values()),
        computed=sum(cost["computed"] for cost in costs.values()),
        run_s=(run.ended_at - run.started_at).total_seconds(),
        cpu_s=cpu_s,
        stage_s=sum(cost["wall_s"] for cost in costs.values()),
        by_stage={stage: cost["wall_s"] for stage, cost in costs.items()},
    )


def of_scans(running: Services, folder: Path, sizes: list[int]) -> Iterator[dict[str, Any]]:
    """Yield what storeys of more and more scans take, on the embedded server."""
    for size in sizes:
        store = folder / f"scans-{size}"
        found = mapped(running, scans_of(folder / "scans", size), store, 2, **EMBEDDED)
        row = {
            "scans": size,
            "stages": found.stages,
            "s": round(found.run_s, 1),
            "ms/scan": round(1e3 * found.run_s / size),
            "CPU ms/scan": round(1e3 * found.cpu_s / size),
        }
        told(row)
        longest = sorted(found.by_stage.items(), key=lambda item: -item[1])
        yield row | {"stages_s": dict(longest)}


def of_workers(running: Services, folder: Path, counts: list[int]) -> Iterator[dict[str, Any]]:
    """Yield what a fixed campaign takes in threads, and in processes of a Dask cluster."""
    scans = scans_of(folder / "campaign", CAMPAIGN)
    for count in counts:
        found = mapped(running, scans, folder / f"threads-{count}", count, MAPSENSE_DASK="")
        row = {"runner": "threads", "workers": count, "s": round(found.run_s, 1)}
        told(row)
        yield row
    for count in counts:
        address = running.dask_cluster(count)
        # imports, and what is compiled at first use, are paid once for a cluster
        first = scans_of(folder / f"first-{count}", 2 * count)
        mapped(running, first, folder / f"first-{count}-store", count, MAPSENSE_DASK=address)
        store = folder / f"dask-{count}"
        found = mapped(running, scans, store, count, MAPSENSE_DASK=address)
        running.end_dask()
        row = {"runner": "Dask", "workers": count, "s": round(found.run_s, 1)}
        told(row)
        yield row


def of_overhead(
    running: Services, folder: Path, database: str, jobs: int = 2
) -> Iterator[dict[str, Any]]:
    """Yield what a stage takes whose result is there: Prefect's bookkeeping and the look-up."""
    scans, store = scans_of(folder / "cached", CACHED), folder / "cached-store"
    mapped(running, scans, store, jobs, MAPSENSE_DASK="")
    address = running.dask_cluster(jobs)
    for runner, dask in (("threads", ""), ("Dask", address)):
        for attempt in ("first", "again"):  # workers import at the first
            found = mapped(running, scans, store, jobs, MAPSENSE_DASK=dask)
            assert found.computed == 0
            row = {
                "database": database,
                "runner": runner,
                "run": attempt,
                "stages": found.stages,
                "ms/stage": round(1e3 * found.run_s / found.stages, 1),
                "CPU ms/stage": round(1e3 * found.cpu_s / found.stages, 1),
            }
            told(row)
            yield row


def _rows(
    table: str, running: Services, database: str, given: argparse.Namespace
) -> Iterator[dict[str, Any]]:
    if table == "scans":
        return of_scans(running, running.folder, given.sizes)
    if table == "workers":
        return of_workers(running, running.folder, given.workers)
    return of_overhead(running, running.folder, database)


def _cpu_s(running: Services) -> float:
    """Return the processor time of commands that have ended, and of services that go on."""
    ended = resource.getrusage(resource.RUSAGE_CHILDREN)
    ticks, groups = 0, {process.pid for process in running.processes}
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            fields = path.read_text().rpartition(") ")[2].split()  # from the third on
            if int(fields[2]) in groups:
                ticks += int(fields[11]) + int(fields[12])
    return ended.ru_utime + ended.ru_stime + ticks / os.sysconf("SC_CLK_TCK")


def told(row: dict[str, Any]) -> None:
    """Print a row."""
    print("  ".join(f"{name} {value}" for name, value in row.items()), flush=True)


def main() -> None:
    """Measure; print rows as they come, and write them where it is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", choices=["scans", "workers", "overhead"], help="one table")
    parser.add_argument("--sizes", type=int, nargs="+", default=[10, 100, 1000], help="scans")
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2, 4], help="at once")
    parser.add_argument("--out", type=Path, help="JSON file of all rows")
    given = parser.parse_args()
    for name, value in SETTINGS.items():
        os.environ.setdefault(name, value)
    rows: dict[str, list[dict[str, Any]]] = {}
    with tempfile.TemporaryDirectory(prefix="mapsense-scale-") as path:
        folder = Path(path)
        empty = empty_database(folder / "empty")
        wanted = ("scans", "workers", "overhead") if given.only is None else (given.only,)
        for database in ("SQLite", "PostgreSQL"):
            at = folder / database
            at.mkdir()
            tables = [t for t in wanted if database == "SQLite" or t == "overhead"]
            if not tables:
                continue
            with services(at, empty, Wanted(postgres=database == "PostgreSQL")) as running:
                for table in tables:
                    print(f"{table}:", flush=True)
                    rows.setdefault(table, []).extend(_rows(table, running, database, given))
    if given.out is not None:
        given.out.write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
