"""Named queries that compare runs, against numbers worked by hand."""

import json
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from scipy import stats

from storage import stages
from storage.artifacts import Place, write
from storage.catalog import run_query
from storage.detections import DETECTIONS, Detections
from storage.runs import Run, recorded
from storage.wall_quality import WALL_QUALITY, WallQuality

START = datetime(2026, 1, 1, tzinfo=UTC)
ROW = stages.StageRow(
    id="t", run="r", scan=None, stage="rooms", key="k", outcome="computed", wall_s=1.0, cpu_s=1.0,
    peak_memory_mb=None, rows_in=0, rows_out=0, points_in=0, points_out=0, error=None,
    started_at=START,
)  # fmt: skip


def rooms(found, errors=(), classes=()):
    """Return ten true rooms of 20 m2, of which the first `found` were found, each with an error."""
    errors = [*errors, *[0.0] * (found - len(errors))]
    classes = [*classes, *["office"] * (found - len(classes))]
    ids = np.array([f"r{i}" for i in range(10)])
    hits = np.arange(10) < found
    parts = {
        "simulated": np.full(10, True),
        "classes": np.full(10, "room"),
        "metrics": np.full(10, "iou"),
        "true_ids": ids,
        "found_ids": np.where(hits, ids, ""),
        "values": np.where(hits, 0.9, np.nan),
        "true_classes": np.full(10, "office"),
        "found_classes": np.array([*classes, *[""] * (10 - found)]),
        "true_m2": np.full(10, 20.0),
        "found_m2": np.array([20.0 + e for e in errors] + [np.nan] * (10 - found)),
        "width_error_m": np.full(10, np.nan),
    }
    both = {name: np.concatenate([values, values]) for name, values in parts.items()}
    return Detections(thresholds=np.repeat([0.0, 0.5], 10), **both)


def walls(completeness):
    one = np.ones(1)
    return WallQuality(one > 0, one / 10, one, one, one * completeness, one, one / 50)


class Store:
    """A store that runs are put into, one after the other."""

    def __init__(self, path):
        self.path, self.count = path, 0

    def put(
        self, *values, seconds=1.0, outcome="computed", state="completed", verb="evaluate",
        params=None, **about,
    ):  # fmt: skip
        self.count += 1
        name = f"run{self.count:02}"
        place = Place(store=str(self.path), run=name, building="b", storey="0")
        asked = json.dumps({"params": params or {}})
        start = START + timedelta(hours=self.count)
        run = Run(name, verb, "b", "0", asked, start, **about)
        kinds = {Detections: DETECTIONS, WallQuality: WALL_QUALITY}
        with recorded(str(self.path), run) as record:
            outputs = tuple(write(kinds[type(value)], value, place).uri for value in values)
            row = replace(ROW, id=name, run=name, wall_s=seconds, outcome=outcome)
            stages.append(place, replace(row, outputs=outputs))
            record.end(state, "")
        stages.forget(place)
        return name

    def ask(self, sql):
        return run_query(self.path, sql).to_pylist()


@pytest.fixture
def store(tmp_path):
    return Store(tmp_path / "store")


def test_class_accuracy_is_of_the_rooms_found_with_its_interval_over_seeds(store):
    # 3 of 4, 4 of 5, 6 of 6
    for seed, (found, wrong) in enumerate([(4, ["lab"]), (5, [""]), (6, [])]):
        store.put(rooms(found, classes=wrong), variant="final", seed=seed)
    (row,) = store.ask("class_accuracy")
    values = [0.75, 0.8, 1.0]
    half = stats.t.ppf(0.975, 2) * np.std(values, ddof=1) / np.sqrt(3)
    assert (row["variant"], row["seeds"], row["n_rooms"]) == ("final", 3, 15)
    assert row["accuracy"] == pytest.approx(np.mean(values), abs=1e-4)
    assert row["accuracy_pm"] == pytest.approx(half, abs=2e-4)


def test_class_accuracy_of_one_seed_has_no_interval(store):
    store.put(rooms(4, classes=["lab"]))
    (row,) = store.ask("class_accuracy")
    assert (row["accuracy"], row["accuracy_pm"]) == (0.75, None)


