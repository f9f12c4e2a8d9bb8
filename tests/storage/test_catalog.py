"""SQL over a store."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from storage import stages
from storage.artifacts import Place, write
from storage.catalog import Catalog, QueryError, named_queries, run_query
from storage.points import POINTS, PointCloud
from storage.runs import Run, goes_on, last_runs, read_runs, recorded

START = datetime(2026, 1, 1, tzinfo=UTC)
ROW = stages.StageRow(
    id="t",
    run="r",
    scan="s",
    stage="planes",
    key="k",
    outcome="computed",
    wall_s=2.0,
    cpu_s=1.0,
    peak_memory_mb=100.0,
    rows_in=0,
    rows_out=0,
    points_in=0,
    points_out=0,
    error=None,
    started_at=START,
)


@pytest.fixture
def store(tmp_path):
    # a folder that looks like a partition must not become a column
    return tmp_path / "city=x" / "store"


def add_run(store: Path, number: int, state: str, points: int, storey: str = "0") -> None:
    """Record a run that made one cloud of one scan."""
    name = f"{store.name}-{storey}-{number}"
    place = Place(store=str(store), run=name, building="b", storey=storey, scan="s")
    run = Run(name, "map", "b", storey, "{}", START + timedelta(hours=number))
    with recorded(str(store), run) as record:
        cloud = PointCloud(np.full((points, 3), number, np.float32), np.zeros(3))
        ref = write(POINTS, cloud, place)
        stages.append(place, replace(ROW, id=name, run=name, points_in=points, outputs=(ref.uri,)))
        record.end(state, "")


def test_an_empty_store_has_every_view_with_its_columns(store):
    catalog = Catalog(store)
    for view in ("points", "points_all", "planes", "rooms", "walls", "scans", "coverage"):
        answer = catalog.query(f"select * from {view}")
        assert answer.num_rows == 0
        assert answer.column_names[:3] == ["building", "storey", "scan"]
    assert "outcome" in catalog.query("select * from stages").column_names
    assert "state" in catalog.query("select * from runs").column_names


@pytest.mark.parametrize("query", [query.name for query in named_queries()])
def test_named_queries_answer_over_an_empty_and_a_filled_store(store, query):
    assert run_query(store, query).num_rows == 0
    add_run(store, 1, "completed", 10)
    run_query(store, query)


def test_a_view_shows_the_last_successful_run_of_each_storey(store):
    add_run(store, 1, "completed", 10)
    add_run(store, 2, "partial", 20)
    add_run(store, 3, "failed", 30)
    add_run(store, 1, "completed", 5, storey="01")
    count = "select storey, count(*) as n from {} group by all order by all"
    assert run_query(store, count.format("points")).to_pylist() == [
        {"storey": "0", "n": 20},
        {"storey": "01", "n": 5},
    ]
    assert run_query(store, count.format("points_all")).to_pylist() == [
        {"storey": "0", "n": 60},
        {"storey": "01", "n": 5},
    ]


def test_time_against_points_finds_the_slope(store):
    for number, points in ((1, 1000), (2, 2000), (3, 4000)):
        name = str(number)
        place = Place(store=str(store), run=name, building="b", storey="0")
        row = replace(ROW, id=name, run=name, points_in=points, wall_s=0.5 + points * 2e-6)
        stages.append(place, row)
    (line,) = run_query(store, "time_against_points").to_pylist()
    assert (line["runs"], line["fewest_points"], line["most_points"]) == (3, 1000, 4000)
    assert line["slope_s_per_million_points"] == pytest.approx(2.0)
    assert line["intercept_s"] == pytest.approx(0.5)


def test_a_foreign_or_broken_file_is_named_and_left_out(store, caplog):
    add_run(store, 1, "completed", 10)
    folder = store / "points" / "building=b" / "storey=0" / "scan=s"
    (folder / "broken.parquet").write_bytes(b"no Parquet")
    pq.write_table(pa.table({"x": [1]}), folder / "foreign.parquet")
    catalog = Catalog(store)
    assert catalog.query("select count(*) as n from points_all").to_pylist() == [{"n": 10}]
    broken, foreign = catalog.problems
    assert "broken.parquet: cannot be read as Parquet" in broken
    assert "foreign.parquet: was not written by us; left out" in foreign
    run_query(store, "select count(*) from points_all")
    assert [record.message for record in caplog.records] == catalog.problems


def test_parameters_are_bound_by_name(store):
    add_run(store, 1, "completed", 10)
    sql = "select count(*) as n from points where scan = $scan"
    assert run_query(store, sql, {"scan": "s"}).to_pylist() == [{"n": 10}]
    assert run_query(store, sql, {"scan": "other"}).to_pylist() == [{"n": 0}]


@pytest.mark.parametrize(
    "sql",
    [
        "copy (select 1) to '{store}/x.csv'",
        "attach '{store}/x.db' as x",
        "select * from read_parquet('{store}/**/*.parquet')",
        "select * from read_text('/etc/hostname')",
        "set enable_external_access = true",
        "install httpfs",
    ],
)
def test_sql_reaches_no_file(store, sql):
    add_run(store, 1, "completed", 10)
    before = sorted(store.rglob("*"))
    with pytest.raises(QueryError, match="the query failed"):
        run_query(store, sql.format(store=store))
    assert sorted(store.rglob("*")) == before


def test_a_query_that_cannot_be_answered_says_why(store):
    with pytest.raises(
        QueryError, match="'stage_tims' is no named query; there are area_error, cache_hits"
    ):
        run_query(store, "stage_tims")
    with pytest.raises(QueryError, match="Parser Error"):
        run_query(store, "selec 1")


def test_each_named_query_says_what_it_answers():
    for query in named_queries():
        assert query.about, query.name
        assert query.sql.startswith("-- "), query.name


def test_rows_of_a_run_are_one_file_and_come_back(store):
    place = Place(store=str(store), run="many", building="b", storey="0")
    rows = [replace(ROW, id=str(i), run="many", outputs=("a", "b")) for i in range(5)]
    for row in rows:
        stages.append(place, row)
    assert len(list(store.rglob("*.parquet"))) == 1
    assert stages.of_run(place) == rows


def test_a_run_is_recorded_from_start_to_end(store):
    run = Run("r1", "map", "b", "0", '{"scans": ["x"]}', START)
    with recorded(str(store), run) as record:
        (now,) = read_runs(store)
        assert (now.state, now.ended_at) == ("running", None)
        assert goes_on(str(store), now)
        record.end("completed", "fine")
    (now,) = read_runs(store)
    assert (now.state, now.message, now.request()) == ("completed", "fine", {"scans": ["x"]})
    assert now.ended_at is not None
    assert not goes_on(str(store), now)


def test_a_run_that_raises_is_recorded_as_failed(store):
    run = Run("r1", "map", "b", "0", "{}", START)
    with pytest.raises(ValueError, match="bad"), recorded(str(store), run):
        raise ValueError("bad\nthings")
    (now,) = read_runs(store)
    assert (now.state, now.message) == ("failed", "ValueError: bad")


def test_last_runs_are_one_per_storey(store):
    for number in (1, 2):
        add_run(store, number, "completed", number)
    add_run(store, 1, "failed", 1, storey="1")
    assert [(run.storey, run.state) for run in last_runs(read_runs(store))] == [
        ("0", "completed"),
        ("1", "failed"),
    ]
    assert [run.storey for run in read_runs(store, "b", "1")] == ["1"]
