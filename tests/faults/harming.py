"""Map a small simulated storey as people do, and do it harm: by signals, a full disk, poison."""

import json
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq

from storage.points import PointCloud
from storage.pruning import prune
from storage.retention import Keep
from storage.snapshots import none
from tasks.scans.bundle import write_bundle
from tasks.simulation.clouds import furnished_room

ROOT = Path(__file__).resolve().parents[2]
BUILDING, STOREY = "hut", "0"
SCANS = ("a", "b", "c")
DERIVED = {".locks", ".catalog", ".cache", ".prefect", "runs", "stages"}
"""Parts of a store that say when, where and how: they differ from run to run."""
TIMEOUT_S = 600


def write_scans(folder: Path, points: int = 8_000) -> Path:
    """Write the scans of a storey of one room, always the same."""
    for seed, name in enumerate(SCANS, 1):
        cloud = PointCloud(furnished_room(points, seed)[0], np.zeros(3))
        write_bundle(folder / f"{name}.scan", cloud, none())
    return folder


def write_ply(path: Path, points: int, seed: int) -> None:
    """Write a scan as PLY, whose reader opens the file by Python; of many points the same again."""
    xyz = np.resize(furnished_room(min(points, 100_000), seed)[0].astype("<f4"), (points, 3))
    properties = "".join(f"property float {axis}\n" for axis in "xyz")
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(xyz)}\n{properties}"
    path.write_bytes(f"{header}end_header\n".encode() + xyz.tobytes())


@dataclass
class Ended:
    """How a command has ended."""

    code: int
    out: str
    err: str

    def summary(self) -> dict:
        """Return the summary it answered."""
        return json.loads(self.out)


