"""The services of compose.yaml as processes of this machine, without containers; run by hand.

    python tests/deployments/composed.py

Commands and environments are those of the file; names of hosts become 127.0.0.1, ports free ones,
/store and /scans folders, and the images of others what is installed here: PostgreSQL, and moto as
the S3-compatible service. It shows that the file says all that is needed: a building whose scans
lie in /scans is deployed, mapped by the clock on the Dask cluster, and shared by the service.
"""

import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import yaml
from postgres import postgres
from services import BUCKET, ROOT, SECRET, Services, free_port, wait_until, write_scan

FILE = ROOT / "deployments" / "compose.yaml"
OF_OTHERS = {"postgres", "s3"}
ENDS = {"bucket", "deploy"}
"""Services that end well before those that need them begin."""
ORDER = ("bucket", "server", "scheduler", "stages", "deploy", "runs")
BUILDING = """
building = "hut"
settle_s = 0
params.detect = []
[schedule]
every_s = 60
[[storeys]]
storey = "0"
scans = ["/scans"]
"""


def main() -> None:
    """Start the services in the order they need each other, and wait for a mapped storey."""
    with tempfile.TemporaryDirectory(prefix="mapsense-composed-") as path, ExitStack() as stack:
        folder = Path(path)
        write_scan(folder / "scans", "a", seed=1)
        (folder / "deployments").mkdir()
        shutil.copy(ROOT / "deployments" / "prefect.yaml", folder / "deployments")
        building = BUILDING.replace("/scans", str(folder / "scans"))
        (folder / "deployments" / "hut.toml").write_text(building)
        database = stack.enter_context(postgres(free_port()))
        kept = {k: v for k, v in os.environ.items() if not k.startswith(("PREFECT_", "MAPSENSE_"))}
        kept |= {"PYTHONPATH": str(ROOT), "PREFECT_HOME": str(folder / "home")}
        kept["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{kept['PATH']}"
        running = Services(folder, "", kept)
        stack.callback(running.stop)
        url = running.bucket()["AWS_ENDPOINT_URL"]
        compose = here(FILE.read_text(), folder, database, url)
        check(compose)
        for name in ORDER:
            began = time.monotonic()
            start(running, name, compose["services"][name])
            if name == "server":
                running.url = compose["services"]["runs"]["environment"]["PREFECT_API_URL"]
                wait_until(lambda: running.api("/health"), 180)
            told(f"{name}: {time.monotonic() - began:.0f} s")
        done = wait_until(lambda: completed(running), 420)
        told(f"by the clock: {done['state']['message']}")
        assert done["state"]["message"] == "0: mapped from 1 scans, 1 new", done["state"]
        rows = list((folder / "store" / "stages").rglob("*.parquet"))
        assert rows, "no stage has run"
    told("all as it must be")


def here(text: str, folder: Path, database: str, s3: str) -> dict[str, Any]:
    """Return what the file says, with hosts, ports and folders of this machine."""
    server, scheduler = free_port(), free_port()
    address = database.removeprefix("postgresql+asyncpg://")
    for is_, becomes in {
        r"prefect:\$\{POSTGRES_PASSWORD:[^}]*\}@postgres:5432/prefect": address,
        r"\$\{AWS_ACCESS_KEY_ID:[^}]*\}": "test",
        r"\$\{AWS_SECRET_ACCESS_KEY:[^}]*\}": SECRET,
        r"\$\{POSTGRES_PASSWORD:[^}]*\}": "unused",
        r"http://server:4200": f"http://127.0.0.1:{server}",
        r"--port 4200": f"--port {server}",
        r"tcp://scheduler:8786": f"tcp://127.0.0.1:{scheduler}",
        r"--port 8786": f"--port {scheduler}",
        r"http://s3:8333": s3,
        r"MAPSENSE_STORE: /store": f"MAPSENSE_STORE: {folder / 'store'}",
        r"/mapsense/deployments": str(folder / "deployments"),
    }.items():
        text, found = re.subn(is_, becomes.replace("\\", r"\\"), text)
        assert found, f"{FILE}: there is no {is_}"
    found: dict[str, Any] = yaml.safe_load(text)
    return found


def check(compose: dict[str, Any]) -> None:
    """Raise AssertionError unless services start after those they need, and all are started."""
    services = compose["services"]
    assert set(ORDER) | OF_OTHERS == set(services), set(services)
    for number, name in enumerate(ORDER):
        needs = services[name].get("depends_on", {})
        assert set(needs) <= {*ORDER[:number], *OF_OTHERS}, f"{name} needs {needs}"
    environment = services["runs"]["environment"]
    assert environment["MAPSENSE_REMOTE"].startswith(f"s3://{BUCKET}/")


def start(running: Services, name: str, service: dict[str, Any]) -> None:
    """Start a service; one that ends is waited for."""
    command = service["command"]
    if isinstance(command, str):
        command = shlex.split(command)
    image = {"mapsense": ["-c", "from flows.cli import main; main()"]}
    if command[0] in image:
        command = [sys.executable, *image[command[0]], *command[1:]]
    environment = running.environment | service.get("environment", {})
    with open(running.folder / f"{name}.log", "ab") as log:
        process = subprocess.Popen(
            command,
            env=environment,
            cwd=running.folder,
            stdout=log,
            stderr=log,
            start_new_session=True,
        )
    running.processes.append(process)
    if name in ENDS:
        assert process.wait(300) == 0, (running.folder / f"{name}.log").read_text()


def completed(running: Services) -> dict[str, Any] | None:
    """Return the first run of the building that the clock began, once it has ended."""
    ended = ("COMPLETED", "FAILED", "CRASHED")
    runs = [run for run in running.flow_runs("hut") if run["state"]["type"] in ended]
    return runs[0] if runs else None


def told(line: str) -> None:
    """Say that something is as it must be."""
    print(f"{time.strftime('%H:%M:%S')} {line}", flush=True)


if __name__ == "__main__":
    main()
