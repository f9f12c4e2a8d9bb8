"""The tables of the device side come back as they were, and the named queries over them answer."""

from dataclasses import fields, replace
from datetime import UTC, datetime

import numpy as np
import pyarrow.parquet as pq
import pytest

from storage import artifacts, stages
from storage.artifacts import Place, kind_of, write
from storage.catalog import run_query
from storage.energy import Energy
from storage.energy_sweep import EnergySweep
from storage.energy_targets import EnergyTargets
from storage.quality import Quality
from storage.runs import Run, recorded
from storage.savings import Savings
from storage.scan_work import ScanWork

ACCEPTED = Quality(90, 9, 0.1, 0.2, 0.6, 0.28, 0.5, True, "")
REJECTED = Quality(80, 60, 0.75, 0.4, 1.0, 0.85, 0.5, False, "incomplete")
NOT_ASSESSED = Quality(0, 0, None, None, None, None, 0.5, None, "not assessed")
TEXTS = {
    "storeys", "rooms", "scans", "volunteers", "series", "methods", "baselines", "first", "second",
    "levers",
}  # fmt: skip
WHOLE = {
    "raw_points", "voxel_points", "snapshots", "bytes_raw", "bytes_mapsense", "bytes_gramap",
    "n_queries", "seeds", "captures", "rejected", "uploads", "unanswered", "n_seeds",
}  # fmt: skip
NULLABLE = {
    "p_sum", "skills", "low", "high", "second_values", "needed", "savings", "best_values",
    "best_savings",
}  # fmt: skip
NOT_MEASURED = (Energy, Savings, EnergySweep, EnergyTargets)


def columns(type_, n):
    """Return n rows of anything; the last is null where it may be."""
    rng = np.random.default_rng(n)
    whole = WHOLE - {"unanswered"} if type_ is Savings else WHOLE
    values = {}
    for field in fields(type_):
        if field.name in TEXTS:
            values[field.name] = np.array([f"Höhe {i}" for i in range(n)], np.str_)
        elif field.name in whole:
            values[field.name] = rng.integers(0, 2**40, n)
        elif field.name == "usable":
            values[field.name] = rng.random(n) > 0.5
        else:
            values[field.name] = rng.random(n)
            if field.name in NULLABLE and n:
                values[field.name][-1] = np.nan
    return type_(**values)


TABLES = {
    f"{type_.__name__} of {n}": columns(type_, n)
    for type_ in (ScanWork, *NOT_MEASURED)
    for n in (0, 1, 4)
}
VALUES = {"accepted": ACCEPTED, "rejected": REJECTED, "not assessed": NOT_ASSESSED} | TABLES


def assert_same(found, value):
    assert type(found) is type(value)
    for field in fields(value):
        one, other = getattr(found, field.name), getattr(value, field.name)
        if isinstance(other, np.ndarray):
            np.testing.assert_array_equal(one, other, strict=True)
        else:
            assert one == other and type(one) is type(other), field.name


@pytest.mark.parametrize("value", VALUES.values(), ids=VALUES)
def test_a_value_comes_back_from_its_file_and_its_columns_say_what_they_hold(value, tmp_path):
    kind = kind_of(type(value))
    place = Place(store=str(tmp_path), run="r", building="b", storey="0")
    ref = write(kind, value, place)
    assert_same(artifacts.read(kind, ref, tmp_path), value)
    assert write(kind, value, place).sha256 == ref.sha256
    table = kind.to_table(value)
    assert table.schema.equals(kind.schema)
    for field in table.schema:
        assert field.metadata[b"about"], field.name
        assert field.nullable or table[field.name].null_count == 0, field.name


@pytest.mark.parametrize("value", TABLES.values(), ids=TABLES)
def test_what_is_not_known_is_null_not_nan(value):
    table = kind_of(type(value)).to_table(value)
    nulls = {name for name in table.column_names if table[name].null_count}
    nullable = {field.name for field in table.schema if field.nullable}
    assert nulls == (nullable if len(value) else set())