class Mapping:
    """`mapsense map` in a process of its own.

    Parameters
    ----------
    environment : beside that of this process
    """

    def __init__(self, store: Path, scans: Path, **environment: str) -> None:
        self.store = store
        asked = ["map", str(scans), "--building", BUILDING, "--storey", STOREY]
        asked += ["--store", str(store), "--jobs", "2", "--json"]
        paths = [str(ROOT), environment.pop("PYTHONPATH", "")]
        self.process = subprocess.Popen(
            [sys.executable, "-c", "from flows.cli import main; main()", *asked],
            env=os.environ | {"PYTHONPATH": os.pathsep.join(paths)} | environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def wait_for(self, artifacts: int) -> bool:
        """Wait until the store has so many artifacts; False if the run ended before."""
        while len(artifacts_of(self.store)) < artifacts:
            if self.process.poll() is not None:
                return False
            time.sleep(0.002)
        return True

    def kill(self) -> None:
        """Kill the process of the flow, -9."""
        self.process.send_signal(signal.SIGKILL)

    def ended(self, timeout_s: float = TIMEOUT_S) -> Ended:
        """Wait for its end."""
        out, err = self.process.communicate(timeout=timeout_s)
        return Ended(self.process.returncode, out, err)

    def __enter__(self) -> "Mapping":
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()


def run(store: Path, scans: Path, **environment: str) -> Ended:
    """Map the storey, to the end."""
    with Mapping(store, scans, **environment) as mapping:
        return mapping.ended()


def artifacts_of(store: Path) -> set[Path]:
    """Return the artifacts there are: files named by their content."""
    folders = (folder for folder in store.glob("*") if folder.name not in DERIVED)
    return {path for folder in folders for path in folder.glob("building=*/**/*.parquet")}


def results(store: Path) -> dict[str, bytes]:
    """Return what a store holds, to the byte, once what no result needs was pruned.

    Left out is what says when and how long: summaries, records of runs and stages. Of the cache
    the keys are left, and what they lead to.
    """
    pruned = prune(store, Keep())
    assert pruned.in_use == pruned.unknown == [], pruned
    found = {}
    for path in sorted(store.rglob("*")):
        name = path.relative_to(store)
        if path.is_file() and name.parts[0] not in DERIVED and name.name != "summary.json":
            found[str(name)] = path.read_bytes()
    for path in sorted((store / ".cache").rglob("*")):
        if path.is_file():
            found[str(path.relative_to(store))] = json.loads(path.read_text())["result"].encode()
    return found


def check_same(store: Path, undisturbed: dict[str, bytes]) -> None:
    """Raise AssertionError unless a store holds what an undisturbed one does, to the byte."""
    found = results(store)
    missing, more = undisturbed.keys() - found.keys(), found.keys() - undisturbed.keys()
    other = [name for name in undisturbed.keys() & found.keys() if undisturbed[name] != found[name]]
    assert not (missing or more or other), f"missing {missing}, more {more}, other {other}"


def kill_and_rerun(store: Path, scans: Path, seed: int, of: int, **environment: str) -> str:
    """Kill a run at a moment drawn, then run it again to the end; return when it was killed.

    Parameters
    ----------
    of : artifacts of a whole run
    """
    draws = random.Random(seed)
    artifacts, delay_s = draws.randrange(of), draws.uniform(0, 0.2)
    with Mapping(store, scans, **environment) as mapping:
        mapping.wait_for(artifacts)
        time.sleep(delay_s)
        mapping.kill()
        code = mapping.ended().code
    left = len(artifacts_of(store))
    again = run(store, scans, **environment)
    assert again.code == 0, again.err
    assert again.summary()["state"] == "completed"
    return f"{'killed' if code == -9 else 'ended'} at {left} of {of} artifacts"


def spawned_by(process: int) -> list[int]:
    """Return the processes that a process has started by `multiprocessing`, and that go on."""
    found = []
    for path in Path(f"/proc/{process}/task").glob("*/children"):
        with suppress(OSError):
            for child in path.read_text().split():
                if b"spawn_main" in Path(f"/proc/{child}/cmdline").read_bytes():
                    found.append(int(child))
    return found


def two_at_once(store: Path, scans: Path, **environment: str) -> tuple[Ended, Ended]:
    """Map the storey twice at the same time."""
    with Mapping(store, scans, **environment) as one, Mapping(store, scans, **environment) as other:
        return one.ended(), other.ended()


def computed(ended: Ended) -> int:
    """Return how many stages a run computed."""
    return sum(cost["computed"] for cost in ended.summary()["stages"].values())


def computed_in(store: Path) -> int:
    """Return how many stages all runs in a store have computed."""
    files = (store / "stages").rglob("*.parquet")
    tables = [pq.read_table(file, columns=["outcome"], partitioning=None) for file in files]
    return sum(table["outcome"].to_pylist().count("computed") for table in tables)


@contextmanager
def small_disk(folder: Path, kilobytes: int) -> Iterator[Callable[[int], None]]:
    """Mount a small file system; yield what makes it larger. OSError where that is forbidden."""
    folder.mkdir(parents=True, exist_ok=True)
    _mount("-t", "tmpfs", "-o", f"size={kilobytes}k", "mapsense-faults", str(folder))
    try:
        yield lambda more: _mount("-o", f"remount,size={more}k", str(folder))
    finally:
        subprocess.run(["umount", "--lazy", str(folder)], check=True)


def _mount(*arguments: str) -> None:
    try:
        done = subprocess.run(["mount", *arguments], capture_output=True, text=True)
    except FileNotFoundError as error:
        raise OSError("there is no mount") from error
    if done.returncode != 0:
        raise OSError(done.stderr.strip())


@contextmanager
def server(home: Path) -> Iterator[tuple[str, "subprocess.Popen[bytes]"]]:
    """Serve Prefect's API in a process of its own; yield its address and the process."""
    from flows import server as own

    database = home / "served.db"
    database.write_bytes(own.empty_database(home).read_bytes())
    port = own._free_port()
    process = own._start(port, database)
    try:
        yield f"http://127.0.0.1:{port}/api", process
    finally:
        with suppress(ProcessLookupError):
            process.kill()
        process.wait()
