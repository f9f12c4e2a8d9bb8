"""A plan scored against its truth by the command line."""

import json

import pytest
from shapely import LineString, box

from flows.params import MapSenseParams
from storage.catalog import run_query
from storage.plan import Plan, PlanRoom, PlanWall
from storage.plan_geojson import read_plan, write_plan
from storage.runs import last_runs, parameter_set, read_runs
from tests.flows.command import mapsense

SUFFIXES = ("geojson", "json")


def plan_of(*rooms):
    walls = [PlanWall("w0", LineString([(0, 0), (4, 0)]), 0.2)]
    rooms = [PlanRoom(f"r{i}", polygon, "office") for i, polygon in enumerate(rooms)]
    return Plan("hut", "0", tuple(rooms), tuple(walls))


@pytest.fixture(scope="module")
def folder(prefect_server, tmp_path_factory):
    folder = tmp_path_factory.mktemp("evaluation")
    write_plan(plan_of(box(0, 0, 4, 3), box(5, 0, 8, 3)), folder / "truth.geojson")
    write_plan(plan_of(box(0, 0, 4, 3.5)), folder / "plan.geojson")
    with pytest.MonkeyPatch.context() as patched:
        patched.setenv("PREFECT_API_URL", prefect_server)
        yield folder


def evaluate(folder, *changes, plan="plan.geojson"):
    asked = ("evaluate", folder / plan, "--truth", folder / "truth.geojson")
    return mapsense(*asked, "--store", folder / "store", *changes)


def test_a_plan_is_scored_and_the_scores_can_be_asked_for(folder):
    code, out, err = evaluate(folder, "--json")
    assert (code, err) == (0, "")
    answers = json.loads(out)
    (area,) = answers["area of rooms"]
    assert (area["n_true"], area["n_found"], area["n_matched"]) == (2, 1, 1)
    assert area["mean_m2"] == pytest.approx(4 * 3.5 - 4 * 3)
    assert area["mean_iou"] == pytest.approx(3 / 3.5, abs=1e-4)
    rooms = [
        row
        for row in answers["found and true"]
        if (row["class"], row["metric"], row["threshold"]) == ("room", "iou", 0.5)
    ]
    assert [(row["precision"], row["recall"]) for row in rooms] == [(1.0, 0.5)]
    (asked,) = run_query(folder / "store", "area_error").to_pylist()
    assert (asked["building"], asked["storey"]) == ("hut", "0")
    assert asked["mean_m2"] == area["mean_m2"]


def test_scoring_a_plan_is_no_news_of_its_mapping(folder):
    evaluate(folder)
    runs = read_runs(folder / "store")
    assert {run.verb for run in runs} == {"evaluate"}
    assert last_runs(runs) == []
    code, out, _ = mapsense("rerun", "--store", folder / "store")
    assert code == 0 and out.startswith("nothing to run again")


def test_scoring_again_computes_nothing(folder):
    evaluate(folder)
    evaluate(folder)
    outcomes = run_query(
        folder / "store",
        "select outcome, count(*) as n from stages "
        "where run = (select max(id) from runs) group by all",
    )
    assert outcomes.to_pylist() == [{"outcome": "cached", "n": 2}]


def test_a_truth_that_is_no_geojson_file_is_kept_as_one_and_scored_alike(folder):
    (folder / "truth.json").write_bytes((folder / "truth.geojson").read_bytes())
    asked = (folder / "plan.geojson", "--store", folder / "other", "--json")
    codes, answers, _ = zip(
        *(mapsense("evaluate", *asked, "--truth", folder / f"truth.{end}") for end in SUFFIXES),
        strict=True,
    )
    assert codes == (0, 0)
    assert answers[0] == answers[1]
    (kept,) = (folder / "other" / "truths").iterdir()
    assert kept.suffix == ".geojson"
    assert [room.polygon for room in read_plan(kept).rooms] == [
        room.polygon for room in read_plan(folder / "truth.geojson").rooms
    ]


def test_a_run_says_what_its_parameters_are_known_by(folder):
    evaluate(folder)
    evaluate(folder, "--set", "evaluation.off_wall_m=0.4")
    *_, one, other = read_runs(folder / "store")
    assert one.parameters == parameter_set(MapSenseParams().model_dump(mode="json"))
    assert other.parameters != one.parameters
    assert {(run.variant, run.seed) for run in (one, other)} == {("", None)}


@pytest.mark.parametrize("content", [b"", b"{}", b"no JSON"])
def test_what_is_no_plan_is_named_failure(folder, content):
    (folder / "broken.geojson").write_bytes(content)
    code, out, err = evaluate(folder, plan="broken.geojson")
    assert (code, out) == (1, "")
    assert "broken.geojson" in err and len(err.splitlines()) == 1
