"""The real storey flow on small simulated rooms, through Prefect's real engine."""

import json
from pathlib import Path

import numpy as np
import pytest

from flows.params import MapSenseParams
from flows.request import StoreyRequest
from storage.catalog import run_query
from storage.coverage import Coverage
from storage.faces import Faces
from storage.occupancy import Occupancy
from storage.plan_geojson import read_plan
from storage.points import PointCloud
from storage.rooms import Rooms
from storage.runs import read_runs
from storage.snapshots import none
from tasks.scans.bundle import write_bundle
from tasks.simulation.clouds import furnished_room
from tasks.surfaces.intersection import IntersectParams


@pytest.fixture(scope="module")
def clouds():
    return [PointCloud(furnished_room(30_000, seed)[0], np.zeros(3)) for seed in (1, 2)]


@pytest.fixture
def scans(tmp_path, clouds):
    folder = tmp_path / "scans"
    for name, cloud in zip(("a", "b"), clouds, strict=True):
        write_bundle(folder / f"{name}.scan", cloud, none())
    return folder


@pytest.fixture
def mapped(prefect_server, tmp_path, scans):
    """Return what maps the storey and returns its state, summary and outcomes by stage."""
    from flows.storey import map_storey

    def run(**changes):
        asked = {
            "store": str(tmp_path / "store"),
            "building": "hut",
            "storey": "0",
            "scans": (str(scans),),
            "out": str(tmp_path / "out"),
        }
        request = StoreyRequest(**asked | changes)
        state = map_storey(request, return_state=True)
        summary = json.loads((request.folder() / "summary.json").read_text())
        stages = summary["stages"].items()
        counts = {
            outcome: {stage: cost[outcome] for stage, cost in stages if cost[outcome]}
            for outcome in ("computed", "cached", "failed")
        }
        return state, summary, counts

    return run


def test_a_storey_is_mapped_and_an_unchanged_rerun_computes_nothing(mapped, tmp_path):
    state, summary, counts = mapped()
    every = {"clouds": 2, "planes": 2, "segments": 2, "occupancy": 2, "faces": 1, "rooms": 1}
    assert state.is_completed()
    assert counts == {"computed": every, "cached": {}, "failed": {}}
    assert (summary["state"], summary["skipped"]) == ("completed", [])
    assert [scan["scan"] for scan in summary["used"]["scans"]] == ["a", "b"]
    assert summary["used"]["points"] == 60_000
    assert summary["found"]["rooms"] == 1
    plan = read_plan(tmp_path / "out" / "plan.geojson")
    assert (plan.building, plan.storey) == ("hut", "0")
    assert plan.rooms[0].scans == ("a", "b")
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "plan.geojson",
        "initial.geojson",
        "plan.svg",
        "plan.png",
        "summary.json",
    }
    _, again, counts = mapped()
    assert counts == {"computed": {}, "cached": every, "failed": {}}
    assert again["found"] == summary["found"]


def test_a_changed_parameter_recomputes_its_stage_and_what_follows(mapped):
    mapped()
    params = MapSenseParams.model_validate({"filter": {"cell_m": 0.12}})
    _, _, counts = mapped(params=params)
    assert counts["computed"] == {"segments": 2, "faces": 1, "rooms": 1}
    assert counts["cached"] == {"clouds": 2, "planes": 2, "occupancy": 2}


def test_a_broken_scan_is_skipped_with_its_reason_and_made_up_for_later(mapped, scans, clouds):
    points = scans / "b.scan" / "points.parquet"
    points.write_bytes(b"no Parquet")
    state, summary, counts = mapped()
    assert state.is_completed()
    assert summary["state"] == "partial"
    assert [skipped["scan"] for skipped in summary["skipped"]] == ["b"]
    assert "points.parquet" in summary["skipped"][0]["reason"]
    assert counts["failed"] == {"clouds": 1}
    write_bundle(scans / "b.scan", clouds[1], none())
    _, summary, counts = mapped()
    assert summary["state"] == "completed"
    assert counts["computed"] == {
        "clouds": 1,
        "planes": 1,
        "segments": 1,
        "occupancy": 1,
        "faces": 1,
        "rooms": 1,
    }
    assert counts["cached"] == {"clouds": 1, "planes": 1, "segments": 1, "occupancy": 1}


def test_a_plan_of_some_of_the_scans_says_so(mapped, scans, tmp_path):
    (scans / "b.scan" / "points.parquet").write_bytes(b"no Parquet")
    mapped()
    assert "made from 1 of 2 scans" in read_plan(tmp_path / "out" / "plan.geojson").notes


def test_a_storey_without_a_usable_scan_fails_with_the_reasons(mapped, scans, tmp_path):
    for name in ("a", "b"):
        (scans / f"{name}.scan" / "points.parquet").write_bytes(b"no Parquet")
    state, summary, _ = mapped()
    assert state.is_failed()
    assert state.message.startswith("none of 2 scans could be used: a: ")
    assert summary["found"] is None
    (run,) = read_runs(tmp_path / "store")
    assert (run.state, run.message) == ("failed", state.message)
    assert run.ended_at is not None


def test_the_catalog_shows_the_last_successful_run(mapped, scans, tmp_path):
    mapped()
    store = tmp_path / "store"
    params = MapSenseParams.model_validate({"hough": {"seed": 3}})
    mapped(params=params)
    for name in ("a", "b"):
        (scans / f"{name}.scan" / "points.parquet").write_bytes(b"no Parquet")
    mapped()
    count = "select (select count(*) from plane_labels) as now, (select count(*) from points_all)"
    assert run_query(store, count).to_pylist()[0]["now"] == 60_000
    hits = run_query(store, "cache_hits").to_pylist()
    assert [hit["state"] for hit in hits] == ["failed", "completed", "completed"]


def test_a_broken_storey_stops_no_other(prefect_server, scans, tmp_path):
    from flows.building import map_building

    store = str(tmp_path / "store")
    storeys = [
        StoreyRequest(store=store, building="hut", storey=storey, scans=(path,))
        for storey, path in (("0", str(tmp_path / "missing")), ("1", str(scans)))
    ]
    state = map_building("hut", storeys, return_state=True)
    assert state.is_failed()
    assert state.message.startswith("1 of 2 storeys failed: 0: none of 1 scans could be used")
    assert (Path(store) / "plans" / "hut" / "1" / "plan.geojson").is_file()


def test_a_stage_over_all_scans_that_raises_fails_the_run_and_keeps_what_was_computed(
    mapped, monkeypatch, tmp_path
):
    from flows import stages
    from tasks.stage.declare import stage

    def broken(
        faces: Faces, coverage: Coverage, occupancy: list[Occupancy], params: IntersectParams
    ) -> Rooms:
        raise ZeroDivisionError("no\nluck")

    with monkeypatch.context() as patched:
        patched.setattr(stages, "rooms", stage(broken, name="rooms"))
        state, summary, counts = mapped()
    assert state.is_failed()
    assert (summary["state"], summary["message"]) == ("failed", "ZeroDivisionError: no")
    assert counts["failed"] == {"rooms": 1}
    failures = run_query(tmp_path / "store", "failures").to_pylist()
    assert {(row["stage"], row["error"]) for row in failures} == {
        ("rooms", "ZeroDivisionError: no"),
        ("(run)", "ZeroDivisionError: no"),
    }
    _, summary, counts = mapped()
    assert counts["computed"] == {"rooms": 1}
    assert summary["state"] == "completed"
