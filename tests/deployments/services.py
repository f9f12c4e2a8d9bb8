"""Real services as processes of their own, for the tests of deployments, faults and scale.

A Prefect server always; as wanted PostgreSQL below it, a Dask scheduler with workers, and an
S3-compatible service. All end with the test.
"""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import numpy as np
from postgres import postgres

from storage.points import PointCloud
from storage.snapshots import none
from tasks.scans.bundle import write_bundle
from tasks.simulation.clouds import furnished_room

ROOT = Path(__file__).resolve().parents[2]
BUCKET = "mapsense"
SECRET = "not-so-secret"


@dataclass(frozen=True)
class Wanted:
    """What a Prefect server is joined by."""

    postgres: bool = False
    """PostgreSQL holds the server's database; else SQLite"""
    dask_workers: int = 0
    """processes of one thread that stages run in; 0: threads of their flows"""
    s3: bool = False
    """stores share an address of an S3-compatible service"""
    apart: bool = False
    """each worker, Dask's too, sees a store of its own, as on a machine of its own; needs root"""


@dataclass
class Services:
    """A server, its address, and what commands of ours and Prefect's are run with."""

    folder: Path
    url: str
    environment: dict[str, str]
    apart: bool = False
    processes: list[subprocess.Popen[bytes]] = field(default_factory=list)
    dask: list[subprocess.Popen[bytes]] = field(default_factory=list)
    """processes of the Dask workers"""
    scheduler: subprocess.Popen[bytes] | None = None
    """process of the Dask scheduler that was started last"""

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

    def mapsense(
        self, *arguments: str, check: bool = True, timeout_s: float = 300, **environment: str
    ) -> subprocess.CompletedProcess[str]:
        """Run our command, with more in its environment; what is '' there is not set."""
        own = {**self.environment, **environment}
        code = "from flows.cli import main; main()"
        done = subprocess.run(
            [sys.executable, "-c", code, *arguments],
            env={name: value for name, value in own.items() if value},
            cwd=self.folder,
            capture_output=True,
            text=True,
            timeout=timeout_s,
        )
        assert not check or done.returncode == 0, done.stdout + done.stderr
        return done

    def start(
        self, log: str, *arguments: str, apart: bool = False, **environment: str
    ) -> subprocess.Popen[bytes]:
        """Start a module of Python's, its output in a file; it ends with the services.

        Parameters
        ----------
        apart : with another folder in place of the store, if that is wanted
        """
        command = [sys.executable, "-m", *arguments]
        if apart and self.apart:
            store = self.folder / "store"
            own = self.folder / f"store-of-{len(self.processes)}"
            for folder in (store, own):
                folder.mkdir(exist_ok=True)
            mounted = 'mount --bind "$1" "$2" && shift 2 && exec "$@"'
            command = ["unshare", "--mount", "sh", "-c", mounted, "sh", own, store, *command]
        with open(self.folder / log, "ab") as file:
            process = subprocess.Popen(
                command,
                env=dict(self.environment) | environment,
                cwd=self.folder,
                stdout=file,
                stderr=file,
                start_new_session=True,
            )
        self.processes.append(process)
        return process

    def worker(self, pool: str, *arguments: str, **environment: str) -> subprocess.Popen[bytes]:
        """Start a worker that looks for work every two seconds."""
        return self.start(
            "worker.log",
            *("prefect", "worker", "start", "--pool", pool, *arguments),
            apart=True,
            **environment | {"PREFECT_WORKER_QUERY_SECONDS": "2"},
        )

    def dask_worker(self, scheduler: str) -> subprocess.Popen[bytes]:
        """Start a process of a Dask cluster that runs one stage at a time."""
        one = ("--nworkers", "1", "--nthreads", "1", "--no-dashboard", "--death-timeout", "60")
        command = ("distributed.cli.dask_worker", scheduler, *one, "--preload", "flows.stages")
        self.dask.append(self.start("dask.log", *command, apart=True))
        return self.dask[-1]

    def dask_cluster(self, workers: int) -> str:
        """Start a Dask scheduler and workers; return the address once all of them are there."""
        address = f"tcp://127.0.0.1:{free_port()}"
        host, port = ("--host", "127.0.0.1"), ("--port", address.rpartition(":")[2])
        command = ("distributed.cli.dask_scheduler", *host, *port, "--no-dashboard")
        self.scheduler = self.start("dask.log", *command)
        for _ in range(workers):
            self.dask_worker(address)
        from distributed import Client

        with Client(address, timeout=60, set_as_default=False) as client:
            client.wait_for_workers(workers, timeout=180)
        return address

    def bucket(self) -> dict[str, str]:
        """Start an S3-compatible service; return what is set to share a bucket of it."""
        port = str(free_port())
        self.start("s3.log", "moto.server", "-H", "127.0.0.1", "-p", port)
        url = f"http://127.0.0.1:{port}"

        def made() -> bool:
            # the service asks for no signature, only for a place a signature names
            about = {"Authorization": "AWS4-HMAC-SHA256 Credential=test/20260101/us-east-1/s3/aws4"}
            urlopen(Request(f"{url}/{BUCKET}", None, about, method="PUT"), timeout=10).close()
            return True

        wait_until(made, 120)
        return {
            "AWS_ENDPOINT_URL": url,
            "AWS_ACCESS_KEY_ID": "test",
            "AWS_SECRET_ACCESS_KEY": SECRET,
            "AWS_DEFAULT_REGION": "us-east-1",
            "MAPSENSE_REMOTE": f"s3://{BUCKET}/store",
        }

    def end_dask(self) -> None:
        """End the Dask cluster."""
        if self.scheduler is not None:
            _end([*self.dask, self.scheduler])
            self.dask.clear()

    def stop(self) -> None:
        """End every process that was started, with all it started itself."""
        _end(self.processes[::-1])


