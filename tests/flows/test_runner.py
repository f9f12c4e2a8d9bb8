"""Where stages run is a setting; what a stage is survives the way to another process."""

import importlib
import pickle
import socket
from pathlib import Path

import pytest

from flows.settings import load_settings
from storage.errors import MapSenseError

TOY = Path(__file__).parent
URL = "http://127.0.0.1:4200/api"


@pytest.fixture
def listening():
    """The address of something that answers, where no cluster is needed to choose one."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield f"tcp://127.0.0.1:{server.getsockname()[1]}"


def test_stages_run_in_threads_unless_a_cluster_is_set(monkeypatch):
    from prefect.task_runners import ThreadPoolTaskRunner

    from flows.runner import task_runner

    monkeypatch.delenv("MAPSENSE_DASK", raising=False)
    runner = task_runner(3)
    assert isinstance(runner, ThreadPoolTaskRunner)
    assert runner == ThreadPoolTaskRunner(max_workers=3)


def test_a_cluster_that_is_set_runs_the_stages_of_every_flow(monkeypatch, listening, tmp_path):
    pytest.importorskip("prefect_dask")
    from flows.building import with_jobs

    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PREFECT_API_URL", URL)
    (tmp_path / "mapsense.toml").write_text(f'dask = "{listening}"\n')
    monkeypatch.setenv("MAPSENSE_DASK", listening)  # so that it is undone, whoever sets it
    monkeypatch.delenv("MAPSENSE_DASK")
    load_settings()
    runner = with_jobs(2).task_runner
    assert type(runner).__name__ == "ClusterTaskRunner"
    assert runner.address == listening
    sent = pickle.loads(pickle.dumps(runner))
    assert (type(sent), sent.address) == (type(runner), listening)


@pytest.mark.parametrize(
    ("address", "api", "said"),
    [
        ("scheduler:8786", URL, "is no address of a Dask scheduler; write tcp://host:8786"),
        ("tcp://scheduler", URL, "is no address of a Dask scheduler"),
        ("tcp://scheduler:99999", URL, "is no address of a Dask scheduler"),
        ("tcp://127.0.0.1:8786", "", "need a Prefect server .* or unset dask$"),
        ("tcp://127.0.0.1:1", URL, "nothing answers there .*; start 'dask scheduler'"),
    ],
)
def test_a_cluster_that_cannot_be_used_is_an_error_with_a_remedy(monkeypatch, address, api, said):
    pytest.importorskip("prefect_dask")
    from flows.runner import task_runner

    monkeypatch.setenv("MAPSENSE_DASK", address)
    monkeypatch.setenv("PREFECT_API_URL", api)
    with pytest.raises(MapSenseError, match=rf"^setting 'dask' = '{address}': .*{said}"):
        task_runner()


def test_a_server_of_the_command_itself_is_none_for_a_cluster(monkeypatch, listening):
    from flows import runner, server

    monkeypatch.setenv("MAPSENSE_DASK", listening)
    monkeypatch.setenv("PREFECT_API_URL", URL)
    monkeypatch.setattr(server, "_own", {URL})
    with pytest.raises(MapSenseError, match="its workers reach; start 'prefect server start"):
        runner.task_runner()


def test_a_missing_package_is_named_with_what_installs_it(monkeypatch, listening):
    import sys

    from flows.runner import task_runner

    monkeypatch.setenv("MAPSENSE_DASK", listening)
    monkeypatch.setenv("PREFECT_API_URL", URL)
    monkeypatch.delitem(sys.modules, "flows.cluster", raising=False)
    for name in ("prefect_dask", "prefect_dask.client"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(MapSenseError, match=r"package 'prefect_dask.*install 'mapsense\[scale\]'"):
        task_runner()


@pytest.fixture
def toy(monkeypatch):
    monkeypatch.syspath_prepend(str(TOY))
    return importlib.import_module("toy.pipeline")


def test_a_stage_is_found_again_by_its_function_and_name(toy):
    from flows import stages

    for stage in (toy.made, stages.planes, stages.openings):
        text = pickle.dumps(stage)
        again = pickle.loads(text)
        assert (again.fn, again.name) == (stage.fn, stage.name)
        assert again.signature == stage.signature
        assert pickle.loads(text) is again  # a process has one of each
        assert len(text) < 300  # a name, no code


def test_a_stage_of_no_module_does_not_leave_its_process():
    from storage.points import PointCloud
    from storage.sources import Source
    from tasks.stage.declare import stage

    def local(source: Source) -> PointCloud:
        raise NotImplementedError

    with pytest.raises(TypeError, match="'local': other processes run functions that a module"):
        pickle.dumps(stage(local, "local"))


def test_a_stages_task_is_made_anew_with_the_limits_of_who_asks(toy, monkeypatch, tmp_path):
    from tasks.stage.limits import Limits, limits

    monkeypatch.setenv("MAPSENSE_STAGE_TIMEOUT_S", "7")
    task = toy.made._task(str(tmp_path))
    text = pickle.dumps(task)
    monkeypatch.delenv("MAPSENSE_STAGE_TIMEOUT_S")
    again = pickle.loads(text)
    assert (again.name, again.store, again.stage.name) == ("made", str(tmp_path), "made")
    assert again.cache_policy.fn is toy.made.fn
    assert again is pickle.loads(text)
    # what this process's environment leaves open is the asker's, and nothing else is
    asked = Limits(timeout_s=7.0)
    assert again is again.stage._task(str(tmp_path), asked)
    assert limits(asked) == asked
    monkeypatch.setenv("MAPSENSE_STAGE_TIMEOUT_S", "3")
    monkeypatch.setenv("MAPSENSE_STAGE_MEMORY_MB", "500")
    assert limits(asked) == Limits(3.0, 500)


def test_a_row_arrives_as_it_was_sent(monkeypatch):
    import json
    from datetime import UTC, datetime
    from types import SimpleNamespace

    from storage.artifacts import Place
    from storage.stages import StageRow
    from tasks.stage import elsewhere

    sent: list[tuple[str, str]] = []
    worker = SimpleNamespace(log_event=lambda topic, message: sent.append((topic, message)))
    place = Place(store="/s", run="r", building="b", storey="0", scan="a")
    row = StageRow(
        *("i", "r", "a", "planes", "k", "computed", 0.5, 0.25, None, 1, 2, 3, 4, None),
        started_at=datetime(2026, 1, 2, 3, 4, 5, 678, UTC),
        outputs=("planes/x.parquet",),
    )
    monkeypatch.setitem(
        elsewhere.sys.modules, "distributed", SimpleNamespace(get_worker=lambda: worker)
    )
    elsewhere.send(place, row)
    ((topic, message),) = sent
    assert topic == elsewhere.TOPIC
    json.loads(message)  # no pickle
    assert elsewhere.received(message) == (place, row)


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (type("KilledWorker", (Exception,), {})("x"), "took down every Dask worker that tried it"),
        (ModuleNotFoundError("No module named 'flows'"), "No module named 'flows'.*see the logs"),
        (None, "was given up by the Dask scheduler"),
    ],
)
def test_a_stage_that_no_worker_could_end_says_why(error, said):
    pytest.importorskip("prefect_dask")
    from types import SimpleNamespace
    from uuid import uuid4

    from flows.cluster import ClusterFuture
    from flows.ended import why_ended

    def result(timeout=None):
        raise error or RuntimeError("cancelled")

    gone = SimpleNamespace(result=result, done=lambda: True, exception=lambda: error)
    future = ClusterFuture(task_run_id=uuid4(), wrapped_future=gone)
    future.wait()
    assert future.state.is_crashed()
    assert why_ended(future) == str(future.state.data)
    with pytest.raises(MapSenseError, match=said):
        future.result()
