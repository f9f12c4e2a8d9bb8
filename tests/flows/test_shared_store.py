"""Runs on machines that share an address: each has a folder of its own, empty at first."""

import shutil
from datetime import UTC, datetime

import fsspec
import pytest

from storage import remote
from storage.artifacts import Place
from storage.holdings import Holdings
from storage.leases import leased
from storage.pruning import prune
from storage.retention import Keep
from storage.runs import COMPLETED, Run, recorded, runs_lease
from storage.stages import of_run

pytestmark = pytest.mark.usefixtures("address")
ALL = ["made:one", "made:two", "merged", "shifted:one", "shifted:two"]


def test_what_one_machine_computed_is_a_hit_on_another(toy, scans, tmp_path):
    assert toy.toy(str(tmp_path / "one"), "r1", scans)["computed"] == ALL
    done = toy.toy(str(tmp_path / "two"), "r2", scans)
    assert done == {"computed": [], "cached": ALL, "failed": []}


def test_a_hit_fetches_no_artifact_that_nobody_reads(toy, scans, tmp_path):
    toy.toy(str(tmp_path / "one"), "r1", scans)
    toy.toy(str(tmp_path / "two"), "r2", scans)
    assert not list((tmp_path / "two").rglob("points/**/*.parquet"))


def test_another_machine_goes_on_where_one_was_lost(toy, scans, tmp_path):
    toy.toy(str(tmp_path / "one"), "r1", scans[:1])
    shutil.rmtree(tmp_path / "one")
    done = toy.toy(str(tmp_path / "two"), "r2", scans)
    assert done["computed"] == ["made:two", "merged", "shifted:two"]
    assert done["cached"] == ["made:one", "shifted:one"]


def test_an_object_that_is_lost_is_a_miss_and_remade(toy, scans, tmp_path, address):
    toy.toy(str(tmp_path / "one"), "r1", scans)
    rows = of_run(Place(store=str(tmp_path / "one"), run="r1", building="b", storey="0"))
    (lost,) = next(row for row in rows if (row.stage, row.scan) == ("made", "one")).outputs
    fsspec.filesystem("memory").rm_file(f"{address}/{lost}")
    done = toy.toy(str(tmp_path / "two"), "r2", scans)
    assert done["computed"] == ["made:one"]
    assert fsspec.filesystem("memory").isfile(f"{address}/{lost}")


def test_a_planted_record_is_not_taken(toy, scans, tmp_path, address):
    toy.toy(str(tmp_path / "one"), "r1", scans)
    memory = fsspec.filesystem("memory")
    (record,) = memory.find(f"{address}/.cache/b/0/one/made")
    memory.pipe_file(record, b'{"metadata": {"serializer": {"type": "pickle"}}, "result": "x"}')
    assert toy.toy(str(tmp_path / "two"), "r2", scans)["computed"] == ["made:one"]


def test_an_address_that_is_out_of_reach_costs_what_was_not_put_and_no_more(
    toy, scans, tmp_path, monkeypatch
):
    store = str(tmp_path / "one")
    monkeypatch.setattr(remote, "PAUSES_S", ())
    put = remote.Remote.put

    def fail_for_one(at, path, name):
        if "/scan=one/" in name and not name.startswith("stages/"):
            raise remote.StoreError("memory: 503; run again")
        return put(at, path, name)

    monkeypatch.setattr(remote.Remote, "put", fail_for_one)
    assert toy.toy(store, "r1", scans)["failed"] == ["made:one"]
    monkeypatch.setattr(remote.Remote, "put", put)
    done = toy.toy(store, "r2", scans)
    assert done["computed"] == ["made:one", "merged", "shifted:one"]
    assert done["cached"] == ["made:two", "shifted:two"]
    assert toy.toy(str(tmp_path / "two"), "r3", scans)["cached"] == ALL


def test_pruning_empties_the_address_of_what_no_run_needs(toy, scans, tmp_path, address):
    kept = [tmp_path / "kept", tmp_path / "expected"]
    for run, paths in (("r1", scans[:1]), ("r2", scans)):
        with recorded(str(kept[0]), a_run(run)) as record:
            toy.toy(str(kept[0]), run, paths)
            record.end(COMPLETED, "")
    before = Holdings(kept[1]).below("points")
    pruned = prune(kept[1], Keep())  # a machine that has made nothing itself
    after = Holdings(kept[1]).below("points")
    assert pruned.files["artifacts"] == len(before) - len(after) > 0
    done = toy.toy(str(tmp_path / "third"), "r3", scans)
    assert done == {"computed": [], "cached": ALL, "failed": []}


def test_pruning_leaves_a_storey_where_another_machine_is_at_work(toy, scans, tmp_path):
    with recorded(str(tmp_path / "one"), a_run("r1")) as record:
        toy.toy(str(tmp_path / "one"), "r1", scans)
        record.end(COMPLETED, "")
    before = Holdings(tmp_path / "two").below("points")
    with leased(f"{runs_lease('b', '0')}/r2"):
        assert prune(tmp_path / "two", Keep()).in_use == ["b/0"]
    assert Holdings(tmp_path / "two").below("points") == before


def a_run(name: str) -> Run:
    return Run(name, "map", "b", "0", "{}", datetime.now(UTC))
