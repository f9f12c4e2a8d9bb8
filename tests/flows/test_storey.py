"""The real storey flow on small simulated rooms, through Prefect's real engine."""

import json
import shutil
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
from storage.snapshots import Snapshots, none
from tasks.scans.bundle import write_bundle
from tasks.simulation.clouds import furnished_room
from tasks.surfaces.intersection import IntersectParams

PER_SCAN = (
    *("clouds", "quality", "voxels", "streams"),
    *("decoded", "planes", "segments", "occupancy"),
)
OBJECTS = dict.fromkeys(
    ("wall_images", "opening_candidates", "openings", "furniture_segments", "furniture"), 1
)
UPRIGHT = (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0)
"""Rotation of a device held upright: a roll of 90 degrees."""
ON_ITS_BACK = (1.0, 0.0, 0.0, 0.0)


def asking_for(t_q):
    """Return parameters that ask for a quality."""
    return MapSenseParams.model_validate({"quality": {"t_q": t_q}, "energy": {"t_q": t_q}})


def stages_of(scans, *names, **others):
    """Return how often each stage runs: some of those of a scan, and others."""
    return dict.fromkeys(names or PER_SCAN, scans) | others


def posed(cloud, snapshots, rotation):
    """Return a cloud as so many equal snapshots saw it from the room's middle, and those."""
    each = np.sort(np.arange(len(cloud)) % snapshots).astype(np.int32)
    poses = Snapshots(
        np.arange(snapshots, dtype=float),
        np.tile(np.median(cloud.xyz, axis=0), (snapshots, 1)),
        np.tile(rotation, (snapshots, 1)),
        np.bincount(each, minlength=snapshots),
    )
    return PointCloud(cloud.xyz, cloud.origin, each), poses


@pytest.fixture(scope="module")
def clouds():
    return [PointCloud(furnished_room(30_000, seed)[0], np.zeros(3)) for seed in (1, 2)]


@pytest.fixture
def scans(tmp_path, clouds):
    folder = tmp_path / "scans"
    for name, cloud in zip(("a", "b"), clouds, strict=True):
        write_bundle(folder / f"{name}.scan", cloud, none())
    return folder


@pytest.fixture(scope="module")
def first_store(prefect_server, tmp_path_factory, clouds):
    """A store in which the storey was mapped once."""
    from flows.storey import map_storey

    folder = tmp_path_factory.mktemp("first")
    for name, cloud in zip(("a", "b"), clouds, strict=True):
        write_bundle(folder / "scans" / f"{name}.scan", cloud, none())
    request = StoreyRequest(
        store=str(folder / "store"), building="hut", storey="0", scans=(str(folder / "scans"),)
    )
    assert map_storey(request, return_state=True).is_completed()
    return folder / "store"


@pytest.fixture
def mapped_before(first_store, tmp_path):
    """A store of the test's own in which the storey was mapped once."""
    shutil.copytree(first_store, tmp_path / "store")


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
    every = stages_of(2, faces=1, rooms=1, **OBJECTS)
    assert state.is_completed()
    assert counts == {"computed": every, "cached": {}, "failed": {}}
    assert (summary["state"], summary["skipped"], summary["rejected"]) == ("completed", [], [])
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


def test_a_changed_parameter_recomputes_its_stage_and_what_follows(mapped_before, mapped):
    params = MapSenseParams.model_validate({"filter": {"cell_m": 0.12}})
    _, _, counts = mapped(params=params)
    # coarser segments give the walls other places, and their images the same rectangles: none
    same = {"opening_candidates": 1}
    assert counts["computed"] | same == {"segments": 2, "faces": 1, "rooms": 1} | OBJECTS
    unchanged = stages_of(2, *(s for s in PER_SCAN if s != "segments"))
    assert counts["cached"].items() >= unchanged.items()


def test_the_server_works_on_what_was_decoded(mapped_before, mapped, tmp_path):
    params = MapSenseParams.model_validate({"codec": {"profile": "medium"}})
    _, _, counts = mapped(params=params)
    assert counts["cached"] == stages_of(2, "clouds", "quality", "voxels")
    changed = ("streams", "decoded", "planes", "segments", "occupancy")
    assert counts["computed"] == stages_of(2, *changed, faces=1, rooms=1, **OBJECTS)
    rows = run_query(
        tmp_path / "store",
        "select s.stage, s.points_in, s.points_out, t.cells, t.points "
        "from stages s join streams_all t using (scan) "
        "where t.profile = 'medium' and s.outcome = 'computed' "
        "and s.run = (select max(id) from runs)",
    ).to_pylist()
    assert len(rows) == 10
    for row in rows:
        assert 0 < row["cells"] <= row["points"] < 30_000
        if row["stage"] == "streams":
            assert row["points_in"] == row["points"]
        elif row["stage"] == "decoded":
            assert row["points_out"] == row["cells"]
        else:
            assert row["points_in"] == row["cells"]


def test_a_broken_scan_is_skipped_with_its_reason_and_made_up_for_later(
    mapped, scans, clouds, tmp_path
):
    points = scans / "b.scan" / "points.parquet"
    points.write_bytes(b"no Parquet")
    state, summary, counts = mapped()
    assert state.is_completed()
    assert summary["state"] == "partial"
    assert [skipped["scan"] for skipped in summary["skipped"]] == ["b"]
    assert "points.parquet" in summary["skipped"][0]["reason"]
    assert counts["failed"] == {"clouds": 1}
    assert "made from 1 of 2 scans" in read_plan(tmp_path / "out" / "plan.geojson").notes
    write_bundle(scans / "b.scan", clouds[1], none())
    _, summary, counts = mapped()
    assert summary["state"] == "completed"
    assert counts["computed"] == stages_of(1, faces=1, rooms=1, **OBJECTS)
    assert counts["cached"] == stages_of(1)


