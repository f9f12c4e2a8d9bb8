"""What comes from outside is data: it is not run, and leads nowhere but into the store."""

import ast
import tomllib
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from flows.request import StoreyRequest
from flows.server import SETTINGS
from storage.artifacts import Place, write
from storage.catalog import run_query
from storage.errors import MapSenseError, StoreError
from storage.points import POINTS, PointCloud
from storage.runs import Run, recorded
from storage.snapshots import none
from tasks.scans.bundle import write_bundle
from tasks.scans.sources import find_sources

ROOT = Path(__file__).resolve().parents[1]
LOADERS = {"pickle", "cloudpickle", "dill", "joblib", "shelve", "marshal"}
YAML_OF_ANYTHING = {f"{how}load{all_}" for how in ("", "full_", "unsafe_") for all_ in ("", "_all")}
"""Functions of yaml that make more than plain values; safe_load does not."""
OWN_PROCESS = {"tasks/stage/apart.py"}
"""Where a process talks to one it has started, through a pipe nobody else has."""
OUTSIDE = ["../x", "/x", "a/../../x", "..", "a\0b", "a/b", "-x", ".x", "x'y", "x=y"]


def sources():
    packages = ("flows", "tasks", "storage", "grammars")
    found = (path for package in packages for path in (ROOT / package).rglob("*.py"))
    return sorted(path.relative_to(ROOT).as_posix() for path in found)


def test_no_module_runs_what_it_reads():
    wrong = [
        f"{path}:{node.lineno}"
        for path in sources()
        if path not in OWN_PROCESS
        for node in ast.walk(ast.parse((ROOT / path).read_bytes()))
        if runs_what_it_reads(node)
    ]
    assert wrong == []


@pytest.mark.parametrize(
    "code",
    [
        "import pickle",
        "from cloudpickle import loads",
        "import joblib.memory as m",
        "eval('1')",
        "yaml.load(x, Loader=yaml.Loader)",
        "np.load(x, allow_pickle=True)",
        "subprocess.run(x, shell=wanted)",
    ],
)
def test_what_runs_what_it_reads_is_found(code):
    assert any(runs_what_it_reads(node) for node in ast.walk(ast.parse(code)))


def runs_what_it_reads(node):
    if isinstance(node, ast.Import):
        return bool(LOADERS & {name.name.partition(".")[0] for name in node.names})
    if isinstance(node, ast.ImportFrom):
        return (node.module or "").partition(".")[0] in LOADERS
    if isinstance(node, ast.Call):
        flags = [k.value for k in node.keywords if k.arg in ("allow_pickle", "shell")]
        called = isinstance(node.func, ast.Name) and node.func.id in ("eval", "exec")
        if isinstance(node.func, ast.Attribute) and isinstance(node.func.value, ast.Name):
            called = node.func.value.id == "yaml" and node.func.attr in YAML_OF_ANYTHING
        return called or any(getattr(flag, "value", True) is not False for flag in flags)
    return False


def test_results_of_prefect_are_json_everywhere():
    assert SETTINGS["PREFECT_RESULTS_DEFAULT_SERIALIZER"] == "json"
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    assert project["tool"]["prefect"]["results"]["default_serializer"] == "json"


def test_every_stage_writes_json_records_into_its_store(tmp_path):
    from flows import stages
    from tasks.stage.declare import Stage

    found = [stage for stage in vars(stages).values() if isinstance(stage, Stage)]
    assert len(found) > 20
    for stage in found:
        task = stage._task(str(tmp_path))
        assert (task.result_serializer, task.persist_result) == ("json", True)
        assert task.result_storage == tmp_path / ".cache"


@pytest.mark.parametrize("name", OUTSIDE)
@pytest.mark.parametrize("field", ["run", "building", "storey", "scan"])
def test_no_name_leads_out_of_the_store(tmp_path, field, name):
    named = {"run": "r", "building": "b", "storey": "0", "scan": "s"} | {field: name}
    with pytest.raises(ValidationError, match="is no usable name"):
        Place(store=str(tmp_path), **named)
    if field in ("building", "storey"):
        with pytest.raises(ValidationError, match="is no usable name"):
            storey = {"building": named["building"], "storey": named["storey"]}
            StoreyRequest(store=str(tmp_path), scans=(), **storey)
    if field != "scan":
        run = Run(named["run"], "map", named["building"], named["storey"], "{}", datetime.now(UTC))
        with pytest.raises(ValueError, match="is no usable name"), recorded(str(tmp_path), run):
            pass
    assert not [path for path in tmp_path.rglob("*") if path.is_file() and path.suffix != ".lock"]
    assert not list(tmp_path.parent.glob("x*"))


