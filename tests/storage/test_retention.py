"""Pruning: what is needed stays to the byte, the rest goes, whatever happens meanwhile."""

import os
import shutil
import subprocess
import sys
import threading
from datetime import UTC, datetime, timedelta
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest

from storage import locks, packs, stages
from storage.artifacts import Place, write
from storage.catalog import run_query
from storage.errors import StoreError
from storage.points import POINTS, PointCloud
from storage.pruning import (
    ARTIFACTS,
    FOLDERS,
    LOCKS,
    PACKS,
    RECORDS,
    RUNS,
    STAGES,
    TEMPORARIES,
    prune,
)
from storage.retention import Keep, kept_runs
from storage.runs import (
    COMPLETED,
    EVALUATE,
    FAILED,
    PARTIAL,
    RUNNING,
    Run,
    last_runs,
    read_runs,
    recorded,
    storey_lock,
)

START = datetime(2026, 1, 1, tzinfo=UTC)
ROOT = Path(__file__).resolve().parents[2]


def key_of(what: str, storey: str = "0") -> str:
    return f"b/{storey}/s/made/{sha256(what.encode()).hexdigest()[:32]}"


def add_run(
    store: Path,
    number: int,
    made: str = "",
    reused: str = "",
    state: str = COMPLETED,
    storey: str = "0",
    verb: str = "map",
    **about,
) -> str:
    """Record a run whose stages each made or reused a cloud, called by a letter."""
    name = f"r{number}"
    place = Place(store=str(store), run=name, building="b", storey=storey, scan="s")
    run = Run(name, verb, "b", storey, "{}", START + timedelta(days=number), **about)
    with recorded(str(store), run) as record:
        for what in made + reused:
            xyz = np.full((ord(what) - 60, 3), ord(what) / 1000, np.float32)
            ref = write(POINTS, PointCloud(xyz, np.zeros(3)), place)
            key = key_of(what, storey)
            path = store / ".cache" / key
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(ref.uri)
            (store / ".locks" / f"{sha256(key.encode()).hexdigest()[:32]}.lock").touch()
            outcome = "computed" if what in made else "cached"
            stages.append(place, row_of(name, key, outcome, (ref.uri,)))
        record.end(state, "")
    stages.forget(place)
    return name


def row_of(run: str, key: str, outcome: str, outputs: tuple[str, ...]) -> stages.StageRow:
    costs = {"wall_s": 1.0, "cpu_s": 1.0, "peak_memory_mb": None}
    counts = dict.fromkeys(("rows_in", "rows_out", "points_in", "points_out"), 0)
    about = {"id": f"{run}{key}", "run": run, "scan": "s", "stage": "made", "error": None}
    return stages.StageRow(
        **about, **costs, **counts, key=key, outcome=outcome, started_at=START, outputs=outputs
    )


def clouds(store: Path, storey: str = "0") -> str:
    """Return the letters of the clouds there are."""
    rows = run_query(store, "select distinct storey, x_mm from points_all").to_pylist()
    return "".join(sorted(chr(r["x_mm"]) for r in rows if r["storey"] == storey))


def cached(store: Path, storey: str = "0") -> str:
    """Return the letters of the clouds the cache knows."""
    known = {path.relative_to(store / ".cache").as_posix() for path in files(store / ".cache")}
    return "".join(letter for letter in "ABCDEFGH" if key_of(letter, storey) in known)


def files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.is_file())


def content(store: Path) -> dict[str, bytes]:
    """Return every file of a store, locks and what is derived aside."""
    kept = (p for p in files(store) if not {".locks", ".catalog"} & set(p.parts))
    return {path.relative_to(store).as_posix(): path.read_bytes() for path in kept}


@pytest.fixture
def store(tmp_path):
    return tmp_path / "store"