@pytest.mark.parametrize("type_", NOT_MEASURED)
def test_a_table_of_joules_says_that_they_are_simulated(type_, tmp_path):
    kind = kind_of(type_)
    ref = write(
        kind, columns(type_, 3), Place(store=str(tmp_path), run="r", building="b", storey="0")
    )
    assert pq.read_schema(tmp_path / ref.uri).metadata[b"mapsense.origin"] == b"simulated"


@pytest.fixture
def filled(tmp_path):
    """Return a function that puts values into a store as one run over storey 0 made them."""
    start = datetime(2026, 1, 1, tzinfo=UTC)

    def fill(values):
        place = Place(store=str(tmp_path), run="r", building="b", storey="0")
        with recorded(str(tmp_path), Run("r", "campaign", "b", "0", "{}", start)) as record:
            for i, (scan, value) in enumerate(values):
                there = place.of_scan(scan) if scan else place
                ref = write(kind_of(type(value)), value, there)
                row = stages.StageRow(
                    id=str(i), run="r", scan=scan, stage="s", key="k", outcome="computed",
                    wall_s=1.0, cpu_s=1.0, peak_memory_mb=None, rows_in=0, rows_out=ref.rows,
                    points_in=0, points_out=0, error=None, started_at=start, outputs=(ref.uri,),
                )  # fmt: skip
                stages.append(place, row)
            record.end("completed", "")
        return tmp_path

    return fill


def work(scans, usable, volunteers):
    made = columns(ScanWork, len(scans))
    return replace(
        made,
        storeys=np.array(["0"] * len(scans)),
        scans=np.array(scans),
        volunteers=np.array(volunteers),
        usable=np.array(usable),
    )


SCANS = [
    ("s1", ACCEPTED),
    ("s2", replace(ACCEPTED, p_sum=0.4)),
    ("s3", REJECTED),
    ("s4", NOT_ASSESSED),
]


def test_quality_lists_every_scan_with_its_reason(filled):
    rows = run_query(filled(SCANS), "quality").to_pylist()
    assert [(r["scan"], r["accepted"], r["reason"]) for r in rows] == [
        ("s4", None, "not assessed"),
        ("s3", False, "incomplete"),
        ("s2", True, ""),
        ("s1", True, ""),
    ]


def test_quality_by_volunteer_counts_what_the_gate_got_wrong(filled):
    usable = [True, False, True, False]
    store = filled([*SCANS, (None, work(["s1", "s2", "s3", "s4"], usable, ["ann", "bo"] * 2))])
    ann, bo = run_query(store, "quality_by_volunteer").to_pylist()
    assert [ann[k] for k in ("volunteer", "scans", "assessed", "accepted")] == ["ann", 2, 2, 1]
    assert [ann[k] for k in ("accepted_percent", "p_sum")] == pytest.approx([50, (0.28 + 0.85) / 2])
    assert [ann[k] for k in ("usable", "usable_rejected", "unusable_accepted")] == [2, 1, 0]
    assert [bo[k] for k in ("volunteer", "scans", "assessed", "accepted")] == ["bo", 2, 1, 1]
    assert [bo[k] for k in ("usable", "usable_rejected", "unusable_accepted")] == [0, 0, 1]


def test_quality_by_volunteer_answers_where_nobody_says_who_scanned(filled):
    (row,) = run_query(filled(SCANS), "quality_by_volunteer").to_pylist()
    assert (row["volunteer"], row["scans"], row["assessed"], row["accepted"]) == (None, 4, 3, 2)


def test_the_gate_curve_is_over_assessed_scans_and_ends_where_all_are_accepted(filled):
    usable = [True, False, False, False]
    store = filled([*SCANS, (None, work(["s1", "s2", "s3", "s4"], usable, ["ann"] * 4))])
    curve = {round(row["t_q"], 2): row for row in run_query(store, "gate_curve").to_pylist()}
    assert len(curve) == 21
    # P_sum is 0.28, 0.4 and 0.85: of no use are the latter two
    expected = {  # accepted, percent of no use among the rejected, the accepted, and caught
        0.0: (0, pytest.approx(66.7), None, 100),
        0.3: (1, 100, 0, 100),
        0.4: (2, 100, 50, 50),
        1.0: (3, None, pytest.approx(66.7), 0),
    }
    names = (
        "accepted",
        "unusable_of_rejected_percent",
        "unusable_of_accepted_percent",
        "unusable_caught_percent",
    )
    for t_q, numbers in expected.items():
        assert curve[t_q]["assessed"] == 3
        assert tuple(curve[t_q][name] for name in names) == numbers


