"""Detections and wall measures as tables, and the queries over them."""

import re
from dataclasses import asdict, replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from scipy import stats
from shapely import box

from storage import stages
from storage.artifacts import Place, kind_of, write
from storage.catalog import run_query
from storage.detections import DETECTIONS
from storage.plan import Plan, PlanFurniture, PlanRoom
from storage.runs import Run, recorded
from storage.views import SETTINGS
from storage.wall_quality import WALL_QUALITY, WallQuality
from tasks.evaluation.detections import EvaluationParams, detect
from tasks.evaluation.scores import scores

START = datetime(2026, 1, 1, tzinfo=UTC)
TRUE = [box(4 * i, 0, 4 * i + 4, 5) for i in range(6)]


def storey(polygons, classes, furniture=()):
    named = enumerate(zip(polygons, classes, strict=True))
    rooms = tuple(PlanRoom(f"r{i}", polygon, class_) for i, (polygon, class_) in named)
    return Plan("b", "0", rooms, furniture=furniture)


CHAIR = PlanFurniture("s", box(1, 1, 1.5, 1.5), "chair", 0.0, 0.9)
TRUTH = storey(TRUE, ["office", "office", "lab", None, "office", "lab"], (CHAIR,))


def mapped(seed):
    """Return a plan with rooms lost and moved."""
    rng = np.random.default_rng(seed)
    kept = np.flatnonzero(rng.random(6) < 0.8)
    shift = rng.uniform(-2.5, 2.5, 6)
    polygons = [box(4 * i + shift[i], 0, 4 * i + 4, 5) for i in kept]
    classes = rng.choice(["office", "lab"], len(kept))
    return storey(polygons, [str(c) for c in classes], (CHAIR,) if seed % 2 else ())


def found(seed):
    return detect(mapped(seed), TRUTH, EvaluationParams())


def put(store, *values, kind=DETECTIONS, number=1, variant="", seed=None):
    """Store values as what one run made."""
    place = Place(store=str(store), run=f"run{number}", building="b", storey="0")
    start = START + timedelta(hours=number)
    run = Run(place.run, "evaluate", "b", "0", "{}", start, variant=variant, seed=seed)
    with recorded(str(store), run) as record:
        refs = tuple(write(kind, value, place).uri for value in values)
        row = stages.StageRow(
            id=f"{place.run}/1", run=place.run, scan=None, stage="detections", key="k",
            outcome="computed", wall_s=1.0, cpu_s=1.0, peak_memory_mb=1.0, rows_in=0, rows_out=0,
            points_in=0, points_out=0, error=None, started_at=START, outputs=refs,
        )  # fmt: skip
        stages.append(place, row)
        record.end("completed", "")


NO_DETECTIONS = detect(Plan("b", "0"), Plan("b", "0"), EvaluationParams())
QUALITY = WallQuality(
    simulated=np.array([True, False]),
    buffer_m=np.array([0.1, 0.05]),
    true_m=np.array([10.0, 0.0]),
    found_m=np.array([8.0, 8.0]),
    completeness=np.array([0.7, np.nan]),
    correctness=np.array([0.9, 0.0]),
    accuracy_m=np.array([0.02, np.nan]),
)
VALUES = {
    "detections": found(1),
    "no detections": NO_DETECTIONS,
    "wall quality": QUALITY,
}


@pytest.mark.parametrize("value", VALUES.values(), ids=VALUES.keys())
def test_what_is_stored_comes_back_and_every_column_says_what_it_holds(value):
    kind = kind_of(type(value))
    table = kind.to_table(value)
    assert table.schema.equals(kind.schema, check_metadata=True)
    for field in table.schema:
        assert field.metadata[b"about"], field.name
        assert field.nullable or table[field.name].null_count == 0, field.name
    back = kind.from_table(table)
    for name, column in asdict(value).items():
        np.testing.assert_array_equal(getattr(back, name), column, err_msg=name)
        assert getattr(back, name).dtype.kind == column.dtype.kind, name


def test_what_is_not_there_is_null():
    table = DETECTIONS.to_table(VALUES["detections"])
    rows = table.to_pylist()
    for row in rows:
        matched = row["true_id"] is not None and row["found_id"] is not None
        assert (row["value"] is not None) == matched
        assert row["width_error_m"] is None
    assert {row["true_class"] for row in rows if row["class"] == "room"} == {"office", "lab", None}
    assert "" not in {row["true_id"] for row in rows} | {row["found_id"] for row in rows}


def near(value):
    return None if value is None else pytest.approx(value, abs=1e-4)


@pytest.mark.parametrize("seed", range(4))
def test_the_query_gives_the_scores_of_one_plan(tmp_path, seed):
    detections = found(seed)
    put(tmp_path, detections, variant="final", seed=seed)
    answer = run_query(tmp_path, "recall_precision").to_pylist()
    rows = {(row["class"], row["metric"], row["threshold"]): row for row in answer}
    expected = scores(detections)
    assert len(rows) == len(answer) == len(expected)
    for s in expected:
        row = rows[s.class_, s.metric, s.threshold]
        assert (row["n_true"], row["n_found"], row["n_matched"]) == (
            s.n_true,
            s.n_found,
            s.n_matched,
        )
        assert row["precision"] == near(s.precision)
        assert row["recall"] == near(s.recall)
        assert row["f1"] == near(s.f1)
        assert row["mean_value"] == near(s.value)
        assert row["class_accuracy"] == near(s.class_accuracy)
        assert row["seeds"] == 1 and row["f1_pm"] is None
        assert row["variant"] == "final" and row["simulated"] is False


