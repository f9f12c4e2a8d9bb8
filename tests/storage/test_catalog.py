"""SQL over a store."""

import json
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from storage import packs, stages
from storage.artifacts import Place, write
from storage.catalog import Catalog, QueryError, named_queries, run_query
from storage.energy import ENERGY, Energy
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


def add_run(
    store: Path, number: int, state: str, points: int, storey: str = "0", verb: str = "map", **about
) -> None:
    """Record a run that made one cloud of one scan."""
    name = f"{store.name}-{storey}-{number}"
    place = Place(store=str(store), run=name, building="b", storey=storey, scan="s")
    start = START + timedelta(hours=number)
    run = Run(name, verb, "b", storey, about.pop("asked", "{}"), start, **about)
    with recorded(str(store), run) as record:
        cloud = PointCloud(np.full((points, 3), points, np.float32), np.zeros(3))
        ref = write(POINTS, cloud, place)
        stages.append(place, replace(ROW, id=name, run=name, points_in=points, outputs=(ref.uri,)))
        record.end(state, "")


def test_an_empty_store_has_every_view_with_its_columns(store):
    catalog = Catalog(store)
    for view in ("points", "points_all", "planes", "rooms", "walls", "scans", "coverage"):
        answer = catalog.query(f"select * from {view}")
        assert answer.num_rows == 0
        of_run = ["run", "variant", "seed", "parameters"]
        assert answer.column_names[:7] == ["building", "storey", "scan", *of_run]
    assert catalog.query("select * from parameters").column_names == ["run", "name", "value"]
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


def test_each_variant_and_seed_has_a_current_run_and_evaluations_have_their_own(store):
    add_run(store, 1, "completed", 10)
    add_run(store, 2, "completed", 20, variant="fine", seed=1)
    add_run(store, 3, "completed", 30, variant="fine", seed=2)
    add_run(store, 4, "completed", 40, variant="fine", seed=2, parameters="abc")
    add_run(store, 5, "failed", 50, variant="fine", seed=1)
    add_run(store, 6, "completed", 60, verb="evaluate")
    rows = "select run, variant, seed, parameters, count(*) as n from {} group by all order by run"
    all_rows = [
        {"run": f"store-0-{number}", "variant": variant, "seed": seed, "parameters": p, "n": n}
        for number, variant, seed, p, n in [
            (1, "", None, "", 10),
            (2, "fine", 1, "", 20),
            (3, "fine", 2, "", 30),
            (4, "fine", 2, "abc", 40),
            (5, "fine", 1, "", 50),
            (6, "", None, "", 60),
        ]
    ]
    current = [all_rows[i] for i in (0, 1, 3, 5)]
    assert run_query(store, rows.format("points")).to_pylist() == current
    assert run_query(store, rows.format("points_all")).to_pylist() == all_rows


def test_an_artifact_shows_once_for_each_run_that_made_or_took_it(store):
    add_run(store, 1, "completed", 10, variant="a")
    add_run(store, 2, "completed", 10, variant="b")
    add_run(store, 3, "failed", 10, variant="c")
    assert len(list(store.glob("points/**/*.parquet"))) == 1
    place = Place(store=str(store), run="nobody", building="b", storey="0", scan="s")
    write(POINTS, PointCloud(np.ones((7, 3), np.float32), np.zeros(3)), place)
    rows = "select variant, count(*) as n from {} group by all order by all"
    current = [{"variant": "a", "n": 10}, {"variant": "b", "n": 10}]
    assert run_query(store, rows.format("points")).to_pylist() == current
    assert run_query(store, rows.format("points_all")).to_pylist() == [
        *current,
        {"variant": "c", "n": 10},
        {"variant": None, "n": 7},
    ]


def test_a_run_without_a_record_is_known_by_its_stages(store):
    add_run(store, 1, "completed", 10)
    for file in store.glob("runs/**/*.parquet"):
        file.unlink()
    rows = run_query(store, "select distinct run, variant, seed from points_all").to_pylist()
    assert rows == [{"run": "store-0-1", "variant": None, "seed": None}]
    assert run_query(store, "select * from points").num_rows == 0


def test_a_row_of_a_history_leads_to_no_file_but_the_tables(store, tmp_path):
    add_run(store, 1, "completed", 10)
    (file,) = store.glob("points/**/*.parquet")
    beside = tmp_path / "beside.parquet"
    beside.write_bytes(file.read_bytes())
    uris = ("points/../../../beside.parquet", str(beside), "rooms/x.parquet", "points/x.parquet")
    place = Place(store=str(store), run="store-0-1", building="b", storey="0")
    stages.append(place, replace(ROW, id="x", run="store-0-1", outputs=uris))
    assert run_query(store, "select count(*) as n from points").to_pylist() == [{"n": 10}]


def test_parameters_are_the_leaves_of_what_was_asked(store):
    asked = {
        "store": "s",
        "params": {
            "hough": {"gamma_cell": 20, "seed": None, "beta": [0.2, 5.0], "inner": {"on": True}},
            "name": 'the "best"',
            "none": {},
            "scans": [{"a": 1}],
        },
    }
    add_run(store, 1, "completed", 10, asked=json.dumps(asked))
    add_run(store, 1, "completed", 10, asked='{"params": {}}', storey="1")
    add_run(store, 1, "completed", 10, asked="no JSON", storey="2")
    rows = run_query(store, "select * from parameters order by name").to_pylist()
    expected = {
        "hough.gamma_cell": 20,
        "hough.seed": None,
        "hough.beta": [0.2, 5.0],
        "hough.inner.on": True,
        "name": 'the "best"',
        "none": {},
        "scans": [{"a": 1}],
    }
    assert {row["run"] for row in rows} == {"store-0-1"}
    assert [row["name"] for row in rows] == sorted(expected)
    assert {row["name"]: json.loads(row["value"]) for row in rows} == expected


