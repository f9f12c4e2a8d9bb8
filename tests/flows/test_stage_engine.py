"""The stage engine through Prefect's real engine, on a toy pipeline."""

import json
import os
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from storage.artifacts import Place
from storage.catalog import run_query
from storage.stages import of_run

HERE = Path(__file__).parent
ALL = ["made:one", "made:two", "merged", "shifted:one", "shifted:two"]


@pytest.fixture
def store(tmp_path):
    return str(tmp_path / "store")


def run_apart(
    server: str, packages: Path, store: str, run: str, scans: list[str], **environment: str
) -> subprocess.CompletedProcess:
    path = os.pathsep.join([str(packages), str(HERE.parents[1])])
    return subprocess.run(
        [sys.executable, "-m", "toy.pipeline", store, run, *scans],
        env=os.environ
        | {"PYTHONPATH": path, "PREFECT_API_URL": server, "PREFECT_LOGGING_LEVEL": "ERROR"}
        | environment,
        capture_output=True,
        text=True,
        timeout=120,
    )


def test_an_unchanged_rerun_computes_nothing(toy, store, scans):
    assert toy.toy(store, "r1", scans)["computed"] == ALL
    assert toy.toy(store, "r2", scans) == {"computed": [], "cached": ALL, "failed": []}


def test_a_row_says_what_a_stage_cost_and_made(toy, store, scans):
    toy.toy(store, "r1", scans)
    rows = run_query(store, "select * from stages where stage = 'shifted' and scan = 'two'")
    (row,) = rows.to_pylist()
    assert (row["building"], row["storey"], row["run"]) == ("b", "0", "r1")
    assert (row["rows_in"], row["rows_out"], row["points_in"], row["points_out"]) == (20,) * 4
    assert row["wall_s"] >= row["cpu_s"] > 0
    assert row["peak_memory_mb"] > 10
    assert row["key"].startswith("b/0/two/shifted/")
    assert len(row["outputs"]) == 1
    assert (Path(store) / row["outputs"][0]).is_file()


def test_a_changed_parameter_recomputes_its_stage_and_what_follows(toy, store, scans):
    toy.toy(store, "r1", scans)
    done = toy.toy(store, "r2", scans, shifting=toy.ShiftParams(times=2))
    assert done["cached"] == ["made:one", "made:two"]
    assert done["computed"] == ["merged", "shifted:one", "shifted:two"]


def test_one_more_scan_computes_that_scan_and_the_merge(toy, store, scans, tmp_path):
    toy.toy(store, "r1", scans[:1])
    done = toy.toy(store, "r2", scans)
    assert done["computed"] == ["made:two", "merged", "shifted:two"]
    assert done["cached"] == ["made:one", "shifted:one"]


@pytest.mark.parametrize("harm", [Path.unlink, lambda path: os.truncate(path, 100)])
def test_a_harmed_artifact_is_remade_and_what_follows_is_not(toy, store, scans, harm):
    toy.toy(store, "r1", scans)
    rows = of_run(Place(store=store, run="r1", building="b", storey="0"))
    (row,) = [row for row in rows if (row.stage, row.scan) == ("made", "one")]
    before = (Path(store) / row.outputs[0]).read_bytes()
    harm(Path(store) / row.outputs[0])
    done = toy.toy(store, "r2", scans)
    assert done["computed"] == ["made:one"]
    assert len(done["cached"]) == 4
    assert (Path(store) / row.outputs[0]).read_bytes() == before


def test_a_harmed_cache_record_is_a_miss(toy, store, scans):
    toy.toy(store, "r1", scans)
    (record,) = (Path(store) / ".cache/b/0/one/made").iterdir()
    record.write_text('{"metadata": {')
    assert toy.toy(store, "r2", scans)["computed"] == ["made:one"]


def test_a_store_can_be_moved(toy, store, scans, tmp_path):
    toy.toy(store, "r1", scans)
    moved = shutil.move(store, tmp_path / "elsewhere")
    assert toy.toy(str(moved), "r2", scans)["cached"] == ALL


def test_a_failing_scan_leaves_the_others_and_a_rerun_computes_what_is_missing(toy, store, scans):
    Path(scans[1]).write_text("broken")
    done = toy.toy(store, "r1", scans)
    assert done["failed"] == ["made:two"]
    assert done["computed"] == ["made:one", "merged", "shifted:one"]
    (row,) = run_query(store, "failures").to_pylist()
    assert row["error"] == f"{scans[1]}: holds 'broken'; write a number"
    Path(scans[1]).write_text("20")
    done = toy.toy(store, "r2", scans)
    assert done["computed"] == ["made:two", "merged", "shifted:two"]
    assert done["failed"] == []


def test_an_argument_that_is_no_reference_fails_the_stage_loudly(toy, store):
    # Prefect would log the failed key and run the stage without a cache
    from prefect import flow

    place = Place(store=store, run="r1", building="b", storey="0")

    @flow
    def wrong():
        return toy.shifted(place, [], toy.ShiftParams())

    with pytest.raises(TypeError, match="expected one reference to table 'points', got 0"):
        wrong()
    assert toy.outcomes(place)["failed"] == ["shifted"]


def test_an_edited_helper_recomputes_the_stage_that_calls_it(
    prefect_server, store, scans, tmp_path
):
    shutil.copytree(HERE / "toy", tmp_path / "toy")
    first = run_apart(prefect_server, tmp_path, store, "r1", scans)
    assert json.loads(first.stdout)["computed"] == ALL, first.stderr
    helper, stage = tmp_path / "toy" / "numbers.py", tmp_path / "toy" / "making.py"
    helper.write_text(helper.read_text().replace("1.0", "2.0"))
    stage.write_text('"""A docstring."""\n# a comment\n' + stage.read_text())
    done = json.loads(run_apart(prefect_server, tmp_path, store, "r2", scans).stdout)
    assert done["cached"] == ["made:one", "made:two"]
    assert done["computed"] == ["merged", "shifted:one", "shifted:two"]


def test_a_killed_run_keeps_the_rows_of_ended_stages_and_locks_nobody_out(
    toy, prefect_server, store, scans
):
    killed = run_apart(prefect_server, HERE, store, "r1", scans, TOY_KILL="1")
    assert killed.returncode == -9
    place = Place(store=store, run="r1", building="b", storey="0")
    assert toy.outcomes(place)["computed"] == [name for name in ALL if name != "merged"]
    assert toy.toy(store, "r2", scans)["computed"] == ["merged"]


def test_two_processes_at_once_compute_each_key_once(prefect_server, store, scans):
    with ThreadPoolExecutor() as pool:
        runs = [
            pool.submit(run_apart, prefect_server, HERE, store, run, scans) for run in ("r1", "r2")
        ]
    done = [json.loads(run.result().stdout) for run in runs]
    assert sorted(done[0]["computed"] + done[1]["computed"]) == ALL
    assert sorted(done[0]["cached"] + done[1]["cached"]) == ALL
    assert run_query(store, "select count(*) as n from stages").to_pylist() == [{"n": 10}]
    made = "select count(*) as n, count(distinct run) as runs from points_all"
    assert run_query(store, made).to_pylist() == [{"n": 2 * 90, "runs": 2}]