def energy(seeds=2):
    """Return 10 queries of one storey: the methods take 50, 100 and 200 J, a tenth more at each
    further seed."""
    methods = np.repeat(["MapSense", "GraMap", "No Processing"], seeds)
    joules = np.repeat([50.0, 100.0, 200.0], seeds) * (1 + np.tile(np.arange(seeds), 3) / 10)
    made = columns(Energy, len(methods))
    return replace(
        made,
        series=np.array(["storey"] * len(methods)),
        storeys=np.array(["0"] * len(methods)),
        methods=methods,
        seeds=np.tile(np.arange(seeds), 3),
        n_queries=np.full(len(methods), 10),
        unanswered=np.full(len(methods), 2),
        total_j=joules,
    )


def test_energy_per_method_is_the_mean_over_the_seeds(filled):
    rows = run_query(filled([(None, energy())]), "energy_per_method").to_pylist()
    found = {row["method"]: (row["seeds"], row["total_j"], row["j_per_answer"]) for row in rows}
    assert found == {
        "MapSense": (2, pytest.approx(52.5), pytest.approx(52.5 / 8, abs=0.01)),
        "GraMap": (2, pytest.approx(105), pytest.approx(105 / 8, abs=0.01)),
        "No Processing": (2, pytest.approx(210), pytest.approx(210 / 8, abs=0.01)),
    }


def test_energy_savings_stand_beside_their_range_over_the_sweep(filled):
    saved = Savings(
        series=np.array(["queries", "storey"]),
        storeys=np.array(["0", "0"]),
        n_queries=np.array([40, 26]),
        baselines=np.array(["GraMap", "GraMap"]),
        n_seeds=np.array([10, 10]),
        savings=np.array([0.2, 0.21]),
        low=np.array([0.19, np.nan]),
        high=np.array([0.21, np.nan]),
        unanswered=np.array([0.0, 0.5]),
        baseline_unanswered=np.array([0.0, 0.0]),
    )
    swept = EnergySweep(
        storeys=np.array(["0"] * 3),
        baselines=np.array(["GraMap", "GraMap", "No Processing"]),
        first=np.array(["capture_w", "cpu_w", "cpu_w"]),
        first_values=np.array([1.0, 2.0, 2.0]),
        second=np.array(["cpu_w", "", ""]),
        second_values=np.array([4.0, np.nan, np.nan]),
        savings=np.array([-0.1, 0.4, 0.9]),
    )
    store = filled([(None, saved), (None, swept)])
    storey, queries = run_query(store, "energy_savings").to_pylist()
    assert (storey["saving_percent"], storey["low95_percent"]) == (21.0, None)
    assert (storey["sweep_least_percent"], storey["sweep_most_percent"]) == (-10.0, 40.0)
    assert (queries["saving_percent"], queries["low95_percent"]) == (20.0, 19.0)
    assert queries["sweep_least_percent"] is None
    sensitivity = run_query(store, "energy_sensitivity").to_pylist()
    assert {(row["baseline"], row["assumption"], row["least_percent"]) for row in sensitivity} == {
        ("GraMap", "capture_w x cpu_w", -10.0),
        ("GraMap", "cpu_w", 40.0),
        ("No Processing", "cpu_w", 90.0),
    }


def test_energy_targets_are_listed_with_what_reaches_them_first(filled):
    made = replace(
        columns(EnergyTargets, 2),
        storeys=np.array(["0", "0"]),
        baselines=np.array(["GraMap", "GraMap"]),
        levers=np.array(["cpu_w", "capture_w"]),
        needed=np.array([np.nan, 0.3]),
    )
    rows = run_query(filled([(None, made)]), "energy_targets").to_pylist()
    assert [(row["lever"], row["needed"]) for row in rows] == [("capture_w", 0.3), ("cpu_w", None)]
