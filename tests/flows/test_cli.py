"""The command line: answers, exit codes and sentences."""

import json
import os
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from flows.params import parse_params
from flows.request import StoreyRequest
from flows.settings import load_settings
from storage.points import PointCloud
from storage.runs import Run, goes_on, read_runs, recorded
from storage.snapshots import none
from tasks.scans.bundle import write_bundle
from tasks.simulation.clouds import furnished_room

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def cloud():
    return PointCloud(furnished_room(30_000, 1)[0], np.zeros(3))


@pytest.fixture
def served(prefect_server, monkeypatch):
    monkeypatch.setenv("PREFECT_API_URL", prefect_server)


VERBS = (
    "map",
    "demo",
    "simulate",
    "energy",
    "train",
    "query",
    "status",
    "rerun",
    "deploy",
    "prune",
    "wall",
)


@pytest.mark.parametrize("verb", VERBS)
def test_help_shows_an_example(mapsense, verb):
    code, out, _ = mapsense(verb, "--help")
    assert code == 0
    assert f"mapsense {verb}" in out.partition("Usage:")[2].partition("\n")[2]


def test_help_answers_at_once():
    heavy = ["prefect", "open3d", "numpy", "pyarrow", "duckdb", "sklearn"]
    code = f"import sys, flows.cli; print(*set({heavy}) & set(sys.modules))"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == []


def test_map_query_status_and_rerun(mapsense, served, cloud, tmp_path):
    for name in ("a", "b"):
        write_bundle(tmp_path / "scans" / f"{name}.scan", cloud, none())
    broken = tmp_path / "scans" / "b.scan" / "points.parquet"
    whole = broken.read_bytes()
    broken.write_bytes(b"no Parquet")

    asked = ("map", "scans", "--building", "hut", "--storey", "0", "--set", "hough.gamma_cell=25")
    code, out, err = mapsense(*asked)
    assert code == 1
    assert "hut/0: 1 room, " in out
    assert "1 of 2 scans skipped: b: " in err

    code, out, _ = mapsense("status", "--json")
    (row,) = json.loads(out)
    assert (code, row["building"], row["state"]) == (0, "hut", "partial")

    code, out, _ = mapsense("query", "failures", "--format", "json")
    assert {row["stage"] for row in json.loads(out)} == {"(run)", "clouds"}

    broken.write_bytes(whole)
    code, out, _ = mapsense("rerun", "--json")
    (summary,) = json.loads(out)
    assert code == 0
    assert summary["state"] == "completed"
    assert summary["used"]["params"]["hough"]["gamma_cell"] == 25
    assert summary["stages"]["clouds"]["cached"] == 1

    code, out, _ = mapsense("rerun")
    assert (code, out) == (0, "nothing to run again: last runs: 1 completed\n")


