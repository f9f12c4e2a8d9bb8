"""A storey mapped with a grammar, by the command line; grammars learnt, shown and checked."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from grammars.reading import read_grammar
from storage.catalog import run_query
from storage.plan_geojson import read_plan, to_geojson, write_plan
from storage.points import PointCloud
from storage.snapshots import none
from tasks.scans.bundle import write_bundle
from tasks.simulation.layouts.double_loaded import DoubleLoadedParams
from tasks.simulation.mesh import storey_mesh
from tasks.simulation.plan import StoreyParams, make_storey
from tests.flows.command import mapsense

OBJECTS = {
    *("wall_images", "opening_candidates", "openings"),
    *("furniture_segments", "furniture"),
}
"""The stages that look into the final plan."""
LAYOUT = {"observations", "layout", "sightings", "layout_rooms", "layout_walls"}


def storey(name, seed):
    """Return a storey of one building: the same corridor, other rooms along it."""
    params = StoreyParams(
        seed=seed,
        layout="double_loaded",
        double_loaded=DoubleLoadedParams(modules=8),
    )
    return replace(make_storey(params, "hut", name), furniture=())


def sampled(plan, n):
    """Return points spread evenly over a storey's surfaces."""
    mesh = storey_mesh(plan)
    rng = np.random.default_rng(0)
    corners = mesh.vertices[mesh.triangles]
    edges = corners[:, 1:] - corners[:, :1]
    areas = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    chosen = rng.choice(len(areas), n, p=areas / areas.sum())
    uv = rng.random((n, 2, 1))
    uv = np.where(uv.sum(axis=1, keepdims=True) > 1, 1 - uv, uv)
    points = corners[chosen, 0] + (uv * edges[chosen]).sum(axis=1)
    return PointCloud((points + rng.normal(0, 0.005, (n, 3))).astype(np.float32), np.zeros(3))


@pytest.fixture(scope="module")
def folder(prefect_server, tmp_path_factory):
    """A folder with a scan of storey 1, its truth, and a grammar of storey 2."""
    folder = tmp_path_factory.mktemp("grammar")
    truth = storey("1", 5)
    write_plan(truth, folder / "truth.geojson")
    write_plan(storey("2", 6), folder / "other.geojson")
    write_bundle(folder / "a.scan", sampled(truth, 400_000), none())
    with pytest.MonkeyPatch.context() as patched:
        patched.setenv("PREFECT_API_URL", prefect_server)
        patched.chdir(folder)
        learnt = mapsense("grammar", "learn", "other.geojson", "--out", "hut.toml")
        assert learnt[0] == 0, learnt[2]
        yield folder


def mapped(folder, *flags):
    """Map the scan; return the exit code, the summary and what was told."""
    place = ("--building", "hut", "--storey", "1", "--store", "store", "--out", "out")
    code, out, err = mapsense("map", "a.scan", *place, *flags, "--json")
    return code, json.loads(out) if out else None, err


@pytest.fixture(scope="module")
def corrected(folder):
    """The summary of the storey mapped with the grammar, and both of its plans."""
    code, summary, err = mapped(folder, "--grammar", "hut.toml")
    assert code == 0, err
    return (
        summary,
        read_plan(folder / "out/initial.geojson"),
        read_plan(folder / "out/plan.geojson"),
    )


def test_the_final_plan_says_class_rule_and_posterior(folder, corrected):
    summary, initial, final = corrected
    rules = {rule.id for rule in read_grammar(folder / "hut.toml").rules}
    explained = [room for room in final.rooms if room.rule is not None]
    assert len(explained) >= len(read_plan(folder / "truth.geojson").rooms) // 2
    assert all(room.rule in rules and room.class_ and room.posterior > 0 for room in explained)
    assert all(room.class_ is None for room in initial.rooms)
    assert Path(summary["used"]["grammar"]).name == "hut.toml"
    assert set(summary["found"]["rows"]) >= LAYOUT
    assert {r for wall in final.walls for r in wall.rooms} <= {room.id for room in final.rooms}


def test_rooms_are_no_worse_than_the_initial_ones(folder, corrected):
    _, initial, final = corrected
    truth = read_plan(folder / "truth.geojson")

    def worst(plan):
        """Return the sum of what each true room lacks in the room it shares most with."""
        return sum(
            1
            - max(
                r.polygon.intersection(t.polygon).area / r.polygon.union(t.polygon).area
                for r in plan.rooms
            )
            for t in truth.rooms
        )

    assert worst(final) <= worst(initial) + 1e-6