def test_the_quality_gate_keeps_back_what_is_sparse_or_skewed(mapped, tmp_path, clouds):
    scans = {
        "good": posed(clouds[0], 3, UPRIGHT),
        "skewed": posed(clouds[1], 3, ON_ITS_BACK),
        "sparse": posed(clouds[1], 10, UPRIGHT),
    }
    for name, (cloud, snapshots) in scans.items():
        write_bundle(tmp_path / "gated" / f"{name}.scan", cloud, snapshots)
    asked = {"scans": (str(tmp_path / "gated"),)}
    _, summary, counts = mapped(params=asking_for(0.5), **asked)
    assert summary["state"] == "completed"
    assert summary["message"] == "2 of 3 scans rejected by the quality gate"
    assert summary["skipped"] == []
    assert [(r["scan"], r["reason"].partition(" (")[0]) for r in summary["rejected"]] == [
        # Eq. 2 at 90 of sigma's 30 degrees: 1 - exp(-9 / 2)
        ("skewed", "rejected on the device: P_sum 0.99 > T_q 0.50, skewed"),
        ("sparse", "rejected on the device: P_sum 1.00 > T_q 0.50, incomplete"),
    ]
    (used,) = summary["used"]["scans"]
    assert (used["scan"], used["p_in"], used["p_sk"], used["p_sum"]) == ("good", 0, 0, 0)
    assert counts["computed"] == stages_of(1, clouds=3, quality=3, faces=1, rooms=1, **OBJECTS)
    plan = read_plan(tmp_path / "out" / "plan.geojson")
    assert [room.scans for room in plan.rooms] == [("good",)]
    assert "made from 1 of 3 scans" in plan.notes

    _, summary, counts = mapped(params=asking_for(1.0), **asked)
    assert (summary["state"], summary["message"], summary["rejected"]) == ("completed", "", [])
    assert [s["scan"] for s in summary["used"]["scans"]] == ["good", "skewed", "sparse"]
    assert [round(s["p_sum"], 3) for s in summary["used"]["scans"]] == [0, 0.989, 1]
    assert counts["computed"] == stages_of(2, *PER_SCAN[2:], quality=3, faces=1, rooms=1, **OBJECTS)
    assert counts["cached"] == stages_of(1, *PER_SCAN[2:], clouds=3)


def test_a_storey_whose_scans_are_all_rejected_fails_with_the_reasons(mapped, tmp_path, clouds):
    write_bundle(tmp_path / "gated" / "sparse.scan", *posed(clouds[0], 10, UPRIGHT))
    state, summary, counts = mapped(scans=(str(tmp_path / "gated"),), params=asking_for(0.5))
    assert state.is_failed()
    assert state.message.startswith(
        "none of 1 scans could be used: sparse: rejected on the device: P_sum 1.00 > T_q 0.50"
    )
    assert (summary["state"], summary["found"]) == ("failed", None)
    assert [skipped["scan"] for skipped in summary["skipped"]] == ["sparse"]
    assert counts == {"computed": {"clouds": 1, "quality": 1}, "cached": {}, "failed": {}}


def test_a_cloud_without_poses_is_not_assessed_and_used(mapped, tmp_path, clouds):
    write_bundle(tmp_path / "gated" / "b.scan", clouds[1], none())
    _, summary, _ = mapped(scans=(str(tmp_path / "gated"),), params=asking_for(0.0))
    assert summary["state"] == "completed"
    (used,) = summary["used"]["scans"]
    assert (used["scan"], used["p_in"], used["p_sk"], used["p_sum"]) == ("b", None, None, None)
    (row,) = run_query(tmp_path / "store", "quality").to_pylist()
    assert (row["scan"], row["accepted"], row["reason"]) == ("b", None, "not assessed")


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


def test_the_catalog_shows_the_last_successful_run(mapped_before, mapped, scans, tmp_path):
    store = tmp_path / "store"
    params = MapSenseParams.model_validate({"hough": {"seed": 3}})
    mapped(params=params)
    for name in ("a", "b"):
        (scans / f"{name}.scan" / "points.parquet").write_bytes(b"no Parquet")
    mapped()
    count = "select count(*) as n, (select sum(cells) from streams) as decoded from "
    (now,) = run_query(store, count + "plane_labels").to_pylist()
    assert now["n"] == now["decoded"] > 0
    (ever,) = run_query(store, count + "plane_labels_all").to_pylist()
    assert ever["n"] == 2 * now["n"]
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
    assert counts["computed"] == {"rooms": 1} | OBJECTS
    assert summary["state"] == "completed"


def test_what_cannot_be_looked_for_is_said_and_leaves_the_rest(mapped, monkeypatch, tmp_path):
    from flows import objects

    def shipped(kind):
        return tmp_path / "none.parquet" if kind == "doors" else path_of(kind)

    path_of = objects.shipped
    monkeypatch.setattr(objects, "shipped", shipped)
    state, summary, counts = mapped()
    assert state.is_completed()
    assert summary["state"] == "partial"
    assert "doors not looked for" in summary["message"] and "none.parquet" in summary["message"]
    assert counts["computed"]["furniture"] == 1 and "openings" not in counts["computed"]
    assert read_plan(tmp_path / "out" / "plan.geojson").rooms


def test_nothing_is_looked_for_that_was_not_asked_for(mapped):
    params = MapSenseParams.model_validate({"detect": ["furniture"]})
    _, summary, counts = mapped(params=params)
    assert summary["found"]["doors"] == summary["found"]["windows"] == 0
    assert OBJECTS.keys() & counts["computed"].keys() == {"furniture_segments", "furniture"}
