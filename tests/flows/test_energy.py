"""A tiny campaign by the command line: simulated, charged, charged again, with a scan broken."""

import json
from contextlib import contextmanager
from pathlib import Path

import pytest
from shapely import LineString, box

from flows.work import ENERGY_ANSWERS
from storage.catalog import run_query
from storage.plan import Plan, PlanRoom, PlanWall
from storage.plan_geojson import write_plan
from storage.runs import read_runs
from tests.flows.command import mapsense

SIMULATED = (
    *("--set", "campaign.sensor.rays=1500"),
    *("--set", "campaign.volunteer.interval_s=1.0"),
    *("--set", "campaign.skill=1.0"),
    *("--set", "campaign.skill_spread=0.0"),
)
FEW = (
    *("--set", "quality.alpha_p=300"),
    *("--set", "energy.seeds=[0,1]"),
    *("--set", "sweep.steps=2"),
    *("--set", "targets.steps=2"),
)
PER_SCAN = {
    *("clouds", "quality", "voxels", "streams", "decoded", "planes", "segments", "occupancy"),
    *("faces", "rooms", "room_errors"),
}
WHOLE = {"scan_work", "energy", "savings", "energy_sweep", "energy_targets"}
WATTS = (283.17 * 20 + 132.86) / 1000
"""Of Wi-Fi at 20 Mbit/s (Huang et al. 2012)."""


def strict(text):
    """Return what JSON holds; NaN and Infinity are none."""

    def refused(constant):
        raise ValueError(f"{constant} is no JSON")

    return json.loads(text, parse_constant=refused)


@pytest.fixture(scope="module")
def folder(prefect_server, tmp_path_factory):
    """A folder with a campaign of two rooms, scanned once each, and what the command answered."""
    folder = tmp_path_factory.mktemp("energy")
    rooms = [PlanRoom(f"r{i}", box(4.2 * i, 0, 4.2 * i + 4, 3)) for i in range(2)]
    lines = [((-0.1, y), (8.3, y)) for y in (-0.1, 3.1)]
    lines += [((x, -0.1), (x, 3.1)) for x in (-0.1, 4.1, 8.3)]
    walls = [PlanWall(f"w{i}", LineString(line)) for i, line in enumerate(lines)]
    write_plan(Plan("b", "0", tuple(rooms), tuple(walls)), folder / "plan.geojson")
    asked = ("simulate", folder / "plan.geojson", "--building", "hut", "--out", folder / "campaign")
    code, out, err = mapsense(*asked, *SIMULATED, "--json")
    assert (code, err) == (0, "")
    (folder / "answer.json").write_text(out)
    with pytest.MonkeyPatch.context() as patched:
        patched.setenv("PREFECT_API_URL", prefect_server)
        yield folder


@pytest.fixture(scope="module")
def scans(folder):
    """The campaign's scans, by room."""
    record = json.loads((folder / "campaign" / "campaign.json").read_text())
    return sorted(record["storeys"][0]["scans"], key=lambda scan: scan["room"])


def charge(folder, *changes):
    return mapsense("energy", folder / "campaign", "--store", folder / "store", *FEW, *changes)


@pytest.fixture(scope="module")
def charged(folder):
    """The answers about the campaign."""
    code, out, _ = charge(folder, "--json")
    assert code == 0
    return strict(out)


def last(folder):
    """Return the outcomes of the last run's stages, by stage."""
    rows = run_query(
        folder / "store",
        "select stage, outcome, count(*) as n from stages "
        "where run = (select max(id) from runs) group by all",
    )
    found = {"computed": {}, "cached": {}, "failed": {}}
    for row in rows.to_pylist():
        found[row["outcome"]][row["stage"]] = row["n"]
    return found


def ask(folder, query):
    code, out, _ = mapsense("query", query, "--store", folder / "store", "--format", "json")
    assert code == 0
    return strict(out)


@contextmanager
def broken(path: Path, data=b"no Parquet"):
    whole = path.read_bytes()
    path.write_bytes(data)
    try:
        yield
    finally:
        path.write_bytes(whole)


def test_simulate_answers_with_what_the_folder_holds(folder, scans):
    record = (folder / "campaign" / "campaign.json").read_text()
    assert strict((folder / "answer.json").read_text()) == json.loads(record)
    assert [scan["room"] for scan in scans] == ["r0", "r1"]
    assert all((folder / "campaign" / scan["path"]).is_dir() for scan in scans)


def test_energy_answers_what_each_method_costs(charged, scans):
    assert set(charged) == set(ENERGY_ANSWERS)
    assert all(charged.values())
    joules = {row["method"]: row for row in charged["simulated joules, one query a room"]}
    assert set(joules) == {"MapSense", "GraMap", "No Processing"}
    # one usable scan of each room: nothing is drawn, and no scan is made twice
    capture_j = 2.5 * sum(scan["duration_s"] for scan in scans)
    sent_j = sum(WATTS * scan["points"] * 12 * 8 / 20e6 + 0.04 for scan in scans)
    for row in joules.values():
        assert (row["n_queries"], row["captures"], row["uploads"]) == (2, 2, 2)
        assert (row["rejected"], row["unanswered"]) == (0, 0)
        assert row["capture_j"] == pytest.approx(capture_j, abs=0.06)
    raw = joules["No Processing"]
    assert raw["transmit_j"] == pytest.approx(sent_j, abs=0.06)
    assert raw["total_j"] == pytest.approx(capture_j + sent_j, abs=0.06)
    assert joules["MapSense"]["transmit_j"] < joules["GraMap"]["transmit_j"] < raw["transmit_j"]


