"""Variants and seeds compared by the command line, on rooms of two small campaigns."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from shapely import affinity, box

from flows.params import MapSenseParams
from flows.seeds import seeded, seeds_in, stage_seed
from storage.campaign import Campaign, CampaignScan, CampaignStorey, write_campaign
from storage.catalog import run_query
from storage.plan import Plan, PlanRoom
from storage.plan_geojson import read_plan, write_plan
from storage.points import PointCloud
from storage.runs import EVALUATE, parameter_set, read_runs
from storage.snapshots import none
from tasks.scans.bundle import write_bundle
from tasks.simulation.clouds import SHIFT_M, YAW_RAD, furnished_room
from tests.flows.command import mapsense

ROOM = affinity.translate(
    affinity.rotate(box(0, 0, 6, 5), YAW_RAD, origin=(0, 0), use_radians=True), *SHIFT_M[:2]
)
"""What `furnished_room` is the inside of."""
SEEDLESS = {"clouds", "quality", "voxels", "streams", "decoded", "occupancy"}
TWO = """
campaigns = ["hut", "shed"]
seeds = [0, 3]
[variants.default]
[variants.coarse.filter]
cell_m = 0.12
"""


def truth_of(building, polygon=ROOM):
    room = PlanRoom("r0", polygon, "office", floor_m=float(SHIFT_M[2]))
    return Plan(building, "0", (room,), simulated=True)


def campaign(folder, building, clouds):
    """Write a campaign of one storey: a scan of each cloud."""
    scans = []
    for name, cloud in clouds.items():
        path = f"0/scans/{name}.scan"
        write_bundle(folder / path, cloud, none())
        scan = CampaignScan(
            scan=name, path=path, room="r0", volunteer="v", duration_s=1.0, points=len(cloud)
        )
        scans.append(scan)
    write_plan(truth_of(building), folder / "0" / "truth.geojson")
    storey = CampaignStorey(storey="0", truth="0/truth.geojson", scans=tuple(scans))
    write_campaign(Campaign(building=building, simulated=True, seed=0, storeys=(storey,)), folder)


@pytest.fixture(scope="module")
def folder(prefect_server, tmp_path_factory):
    """A folder with two campaigns, `hut` of two scans and `shed` of one."""
    folder = tmp_path_factory.mktemp("experiment")
    a, b, c = (PointCloud(furnished_room(20_000, seed)[0], np.zeros(3)) for seed in (1, 2, 3))
    campaign(folder / "hut", "hut", {"a": a, "b": b})
    campaign(folder / "shed", "shed", {"c": c})
    with pytest.MonkeyPatch.context() as patched:
        patched.setenv("PREFECT_API_URL", prefect_server)
        yield folder


@pytest.fixture(scope="module")
def compare(folder):
    """Return what runs an experiment's text in the shared store: code, answer, stderr."""

    def run(text, *flags):
        (folder / "experiment.toml").write_text(text)
        asked = (folder / "experiment.toml", "--store", folder / "store", "--json", *flags)
        code, out, err = mapsense("evaluate", *asked)
        return code, json.loads(out) if out else None, err

    return run


@pytest.fixture(scope="module")
def compared(compare):
    """What the first experiment answered, and the outcomes of its stages."""
    code, answer, err = compare(TWO)
    assert (code, err) == (0, "")
    return answer


def outcomes(folder, answer):
    """Return how often stages of an experiment's runs were computed, cached, and failed."""
    runs = ", ".join(f"'{row['run']}'" for row in answer["runs"])
    rows = run_query(
        folder / "store",
        f"select stage, outcome, count(*) as n from stages where run in ({runs}) group by all",
    )
    found = {"computed": {}, "cached": {}, "failed": {}}
    for row in rows.to_pylist():
        found[row["outcome"]][row["stage"]] = row["n"]
    return found


def test_each_storey_is_scored_with_each_variant_and_seed(folder, compared):
    rows = [(r["building"], r["storey"], r["variant"], r["seeds"]) for r in compared["variants"]]
    assert rows == [
        ("hut", "0", "default", 2),
        ("hut", "0", "coarse", 2),
        ("shed", "0", "default", 2),
        ("shed", "0", "coarse", 2),
    ]
    for row in compared["variants"]:
        assert (row["precision"], row["recall"], row["f1"], row["failed"]) == (1, 1, 1, 0)
        assert 0 < row["area_error_m2"] <= row["worst_area_error_m2"] < 1.5
    runs = {run.id: run for run in read_runs(folder / "store")}
    asked = [(r["building"], r["variant"], r["seed"], r["state"]) for r in compared["runs"]]
    assert asked == [
        (building, variant, seed, "completed")
        for building in ("hut", "shed")
        for variant in ("default", "coarse")
        for seed in (0, 3)
    ]
    for row in compared["runs"]:
        run = runs[row["run"]]
        assert (run.verb, run.variant, run.seed) == (EVALUATE, row["variant"], row["seed"])
        assert run.parameters == row["parameters"]
    assert len({row["parameters"] for row in compared["runs"]}) == 2
    assert runs[compared["runs"][0]["run"]].parameters == parameter_set(
        MapSenseParams().model_dump(mode="json")
    )


