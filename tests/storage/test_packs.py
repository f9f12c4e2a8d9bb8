"""Small files read from packs: the same rows, whatever happens to files, packs and index."""

import fcntl
import os
import shutil
import threading
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from storage import packs, runs, stages
from storage.artifacts import Place, write
from storage.catalog import Catalog, run_query
from storage.points import POINTS, PointCloud
from storage.runs import Run, recorded

START = datetime(2026, 1, 1, tzinfo=UTC)
ROW = stages.StageRow(
    id="t", run="r", scan="s", stage="planes", key="k", outcome="computed", wall_s=2.0, cpu_s=1.0,
    peak_memory_mb=None, rows_in=0, rows_out=0, points_in=0, points_out=0, error=None,
    started_at=START,
)  # fmt: skip
POINTS_OF_RUNS = "select run, x_mm, count(*) as n from points_all group by all order by all"


@pytest.fixture(autouse=True)
def few_are_enough(monkeypatch):
    monkeypatch.setattr(packs, "ENOUGH", 3)


@pytest.fixture
def store(tmp_path):
    return tmp_path / "store"


def add_run(store, number, points=None, storey="0", state="completed"):
    """Record a run that made a cloud of as many points as its number says; return its file."""
    name = f"run{number:03}"
    place = Place(store=str(store), run=name, building="b", storey=storey, scan="s")
    start = START + timedelta(hours=number)
    with recorded(str(store), Run(name, "map", "b", storey, "{}", start)) as record:
        xyz = np.full((number if points is None else points, 3), number, np.float32)
        ref = write(POINTS, PointCloud(xyz, np.zeros(3)), place)
        stages.append(place, replace(ROW, id=name, run=name, outputs=(ref.uri,)))
        record.end(state, "")
    stages.forget(place)
    return store / ref.uri


def expected(numbers):
    return [{"run": f"run{n:03}", "x_mm": n * 1000, "n": n} for n in numbers]


def packs_of(store, table):
    found = (store / ".catalog" / table).glob("*.parquet")
    return [path for path in found if path.name != packs.INDEX_FILE]


def test_packs_are_made_by_a_reader_and_hold_what_the_files_hold(store, monkeypatch):
    for number in range(1, 8):
        add_run(store, number, storey=str(number % 3))
    queries = [
        POINTS_OF_RUNS,
        "select * from points_all order by all",
        "select * from points order by all",
        "select * from runs order by all",
        "select * from stages order by all",
    ]
    monkeypatch.setattr(packs, "ENOUGH", 1000)
    plain = [run_query(store, query) for query in queries]
    assert not (store / ".catalog").exists()
    monkeypatch.setattr(packs, "ENOUGH", 3)
    for _ in range(2):  # as they are made, and once they are
        for query, answer in zip(queries, plain, strict=True):
            assert run_query(store, query).equals(answer), query
    for table in ("runs", "stages", "points"):
        assert len(packs_of(store, table)) == 1, table
    assert plain[0].to_pylist() == expected(range(1, 8))


def test_a_packed_file_is_not_opened_again(store):
    files = [add_run(store, number) for number in range(1, 5)]
    run_query(store, POINTS_OF_RUNS)
    for file in files:  # same size and time, other bytes
        times = file.stat()
        file.write_bytes(bytes(times.st_size))
        os.utime(file, ns=(times.st_atime_ns, times.st_mtime_ns))
    catalog = Catalog(store)
    assert catalog.query(POINTS_OF_RUNS).to_pylist() == expected(range(1, 5))
    assert catalog.problems == []


def test_a_file_that_is_gone_is_not_shown_and_one_that_changed_is_shown_as_it_is(store):
    files = [add_run(store, number) for number in range(1, 6)]
    run_query(store, POINTS_OF_RUNS)
    files[0].unlink()
    table = pq.read_table(files[1], partitioning=None)
    pq.write_table(table.slice(0, 1), files[1])
    rows = expected([2, 3, 4, 5])
    rows[0]["n"] = 1
    assert run_query(store, POINTS_OF_RUNS).to_pylist() == rows
    assert run_query(store, "select count(*) as n from points").to_pylist() == [{"n": 5}]


def test_a_file_that_became_unsound_is_told_and_left_out(store):
    files = [add_run(store, number) for number in range(1, 6)]
    run_query(store, POINTS_OF_RUNS)
    files[2].write_bytes(b"no Parquet")
    catalog = Catalog(store)
    assert catalog.query(POINTS_OF_RUNS).to_pylist() == expected([1, 2, 4, 5])
    (problem,) = catalog.problems
    assert problem.startswith(f"{files[2]}: cannot be read as Parquet")