def test_sql_builds_on_named_queries_but_a_thing_keeps_its_name(store):
    add_run(store, 1, "completed", 10)
    (row,) = run_query(store, "select outcome_count from (select computed as outcome_count "
                       "from cache_hits where storey = '0')").to_pylist()  # fmt: skip
    assert row == {"outcome_count": 1}
    assert "run" in run_query(store, "select * from quality").column_names
    assert "run" not in run_query(store, "quality").column_names


def test_what_a_table_has_itself_is_not_the_runs(store):
    place = Place(store=str(store), run="r", building="b", storey="0")
    n = 2
    whole = {name: np.arange(n) for name in ("captures", "rejected", "uploads", "unanswered")}
    joules = {f"{name}_j": np.ones(n) for name in ("capture", "process", "transmit", "total")}
    value = Energy(
        series=np.array(["queries"] * n),
        storeys=np.array(["7"] * n),
        methods=np.array(["MapSense"] * n),
        n_queries=np.arange(n),
        seeds=np.array([3, 4]),
        **whole,
        **joules,
    )
    with recorded(str(store), Run("r", "energy", "b", "0", "{}", START, seed=9)) as record:
        ref = write(ENERGY, value, place)
        stages.append(place, replace(ROW, run="r", scan=None, outputs=(ref.uri,)))
        record.end("completed", "")
    rows = run_query(store, "select run, storey, seed from energy order by seed").to_pylist()
    assert rows == [
        {"run": "r", "storey": "7", "seed": 3},
        {"run": "r", "storey": "7", "seed": 4},
    ]


def test_polygons_stay_well_known_binary(store):
    add_run(store, 1, "completed", 10)
    schema = run_query(store, "select geometry from rooms").schema
    assert schema.field("geometry").type == pa.binary()


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


COPY = "copy (select 1 as x) to '{}' (format parquet, use_tmp_file false)"
FORBIDDEN = {
    "copy": "copy (select 1) to '{store}/x.csv'",
    "copy over a packed file's pack": COPY.format("mapsense://{pack}"),
    "copy over a file": COPY.format("mapsense://{file}"),
    "copy over a file, by its path": COPY.format("{store}/{file}"),
    "copy within a query": f"with x as ({COPY.format('mapsense://{pack}')}) select * from x",
    "copy within a query, by path": f"with x as ({COPY.format('{store}/{file}')}) from x",
    "copy within text": "from query($$with x as ("
    + COPY.format("mapsense://{file}")
    + ") from x$$)",
    "copy explained": f"explain analyze {COPY.format('mapsense://{pack}')}",
    "text over a file": "copy (select 1) to 'mapsense://{file}' (format csv, use_tmp_file false)",
    "export": "export database '{store}'",
    "attach": "attach '{store}/x.db' as x",
    "read a path": "select * from read_parquet('{store}/{file}')",
    "read many": "select * from read_parquet('{store}/**/*.parquet')",
    "read many of ours": "select * from read_parquet('mapsense://**/*.parquet')",
    "read what was not asked for": "select * from read_text('mapsense://secret.txt')",
    "read beside": "select * from read_text('mapsense://../secret.txt')",
    "read text": "select * from read_text('/etc/hostname')",
    "read a folder": "select * from glob('{store}/*')",
    "read a URL": "select * from read_text('file:///etc/hostname')",
    "read our variables": "select * from named_queries_of_python",
    "allow access": "set enable_external_access = true",
    "allow paths": "set allowed_paths = ['{store}/{file}']",
    "log": "select * from enable_logging(storage = 'file', storage_path = '{store}')",
    "install": "install httpfs",
}


@pytest.fixture(scope="module")
def open_store(tmp_path_factory):
    """Return a store with a packed file and one beside it, and the names of pack and file."""
    store = tmp_path_factory.mktemp("forbidden") / "store"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(packs, "ENOUGH", 2)
        for number in (1, 2):
            add_run(store, number, "completed", number)
        run_query(store, "select * from points_all")
    add_run(store, 3, "completed", 3)
    for folder in (store, store.parent):
        (folder / "secret.txt").write_text("secret")
    made = (store / ".catalog" / "points").glob("*.parquet")
    (pack,) = (path for path in made if path.name != packs.INDEX_FILE)
    packed = packs.read_index(store, "points", POINTS.schema).files
    uris = {path.relative_to(store).as_posix() for path in store.glob("points/**/*.parquet")}
    (file,) = uris - packed.keys()
    return {"store": store, "pack": pack.relative_to(store).as_posix(), "file": file}


@pytest.mark.parametrize("sql", FORBIDDEN.values(), ids=FORBIDDEN)
def test_sql_reaches_no_file_but_to_read_what_was_asked_for(open_store, sql):
    named_queries_of_python = pa.table({"x": [1]})
    assert named_queries_of_python.num_rows
    around = open_store["store"].parent
    before = {path: path.read_bytes() for path in around.rglob("*") if path.is_file()}
    with pytest.raises(QueryError, match="the query failed"):
        # first what makes both files readable
        run_query(open_store["store"], "select * from points_all; " + sql.format(**open_store))
    assert {path: path.read_bytes() for path in around.rglob("*") if path.is_file()} == before


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