def test_another_grammar_runs_only_what_hangs_on_it(folder, corrected):
    code, summary, err = mapped(folder, "--grammar", "office")
    assert code == 0, err
    computed = {name for name, cost in summary["stages"].items() if cost["computed"]}
    assert "observations" in computed
    assert computed <= LAYOUT | OBJECTS


def test_without_a_grammar_the_initial_model_is_the_final_one(folder, corrected):
    code, summary, err = mapped(folder)
    assert code == 0, err
    assert summary["used"]["grammar"] is None
    assert not LAYOUT & set(summary["stages"])
    initial, final = (read_plan(folder / "out" / f"{name}.geojson") for name in ("initial", "plan"))
    bare = replace(final, doors=(), windows=(), furniture=())
    assert to_geojson(initial) == to_geojson(bare)


def test_a_grammar_whose_lines_do_not_fit_leaves_the_initial_model_failure(folder, corrected):
    code, summary, _ = mapped(
        folder, "--grammar", "hospital", "--set", "extract.line.lines=grammar"
    )
    assert code == 1
    assert summary["state"] == "partial"
    assert "grammar hospital not applied" in summary["message"]
    assert read_plan(folder / "out/plan.geojson").rooms


@pytest.mark.parametrize("name", ["nowhere.toml", "a.scan/points.parquet"])
def test_what_is_no_grammar_is_said_before_anything_runs_failure(folder, name):
    code, _, err = mapped(folder, "--grammar", name)
    assert code == 1
    assert name.rsplit("/", 1)[-1] in err


def test_layout_tables_can_be_queried(folder, corrected):
    mapped(folder, "--grammar", "hut.toml")
    rows = run_query(folder / "store", "select rule, area_m2 from layout_rooms").to_pylist()
    final = read_plan(folder / "out/plan.geojson")
    assert sorted(row["area_m2"] for row in rows) == pytest.approx(
        sorted(room.polygon.area for room in final.rooms), abs=1e-3
    )
    told = run_query(folder / "store", "select count(*) as n from observations").to_pylist()
    assert told[0]["n"] > 0


def experiment(folder, grammar):
    """Score the storey with and without a grammar."""
    (folder / "experiment.toml").write_text(f"""
seeds = 1
[[storeys]]
building = "hut"
storey = "1"
scans = ["a.scan"]
truth = "truth.geojson"
[variants.default]
grammar = "{grammar}"
""")
    return mapsense("evaluate", "experiment.toml", "--store", "store", "--json")


def test_a_variant_has_the_grammar_of_its_building(folder, corrected):
    code, out, err = experiment(folder, "{building}.toml")
    assert code == 0, err
    assert {row["variant"] for row in json.loads(out)["variants"]} == {"default", "initial"}


def test_a_grammar_learnt_from_the_scored_storey_is_an_error_failure(folder):
    code, _, err = mapsense("grammar", "learn", "truth.geojson", "--out", "cheat.toml")
    assert code == 0, err
    code, out, err = experiment(folder, "cheat.toml")
    assert code == 1
    assert "truth.geojson" in err and "cheat.toml" in err and out == ""


def test_a_grammar_is_shown_drawn_and_checked(folder):
    code, out, err = mapsense("grammar", "show", "hut.toml", "--out", "drawn")
    assert code == 0, err
    assert all(rule.id in out for rule in read_grammar(folder / "hut.toml").rules)
    assert (folder / "drawn/hut.svg").stat().st_size > 0
    assert (folder / "drawn/hut.png").stat().st_size > 0
    code, out, err = mapsense("grammar", "check", "hut.toml", "office", "institute", "hospital")
    assert code == 0, err
    assert out.count("sound") == 4


def test_a_wrong_grammar_is_told_with_line_and_field_failure(folder):
    text = (folder / "hut.toml").read_text()
    (folder / "wrong.toml").write_text(text.replace("p_apriori", "p_apriory", 1))
    code, _, err = mapsense("grammar", "check", "wrong.toml")
    assert code == 1
    assert "wrong.toml" in err and "p_apriory" in err and "line" in err


def test_a_grammar_is_updated_by_a_plan_once(folder):
    write_plan(storey("3", 7), folder / "third.geojson")
    code, _, err = mapsense("grammar", "update", "hut.toml", "third.geojson", "-o", "more.toml")
    assert code == 0, err
    one, more = read_grammar(folder / "hut.toml"), read_grammar(folder / "more.toml")
    assert [origin.storey for origin in more.learnt_from] == ["2", "3"]
    assert more.evidence > one.evidence
    code, _, err = mapsense("grammar", "update", "more.toml", "third.geojson", "-o", "again.toml")
    assert code == 1
    assert not (folder / "again.toml").exists()
