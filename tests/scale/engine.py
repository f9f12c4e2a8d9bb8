"""What a stage costs that computes nothing, in runs of more and more stages.

    python tests/scale/engine.py --sizes 10 100 1000

Each scan has two toy stages (tests/flows/toy) on the embedded server, once computed and once looked
up. Told are milliseconds of the processor, of the flow's process and of Prefect's server, and the
greatest memory of the flow's process so far: all must stay as they are.
"""

import argparse
import os
import resource
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "flows")]

from flows.server import prefect_api, quiet, wait_until_up  # noqa: E402


def main() -> None:
    """Measure each size twice: all stages computed, none computed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", type=int, nargs="+", default=[10, 100, 1000], help="scans")
    sizes = parser.parse_args().sizes
    quiet(False)
    with tempfile.TemporaryDirectory(prefix="mapsense-engine-") as path:
        folder = Path(path)
        os.environ.setdefault("PREFECT_HOME", str(folder / "prefect"))
        with prefect_api(folder):
            wait_until_up()
            from toy.pipeline import toy

            toy(str(folder / "first"), "first", scans_of(folder, 2))  # what is paid once
            for size in sizes:
                paths, store = scans_of(folder, size), str(folder / f"store-{size}")
                for run in ("computed", "cached"):
                    flow_s, server_s = time.process_time(), children_s()
                    stages = len(toy(store, run, paths)[run])
                    assert stages == 2 * size + 1, f"{stages} of {2 * size + 1} stages {run}"
                    flow_ms = 1e3 * (time.process_time() - flow_s) / stages
                    server_ms = 1e3 * (children_s() - server_s) / stages
                    memory_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
                    print(
                        f"{size} scans, {stages} stages {run}: flow {flow_ms:.1f} ms/stage, "
                        f"server {server_ms:.1f} ms/stage, {memory_mb:.0f} MB",
                        flush=True,
                    )


def scans_of(folder: Path, count: int) -> list[str]:
    """Write the texts that stand for scans."""
    (folder / str(count)).mkdir()
    paths = [folder / str(count) / f"s{number:04d}.txt" for number in range(count)]
    for path in paths:
        path.write_text("10")
    return [str(path) for path in paths]


def children_s() -> float:
    """Return the processor time of the processes this one has started, that go on."""
    ticks = 0
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            fields = path.read_text().rpartition(") ")[2].split()  # from the third on
            if int(fields[1]) == os.getpid():
                ticks += int(fields[11]) + int(fields[12])
    return ticks / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    main()
