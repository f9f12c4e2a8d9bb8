"""Do a small storey every harm there is, and compare what is left with an undisturbed store.

    python tests/faults/run.py --kills 10

Each fault has a store of its own. After it the storey is mapped again, and pruned: artifacts, cache
and plans must be those of a store that nothing was done to, byte by byte. The faults of a Dask
cluster and of an S3-compatible service need the extra `scale` and the dependency group `services`.
"""

import argparse
import os
import random
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import cached_property
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(Path(__file__).parent), str(ROOT / "tests" / "deployments")]

import harming  # noqa: E402
import sharing  # noqa: E402
from faulty import CUT, ERROR, RESET, SLOW, faulty  # noqa: E402
from faulty import Faults as Answers  # noqa: E402
from services import Services, Wanted, services, wait_until  # noqa: E402

from flows.server import SETTINGS, empty_database, wait_until_up  # noqa: E402

PATIENCE_S = 1800
"""For a run whose every request is refused: each is tried again and again."""
POISON_MEMORY_MB, POISON_POINTS, POISON_TIMEOUT_S = 700, 30_000_000, 60


class Faults:
    """The faults, each done to a store of its own."""

    def __init__(self, folder: Path, home: Path) -> None:
        self.folder, self.home, self._stack = folder, home, ExitStack()
        self.scans = harming.write_scans(folder / "scans")
        first = harming.run(folder / "undisturbed", self.scans)
        assert first.code == 0, first.err
        self.whole = len(harming.artifacts_of(folder / "undisturbed"))
        self.undisturbed = harming.results(folder / "undisturbed")

    def __enter__(self) -> "Faults":
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    @cached_property
    def running(self) -> Services:
        """A Prefect server and a Dask cluster that live as long as the faults."""
        folder = self.folder / "services"
        folder.mkdir()
        wanted = Wanted(dask_workers=2)
        return self._stack.enter_context(services(folder, empty_database(self.home), wanted))

    @cached_property
    def bucket(self) -> dict[str, str]:
        """An S3-compatible service, as it is set."""
        return self.running.bucket()

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

    def kill_dask_worker(self, seed: int, whole: bool) -> str:
        """Kill -9 of a Dask worker at a moment drawn; with `whole`, of its nanny too."""
        store = self.folder / f"cluster-{seed}-{whole}"
        address = self.running.environment["MAPSENSE_DASK"]
        cluster = {"PREFECT_API_URL": self.running.url, "MAPSENSE_DASK": address}
        nanny = random.Random(seed).choice([w for w in self.running.dask if w.poll() is None])
        moment = random.Random(seed).randrange(self.whole // 2)
        with harming.Mapping(store, self.scans, **cluster) as mapping:
            assert mapping.wait_for(moment), mapping.ended().err
            (worker,) = wait_until(lambda: harming.spawned_by(nanny.pid), 60, 0.02)
            os.kill(worker, signal.SIGKILL)
            if whole:
                os.killpg(nanny.pid, signal.SIGKILL)
            left = len(harming.artifacts_of(store))
            ended = mapping.ended()
        if whole:
            self.running.dask_worker(address)  # another machine in its place
        assert ended.code == 0, ended.err
        again = harming.run(store, self.scans)
        assert (again.code, harming.computed(again)) == (0, 0), again.err
        harming.check_same(store, self.undisturbed)
        return f"at {left} of {self.whole} artifacts; the run completed, on threads nothing is new"

    def bad_answers(self, seed: int) -> str:
        """S3 errors, slow answers, connections that break."""
        store, address = self.folder / f"shared-{seed}", self.shared_at(f"bad-{seed}")
        often = {ERROR: 0.08, SLOW: 0.08, RESET: 0.04, CUT: 0.04}
        answers = Answers(often, seed)
        with faulty(address["AWS_ENDPOINT_URL"], answers) as url:
            ended = harming.run(store, self.scans, **address | {"AWS_ENDPOINT_URL": url})
        assert ended.code == 0, ended.err
        harming.check_same(store, self.undisturbed)
        sharing.check_same(address, self.undisturbed)
        return ", ".join(f"{count} {fault}" for fault, count in sorted(answers.happened.items()))

    def service_gone(self) -> str:
        """An S3 service that is gone in the midst of a run, and back for the next."""
        store, address = self.folder / "gone", self.shared_at("gone")
        answers = Answers({})
        with faulty(address["AWS_ENDPOINT_URL"], answers) as url:
            # the client itself tries once: else each request takes minutes to be given up
            asked = address | {"AWS_ENDPOINT_URL": url, "AWS_MAX_ATTEMPTS": "1"}
            with harming.Mapping(store, self.scans, **asked) as mapping:
                assert mapping.wait_for(self.whole // 3), mapping.ended().err
                answers.shares = {ERROR: 1.0}
                began = time.monotonic()
                ended = mapping.ended(PATIENCE_S)
                took = time.monotonic() - began
            assert ended.code == 1, ended
            answers.shares = {}
            again = harming.run(store, self.scans, **asked)
        assert again.code == 0, again.err
        harming.check_same(store, self.undisturbed)
        sharing.check_same(address, self.undisturbed)
        return f"after {took:.0f} s: " + ended.err.strip().rpartition("\n")[2]

    def shared_at(self, name: str) -> dict[str, str]:
        """Return what is set to share an address of its own."""
        return self.bucket | {"MAPSENSE_REMOTE": f"s3://{sharing.BUCKET}/{name}"}

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
        computed = harming.computed_in(store)  # one's summary may be there in place of the other's
        harming.check_same(store, self.undisturbed)
        alone = harming.computed(harming.run(self.folder / "counted", self.scans))
        assert computed == alone, f"{computed} stages computed, {alone} by one flow"
        return f"{computed} stages computed, none twice"

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
    yield "kill -9 of a Dask worker", lambda: asked.kill_dask_worker(seed, whole=False)
    yield "a Dask worker's machine lost", lambda: asked.kill_dask_worker(seed + 1, whole=True)
    yield "bad answers of S3", lambda: asked.bad_answers(seed)
    yield "S3 gone meanwhile", asked.service_gone


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
        with Faults(Path(folder), home) as every:
            for name, fault in faults(every, given.kills, given.seed):
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
