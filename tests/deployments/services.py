"""A real Prefect server and worker as processes of their own, for the tests of deployments."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import numpy as np

from storage.points import PointCloud
from storage.snapshots import none
from tasks.scans.bundle import write_bundle
from tasks.simulation.clouds import furnished_room

ROOT = Path(__file__).resolve().parents[2]


@dataclass
class Services:
    """A server, its address, and what commands of ours and Prefect's are run with."""

    folder: Path
    url: str
    environment: Mapping[str, str]
    processes: list[subprocess.Popen[bytes]] = field(default_factory=list)

    def api(self, path: str, **body: Any) -> Any:
        """Ask the server's API; a body makes it a POST. Asked again while it is busy."""
        data = json.dumps(body).encode() if body else None
        request = Request(self.url + path, data, {"Content-Type": "application/json"})
        for pause in (1, 2, 4, 8, 16, 32, None):
            try:
                with urlopen(request, timeout=60) as answer:
                    return json.load(answer)
            except HTTPError as error:
                if error.code != 503 or pause is None:
                    raise
                time.sleep(pause)
        raise AssertionError("the last attempt returns or raises")

    def flow_runs(self, deployment: str) -> list[dict[str, Any]]:
        """Return the runs of a deployment that have begun, in their order."""
        found = self.api(
            "/flow_runs/filter",
            deployments={"name": {"any_": [deployment]}},
            flow_runs={"state": {"type": {"not_any_": ["SCHEDULED"]}}},
            sort="START_TIME_ASC",
        )
        return [run for run in found if run["start_time"] is not None]

    def command(self, *arguments: str, check: bool = True) -> subprocess.CompletedProcess[str]:
        """Run a module of Python's, as `prefect` or `flows.cli`, and return what it said."""
        done = subprocess.run(
            [sys.executable, "-m", *arguments],
            env=self.environment,
            cwd=self.folder,
            capture_output=True,
            text=True,
            timeout=300,
        )
        assert not check or done.returncode == 0, done.stdout + done.stderr
        return done

    def mapsense(self, *arguments: str, check: bool = True) -> subprocess.CompletedProcess[str]:
        """Run our command."""
        code = "from flows.cli import main; main()"
        done = subprocess.run(
            [sys.executable, "-c", code, *arguments],
            env=self.environment,
            cwd=self.folder,
            capture_output=True,
            text=True,
            timeout=300,
        )
        assert not check or done.returncode == 0, done.stdout + done.stderr
        return done

    def start(self, log: str, *arguments: str, **environment: str) -> subprocess.Popen[bytes]:
        """Start a module of Python's, its output in a file; it ends with the services."""
        with open(self.folder / log, "ab") as file:
            process = subprocess.Popen(
                [sys.executable, "-m", *arguments],
                env=dict(self.environment) | environment,
                cwd=self.folder,
                stdout=file,
                stderr=file,
                start_new_session=True,
            )
        self.processes.append(process)
        return process

    def worker(self, pool: str, *arguments: str) -> subprocess.Popen[bytes]:
        """Start a worker that looks for work every two seconds."""
        return self.start(
            "worker.log",
            *("prefect", "worker", "start", "--pool", pool, *arguments),
            PREFECT_WORKER_QUERY_SECONDS="2",
        )

    def stop(self) -> None:
        """End every process that was started, with all it started itself."""
        for process in reversed(self.processes):
            for signal_ in (signal.SIGTERM, signal.SIGKILL):
                if process.poll() is None:
                    os.killpg(process.pid, signal_)
                    try:
                        process.wait(10)
                    except subprocess.TimeoutExpired:
                        continue


@contextmanager
def services(folder: Path, empty_database: Path) -> Iterator[Services]:
    """Start a server in a folder, on a copy of a migrated, empty database."""
    database = folder / "prefect.db"
    database.write_bytes(empty_database.read_bytes())
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = str(probe.getsockname()[1])
    url = f"http://127.0.0.1:{port}/api"
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("PREFECT_", "MAPSENSE_"))}
    environment = kept | {
        "PREFECT_HOME": str(folder / "home"),
        "PREFECT_API_URL": url,
        "PREFECT_SERVER_DATABASE_CONNECTION_URL": f"sqlite+aiosqlite:///{database}",
        "PREFECT_SERVER_SERVICES_TASK_RUN_RECORDER_BATCH_SIZE": "200",
        "PREFECT_SERVER_SERVICES_TASK_RUN_RECORDER_READ_BATCH_SIZE": "200",
        "PREFECT_SERVER_ANALYTICS_ENABLED": "false",
        "PREFECT_SERVER_SERVICES_SCHEDULER_LOOP_SECONDS": "5",
        "DO_NOT_TRACK": "1",
        "OMP_NUM_THREADS": "1",
        "PYTHONPATH": str(ROOT),
        "MAPSENSE_STORE": str(folder / "store"),
    }
    running = Services(folder, url, environment)
    try:
        running.start("server.log", "prefect", "server", "start", "--port", port)
        wait_until(lambda: running.api("/health"), 180)
        yield running
    finally:
        running.stop()


def wait_until(ready: Callable[[], Any], seconds: float, every: float = 1.0) -> Any:
    """Return what `ready` returns once it is true; an error counts as not ready."""
    end = time.monotonic() + seconds
    while True:
        try:
            if answer := ready():
                return answer
        except OSError:
            pass
        if time.monotonic() > end:
            raise TimeoutError(f"not ready after {seconds:g} s")
        time.sleep(every)


def write_scan(folder: Path, name: str, seed: int, points: int = 15_000) -> Path:
    """Write the simulated scan of a small furnished room."""
    path = folder / f"{name}.scan"
    cloud = PointCloud(furnished_room(points, seed)[0], np.zeros(3))
    write_bundle(path, cloud, none(), simulated=True)
    return path
