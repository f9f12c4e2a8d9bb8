"""Two buildings mapped by the clock, on a real Prefect server and worker; run by hand.

    python tests/deployments/end_to_end.py --work ops
    python tests/deployments/end_to_end.py --postgres --workers 2 --dask 2 --s3 --apart

The second is what more than one machine needs: the server's database in PostgreSQL, two workers
that take runs, stages on a Dask cluster, and stores that share an address of an S3-compatible
service; with `--apart` each worker has a store of its own, as on a machine of its own. The extra
`scale` and the dependency group `services` bring what it imports. What must hold is asserted, and
told as it is seen:

1. `mapsense deploy` registers two buildings; deployed again, nothing changes.
2. The scheduler begins runs of both; the worker maps every storey.
3. The next tick computes nothing: no run of a storey, no stage.
4. A scan dropped into one storey is the only thing computed at the next tick.
5. Each event of a run is one JSON line on the worker's output; artifacts show each storey.
6. A run that failed is retried by Prefect's own `flow-run retry`: only what failed is computed.
7. With `--dask`: only processes of the cluster ran stages.
8. With `--s3`: another machine, whose store is empty, maps a storey and computes nothing.

It takes about three minutes on a machine with nothing else to do.
"""

import argparse
import json
import os
import shutil
import tempfile
import time
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
from services import BUCKET, ROOT, Services, Wanted, services, wait_until, write_scan

from flows.server import empty_database
from storage.remote import REMOTE, refresh

NORTH = """
building = "north"
settle_s = 1
params.detect = []  # rooms and walls are enough here
[schedule]
every_s = 60
[[storeys]]
storey = "0"
scans = ["../scans/north-0"]
[[storeys]]
storey = "1"
scans = ["../scans/north-1"]
"""
SOUTH = """
building = "south"
settle_s = 1
params.detect = []
[schedule]
cron = "* * * * *"
timezone = "Europe/Berlin"
[[storeys]]
storey = "0"
scans = ["../scans/south-0"]
"""
SOUTH_LATER = (
    SOUTH.partition("[schedule]")[0]
    + """
[[storeys]]
storey = "0"
scans = ["../scans/south-0"]
[[storeys]]
storey = "1"
scans = ["../scans/south-1"]
"""
)
ENDED = ("COMPLETED", "FAILED", "CRASHED", "CANCELLED")
PATIENCE_S = 420


