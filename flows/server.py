"""Prefect's API for one command: a server of our own, unless PREFECT_API_URL names one.

Prefect would start one by itself, but shares its database between processes: two commands at once
lock each other out of it for up to a minute. Here each command has a private copy of an empty one,
made once and kept in PREFECT_HOME, or in the store if that is not set. Nothing is lost with it:
what ran and how it ended is in the store. The server starts while the command still imports, and
ends with it, however that ends.
"""

import fcntl
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from urllib.error import URLError
from urllib.request import urlopen

from storage.errors import MapSenseError, StoreError

TIMEOUT_S = 120
SETTINGS = {
    "DO_NOT_TRACK": "1",
    "PREFECT_SERVER_ANALYTICS_ENABLED": "false",
    "PREFECT_RESULTS_DEFAULT_SERIALIZER": "json",
    # one row per transaction is the default: it locks the API out of SQLite, for up to 62 s
    "PREFECT_SERVER_SERVICES_TASK_RUN_RECORDER_BATCH_SIZE": "200",
    "PREFECT_SERVER_SERVICES_TASK_RUN_RECORDER_READ_BATCH_SIZE": "200",
    "PREFECT_SERVER_API_BLOCKS_REGISTER_ON_START": "false",
    "PREFECT_UI_ENABLED": "0",
    # 2 + 4 + 8 s: a server that is gone for longer does not come back by waiting a minute a call
    "PREFECT_CLIENT_MAX_RETRIES": "3",
    # stages run in threads of their own: BLAS threads below them cost five times
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
}
"""Set before Prefect or numpy is imported; what the person has set wins."""
_own: set[str] = set()
"""addresses this process serves"""


def quiet(verbose: bool) -> None:
    """Set what must be in the environment before anything heavy is imported."""
    for name, value in SETTINGS.items():
        os.environ.setdefault(name, value)
    if not verbose:
        # errors reach the person as one sentence, from us
        os.environ.setdefault("PREFECT_LOGGING_LEVEL", "CRITICAL")
        os.environ.setdefault("PREFECT_LOGGING_SERVER_LEVEL", "CRITICAL")
        os.environ.setdefault("PREFECT_LOGGING_INTERNAL_LEVEL", "CRITICAL")
        os.environ.setdefault("PREFECT_LOGGING_TO_API_ENABLED", "false")


@contextmanager
def prefect_api(store: Path) -> Iterator[None]:
    """Provide Prefect's API meanwhile; enter before Prefect is imported, see `wait_until_up`."""
    if os.environ.get("PREFECT_API_URL"):
        yield
        return
    home = Path(os.environ.setdefault("PREFECT_HOME", str((store / ".prefect").resolve())))
    with tempfile.TemporaryDirectory(prefix="mapsense-", ignore_cleanup_errors=True) as folder:
        database = Path(folder) / "prefect.db"
        shutil.copyfile(empty_database(home), database)
        port = _free_port()
        server = _start(port, database)
        url = os.environ["PREFECT_API_URL"] = f"http://127.0.0.1:{port}/api"
        _own.add(url)
        try:
            yield
        finally:
            _own.discard(url)
            del os.environ["PREFECT_API_URL"]
            server.terminate()
            server.wait()


def is_own() -> bool:
    """Return whether Prefect's API is one that this process serves: it is gone with it."""
    return os.environ.get("PREFECT_API_URL") in _own


def wait_until_up() -> None:
    """Wait until Prefect's API answers."""
    url = os.environ["PREFECT_API_URL"]
    end = time.monotonic() + TIMEOUT_S
    while time.monotonic() < end:
        try:
            with urlopen(f"{url}/health", timeout=5):
                return
        except (URLError, OSError):
            time.sleep(0.05)
    raise MapSenseError(
        f"{url}: Prefect's API does not answer; unset PREFECT_API_URL to use one of its own, or "
        "start `prefect server start`"
    )


def empty_database(home: Path) -> Path:
    """Return a migrated, empty database; made once for each version of Prefect."""
    path = home / f"mapsense-empty-{version('prefect')}.db"
    try:
        home.mkdir(parents=True, exist_ok=True)
        with open(home / ".mapsense.lock", "w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not path.exists():
                _migrate(home, path)
    except OSError as error:
        raise StoreError(
            f"{home}: cannot write Prefect's database there ({error.strerror or error}); make "
            "the folder writable, or set PREFECT_HOME to another"
        ) from error
    return path


def _migrate(home: Path, path: Path) -> None:
    temporary = home / f".mapsense-{os.getpid()}.db"
    done = subprocess.run(
        [sys.executable, "-m", "prefect", "server", "database", "upgrade", "-y"],
        env=os.environ | {"PREFECT_HOME": str(home), **_database(temporary)},
        capture_output=True,
        text=True,
    )
    if done.returncode != 0:
        temporary.unlink(missing_ok=True)
        last = (done.stderr.strip() or done.stdout.strip()).splitlines()[-1:]
        raise MapSenseError(f"Prefect cannot make its database: {' '.join(last)}")
    os.replace(temporary, path)


def _database(path: Path) -> dict[str, str]:
    return {"PREFECT_SERVER_DATABASE_CONNECTION_URL": f"sqlite+aiosqlite:///{path}"}


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def _start(port: int, database: Path) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-m", "flows.server", str(port)],
        env=os.environ | _database(database),
        stdin=subprocess.PIPE,  # held open by us: its end tells the server that we are gone
        stdout=subprocess.DEVNULL,
        stderr=None
        if os.environ.get("PREFECT_LOGGING_SERVER_LEVEL") is None
        else subprocess.DEVNULL,
    )


def _leave_with_parent() -> None:
    sys.stdin.buffer.read()
    os._exit(0)


def main() -> None:
    """Serve Prefect's API on a port until the process that started this one is gone."""
    import uvicorn

    threading.Thread(target=_leave_with_parent, daemon=True).start()
    uvicorn.run(
        "prefect.server.api.server:create_app",
        factory=True,
        host="127.0.0.1",
        port=int(sys.argv[1]),
        log_level="error",
        lifespan="on",
    )


if __name__ == "__main__":
    main()
