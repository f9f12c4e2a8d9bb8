"""A PostgreSQL server of its own, for the tests of deployments; it refuses to run as root."""

import os
import pwd
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

USER = "prefect"
SYSTEM_USER = "postgres"
"""Who runs it where this process is root's: its package makes this user."""


@contextmanager
def postgres(port: int) -> Iterator[str]:
    """Start a server in a folder of its own; yield the address Prefect is told.

    FileNotFoundError where PostgreSQL is not installed.
    """
    programs = _programs()
    # not below the folder of a test: the user it runs as could not enter that
    folder = Path(tempfile.mkdtemp(prefix="mapsense-postgres-"))
    try:
        if os.geteuid() == 0:
            shutil.chown(folder, SYSTEM_USER, SYSTEM_USER)
        data = folder / "data"
        _run(programs / "initdb", "-D", data, "-A", "trust", "-U", USER, "--encoding=UTF8")
        options = f"-p {port} -k {folder} -c listen_addresses=127.0.0.1"
        log = folder / "log"
        _run(programs / "pg_ctl", "-D", data, "-l", log, "-o", options, "-w", "start")
        try:
            _run(programs / "createdb", "-h", "127.0.0.1", "-p", port, "-U", USER, USER)
            yield f"postgresql+asyncpg://{USER}@127.0.0.1:{port}/{USER}"
        finally:
            _run(programs / "pg_ctl", "-D", data, "-m", "immediate", "-w", "stop")
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _programs() -> Path:
    """Return the folder of PostgreSQL's programs, the newest where there are several."""
    folders = Path("/usr/lib/postgresql").glob("*/bin/initdb")  # as Debian and Ubuntu have it
    newest = max(folders, key=lambda path: float(path.parts[-3]), default=None)
    found = newest or shutil.which("initdb")
    if found is None:
        raise FileNotFoundError("PostgreSQL is not installed: apt-get install postgresql")
    return Path(found).resolve().parent


def _run(*command: object) -> None:
    """Run a program of PostgreSQL's as a user it accepts."""
    as_other = ["runuser", "-u", SYSTEM_USER, "--"] if os.geteuid() == 0 else []
    if as_other:
        pwd.getpwnam(SYSTEM_USER)
    done = subprocess.run(
        [*as_other, *map(str, command)], cwd="/", capture_output=True, text=True, timeout=120
    )
    if done.returncode != 0:
        raise RuntimeError(f"{command[0]}: {done.stdout}{done.stderr}")
