"""A classifier trained by the command line on two tiny storeys, through Prefect's real engine."""

import json
from dataclasses import replace

import numpy as np
import pytest

from flows.disjoint import check_disjoint
from flows.forests import forest_source
from flows.learners import Learner
from storage.artifacts import read
from storage.errors import InputError, MapSenseError
from storage.forest import open_forest, read_forest
from storage.plan_digest import plan_digest
from storage.plan_geojson import write_plan
from storage.points import POINTS
from storage.snapshots import SNAPSHOTS
from tasks.forest import Examples, ForestParams
from tasks.held_out import nothing_more
from tasks.simulation.campaign import CampaignParams
from tasks.simulation.plan import StoreyParams
from tasks.simulation.sensor import SensorParams
from tasks.simulation.training import FurnishedStorey
from tasks.simulation.volunteers import VolunteerParams
from tests.flows.command import mapsense

FEATURES, CLASSES = ("area_m2", "corners"), ("room", "door")


def tiny(number):
    """Return a storey of nine rooms of which one is scanned, sparsely."""
    campaign = CampaignParams(
        seed=number,
        skill=1.0,
        skill_spread=0.0,
        sensor=SensorParams(rays=3_000),
        volunteer=VolunteerParams(interval_s=1.5, spots_max=4),
    )
    params = StoreyParams(seed=9000 + number)
    return FurnishedStorey(f"tiny{number}", "1", params, campaign, 1 / 9)


def of_truth(storey, params):
    """Return one example per true room and door; as of a component, what was mapped is read."""
    asked = storey.request
    (points,), (snapshots,) = storey.of_scans("points"), storey.of_scans("snapshots")
    assert len(read(POINTS, points, asked.store)) == points.rows > 0
    assert len(read(SNAPSHOTS, snapshots, asked.store)) > 0
    assert storey.whole("rooms").table == "rooms" and storey.whole("walls").table == "walls"
    sizes = [(r.polygon.area, len(r.polygon.exterior.coords) - 1) for r in storey.truth.rooms]
    sizes += [(0.0, 2.0)] * len(storey.truth.doors)
    labels = np.repeat([0, 1], [len(storey.truth.rooms), len(storey.truth.doors)])
    group = f"{storey.truth.building}/{storey.truth.storey}"
    return Examples(np.array(sizes, float), labels, np.full(len(labels), group))


LEARNER = Learner(FEATURES, CLASSES, ForestParams(trees=4, seed=3), of_truth, nothing_more)


@pytest.fixture(scope="module")
def folder(prefect_server, tmp_path_factory):
    folder = tmp_path_factory.mktemp("training")
    with pytest.MonkeyPatch.context() as patched:
        patched.setenv("PREFECT_API_URL", prefect_server)
        patched.setattr("flows.training.furnished_storeys", lambda: (tiny(1), tiny(2)))
        patched.setattr("flows.training.LEARNERS", {"doors": LEARNER})
        yield folder


def train(folder, name, *more):
    # snapshots of so few points would be rejected as incomplete
    every_scan = ("--set", "quality.t_q=1", "--set", "energy.t_q=1")
    asked = ("--work", folder / "work", "--out", folder / name, "--jobs", "1")
    return mapsense("train", "doors", *asked, *every_scan, *more)


@pytest.fixture(scope="module")
def trained(folder):
    code, out, err = train(folder, "forest.parquet", "--json")
    assert (code, err) == (0, "")
    return json.loads(out)


def stage_outcomes(folder):
    """Return how often stages were computed and cached in all runs of the work's store."""
    from storage.catalog import run_query

    rows = run_query(
        folder / "work" / "store",
        "select outcome, count(*) as n from stages group by all",
    ).to_pylist()
    return {row["outcome"]: row["n"] for row in rows}


def test_the_forest_names_what_it_was_trained_on(folder, trained):
    forest = read_forest(folder / "forest.parquet", FEATURES, CLASSES)
    made = forest.provenance
    assert len(forest) == trained["trees"] == 4
    assert made.simulated and trained["simulated"]
    assert made.parameters["seed"] == 3
    assert set(made.versions) == {"scikit-learn", "numpy"}
    assert len(made.training["simulation_code"]) == 64
    assert [(s.building, s.storey) for s in made.storeys] == [("tiny1", "1"), ("tiny2", "1")]
    assert [s.digest for s in made.storeys] == [plan_digest(tiny(i).plan()) for i in (1, 2)]
    assert set(made.examples) == {"tiny1/1", "tiny2/1"}
    assert made.training["storeys"]["tiny2/1"]["storey"] == {"seed": 9002}
    assert made.training["storeys"]["tiny2/1"]["campaign"]["sensor"] == {"rays": 3000}
    assert made.training["stages"] == {"quality": {"t_q": 1.0}, "energy": {"t_q": 1.0}}