def test_named_queries_are_listed_with_what_they_answer(mapsense):
    code, out, _ = mapsense("query")
    assert code == 0
    runs = ("stage_times", "time_against_points", "failures", "cache_hits", "slowest")
    campaigns = ("energy_savings", "gate_curve", "quality_by_volunteer")
    for name in (*runs, *campaigns):
        assert name in out


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("map", "x", "--building", "b", "--storey", "0", "--set", "hough.gama_cell=2"),
         "unknown setting 'hough.gama_cell': did you mean 'hough.gamma_cell'"),
        (("map", "x", "--building", "b", "--storey", "0", "--set", "hough.gamma_cell=-2"),
         "setting 'hough.gamma_cell' = -2: input should be greater than 0"),
        (("map", "x", "--building", "b", "--storey", "0", "--set", "gamma_cell"),
         "--set gamma_cell: expected STAGE.NAME=VALUE"),
        (("map", "x", "--building", "b", "--storey", "0", "--crop", "-1,2"),
         "--crop -1,2: expected xmin,ymin,zmin,xmax,ymax,zmax"),
        (("map", "x", "--building", "b", "--storey", "0", "--up", "-w"), "setting 'scans.up' ="),
        (("map", "x", "--building", "../b", "--storey", "0"), "'../b' is no usable name"),
        (("map", "--building", "b", "--storey", "0"), "no scan named"),
        (("map", "missing", "--building", "b", "--storey", "0"),
         "b/0: none of 1 scans could be used: "),
        (("map", "x", "--building", "b", "--storey", "0", "--set", "quality.t_q=1"),
         "settings: quality.t_q and energy.t_q differ: set both"),
        (("simulate", "--out", "c"), "name a plan (GeoJSON or IFC) to scan, or a --preset"),
        (("simulate", "p.ifc", "--preset", "ring", "--out", "c"), "and not both"),
        (("simulate", "--preset", "rng", "--out", "c"),
         "preset 'rng': there are paper, ring, wing"),
        (("simulate", "--preset", "ring", "--out", "c", "--set", "campaign.scans=9"),
         "--set campaign.scans: give it as --scans"),
        (("simulate", "--preset", "ring", "--out", "c", "--set", "campaign.skil=1"),
         "unknown setting 'campaign.skil': did you mean 'campaign.skill'"),
        (("simulate", "--preset", "ring", "--out", "c", "--scans", "0"),
         "--scans 0: expected at least 1"),
        (("simulate", "missing.geojson", "--out", "c"), "missing.geojson: cannot be read"),
        (("simulate", "missing.ifc", "--out", "c"), "missing.ifc: cannot be read"),
        (("energy", "nowhere"), "nowhere/campaign.json: cannot be read (No such file"),
        (("status", "--store", "nowhere"), "nowhere: there is no store"),
        (("nonsense",), "Unknown command"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_in_one_sentence(mapsense, served, arguments, sentence):
    code, out, err = mapsense(*arguments)
    assert code == 1
    assert out == ""
    assert sentence in err
    assert err.startswith("mapsense: ")
    assert err.count("\n") == 1


def test_a_store_that_cannot_be_written_is_said_before_any_work(mapsense, tmp_path):
    (tmp_path / "file").write_text("")
    code, _, err = mapsense(
        "map", "x", "--building", "b", "--storey", "0", "--store", tmp_path / "file" / "store"
    )
    assert code == 1
    assert "the store cannot be written (Not a directory)" in err


@pytest.mark.parametrize(
    ("variable", "file", "sentence"),
    [
        ("MAPSENSE_STOR", "", "environment MAPSENSE_STOR: unknown setting 'stor': did you mean"),
        (None, "stroe = 'x'", "mapsense.toml: unknown setting 'stroe': did you mean 'store'"),
        (None, "store = ", "is no TOML"),
        (None, "jobs = 0", "setting 'jobs' = 0: input should be greater than 0"),
    ],
)
def test_unknown_settings_are_errors(mapsense, monkeypatch, tmp_path, variable, file, sentence):
    if variable:
        monkeypatch.setenv(variable, "x")
    (tmp_path / "mapsense.toml").write_text(file)
    code, _, err = mapsense("status")
    assert code == 1
    assert sentence in err


def test_the_command_serves_prefect_by_itself(cloud, prefect_home, tmp_path):
    write_bundle(tmp_path / "a.scan", cloud, none())
    arguments = ["map", "a.scan", "--building", "hut", "--storey", "0", "--json"]
    environment = {k: v for k, v in os.environ.items() if k != "PREFECT_API_URL"}
    done = subprocess.run(
        [sys.executable, "-c", "from flows.cli import main; main()", *arguments],
        cwd=tmp_path,
        env=environment | {"PREFECT_HOME": str(prefect_home), "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["found"]["rooms"] == 1
    assert done.stderr == ""


def test_flags_win_over_the_environment_and_that_over_the_file(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mapsense.toml").write_text(
        "store = 'file'\njobs = 3\n[params.hough]\ngamma_cell = 1\nseed = 1\nmisses = 1\n"
    )
    monkeypatch.setenv("MAPSENSE_STORE", "environment")
    monkeypatch.setenv("MAPSENSE_PARAMS__HOUGH__GAMMA_CELL", "2")
    monkeypatch.setenv("MAPSENSE_PARAMS__HOUGH__SEED", "2")
    settings = load_settings(store=None, jobs=None, params={"hough": {"gamma_cell": 3}})
    assert (settings.store, settings.jobs) == (Path("environment"), 3)
    hough = parse_params(settings.params).hough
    assert (hough.gamma_cell, hough.seed, hough.misses) == (3, 2, 1)
    assert load_settings(store=Path("flag")).store == Path("flag")


def test_a_run_whose_process_died_is_shown_as_interrupted_and_run_again(
    mapsense, served, cloud, tmp_path
):
    write_bundle(tmp_path / "a.scan", cloud, none())
    request = StoreyRequest(
        store=str(tmp_path / "store"), building="hut", storey="0", scans=(str(tmp_path / "a.scan"),)
    )
    run = Run(request.run, "map", "hut", "0", request.model_dump_json(), datetime.now(UTC))
    with recorded(request.store, run):
        row = read_runs(request.store)[0]
        path = next((tmp_path / "store" / "runs").rglob("*.parquet"))
        as_it_went_on = path.read_bytes()
        assert goes_on(request.store, row)
    path.write_bytes(as_it_went_on)
    _, out, _ = mapsense("status", "--json", "--store", "store")
    assert json.loads(out)[0]["state"] == "interrupted"
    code, out, _ = mapsense("rerun", "--store", "store")
    assert code == 0
    assert "hut/0: 1 room, " in out


def test_a_run_tells_its_own_summary_though_another_of_the_storey_wrote_there_since(
    mapsense, served, cloud, tmp_path, monkeypatch
):
    from flows import storey

    write = storey.write_summary

    def overtaken(request, summary):
        write(request, summary)
        write(request, {"run": "another's"})

    monkeypatch.setattr(storey, "write_summary", overtaken)
    write_bundle(tmp_path / "a.scan", cloud, none())
    asked = ("a.scan", "--building", "hut", "--storey", "0", "--store", "store", "--json")
    code, out, _ = mapsense("map", *asked)
    summary = json.loads(out)
    assert (code, summary["state"], summary["found"]["rooms"]) == (0, "completed", 1)
    assert summary["stages"]["planes"]["computed"] == 1