def test_the_answers_of_the_campaign_agree_with_each_other(charged):
    joules = {r["method"]: r["total_j"] for r in charged["simulated joules, one query a room"]}
    saved = charged["saved by MapSense (simulated)"]
    assert {row["baseline"] for row in saved} == {"GraMap", "No Processing"}
    for row in saved:
        ratio = 100 * (1 - joules["MapSense"] / joules[row["baseline"]])
        assert row["saving_percent"] == pytest.approx(ratio, abs=0.1)
        assert row["seeds"] == 2


def test_named_queries_answer_about_the_campaign(folder, charged, scans):
    savings = ask(folder, "energy_savings")
    assert {(row["building"], row["series"]) for row in savings} == {
        ("hut.scans", "storey"),
        ("hut.scans", "queries"),
    }
    rated = {row["scan"]: row["p_sum"] for row in ask(folder, "select scan, p_sum from quality")}
    assert set(rated) == {scan["scan"] for scan in scans}
    curve = ask(folder, "gate_curve")
    assert [row["t_q"] for row in curve] == pytest.approx([i / 20 for i in range(21)])
    for row in curve:
        assert row["assessed"] == 2
        assert row["accepted"] == sum(p <= row["t_q"] for p in rated.values())
    volunteers = ask(folder, "quality_by_volunteer")
    assert [row["volunteer"] for row in volunteers] == sorted({s["volunteer"] for s in scans})
    assert sum(row["scans"] for row in volunteers) == 2
    assert sum(row["usable"] for row in volunteers) == 2


def test_a_room_found_in_each_scan_alone_is_compared_with_the_one_asked_for(folder, charged, scans):
    found = ask(folder, "select scan, room, true_m2, iou from room_errors order by room")
    assert [(row["scan"], row["room"]) for row in found] == [(s["scan"], s["room"]) for s in scans]
    for row in found:
        assert row["true_m2"] == pytest.approx(12)
        assert row["iou"] > 0.8


def test_charging_again_computes_nothing(folder, charged):
    code, out, _ = charge(folder, "--json")
    assert code == 0
    assert strict(out) == charged
    done = last(folder)
    assert (done["computed"], done["failed"]) == ({}, {})
    # the stage streams runs twice: MapSense's and GraMap's
    assert done["cached"] == dict.fromkeys(PER_SCAN, 2) | dict.fromkeys(WHOLE, 1) | {"streams": 4}


def test_asking_more_of_the_scans_computes_what_they_cost_only(folder, charged):
    code, _, _ = charge(folder, "--set", "work.usable_iou=1.0", "--json")
    assert code == 0
    done = last(folder)
    assert set(done["computed"]) == WHOLE
    assert set(done["cached"]) == PER_SCAN
    (row,) = ask(folder, "select count(*) as n from scan_work where usable")
    assert row["n"] == 0


def test_a_broken_scan_is_left_out_and_said(folder, charged, scans):
    bad, good = scans
    with broken(folder / "campaign" / bad["path"] / "points.parquet"):
        code, out, err = charge(folder)
    assert code == 1
    assert "saved by MapSense (simulated)" in out
    assert err.splitlines()[-1] == (
        f"mapsense: hut.scans/0: left out, their device side failed: {bad['scan']}"
    )
    runs = read_runs(folder / "store")
    states = {run.storey: run.state for run in runs if run.id == runs[-1].id}
    assert states == {"0": "partial", "campaign": "completed"}
    assert last(folder)["failed"] == {"clouds": 1}
    assert [row["scan"] for row in ask(folder, "select scan from scan_work")] == [good["scan"]]
    # a campaign is charged again by its own verb
    code, out, _ = mapsense("rerun", "--store", folder / "store")
    assert (code, out) == (0, "nothing to run again: no storey was mapped\n")


def test_a_campaign_without_a_sound_scan_answers_nothing_and_says_why(folder, charged, scans):
    one, other = (folder / "campaign" / scan["path"] / "points.parquet" for scan in scans)
    with broken(one), broken(other):
        code, out, err = charge(folder, "--json")
    assert code == 1
    assert strict(out)["simulated joules, one query a room"] == []
    assert err.startswith("mapsense: hut.scans/0: left out, their device side failed: s0")


def test_a_scan_that_is_gone_is_left_out(folder, charged, scans):
    gone = folder / "campaign" / scans[1]["path"]
    hidden = gone.rename(folder / "hidden.scan")
    try:
        code, _, err = charge(folder, "--json")
    finally:
        hidden.rename(gone)
    assert code == 1
    assert err.startswith("mapsense: hut.scans/0: left out")
    assert gone.name in err


@pytest.mark.parametrize(
    ("data", "problem"),
    [
        (b"{", "truth.geojson: "),
        (None, "has no room 'r0', which scan 's00v"),
    ],
)
def test_a_truth_that_cannot_be_compared_with_is_an_error_not_useless_scans(
    folder, charged, data, problem
):
    truth = folder / "campaign" / "0" / "truth.geojson"
    other = truth.read_bytes().replace(b'"r0"', b'"x0"')
    with broken(truth, other if data is None else data):
        code, out, err = charge(folder, "--json")
    assert (code, out) == (1, "")
    assert err.startswith(f"mapsense: {truth}: ")
    assert problem in err
    assert err.count("\n") == 1


def test_a_gate_and_an_energy_model_that_disagree_on_t_q_are_an_error(folder, charged):
    code, _, err = charge(folder, "--set", "quality.t_q=0.4", "--set", "energy.t_q=0.6")
    assert code == 1
    assert "quality.t_q and energy.t_q differ" in err