@contextmanager
def services(
    folder: Path, empty_database: Path, wanted: Wanted | None = None
) -> Iterator[Services]:
    """Start a server in a folder, and what it is joined by.

    Parameters
    ----------
    empty_database : a migrated one of SQLite, of which the server gets a copy
    """
    wanted = wanted or Wanted()
    port = str(free_port())
    url = f"http://127.0.0.1:{port}/api"
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("PREFECT_", "MAPSENSE_"))}
    environment = kept | {
        "PREFECT_HOME": str(folder / "home"),
        "PREFECT_API_URL": url,
        "PREFECT_SERVER_ANALYTICS_ENABLED": "false",
        "PREFECT_SERVER_SERVICES_SCHEDULER_LOOP_SECONDS": "5",
        "DO_NOT_TRACK": "1",
        "OMP_NUM_THREADS": "1",
        "PYTHONPATH": str(ROOT),
        "MAPSENSE_STORE": str(folder / "store"),
    }
    running = Services(folder, url, environment, wanted.apart)
    with ExitStack() as stack:
        if wanted.postgres:
            database = stack.enter_context(postgres(free_port()))
        else:
            path = folder / "prefect.db"
            path.write_bytes(empty_database.read_bytes())
            database = f"sqlite+aiosqlite:///{path}"
            # a transaction for each row is the default: it locks the API out of SQLite
            for batch in ("BATCH_SIZE", "READ_BATCH_SIZE"):
                environment[f"PREFECT_SERVER_SERVICES_TASK_RUN_RECORDER_{batch}"] = "200"
        environment["PREFECT_SERVER_DATABASE_CONNECTION_URL"] = database
        stack.callback(running.stop)
        running.start("server.log", "prefect", "server", "start", "--port", port)
        if wanted.s3:
            environment |= running.bucket()
        wait_until(lambda: running.api("/health"), 180)
        if wanted.dask_workers:
            environment["MAPSENSE_DASK"] = running.dask_cluster(wanted.dask_workers)
        yield running


def _end(processes: list[subprocess.Popen[bytes]]) -> None:
    """End processes with all they started, all at once; who does not go in time is killed."""
    for signal_ in (signal.SIGTERM, signal.SIGKILL):
        left = [process for process in processes if process.poll() is None]
        for process in left:
            os.killpg(process.pid, signal_)
        for process in left:
            with suppress(subprocess.TimeoutExpired):
                process.wait(10)


def free_port() -> int:
    """Return a port nobody listens at."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


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