def test_what_the_last_successful_run_made_or_reused_stays(store):
    add_run(store, 1, made="AB")
    add_run(store, 2, made="C", reused="A")
    before = content(store)
    pruned = prune(store, Keep())
    assert (clouds(store), cached(store)) == ("AC", "AC")
    assert pruned.kept == 2
    assert pruned.files == {ARTIFACTS: 1, RECORDS: 1, LOCKS: 3}
    # byte by byte; the first run computed A: its record and rows say what that cost
    gone = before.keys() - content(store).keys()
    assert content(store) == {name: data for name, data in before.items() if name not in gone}
    assert len(gone) == 2
    assert sum(pruned.bytes.values()) == sum(len(before[name]) for name in gone)
    again = prune(store, Keep())
    assert (again.files, again.kept) == ({}, 2)


def test_runs_that_computed_nothing_needed_lose_record_and_rows(store):
    add_run(store, 1, made="A")
    add_run(store, 2, reused="A")
    add_run(store, 3, made="B", reused="A")
    add_run(store, 4, reused="A")
    pruned = prune(store, Keep())
    assert [run.id for run in read_runs(store)] == ["r1", "r4"]
    assert (pruned.files[RUNS], pruned.files[STAGES]) == (2, 2)
    answer = run_query(store, "select run, outcome from stages order by run").to_pylist()
    assert answer == [{"run": "r1", "outcome": "computed"}, {"run": "r4", "outcome": "cached"}]
    shown = run_query(store, "select count(*) as n from points where run = 'r4'").to_pylist()
    assert shown == [{"n": ord("A") - 60}]


@pytest.mark.parametrize("state", [FAILED, RUNNING])
def test_what_a_later_run_computed_before_it_failed_stays_until_one_succeeds(store, state):
    add_run(store, 1, made="A")
    add_run(store, 2, made="B", state=state)
    add_run(store, 3, made="C", reused="B", state=state)
    prune(store, Keep())
    assert (clouds(store), cached(store)) == ("ABC", "ABC")
    assert [run.state for run in last_runs(read_runs(store))] == [state]
    add_run(store, 4, made="D", reused="C", state=PARTIAL)
    prune(store, Keep())
    assert clouds(store) == "CD"


def test_each_storey_verb_variant_and_seed_has_its_own(store):
    add_run(store, 1, made="A")
    add_run(store, 2, made="B", verb=EVALUATE, variant="v", seed=0)
    add_run(store, 3, made="C", verb=EVALUATE, variant="v", seed=1)
    add_run(store, 4, made="D", verb=EVALUATE, variant="w", seed=0)
    add_run(store, 5, made="E", verb="energy")
    add_run(store, 6, made="F", storey="1")
    prune(store, Keep())
    assert (clouds(store), clouds(store, "1")) == ("ABCDE", "F")
    add_run(store, 7, made="G", verb=EVALUATE, variant="v", seed=0)
    add_run(store, 8, made="H", storey="1")
    prune(store, Keep(), building="another")
    assert (clouds(store), clouds(store, "1")) == ("ABCDEG", "FH")
    prune(store, Keep(), building="b")
    assert (clouds(store), clouds(store, "1")) == ("ACDEG", "H")


def test_more_runs_and_young_ones_are_kept_on_demand(store):
    for number, what in enumerate("ABCD"):
        add_run(store, number, made=what)
    runs = read_runs(store)
    for keep, ids in (
        (Keep(runs=2), ["r2", "r3"]),
        (Keep(since=START + timedelta(days=1)), ["r1", "r2", "r3"]),
        (Keep(since=START + timedelta(days=99)), ["r3"]),
    ):
        assert [run.id for run in kept_runs(runs, keep)] == ids
    prune(store, Keep(runs=3))
    assert clouds(store) == "BCD"
    with pytest.raises(ValueError, match="expected at least 1"):
        Keep(runs=0)