def test_what_does_not_depend_on_the_seed_or_the_variant_is_computed_once(folder, compared):
    found = outcomes(folder, compared)
    assert found["failed"] == {}
    assert {stage: found["computed"][stage] for stage in SEEDLESS} == dict.fromkeys(SEEDLESS, 3)
    assert found["computed"]["planes"] == 2 * 3  # of each seed
    # of each variant; of another seed only where that found other planes
    assert 2 * 3 <= found["computed"]["segments"] <= 2 * 2 * 3
    scans = (*SEEDLESS, "planes", "segments")
    for stage in scans:
        assert found["computed"][stage] + found["cached"].get(stage, 0) == 2 * 2 * 3


def test_asked_again_it_computes_nothing_and_answers_the_same(folder, compare, compared):
    code, answer, err = compare(TWO)
    assert (code, err) == (0, "")
    assert answer["variants"] == compared["variants"]
    assert outcomes(folder, answer)["computed"] == {}
    assert not {row["run"] for row in answer["runs"]} & {row["run"] for row in compared["runs"]}


def test_more_seeds_compute_only_what_is_new(folder, compare, compared):
    code, answer, _ = compare(TWO.replace("[0, 3]", "[0, 3, 5]"))
    assert code == 0
    found = outcomes(folder, answer)
    assert SEEDLESS.isdisjoint(found["computed"])
    assert found["computed"]["planes"] == 3


def test_the_mapped_plans_are_kept_and_the_run_says_of_what_truth(folder, compared):
    for row in compared["runs"]:
        place = Path(row["building"], row["storey"], row["variant"], str(row["seed"]))
        kept = folder / "store" / row["plans"]
        assert kept == folder / "store" / "evaluations" / place
        assert {path.name for path in kept.iterdir()} == {"plan.geojson", "initial.geojson"}
        (room,) = read_plan(kept / "plan.geojson").rooms
        overlap = room.polygon.intersection(ROOM).area / room.polygon.union(ROOM).area
        assert overlap > 0.9
    (run,) = [run for run in read_runs(folder / "store") if run.id == compared["runs"][0]["run"]]
    asked = run.request()
    assert Path(asked["truth"]) == folder / "hut" / "0" / "truth.geojson"
    assert asked["params"]["hough"]["seed"] == stage_seed(0, "hough.seed")


def test_the_answer_is_what_the_store_says(folder, compared):
    for row in compared["variants"]:
        runs = [
            f"'{r['run']}'"
            for r in compared["runs"]
            if (r["building"], r["variant"]) == (row["building"], row["variant"])
        ]
        sql = (
            "select avg(abs(true_m2 - found_m2)) as mean, max(abs(true_m2 - found_m2)) as worst, "
            f"count(*) as n from detections_all where run in ({', '.join(runs)}) "
            "and class = 'room' and metric = 'iou' "
            "and threshold = 0"
        )
        (known,) = run_query(folder / "store", sql).to_pylist()
        assert known["n"] == 2
        assert known["mean"] == pytest.approx(row["area_error_m2"], abs=1e-4)
        assert known["worst"] == pytest.approx(row["worst_area_error_m2"], abs=1e-4)


FAILING = """
campaigns = ["hut"]
seeds = 1
[variants.default]
[variants.cropped.scans]
crop = [90, 90, 90, 91, 91, 91]
"""


def test_a_failing_variant_is_named_stops_no_other_and_is_made_up_for_later(
    folder, compare, compared
):
    code, answer, err = compare(FAILING)
    assert code == 1
    assert err.startswith("mapsense: hut/0 cropped seed 0: failed: none of 2 scans could be used")
    assert len(err.splitlines()) == 1
    counts = [(row["variant"], row["seeds"], row["failed"]) for row in answer["variants"]]
    assert counts == [("default", 1, 0), ("cropped", 0, 1)]
    assert answer["variants"][1]["f1"] is None
    code, answer, err = compare(FAILING.replace("[90, 90, 90, ", "[-50, -50, -50, "))
    assert (code, err) == (0, "")
    assert [row["f1"] for row in answer["variants"]] == [1, 1]
    (run,) = [run for run in read_runs(folder / "store") if run.id == answer["runs"][1]["run"]]
    assert run.state == "completed"