def test_regressions_compare_the_last_two_runs_of_each_seed_worst_first(store):
    store.put(rooms(1), seconds=100.0, seed=0)  # too long ago to count
    first = store.put(rooms(8, [1.0]), walls(0.8), seconds=1.0, seed=0)
    store.put(rooms(10), seconds=2.0, seed=1)
    store.put(rooms(2), seed=0, state="failed")
    second = store.put(rooms(4, [2.0, 6.0]), walls(0.9), seconds=4.0, seed=0)
    last = store.put(rooms(10), seconds=2.0, seed=1)
    store.put(rooms(10), variant="alone", seed=0)
    answer = store.ask("regressions")
    rows = {(row["measure"], row["what"]): row for row in answer}
    assert len(rows) == len(answer) and {row["variant"] for row in answer} == {""}

    def numbers(measure, what):
        row = rows[measure, what]
        return row["seeds"], row["before"], row["after"], row["difference"], row["worse"]

    # means of seeds 0 and 1: (0.8 + 1) / 2 and (0.4 + 1) / 2
    assert numbers("recall", "room iou 0.5") == (2, 0.9, 0.7, -0.2, pytest.approx(2 / 9, abs=1e-4))
    assert numbers("precision", "room iou 0.5") == (2, 1.0, 1.0, 0.0, 0.0)
    f1 = [(16 / 18 + 1) / 2, (8 / 14 + 1) / 2]
    assert numbers("f1", "room iou 0.5")[1:3] == pytest.approx(f1, abs=1e-4)
    # seed 0: 1 / 8 to 8 / 4 m2; seed 1: 0
    before, after = 1 / 16, 1.0
    assert numbers("mean_error_m2", "room area") == pytest.approx(
        (2, before, after, after - before, (after - before) / after), abs=1e-4
    )
    assert numbers("worst_error_m2", "room area") == (
        2,
        0.5,
        3.0,
        2.5,
        pytest.approx(2.5 / 3, abs=1e-4),
    )
    assert numbers("completeness", "walls 0.1 m") == (
        1, 0.8, 0.9, 0.1, pytest.approx(-0.1 / 0.9, abs=1e-4)
    )  # fmt: skip
    assert numbers("seconds", "rooms") == (2, 1.5, 3.0, 1.5, 0.5)
    worse = [row["worse"] for row in answer if row["worse"] is not None]
    assert worse == sorted(worse, reverse=True)
    of_walls = rows["completeness", "walls 0.1 m"]
    assert (of_walls["run_before"], of_walls["run_after"]) == (first, second)
    assert rows["recall", "room iou 0.5"]["run_after"] == last


def test_seconds_regress_between_runs_that_computed_the_stage(store):
    store.put(rooms(10), seconds=1.0)
    store.put(rooms(10), seconds=3.0)
    store.put(rooms(10), seconds=0.001, outcome="cached")
    (row,) = (row for row in store.ask("regressions") if row["measure"] == "seconds")
    assert (row["before"], row["after"]) == (1.0, 3.0)


def params(gamma, eps=0.1, seed=0, **more):
    return {"hough": {"gamma_cell": gamma, "seed": seed}, "label": {"eps": eps}, **more}


def test_a_parameter_moves_what_runs_that_differ_in_it_alone_score(store):
    runs_of = [
        # recall of 10 rooms, gamma, eps, seed, set
        (4, 20, 0.1, 1, "a"), (6, 20, 0.1, 2, "a"),
        (8, 40, 0.1, 1, "b"), (10, 40, 0.1, 2, "b"), (2, 40, 0.1, 2, "b"),
        (5, 100, 0.3, 1, "c"),  # differs in two
        (7, 20, 0.3, 1, "d"),
    ]  # fmt: skip
    for found, gamma, eps, seed, name in runs_of:
        asked = params(gamma, eps, seed)
        store.put(rooms(found, [1.0] * found), seed=seed, parameters=name, params=asked)
    # more parameters: differs from all
    store.put(rooms(3), parameters="e", params=params(20, 0.1, other=1))
    # of the same parameters, but another plan, and no evaluation
    store.put(rooms(9), parameters="a", variant="initial", params=params(20))
    store.put(rooms(1), parameters="b", verb="map", params=params(40))
    answer = store.ask("select * from parameter_effect where threshold = 0.5")
    groups = {}
    for row in answer:
        assert (row["plan"], row["class"], row["mean_error_m2"]) == ("final", "room", 1.0)
        key = row["parameter"], row["others"]
        groups.setdefault(key, []).append((row["value"], row["runs"], row["f1"]))

    def f1(*founds):
        return pytest.approx(np.mean([2 * n / (10 + n) for n in founds]), abs=1e-4)

    assert sorted((name, rows) for (name, _), rows in groups.items()) == [
        # of sets b's seed 2 the last; 100 comes after 20
        ("hough.gamma_cell", [("20", 1, f1(7)), ("100", 1, f1(5))]),
        ("hough.gamma_cell", [("20", 2, f1(4, 6)), ("40", 2, f1(8, 2))]),
        ("label.eps", [("0.1", 2, f1(4, 6)), ("0.3", 1, f1(7))]),
    ]


def test_without_two_values_no_parameter_moves_anything(store):
    for seed in range(3):
        store.put(rooms(4 + seed), seed=seed, parameters="a", params=params(20, seed=seed))
    assert store.ask("parameter_effect") == []