def test_only_what_is_ours_goes(store, tmp_path):
    add_run(store, 1, made="A")
    add_run(store, 2, made="B")
    folder = store / "points/building=b/storey=0/scan=s"
    beside = tmp_path / "beside"
    beside.mkdir()
    (beside / f"{'0' * 24}.parquet").write_text("not of this store")
    foreign = [folder / "notes.txt", store / "plans/b/0/plan.geojson", store / "truths/x.geojson"]
    foreign += [store / "evaluations/b/0/v/1/plan.geojson", store / "points/readme"]
    for path in foreign:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("kept")
    (folder / "link").symlink_to(beside)
    left = [folder / ".12-0123456789ab.tmp", store / "plans/b/0/.12-0123456789ab.tmp"]
    left += [folder / f"{'1' * 24}.parquet", store / ".cache/b/0/s/made" / ("2" * 32)]
    for path in left:  # by runs killed between two steps
        path.touch()
    (store / "faces/building=b/storey=0/scan=gone").mkdir(parents=True)
    outside = ("../../../beside/x.parquet", str(beside / "x.parquet"))
    place = Place(store=str(store), run="r1", building="b", storey="0")
    stages.append(place, row_of("r1", "../../beside", "computed", outside))
    pruned = prune(store, Keep())
    assert all(path.read_text() == "kept" for path in foreign)
    assert len(files(beside)) == 1
    assert not any(path.exists() for path in left)
    assert (pruned.files[TEMPORARIES], pruned.files[ARTIFACTS]) == (2, 2)
    assert pruned.files[FOLDERS] == 2
    assert not (store / "faces/building=b/storey=0").exists()
    assert clouds(store) == "B"


def test_a_dry_run_changes_nothing_and_says_what_would_go(store):
    add_run(store, 1, made="AB")
    add_run(store, 2, made="C", reused="A")
    (store / "points/building=b/storey=0/scan=s/.12-0123456789ab.tmp").touch()
    before = content(store)
    would = prune(store, Keep(), dry_run=True)
    assert content(store) == before
    did = prune(store, Keep())
    assert (would.files, would.bytes) == (did.files, did.bytes)
    assert (would.kept, would.kept_bytes) == (did.kept, did.kept_bytes) != (0, 0)


def test_a_storey_where_a_run_goes_on_is_left_as_it_is(store):
    for storey in ("0", "1"):
        add_run(store, 1, made="A", storey=storey)
        add_run(store, 2, made="B", storey=storey)
    failure = store / ".cache" / ("3" * 32)  # Prefect's, of a stage: whose is not known
    failure.touch()
    run = Run("now", "map", "b", "0", "{}", datetime.now(UTC))
    with recorded(str(store), run) as record:
        pruned = prune(store, Keep())
        assert pruned.in_use == ["b/0"]
        assert (clouds(store), cached(store), clouds(store, "1")) == ("AB", "AB", "B")
        assert failure.exists()
        record.end(COMPLETED, "")
    prune(store, Keep(), building="b")
    assert failure.exists()
    prune(store, Keep())
    assert not failure.exists()


def test_two_runs_of_a_storey_go_on_side_by_side(store):
    run = Run("one", "map", "b", "0", "{}", START)
    other = Run("two", "map", "b", "0", "{}", START)
    with recorded(str(store), run), recorded(str(store), other):
        assert prune(store, Keep()).in_use == ["b/0"]
    assert [run.id for run in read_runs(store)] == ["one", "two"]


def test_a_run_that_begins_meanwhile_waits_until_the_storey_is_pruned(store):
    add_run(store, 1, made="A")
    pruning = locks.take(storey_lock(store, "b", "0"))
    began, done = threading.Event(), threading.Event()

    def begin() -> None:
        with recorded(str(store), Run("now", "map", "b", "0", "{}", START)):
            began.set()
            done.wait(10)

    thread = threading.Thread(target=begin)
    thread.start()
    try:
        assert not began.wait(0.3)
        # as pruning ends: the file goes before the lock on it
        storey_lock(store, "b", "0").unlink()
        os.close(pruning)
        assert began.wait(10)
        assert prune(store, Keep()).in_use == ["b/0"]
    finally:
        done.set()
        thread.join()


