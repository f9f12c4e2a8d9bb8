"""Faults that take little time; `python tests/faults/run.py` does them all, as people meet them."""

import importlib
import threading
from hashlib import sha256
from pathlib import Path

import harming
import pytest

from flows.request import StoreyRequest
from storage.artifacts import Place
from storage.pruning import prune
from storage.retention import Keep
from storage.sources import Source
from storage.stages import of_run

SEED = 8


@pytest.fixture(scope="module")
def scans(tmp_path_factory):
    return harming.write_scans(tmp_path_factory.mktemp("scans"), points=4000)


@pytest.fixture(scope="module")
def mapped(prefect_server, scans):
    """Return what maps the storey into a store, here and now, and returns the flow's state."""
    from flows.storey import map_storey

    def run(store: Path):
        asked = {"building": harming.BUILDING, "storey": harming.STOREY, "scans": (str(scans),)}
        return map_storey(StoreyRequest(store=str(store), **asked), return_state=True)

    return run


@pytest.fixture(scope="module")
def undisturbed(mapped, tmp_path_factory):
    """What a store holds that nothing was done to, to the byte."""
    store = tmp_path_factory.mktemp("undisturbed")
    assert mapped(store).is_completed()
    return harming.results(store)


def test_a_killed_run_is_completed_by_the_next_while_others_prune(
    prefect_server, mapped, undisturbed, scans, tmp_path
):
    store = tmp_path / "store"
    with harming.Mapping(store, scans, PREFECT_API_URL=prefect_server) as mapping:
        assert mapping.wait_for(SEED), mapping.ended().err
        mapping.kill()
        assert mapping.ended().code == -9
    assert len(harming.artifacts_of(store)) >= SEED
    left = harming.artifacts_of(store)
    done, in_use = threading.Event(), []

    def prune_on() -> None:
        while not done.wait(0.01):
            in_use.extend(prune(store, Keep()).in_use)

    pruning = threading.Thread(target=prune_on)
    pruning.start()
    try:
        assert mapped(store).is_completed()
    finally:
        done.set()
        pruning.join()
    assert in_use
    assert left & harming.artifacts_of(store)
    harming.check_same(store, undisturbed)


def test_a_full_disk_is_said_and_the_rest_is_done_when_there_is_room(mapped, undisturbed, tmp_path):
    need = sum(len(data) for name, data in undisturbed.items() if name.endswith(".parquet"))
    folder = tmp_path / "disk"
    try:
        disk = harming.small_disk(folder, need // 1000 // 2)
        enlarge = disk.__enter__()
    except OSError as error:
        pytest.skip(f"no file system can be mounted: {error}")
    try:
        state = mapped(folder)
        assert state.is_failed()
        with pytest.raises(Exception, match="No space left on device"):
            state.result()
        enlarge(need)
        assert mapped(folder).is_completed()
        harming.check_same(folder, undisturbed)
    finally:
        disk.__exit__(None, None, None)


def test_poisonous_scans_are_stopped_and_the_others_are_made(prefect_server, tmp_path, monkeypatch):
    from prefect import flow
    from prefect.task_runners import ThreadPoolTaskRunner

    from tasks.stage import apart
    from tasks.stage.declare import stage

    poison = importlib.import_module("poisoned")
    poisoned = stage(poison.poisoned, name="poisoned")
    monkeypatch.setenv("MAPSENSE_STAGE_TIMEOUT_S", "2")
    monkeypatch.setenv("MAPSENSE_STAGE_MEMORY_MB", "600")

    @flow(task_runner=ThreadPoolTaskRunner(max_workers=2))
    def read_all(run: str, texts: dict[str, str]) -> dict[str, tuple[str, str | None]]:
        place = Place(store=str(tmp_path / "store"), run=run, building="b", storey="0")
        futures = []
        for name, text in texts.items():
            path = tmp_path / name
            path.write_text(text)
            digest = sha256(text.encode()).hexdigest()
            source = Source(name=name, path=str(path), sha256=digest, size_bytes=len(text))
            params = poison.PoisonedParams()
            futures.append(poisoned.submit(place.of_scan(name), source, params))
        for future in futures:
            future.wait()
        return {row.scan: (row.outcome, row.error) for row in of_run(place)}

    texts = {"good": "10", "hangs": "hang", "greedy": "greedy", "crashes": "crash", "late": "20"}
    found = read_all("r1", texts)
    assert (found["good"], found["late"]) == (("computed", None), ("computed", None))
    for name, why in {
        "hangs": "was stopped after 2 s",
        "greedy": "needs more than the 600 MB",
        "crashes": "took its process down (SIGSEGV)",
    }.items():
        outcome, error = found[name]
        assert outcome == "failed"
        assert error.startswith(f"{name}: stage 'poisoned' ") and why in error
    found = read_all("r2", texts | dict.fromkeys(("hangs", "greedy", "crashes"), "30"))
    assert {name: outcome for name, (outcome, _) in found.items()} == {
        "good": "cached",
        "late": "cached",
        "hangs": "computed",
        "greedy": "computed",
        "crashes": "computed",
    }
    apart._end_idle()