def main() -> None:
    """Run it all in a folder, which is emptied first."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument(
        "--work", type=Path, help="folder, emptied first [default: a temporary one]"
    )
    parser.add_argument("--postgres", action="store_true", help="PostgreSQL for the server")
    parser.add_argument("--workers", type=int, default=1, help="workers that take runs")
    parser.add_argument("--dask", type=int, default=0, help="workers of a Dask cluster")
    parser.add_argument("--s3", action="store_true", help="share the store by an S3 service")
    parser.add_argument(
        "--apart", action="store_true", help="a store of its own for each worker, needs --s3, root"
    )
    given = parser.parse_args()
    wanted = Wanted(given.postgres, given.dask, given.s3, given.apart)
    if given.work is None:
        with tempfile.TemporaryDirectory(prefix="mapsense-ops-") as folder:
            run(Path(folder), wanted, given.workers)
    else:
        shutil.rmtree(given.work, ignore_errors=True)
        given.work.mkdir(parents=True)
        run(given.work.resolve(), wanted, given.workers)


def run(folder: Path, wanted: Wanted, workers: int) -> None:
    """Run every step on services of their own."""
    for storey, names in {"north-0": "a", "north-1": "c", "south-0": "d"}.items():
        write_scan(folder / "scans" / storey, names, seed=ord(names))
    files = folder / "buildings"
    files.mkdir()
    shutil.copy(ROOT / "deployments" / "prefect.yaml", files)
    (files / "north.toml").write_text(NORTH)
    (files / "south.toml").write_text(SOUTH)
    with services(folder, empty_database(folder / "empty"), wanted) as running:
        # what is read here of the store is what any machine would read
        os.environ |= {
            n: v for n, v in running.environment.items() if n.startswith((REMOTE, "AWS"))
        }
        deploy(running)
        for number in range(workers):
            running.worker("mapsense", "--limit", "1", "--name", f"worker {number}")
        by_the_clock(running)
        nothing_new(running)
        one_new(running)
        seen(running)
        retried(running)
        if wanted.dask_workers:
            on_the_cluster(running)
        if wanted.s3:
            from_elsewhere(running)
    print("all as it must be")


def deploy(running: Services) -> None:
    """Register two buildings, twice."""
    for outcome in ("created", "unchanged"):
        answer = json.loads(running.mapsense("deploy", "buildings", "--json").stdout)
        assert [row["deployment"] for row in answer["deployments"]] == [outcome] * 2, answer
        told(f"deployed: {outcome}")


def by_the_clock(running: Services) -> None:
    """Wait for the first scheduled run of each building."""
    for building, storeys in {"north": "01", "south": "0"}.items():
        first = ended(running, building)[0]
        message = "; ".join(f"{s}: mapped from 1 scans, 1 new" for s in storeys)
        assert first["auto_scheduled"] and first["state"]["message"] == message, first["state"]
        told(f"{building}: by the clock: {message} ({first['total_run_time']:.0f} s)")


def nothing_new(running: Services) -> None:
    """Wait for a tick that has nothing to do."""
    stages = len(rows(running, "stages"))
    before = len(ended(running, "north"))
    tick = wait_until(lambda: ended(running, "north")[before:], PATIENCE_S)[0]
    assert tick["state"]["type"] == "COMPLETED", tick["state"]
    assert tick["state"]["message"].startswith("nothing new: 0: 1 scans, all known"), tick["state"]
    assert len(rows(running, "stages")) == stages
    told(f"next tick: {tick['state']['message']} ({tick['total_run_time']:.1f} s)")


def one_new(running: Services) -> None:
    """Drop a scan in, and wait until it is mapped."""
    known = {row["id"] for row in rows(running, "stages")}
    before = len(ended(running, "north"))
    write_scan(running.folder / "scans" / "north-0", "b", seed=2)

    def mapped() -> list[dict[str, Any]]:
        return [r for r in ended(running, "north")[before:] if "new" in r["state"]["message"][12:]]

    tick = wait_until(mapped, PATIENCE_S)[0]
    told(f"a scan dropped in: {tick['state']['message']} ({tick['total_run_time']:.0f} s)")
    fresh = [row for row in rows(running, "stages") if row["id"] not in known]
    computed = {row["scan"] for row in fresh if row["outcome"] == "computed"}
    cached = {row["scan"] for row in fresh if row["outcome"] == "cached"}
    assert (computed, cached) == ({"b", None}, {"a"}), (computed, cached)
    told("computed: scan b and what is over all scans; scan a from the cache; storey 1 not at all")


def seen(running: Services) -> None:
    """Look at what the worker wrote and what the server shows."""
    lines = (running.folder / "worker.log").read_text().splitlines()
    events = [json.loads(line) for line in lines if line.startswith("{")]
    stages = [e for e in events if e["event"] == "stage computed" and "scan" in e]
    assert stages and all({"run", "building", "storey", "stage"} <= set(e) for e in stages)
    shown = running.api("/artifacts/latest/filter", limit=100)
    kinds = {artifact["key"]: artifact["type"] for artifact in shown}
    for storey in ("north-0", "north-1", "south-0"):
        for what in ("plan", "metrics", "stages", "summary", "progress"):
            assert f"{what}-{storey}" in kinds, kinds
    told(f"{len(events)} events as JSON lines, {len(kinds)} artifacts")


def retried(running: Services) -> None:
    """Let a storey fail, mend it, and retry the run by Prefect's own command."""
    (running.folder / "buildings" / "south.toml").write_text(SOUTH_LATER)
    scan = write_scan(running.folder / "scans" / "south-1", "e", seed=5)
    whole = (scan / "points.parquet").read_bytes()
    (scan / "points.parquet").write_bytes(b"no Parquet")
    answer = json.loads(running.mapsense("deploy", "buildings", "--json").stdout)
    assert {r["building"]: r["deployment"] for r in answer["deployments"]} == {
        "north": "unchanged",
        "south": "updated",
    }
    time.sleep(2)
    deployment = running.api("/deployments/name/mapping/south")["id"]
    asked = running.api(f"/deployments/{deployment}/create_flow_run", name="by hand")["id"]
    failed = wait_until(lambda: has_ended(running, asked), PATIENCE_S)
    assert failed["state"]["type"] == "FAILED", failed["state"]
    told(f"failed: {failed['state']['message']}")
    errors = [
        json.loads(line)
        for line in (running.folder / "worker.log").read_text().splitlines()
        if line.startswith('{"') and '"level": "error"' in line
    ]
    assert any(e.get("scan") == "e" and e["remedy"] for e in errors), errors

    known = {row["id"] for row in rows(running, "stages")}
    (scan / "points.parquet").write_bytes(whole)
    time.sleep(2)
    running.command("prefect", "flow-run", "retry", failed["id"])
    again = wait_until(lambda: has_ended(running, asked, count=2), PATIENCE_S)
    assert again["state"]["type"] == "COMPLETED", again["state"]
    fresh = [row for row in rows(running, "stages") if row["id"] not in known]
    assert {row["storey"] for row in fresh} == {"1"}
    told(f"retried, run {again['run_count']} of the same id: {again['state']['message']}")