def test_over_seeds_the_query_gives_mean_and_confidence_interval(tmp_path):
    seeds = range(10)
    for seed in seeds:
        put(tmp_path, found(seed), number=seed, seed=seed)
    (row,) = (
        row
        for row in run_query(tmp_path, "recall_precision").to_pylist()
        if (row["class"], row["metric"], row["threshold"]) == ("room", "iou", 0.5)
    )
    each = [
        s
        for seed in seeds
        for s in scores(found(seed))
        if (s.class_, s.metric, s.threshold) == ("room", "iou", 0.5)
    ]
    assert row["seeds"] == 10
    assert row["n_matched"] == sum(s.n_matched for s in each)
    for name in ("precision", "recall", "f1"):
        values = [getattr(s, name) for s in each]
        low, high = stats.t.interval(0.95, 9, np.mean(values), stats.sem(values))
        assert row[name] == pytest.approx(np.mean(values), abs=1e-4)
        assert row[f"{name}_pm"] == pytest.approx((high - low) / 2, abs=2e-4)


def test_the_quantiles_of_intervals_are_those_of_student():
    (macro,) = (setting for setting in SETTINGS if "confidence95" in setting)
    listed = re.search(r"\[([\d.,\s]+)\]", macro)
    quantiles = [float(number) for number in listed[1].split(",")]
    assert quantiles == pytest.approx(stats.t.ppf(0.975, np.arange(1, 30)), abs=5.1e-4)


def test_area_error_compares_plans_of_one_storey(tmp_path):
    worse = storey([box(0, 0, 4, 4), box(4, 0, 5, 5)], ["office", "lab"])
    better = storey([box(0, 0, 4, 4.5), TRUE[1]], ["office", "lab"])
    named = {"initial": worse, "final": better}
    for number, (variant, plan) in enumerate(named.items()):
        put(tmp_path, detect(plan, TRUTH, EvaluationParams()), number=number, variant=variant)
    final, initial = run_query(tmp_path, "area_error").to_pylist()
    assert (initial["variant"], final["variant"]) == ("initial", "final")
    # errors 4 and 15 of 20 m2: the room found at an IoU of 1 / 4 counts
    assert (initial["n_true"], initial["n_found"], initial["n_matched"]) == (6, 2, 2)
    assert (initial["mean_m2"], initial["median_m2"], initial["worst_m2"]) == (9.5, 9.5, 15.0)
    assert initial["p95_m2"] == pytest.approx(np.quantile([4, 15], 0.95))
    assert initial["mean_percent"] == initial["area_percent"] == 47.5
    assert initial["mean_iou"] == pytest.approx((0.8 + 0.25) / 2)
    assert (final["mean_m2"], final["worst_m2"]) == (1.0, 2.0)


def test_nothing_found_has_no_area_error(tmp_path):
    put(tmp_path, detect(Plan("b", "0"), TRUTH, EvaluationParams()))
    (row,) = run_query(tmp_path, "area_error").to_pylist()
    assert (row["n_true"], row["n_matched"], row["mean_m2"], row["area_percent"]) == (
        6,
        0,
        None,
        None,
    )


def test_the_worst_rooms_are_those_of_all_runs_once_each(tmp_path):
    first = storey([box(0, 0, 4, 1), *TRUE[1:]], [None] * 6)
    put(tmp_path, detect(first, TRUTH, EvaluationParams()), number=1)
    # the same again, with another threshold
    again = EvaluationParams(corner_m=(0.3,))
    put(tmp_path, detect(first, TRUTH, again), number=2)
    lossy = storey(TRUE[:5], [None] * 5)
    put(tmp_path, detect(lossy, TRUTH, EvaluationParams()), number=3, seed=4)
    lost, small, *rest = run_query(tmp_path, "worst_rooms").to_pylist()
    assert (lost["room"], lost["seed"], lost["error_m2"], lost["found_m2"]) == ("r5", 4, 20.0, None)
    assert (small["room"], small["error_m2"], small["iou"]) == ("r0", 16.0, 0.2)
    assert len(rest) == 10 and {row["error_m2"] for row in rest} == {0.0}


def test_wall_quality_is_averaged_over_seeds(tmp_path):
    other = replace(QUALITY, completeness=np.array([0.9, np.nan]))
    for seed, quality in enumerate((QUALITY, other)):
        put(tmp_path, quality, kind=WALL_QUALITY, number=seed, variant="initial", seed=seed)
    narrow, wide = run_query(tmp_path, "wall_quality").to_pylist()
    assert (wide["variant"], wide["seeds"], wide["completeness"]) == ("initial", 2, 0.8)
    assert (narrow["buffer_m"], narrow["completeness"], narrow["correctness"]) == (0.05, None, 0)