def test_numbers_of_files_that_are_gone_are_not_given_to_others(store, monkeypatch):
    monkeypatch.setattr(packs, "LARGEST_BYTES", 0)  # nothing is merged
    files = {number: add_run(store, number) for number in range(1, 10)}
    run_query(store, POINTS_OF_RUNS)
    later = [add_run(store, number) for number in range(10, 14)]
    run_query(store, POINTS_OF_RUNS)
    # the last numbers are gone, rows of them stay in packs
    for file in [files[9], *later]:
        file.unlink()
    for number in range(20, 26):
        add_run(store, number)
    rest = [*range(1, 9), *range(20, 26)]
    for _ in range(2):
        assert run_query(store, POINTS_OF_RUNS).to_pylist() == expected(rest)


def test_packs_are_few_and_those_merged_away_are_deleted(store):
    numbers = range(1, 25)
    for number in numbers:
        add_run(store, number, points=1)
        if number % 3 == 0:
            run_query(store, "select count(*) from points_all")
    for table in ("runs", "stages", "points"):
        found = packs_of(store, table)
        assert 1 <= len(found) <= 5, table
        index = packs.read_index(store, table, _schema(table))
        assert {store / packed.pack for packed in index.files.values()} == set(found)
        assert len(index.files) == 24
        rows = [pq.read_metadata(path).num_rows for path in found]
        assert sum(rows) == 24
    answer = run_query(store, POINTS_OF_RUNS).to_pylist()
    assert [row["x_mm"] for row in answer] == [n * 1000 for n in numbers]


def _schema(table):
    return {"runs": runs.SCHEMA, "stages": stages.SCHEMA, "points": POINTS.schema}[table]


def test_rows_of_files_that_are_gone_leave_the_packs_when_they_are_most(store):
    files = [add_run(store, number, points=10) for number in range(1, 11)]
    run_query(store, POINTS_OF_RUNS)
    for file in files[:8]:
        file.unlink()
    for number in range(20, 23):
        add_run(store, number, points=1)
    run_query(store, POINTS_OF_RUNS)
    assert sum(pq.read_metadata(path).num_rows for path in packs_of(store, "points")) == 23


def spoil_nothing(folder):
    pass


def spoil_all(folder):
    shutil.rmtree(folder)


def spoil_index(folder):
    (folder / packs.INDEX_FILE).write_bytes(b"no Parquet")


def spoil_index_of_others(folder):
    pq.write_table(pa.table({"x": [1]}), folder / packs.INDEX_FILE)


def lose_index(folder):
    (folder / packs.INDEX_FILE).unlink()


def lose_packs(folder):
    for path in folder.glob("*.parquet"):
        if path.name != packs.INDEX_FILE:
            path.unlink()


def cut_packs(folder):
    for path in folder.glob("*.parquet"):
        if path.name != packs.INDEX_FILE:
            path.write_bytes(path.read_bytes()[:-10])


@pytest.mark.parametrize(
    "spoil",
    [
        spoil_nothing, spoil_all, spoil_index, spoil_index_of_others, lose_index, lose_packs,
        cut_packs,
    ],
)  # fmt: skip
def test_what_becomes_of_the_packs_changes_no_answer(store, spoil):
    for number in range(1, 6):
        add_run(store, number)
    run_query(store, POINTS_OF_RUNS)
    for table in ("runs", "stages", "points"):
        spoil(store / ".catalog" / table)
    catalog = Catalog(store)
    for _ in range(2):
        assert catalog.query(POINTS_OF_RUNS).to_pylist() == expected(range(1, 6))
    assert catalog.problems == []
    assert len(packs_of(store, "points")) == 1


def test_packs_of_another_schema_are_made_anew(store):
    for number in range(1, 5):
        add_run(store, number)
    run_query(store, POINTS_OF_RUNS)
    assert packs.read_index(store, "points", POINTS.schema).files
    other = POINTS.schema.append(pa.field("new", pa.int64()))
    assert packs.read_index(store, "points", other) == packs.Index({}, 0)