def test_a_broken_scan_is_left_out_and_said_once(folder, compare, compared):
    text = """
    seeds = 2
    [[storeys]]
    building = "cabin"
    storey = "0"
    scans = ["hut/0/scans/a.scan", "no.scan"]
    truth = "hut/0/truth.geojson"
    """
    code, answer, err = compare(text)
    assert code == 1
    assert [row["state"] for row in answer["runs"]] == ["partial", "partial"]
    assert answer["variants"][0]["f1"] == 1
    assert len(err.splitlines()) == 1 and "no.scan" in err and "1 of 2 scans skipped" in err


def test_a_campaign_is_scored_without_a_file(folder, compared):
    asked = (folder / "hut", "--seeds", "0,3", "--store", folder / "store")
    code, out, err = mapsense("evaluate", *asked, "--json")
    assert (code, err) == (0, "")
    answer = json.loads(out)
    assert answer["variants"] == compared["variants"][:1]
    assert outcomes(folder, answer)["computed"] == {}
    code, out, _ = mapsense("evaluate", *asked, "--set", "filter.cell_m=0.12")
    assert code == 0 and "default" in out and "area_error_m2" in out


def test_the_initial_model_is_a_variant_of_its_own_where_the_final_one_differs(
    folder, compared, monkeypatch
):
    from flows import repeat

    def refined(mapped, store, into):
        write_plan(mapped.plan, into / "initial.geojson")
        write_plan(truth_of("hut"), into / "plan.geojson")

    monkeypatch.setattr(repeat, "write_plans", refined)
    asked = (folder / "hut", "--seeds", "1", "--store", folder / "refined", "--json")
    code, out, _ = mapsense("evaluate", *asked)
    assert code == 0
    answer = json.loads(out)
    errors = {row["variant"]: row["area_error_m2"] for row in answer["variants"]}
    assert errors["default"] == 0 < errors["initial"]
    assert errors["initial"] == pytest.approx(compared["variants"][0]["area_error_m2"], abs=0.2)
    kept = folder / "refined" / "evaluations" / "hut" / "0"
    initial = (kept / "initial" / "0" / "plan.geojson").read_bytes()
    assert initial == (kept / "default" / "0" / "initial.geojson").read_bytes()
    assert {run.variant for run in read_runs(folder / "refined")} == {"default", "initial"}


def moved(plan):
    """Return the same rooms elsewhere, called otherwise."""
    rooms = [
        replace(room, id=f"x{room.id}", polygon=affinity.translate(room.polygon, 12.5, -3))
        for room in plan.rooms
    ]
    return Plan("mill", "7", tuple(rooms))


@pytest.mark.parametrize(
    ("learnt", "scored", "why"),
    [
        ({"plan": moved(truth_of("shed"))}, "hut", "has the rooms of 'mill/7', learnt from by"),
        ({"plan": truth_of("shed", box(0, 0, 3, 3))}, "shed", "is of storey 'shed/0', as is"),
        ({"names": ["shed/0"]}, "shed", "is of storey 'shed/0', as is"),
    ],
    ids=["rooms", "plan's name", "name"],
)
def test_what_was_learnt_from_is_not_scored_failure(folder, compare, learnt, scored, why):
    source = "experiment.toml"
    lines = f"train_names = {learnt.get('names', [])}"
    if plan := learnt.get("plan"):
        source = "learnt.geojson"
        write_plan(plan, folder / source)
        lines += f'\ntrain = ["{source}"]'
    before = read_runs(folder / "store")
    code, answer, err = compare(lines + TWO)
    assert (code, answer) == (1, None)
    truth = folder / scored / "0" / "truth.geojson"
    assert err.startswith(f"mapsense: {truth}: {why}") and source in err
    assert read_runs(folder / "store") == before


def test_a_plan_of_another_storey_may_be_learnt_from(folder, compare, compared):
    write_plan(replace(truth_of("mill", box(0, 0, 3, 3))), folder / "learnt.geojson")
    code, _, err = compare('train_names = ["mill/1"]\ntrain = ["learnt.geojson"]' + TWO)
    assert (code, err) == (0, "")