def test_figures_are_of_storeys_held_back(folder, trained):
    scores = open_forest(folder / "forest.parquet").provenance.scores
    assert set(scores) == {"forest", "svm"}
    doors = sum(len(tiny(i).plan().doors) for i in (1, 2))
    for room, door in scores.values():
        assert (room.examples, door.examples) == (18, doors)
        assert (door.precision, door.recall) == (1.0, 1.0)  # no room has two corners
    rows = [(row["classifier"], row["class"], row["right"]) for row in trained["scores"]]
    assert ("forest", "door", doors) in rows and len(rows) == 4


def test_training_again_simulates_and_computes_nothing_and_makes_the_same_bytes(folder, trained):
    scans = {p: p.stat().st_mtime_ns for p in (folder / "work" / "campaigns").rglob("*.parquet")}
    before = stage_outcomes(folder)
    code, out, err = train(folder, "again.parquet")
    assert (code, err) == (0, "")
    assert "4 trees of" in out and "simulated" in out
    assert (folder / "again.parquet").read_bytes() == (folder / "forest.parquet").read_bytes()
    assert scans and {p: p.stat().st_mtime_ns for p in scans} == scans
    after = stage_outcomes(folder)
    assert after["computed"] == before["computed"] and after["cached"] > before.get("cached", 0)


def test_a_storey_that_was_trained_on_is_not_scored(folder, trained):
    from flows.disjoint import ScoredStorey
    from flows.experiment import ExperimentRequest, run_experiment
    from flows.params import MapSenseParams

    renamed = replace(tiny(1).plan(), building="library", storey="7")
    write_plan(renamed, folder / "truth.geojson")
    scored = ScoredStorey(
        building="library", storey="7", scans=(str(folder),), truth=str(folder / "truth.geojson")
    )
    request = ExperimentRequest(
        name="unfair",
        store=str(folder / "unfair"),
        storeys=(scored,),
        variants={"default": MapSenseParams()},
        seeds=(0,),
    )
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("flows.experiment.used", lambda: [folder / "forest.parquet"])
        with pytest.raises(InputError, match="has the rooms of 'tiny1/1', learnt from by"):
            run_experiment(request)
        assert not (folder / "unfair").exists()  # nothing was computed
        check_disjoint([(scored, [])])


def test_too_few_examples_write_no_file(folder, trained):
    nothing = replace(LEARNER, classes=(*CLASSES, "window"))
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("flows.training.LEARNERS", {"doors": nothing})
        code, out, err = train(folder, "none.parquet")
    assert (code, out) == (1, "")
    assert "no example of class 'window' was found on 2 storeys; nothing is written" in err
    assert not (folder / "none.parquet").exists()


def test_what_another_simulation_made_is_not_taken(folder, trained):
    from flows.training_storeys import scanned

    one = tiny(1)
    same = scanned(one, folder / "work", print)
    assert (same / "campaign.json").exists()
    other = replace(one, scans_per_room=0.0)
    assert scanned(other, folder / "work", print) != same


def test_a_storey_that_cannot_be_mapped_is_named(folder):
    unusable = replace(tiny(1), building="empty", scans_per_room=0.0)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("flows.training.furnished_storeys", lambda: (unusable,))
        code, _, err = train(folder, "empty.parquet")
    assert code == 1 and "training storey empty/1" in err


def test_what_cannot_be_trained_is_refused(folder):
    code, _, err = mapsense("train", "ceilings")
    assert code == 1 and "doors" in err and "furniture" in err
    (folder / "file").write_text("")
    code, _, err = train(folder, "file/forest.parquet")
    assert code == 1 and "cannot be written" in err and "--out" in err


def test_a_forest_as_an_input_of_a_stage_is_known_by_its_bytes(folder, trained):
    source = forest_source(folder / "forest.parquet")
    assert source.name == "forest" and len(source.sha256) == 64
    assert source.size_bytes == (folder / "forest.parquet").stat().st_size
    (folder / "text.parquet").write_text("no forest")
    with pytest.raises(MapSenseError, match="is no sound forest"):
        forest_source(folder / "text.parquet")