def test_a_run_that_goes_on_is_not_packed_and_its_end_is_seen(store):
    for number in range(1, 5):
        add_run(store, number)
    place = Place(store=str(store), run="now", building="b", storey="0")
    ask = "select state, stages from cache_hits where run = 'now'"
    with recorded(str(store), Run("now", "map", "b", "0", "{}", START)) as record:
        for count in (1, 2, 3):
            stages.append(place, replace(ROW, id=str(count), run="now"))
            assert run_query(store, ask).to_pylist() == [{"state": "running", "stages": count}]
        for table in ("runs", "stages"):
            packed = packs.read_index(store, table, _schema(table)).files
            assert len(packed) == 4 and not any("now" in uri for uri in packed)
        record.end("completed", "")
    stages.forget(place)
    assert run_query(store, ask).to_pylist() == [{"state": "completed", "stages": 3}]


def test_great_files_are_read_as_they_are(store, monkeypatch):
    monkeypatch.setattr(packs, "SMALL_BYTES", 100)
    for number in range(1, 6):
        add_run(store, number)
    assert run_query(store, POINTS_OF_RUNS).to_pylist() == expected(range(1, 6))
    assert not packs_of(store, "points")


def test_a_store_where_packs_cannot_be_written_answers_and_says_so(store):
    for number in range(1, 6):
        add_run(store, number)
    (store / ".catalog").write_text("in the way")
    catalog = Catalog(store)
    assert catalog.query(POINTS_OF_RUNS).to_pylist() == expected(range(1, 6))
    assert {problem.split(" (")[0] for problem in catalog.problems} == {
        f"{store / '.catalog'}: cannot pack files"
    }


def test_a_store_that_is_only_to_be_read_answers_without_packs(store, monkeypatch):
    for number in range(1, 6):
        add_run(store, number)

    def refuse(*args, **kwargs):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(packs.Path, "mkdir", refuse)
    catalog = Catalog(store)
    assert catalog.query(POINTS_OF_RUNS).to_pylist() == expected(range(1, 6))
    assert catalog.problems == []


def test_who_finds_another_packing_reads_the_files(store):
    for number in range(1, 6):
        add_run(store, number)
    folder = store / ".catalog" / "points"
    folder.mkdir(parents=True)
    with open(folder / ".lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        assert run_query(store, POINTS_OF_RUNS).to_pylist() == expected(range(1, 6))
        assert not packs_of(store, "points")
    run_query(store, POINTS_OF_RUNS)
    assert len(packs_of(store, "points")) == 1


def test_a_pack_merged_away_after_its_index_was_read_is_looked_up_again(store, monkeypatch):
    for number in range(1, 6):
        add_run(store, number)
    run_query(store, POINTS_OF_RUNS)
    read_index, late = packs.read_index, []

    def read_and_lose(root, table, schema):
        index = read_index(root, table, schema)
        if table == "points" and not late:
            late.append(table)
            # what a packing beside this reader does
            for path in packs_of(store, "points"):
                path.rename(path.with_name("f00.parquet"))
            moved = {
                uri: replace(packed, pack=".catalog/points/f00.parquet")
                for uri, packed in index.files.items()
            }
            packs._write_index(root, table, schema, replace(index, files=moved))
        return index

    monkeypatch.setattr(packs, "read_index", read_and_lose)
    assert run_query(store, POINTS_OF_RUNS).to_pylist() == expected(range(1, 6))
    assert late


def test_readers_see_whole_runs_while_a_writer_writes_and_others_pack(store):
    add_run(store, 1)
    ended = threading.Event()
    wrong, answers, written = [], [], [1]

    def write_runs():
        try:
            while len(answers) < 8 and not wrong:
                written.append(written[-1] + 1)
                add_run(store, written[-1])
        finally:
            ended.set()

    def read_runs():
        while True:
            last = ended.is_set()
            catalog = Catalog(store)
            try:
                now = catalog.query("select x_mm, run, count(*) as n from points group by all")
                ever = catalog.query(POINTS_OF_RUNS).to_pylist()
            except Exception as error:
                wrong.append(error)
                return
            (row,) = now.to_pylist()
            number = row["n"]
            if row != {"x_mm": number * 1000, "run": f"run{number:03}", "n": number}:
                wrong.append(row)
            # artifacts made while this reader looked are no run's yet
            listed = [row for row in ever if row["run"] is not None]
            if listed != expected(range(1, len(listed) + 1)):
                wrong.append(ever)
            wrong.extend(catalog.problems)
            answers.append(number)
            if last:
                return

    threads = [threading.Thread(target=target) for target in (write_runs, read_runs, read_runs)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert wrong == []
    assert answers.count(written[-1]) >= 2 and len(set(answers)) > 2
    assert packs_of(store, "points")
