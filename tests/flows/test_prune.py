"""The verb `prune` on a storey that was mapped by the real flow."""

import json
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from flows.params import MapSenseParams
from flows.request import StoreyRequest
from storage.catalog import run_query
from storage.points import PointCloud
from storage.runs import Run, recorded
from storage.snapshots import none
from tasks.scans.bundle import write_bundle
from tasks.simulation.clouds import furnished_room

TABLES = ("points", "planes", "segments", "rooms", "walls", "quality")


@pytest.fixture
def mapped(prefect_server, tmp_path):
    """Return what maps the storey and returns how many stages were computed."""
    from flows.storey import map_storey

    cloud = PointCloud(furnished_room(20_000, 1)[0], np.zeros(3))
    write_bundle(tmp_path / "a.scan", cloud, none())

    def run(**params):
        request = StoreyRequest(
            store=str(tmp_path / "mapsense-store"),
            building="hut",
            storey="0",
            scans=(str(tmp_path / "a.scan"),),
            params=MapSenseParams.model_validate(params),
        )
        assert map_storey(request, return_state=True).is_completed()
        stages = json.loads((request.folder() / "summary.json").read_text())["stages"]
        return sum(cost["computed"] for cost in stages.values())

    return run


def answers(store: Path) -> dict[str, str]:
    """Return what current tables show, as text: what is not a number equals itself."""
    return {t: str(run_query(store, f"select * from {t} order by all").to_pylist()) for t in TABLES}


def test_after_pruning_what_was_current_is_still_there_and_in_the_cache(mapped, mapsense, tmp_path):
    store = tmp_path / "mapsense-store"
    before = mapped(hough={"seed": 1})
    assert mapped(hough={"seed": 2}) < before
    shown = answers(store)
    held = {path for path in store.rglob("*.parquet") if ".catalog" not in path.parts}

    code, out, err = mapsense("prune", "--dry-run", "--json")
    would = json.loads(out)
    assert (code, err, would["dry_run"]) == (0, "", True)
    assert {p for p in held if p.exists()} == held
    code, out, _ = mapsense("prune", "--json")
    did = json.loads(out)
    assert (code, did["removed"], did["kept"]) == (0, would["removed"], would["kept"])
    gone = {path for path in held if not path.exists()}
    # planes and what follows from them; the first run's record stays: it computed the rest
    assert did["removed"]["artifacts"]["files"] == len(gone) > 0
    assert did["bytes"] > 0
    assert not any({"runs", "stages"} & set(path.parts) for path in gone)

    assert answers(store) == shown
    assert mapped(hough={"seed": 2}) == 0
    assert mapped(hough={"seed": 1}) > 0
    code, out, _ = mapsense("prune", "--keep-runs", "2")
    assert code == 0
    assert "MB removed; " in out and "are needed" in out


def test_a_storey_in_use_is_named_and_left(mapsense, tmp_path):
    run = Run("now", "map", "hut", "0", "{}", datetime.now(UTC))
    with recorded(str(tmp_path / "mapsense-store"), run):
        code, out, err = mapsense("prune", "--json")
    assert (code, json.loads(out)["in_use"]) == (0, ["hut/0"])
    assert err == "mapsense: hut/0: left as it is, a run goes on there\n"


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("--store", "nowhere"), "nowhere: there is no store"),
        (("--keep-runs", "0"), "--keep-runs 0: expected at least 1"),
        (("--older-than", "1e300"), "--older-than 1e+300: expected a number of days"),
        (("--older-than", "nan"), "--older-than nan: expected a number of days"),
        (("--building", "../hut"), "'../hut' is no usable name"),
    ],
)
def test_what_is_wrong_is_said_in_one_sentence(mapsense, tmp_path, arguments, sentence):
    (tmp_path / "mapsense-store").mkdir()
    code, out, err = mapsense("prune", *arguments)
    assert (code, out) == (1, "")
    assert err.startswith(f"mapsense: {sentence}") and err.count("\n") == 1


def test_help_shows_an_example(mapsense):
    code, out, _ = mapsense("prune", "--help")
    assert code == 0
    assert "mapsense prune --older-than 30 --dry-run" in out