def on_the_cluster(running: Services) -> None:
    """Look which processes wrote rows of stages: those of the cluster, and no others."""
    refresh(running.folder / "store", "stages")
    files = list((running.folder / "store" / "stages").rglob("*.parquet"))
    # run-HHHHHHPID.NNNN.parquet, H of the machine
    processes = {int(file.name.split(".")[-3].rpartition("-")[2][6:]) for file in files}
    groups = {worker.pid for worker in running.dask}
    assert processes and {os.getpgid(process) for process in processes} <= groups, files
    told(f"all stages ran in {len(processes)} processes of the Dask cluster")


def from_elsewhere(running: Services) -> None:
    """Map a storey on a machine that has nothing but the address."""
    scans = running.folder / "scans" / "north-1"
    (running.folder / "mapsense.toml").write_text("params.detect = []\n")
    where = ("--building", "north", "--storey", "1", "--store", str(running.folder / "elsewhere"))
    done = running.mapsense("map", str(scans), *where, "--json")
    costs = json.loads(done.stdout)["stages"].values()
    assert sum(cost["computed"] for cost in costs) == 0, done.stdout
    told(f"from {BUCKET}: {sum(c['cached'] for c in costs)} stages, none of them computed")


def ended(running: Services, building: str) -> list[dict[str, Any]]:
    """Return a building's runs that have ended; the first is waited for."""

    def found() -> list[dict[str, Any]]:
        return [r for r in running.flow_runs(building) if r["state"]["type"] in ENDED]

    return wait_until(found, PATIENCE_S)


def has_ended(running: Services, run: str, count: int = 1) -> dict[str, Any] | None:
    """Return a run once it has ended for the so manieth time."""
    found: dict[str, Any] = running.api(f"/flow_runs/{run}")
    is_over = found["state"]["type"] in ENDED and found["run_count"] >= count
    return found if is_over else None


def rows(running: Services, table: str) -> list[dict[str, Any]]:
    """Return the rows of a history of the store, with their storey."""
    refresh(running.folder / "store", table)
    found = []
    for path in (running.folder / "store" / table).rglob("*.parquet"):
        storey = next(p for p in path.parts if p.startswith("storey=")).removeprefix("storey=")
        found += [
            r | {"storey": storey} for r in pq.read_table(path, partitioning=None).to_pylist()
        ]
    return found


def told(line: str) -> None:
    """Say that something is as it must be."""
    print(f"{time.strftime('%H:%M:%S')} {line}", flush=True)


if __name__ == "__main__":
    main()
