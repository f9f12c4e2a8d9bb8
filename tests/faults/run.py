"""Do a small storey every harm there is, and compare what is left with an undisturbed store.

    python tests/faults/run.py --kills 10

Each fault has a store of its own. After it the storey is mapped again, and pruned: artifacts, cache
and plans must be those of a store that nothing was done to, byte by byte.
"""

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(Path(__file__).parent)]

import harming  # noqa: E402

from flows.server import SETTINGS, wait_until_up  # noqa: E402

POISON_MEMORY_MB, POISON_POINTS, POISON_TIMEOUT_S = 700, 30_000_000, 60


class Faults:
    """The faults, each done to a store of its own."""

    def __init__(self, folder: Path, home: Path) -> None:
        self.folder, self.home = folder, home
        self.scans = harming.write_scans(folder / "scans")
        first = harming.run(folder / "undisturbed", self.scans)
        assert first.code == 0, first.err
        self.whole = len(harming.artifacts_of(folder / "undisturbed"))
        self.undisturbed = harming.results(folder / "undisturbed")

    def kill(self, seed: int) -> str:
        """Kill -9 of the flow."""
        store = self.folder / f"killed-{seed}"
        when = harming.kill_and_rerun(store, self.scans, seed, self.whole)
        harming.check_same(store, self.undisturbed)
        return when

    def kill_server(self) -> str:
        """Kill -9 of the Prefect server."""
        store = self.folder / "served"
        with harming.server(self.home) as (url, process):
            os.environ["PREFECT_API_URL"] = url
            wait_until_up()
            del os.environ["PREFECT_API_URL"]
            began = time.monotonic()
            with harming.Mapping(store, self.scans, PREFECT_API_URL=url) as mapping:
                assert mapping.wait_for(self.whole // 3), mapping.ended().err
                process.kill()
                ended = mapping.ended()
        said = ended.err.strip().rpartition("\n")[2]  # Prefect may have its say before
        assert (ended.code, said.partition(": ")[0]) in ((0, ""), (1, "mapsense")), ended
        again = harming.run(store, self.scans)
        assert again.code == 0, again.err
        harming.check_same(store, self.undisturbed)
        return f"exit code {ended.code} after {time.monotonic() - began:.0f} s: {said}"

    def fill_disk(self) -> str:
        """Disk full, then enlarged."""
        store = self.folder / "full"
        need = sum(
            path.stat().st_size for path in harming.artifacts_of(self.folder / "undisturbed")
        )
        try:
            with harming.small_disk(store, need // 1000 // 2) as enlarge:
                full = harming.run(store, self.scans)
                assert full.code == 1
                said = full.err.strip()
                assert "No space left on device" in said or "disk" in said, said
                enlarge(100 * need // 1000)
                again = harming.run(store, self.scans)
                assert again.code == 0, again.err
                harming.check_same(store, self.undisturbed)
        except OSError as error:
            return f"skipped: {error}"
        return said

    def two_at_once(self) -> str:
        """Two flows on one storey at once."""
        store = self.folder / "both"
        one, other = harming.two_at_once(store, self.scans)
        assert (one.code, other.code) == (0, 0), one.err + other.err
        once = [harming.computed(one), harming.computed(other)]
        harming.check_same(store, self.undisturbed)
        assert sum(once) == harming.computed(harming.run(self.folder / "counted", self.scans))
        return f"{once[0]} and {once[1]} stages computed, none twice"

    def poison(self) -> str:
        """A scan that hangs, and one that exhausts memory."""
        store, scans = self.folder / "poisoned", harming.write_scans(self.folder / "poison")
        harming.write_ply(scans / "hangs.ply", 1000, 4)
        harming.write_ply(scans / "greedy.ply", POISON_POINTS, 5)
        ended = harming.run(
            store,
            scans,
            PYTHONPATH=str(Path(__file__).parent / "inject"),
            MAPSENSE_STAGE_TIMEOUT_S=str(POISON_TIMEOUT_S),
            MAPSENSE_STAGE_MEMORY_MB=str(POISON_MEMORY_MB),
        )
        assert ended.code == 1, ended.err
        summary = ended.summary()
        assert summary["state"] == "partial"
        reasons = {skipped["scan"]: skipped["reason"] for skipped in summary["skipped"]}
        assert reasons.keys() == {"hangs", "greedy"}, reasons
        assert f"was stopped after {POISON_TIMEOUT_S} s" in reasons["hangs"], reasons
        assert "of memory it may take" in reasons["greedy"], reasons
        for name in reasons:
            (scans / f"{name}.ply").unlink()
        again = harming.run(store, scans)
        assert again.code == 0, again.err
        harming.check_same(store, self.undisturbed)
        return "; ".join(reasons.values())


def faults(asked: Faults, kills: int, seed: int) -> Iterator[tuple[str, Callable[[], str]]]:
    """Yield each fault by its name."""
    for number in range(kills):
        yield f"kill -9 of the flow, {number}", lambda n=number: asked.kill(seed + n)
    yield "kill -9 of the Prefect server", asked.kill_server
    yield "two flows on one storey", asked.two_at_once
    yield "disk full", asked.fill_disk
    yield "poison", asked.poison


def main() -> None:
    """Do all faults; leave with 0 if nothing was lost by any."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kills", type=int, default=10, help="kills of the flow")
    parser.add_argument("--seed", type=int, default=0, help="seed of their moments")
    parser.add_argument("--only", default="", help="only faults whose name has this in it")
    given = parser.parse_args()
    for name, value in SETTINGS.items():
        os.environ.setdefault(name, value)
    os.environ.pop("PREFECT_API_URL", None)
    lost = 0
    with tempfile.TemporaryDirectory(prefix="mapsense-faults-") as folder:
        home = Path(os.environ.setdefault("PREFECT_HOME", f"{folder}/prefect"))
        every = faults(Faults(Path(folder), home), given.kills, given.seed)
        for name, fault in every:
            if given.only not in name:
                continue
            began = time.monotonic()
            try:
                said = fault()
            except AssertionError as error:
                lost += 1
                said = f"FAILED: {error}"
            print(f"{name}: {said} ({time.monotonic() - began:.0f} s)", flush=True)
    print("nothing was lost" if not lost else f"{lost} faults lost something")
    sys.exit(1 if lost else 0)


if __name__ == "__main__":
    main()