def test_a_scan_whose_name_leads_elsewhere_is_kept_in_the_store(tmp_path):
    folder = tmp_path / "scans"
    cloud = PointCloud(np.ones((10, 3)), np.zeros(3))
    names = ("a..%2f..", "a'; drop table runs; --", "$(touch x)", "a..", "\n")
    for name in names:
        write_bundle(folder / f"{name}.scan", cloud, none())
    found, errors = find_sources([folder])
    assert (len(found), errors) == (len(names), [])
    store = tmp_path / "store"
    place = Place(store=str(store), run="r", building="b", storey="0")
    for source in found:
        path = store / write(POINTS, cloud, place.of_scan(source.name)).uri
        assert path.resolve().is_relative_to(store.resolve())


@pytest.mark.parametrize("name", ["x'y", "x') union select 1 --", 'x"y', "x;drop table runs", "$x"])
def test_names_of_folders_are_no_sql(tmp_path, name):
    place = Place(store=str(tmp_path), run="r", building="b", storey="0")
    cloud = PointCloud(np.ones((4, 3)), np.zeros(3))
    uri = write(POINTS, cloud, place).uri
    other = tmp_path / f"points/building={name}/storey={name}"
    other.mkdir(parents=True)
    (other / f"{name}.parquet").write_bytes((tmp_path / uri).read_bytes())
    rows = run_query(tmp_path, "select building, count(*) as n from points_all group by all")
    assert {row["building"]: row["n"] for row in rows.to_pylist()} == {"b": 4, name: 4}


def test_values_are_bound_whatever_they_say(tmp_path):
    hostile = "' or 1 = 1; drop view points; --"
    sql = "select count(*) as n from runs where building = $building"
    assert run_query(tmp_path, sql, {"building": hostile}).to_pylist() == [{"n": 0}]


SECRETS = {
    "AWS_SECRET_ACCESS_KEY": "Qx81-secret",
    "AWS_SESSION_TOKEN": "tok-991",
    "DB_PASSWORD": "pw-4711",
}


@pytest.fixture
def leaking(tmp_path, address, monkeypatch):
    """An address whose client quotes every secret of the environment in its errors."""
    from fsspec.implementations.memory import MemoryFileSystem

    for name, value in SECRETS.items():
        monkeypatch.setenv(name, value)

    def refuse(*args, **kwargs):
        quoted = ", ".join(SECRETS.values())
        raise PermissionError(f"403 for https://user:hunter2@host/x with {quoted}")

    monkeypatch.setattr(MemoryFileSystem, "put_file", refuse)


def test_secrets_of_the_environment_reach_no_error_row_or_summary(tmp_path, leaking):
    from storage.stages import reason

    place = Place(store=str(tmp_path), run="r", building="b", storey="0")
    with pytest.raises(StoreError, match="403") as failed:
        write(POINTS, PointCloud(np.ones((1, 3)), np.zeros(3)), place)
    texts = [str(failed.value), reason(failed.value), reason(failed.value.__cause__)]
    assert all("403" in text and "***" in text for text in texts)
    assert not [s for s in (*SECRETS.values(), "hunter2") for text in texts if s in text]


def test_secrets_reach_no_file_of_a_store(tmp_path, monkeypatch):
    for name, value in SECRETS.items():
        monkeypatch.setenv(name, value)
    run = Run("r", "map", "b", "0", "{}", datetime.now(UTC))
    with pytest.raises(ValueError, match="refused"), recorded(str(tmp_path), run):
        raise ValueError(f"refused with {' '.join(SECRETS.values())}")
    told = run_query(tmp_path, "select message from runs")["message"].to_pylist()
    assert told == ["ValueError: refused with *** *** ***"]
    kept = b"".join(path.read_bytes() for path in tmp_path.rglob("*") if path.is_file())
    assert not [secret for secret in SECRETS.values() if secret.encode() in kept]


@pytest.mark.parametrize("url", ["s3://key:secret@bucket/x", "s3://bucket/x?token=1", "bucket/x"])
def test_an_address_with_credentials_is_no_setting(monkeypatch, url):
    from flows.settings import load_settings

    monkeypatch.setenv("MAPSENSE_REMOTE", url)
    with pytest.raises(MapSenseError, match=r"'remote'.*without credentials") as refused:
        load_settings()
    assert "secret" not in str(refused.value)