def test_two_storeys_of_one_name_do_not_overwrite_each_other_failure(folder, compare):
    code, _, err = compare('campaigns = ["hut", "hut"]')
    assert code == 1
    assert "there are two storeys 'hut/0' to be scored; give one another building's name" in err


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "names nothing to be scored; add campaigns"),
        ("campaign = ['hut']", "unknown field 'campaign'; did you mean 'campaigns'"),
        ("colour = 1", "unknown field 'colour'; there are campaigns, storeys, variants, seeds"),
        ("seeds = 0", "field 'seeds': value error, expected at least one seed"),
        ("seeds = [1, 1]", "field 'seeds': value error, a seed is named twice"),
        ("seeds = 'ten'", "field 'seeds'"),
        ("campaigns = ['barn']", "barn/campaign.json: cannot be read"),
        (
            "[[storeys]]\nbuilding = 'b'\nstorey = '0'\nscan = ['a']\ntruth = 't'",
            "field 'storeys.0.scans': field required",
        ),
        (
            "[[storeys]]\nbuilding='b'\nstorey='0'\nscans=['a']\ntruth='t'\ntruths='t'",
            "unknown field 'storeys.0.truths'; did you mean 'truth'",
        ),
        (
            "[[storeys]]\nbuilding = 'a/b'\nstorey = '0'\nscans = ['a']\ntruth = 't'",
            "field 'storeys.0.building': 'a/b' is no usable name",
        ),
        (
            "campaigns = ['hut']\n[variants.fine.voxel]\nedge_m = 0.01",
            "variant 'fine': unknown setting 'voxel': did you mean 'voxels'",
        ),
        (
            "campaigns = ['hut']\n[variants.fine.voxels]\nedge_m = -1",
            "variant 'fine': setting 'voxels.edge_m' = -1",
        ),
        (
            "campaigns = ['hut']\n[variants.lucky.hough]\nseed = 7",
            "variant 'lucky': setting 'hough.seed': every repeat draws its own; leave it out",
        ),
        ("campaigns = ['hut']\n[variants.initial]", "'initial' stands for a variant's initial"),
        ("campaigns = ['hut']\n[variants.'a b']", "field 'variants': 'a b' is no usable name"),
        ("campaigns = ['hut']\ntrain_names = ['shed']", "field 'train_names': 'shed' names no"),
        ("campaigns = [", "is no TOML"),
        (
            "[[storeys]]\nbuilding = 'b'\nstorey = '0'\nscans = ['hut']\ntruth = 'no.geojson'",
            "no.geojson: there is no such file",
        ),
    ],
)
def test_what_is_wrong_in_the_file_is_named_with_the_remedy_failure(compare, text, said):
    code, answer, err = compare(text)
    assert (code, answer) == (1, None)
    assert len(err.splitlines()) == 1
    assert "experiment.toml: " in err or said.startswith(("barn", "no.geojson"))
    assert said in err


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (("hut", "--seeds", "many"), "--seeds many: expected how many, as 10"),
        (("hut", "--seeds", "0"), "--seeds 0: expected how many"),
        (("hut", "--seeds", "1,1"), "--seeds 1,1: expected how many"),
        (("hut", "--storey", "9"), "campaign.json: has no storey '9'; name one of '0'"),
        (("hut", "--set", "hough.seed=1"), "setting 'hough.seed': every repeat draws its own"),
        (("hut/0",), "campaign.json: cannot be read"),
        (("hut/0/truth.geojson",), "expected a plan with --truth TRUTH, a campaign's folder"),
        (("experiment.toml", "--seeds", "3"), "--seeds: leave it out, "),
        (("plan.geojson", "--truth", "t.geojson", "--seeds", "3"), "--seeds: leave it out"),
    ],
)
def test_flags_that_cannot_be_meant_are_refused_failure(folder, asked, said):
    what, *flags = asked
    code, out, err = mapsense("evaluate", folder / what, *flags, "--store", folder / "store")
    assert (code, out) == (1, "")
    assert said in err and len(err.splitlines()) == 1


def test_a_seed_reaches_every_random_stage_and_nothing_else():
    params = MapSenseParams()
    names = list(seeds_in(params.model_dump()))
    assert "hough.seed" in names
    one, other = seeded(params, 1), seeded(params, 2)
    assert one == seeded(one, 1) == seeded(params, 1)
    assert one.hough.seed != other.hough.seed
    assert one.hough.model_copy(update={"seed": 0}) == params.hough
    same = {
        name for name in MapSenseParams.model_fields if getattr(one, name) == getattr(other, name)
    }
    assert set(MapSenseParams.model_fields) - same == {name.partition(".")[0] for name in names}
    assert stage_seed(1, "hough.seed") != stage_seed(1, "other.seed")