KILLED = """
import os, shutil, sys
from pathlib import Path
from storage.pruning import prune
from storage.retention import Keep

store, copies = Path(sys.argv[1]), Path(sys.argv[2])
steps = 0
unlink, rmdir = Path.unlink, os.rmdir

def counted(step):
    def run(*args, **kwargs):
        global steps
        if steps == limit:
            os.kill(os.getpid(), 9)
        steps += 1
        return step(*args, **kwargs)
    return run

limit = 0
while True:
    copy = copies / str(limit)
    shutil.copytree(store, copy)
    if (child := os.fork()) == 0:
        Path.unlink, os.rmdir = counted(unlink), counted(rmdir)
        prune(copy, Keep())
        os._exit(0)
    _, status = os.waitpid(child, 0)
    if os.WIFEXITED(status):
        assert os.WEXITSTATUS(status) == 0
        break
    assert os.WTERMSIG(status) == 9
    limit += 1
print(limit)
"""


def test_killed_at_any_moment_it_leaves_a_store_that_the_next_completes(store, tmp_path):
    add_run(store, 1, made="AB")
    add_run(store, 2, made="C", reused="A")
    add_run(store, 3, made="D", reused="A")
    add_run(store, 4, reused="D")
    asked = [sys.executable, "-c", KILLED, str(store), str(tmp_path / "killed")]
    done = subprocess.run(
        asked, capture_output=True, text=True, env=os.environ | {"PYTHONPATH": str(ROOT)}
    )
    assert done.returncode == 0, done.stderr
    moments = int(done.stdout)
    assert moments > 12
    prune(store, Keep())
    for moment in range(moments):
        copy = tmp_path / "killed" / str(moment)
        for record in files(copy / ".cache"):
            assert (copy / record.read_text()).is_file()
        assert set(content(store)) <= set(content(copy))
        assert run_query(copy, "select run from points group by all").to_pylist() == [{"run": "r4"}]
        prune(copy, Keep())
        assert content(copy) == content(store)


def test_packs_with_rows_that_are_gone_go_and_answers_stay(store, monkeypatch):
    monkeypatch.setattr(packs, "ENOUGH", 2)
    for number in (1, 2, 3):
        add_run(store, number, made="ABC"[number - 1], storey=str(number))
    assert clouds(store, "1") == "A"
    (before,) = packs_of(store)
    assert prune(store, Keep()).files[PACKS] == 0
    assert packs_of(store) == [before]
    add_run(store, 4, made="D", storey="1")
    assert prune(store, Keep(), dry_run=True).files[PACKS] == 0  # nothing is gone yet
    pruned = prune(store, Keep())
    assert pruned.files[PACKS] == 3  # of points, stages and runs
    assert packs_of(store) == []
    assert [clouds(store, storey) for storey in "123"] == ["D", "B", "C"]


def packs_of(store: Path) -> list[Path]:
    made = (store / ".catalog" / "points").glob("*.parquet")
    return [path for path in made if path.name != packs.INDEX_FILE]


def test_what_cannot_be_read_stops_it_failure(store):
    add_run(store, 1, made="A")
    add_run(store, 2, made="B")
    before = content(store)
    (rows,) = store.glob("stages/*/*/r2-*.parquet")
    rows.write_bytes(b"cut")
    with pytest.raises(StoreError, match=r"r2-\w+\.\w+\.parquet: is no record of stages"):
        prune(store, Keep())
    rows.write_bytes(before[rows.relative_to(store).as_posix()])
    assert content(store) == before
    assert locks.take(storey_lock(store, "b", "0")) is not None  # nobody is locked out


def test_a_storey_without_a_record_of_any_run_is_left_as_it_is(store):
    add_run(store, 1, made="A")
    shutil.rmtree(store / "runs")
    assert prune(store, Keep()).unknown == ["b/0"]
    assert clouds(store) == "A"
