"""Deployments on a real Prefect server, and their flow through Prefect's real engine."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from prefect.utilities.asyncutils import run_coro_as_sync

from flows.cli import main
from flows.logs import event, written
from storage.artifacts import Place
from storage.points import PointCloud
from storage.runs import read_runs
from storage.snapshots import none
from storage.stages import of_run
from tasks.scans.bundle import write_bundle
from tasks.simulation.clouds import furnished_room

ROOT = Path(__file__).resolve().parents[2]
STOREY = '[[storeys]]\nstorey = "1"\nscans = ["scans"]\n'
DAILY = '[schedule]\ncron = "0 2 * * *"\ntimezone = "Europe/Berlin"\n'


@pytest.fixture
def deploy(prefect_server, monkeypatch, capsys, tmp_path):
    """Return what deploys buildings, named by their files' texts, and its answer."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PREFECT_API_URL", prefect_server)
    folder = tmp_path / "deployments"
    folder.mkdir()
    shutil.copy(ROOT / "deployments" / "prefect.yaml", folder)

    def deploy(**texts):
        for path in folder.glob("*.toml"):
            path.unlink()
        for building, text in texts.items():
            (folder / f"{building}.toml").write_text(f'building = "{building}"\n{text}')
        capsys.readouterr()
        with pytest.raises(SystemExit) as left:
            main(["deploy", "--json"])
        said = capsys.readouterr()
        assert left.value.code == 0, said.err
        answer = json.loads(said.out)
        return {row["building"]: row for row in answer["deployments"]}, answer["left"]

    return deploy


@pytest.fixture
def client(prefect_server):
    from prefect.client.orchestration import get_client

    with get_client(sync_client=True) as client:
        yield client


def test_deploying_makes_a_deployment_and_again_changes_nothing(deploy, client, tmp_path):
    rows, _ = deploy(north=DAILY + STOREY + "[params.hough]\ngamma_cell = 25\n")
    assert rows["north"]["deployment"] == "created"
    made = client.read_deployment_by_name("mapping/north")
    assert made.entrypoint == "flows.scheduled.map_new_scans"
    assert (made.work_pool_name, made.tags) == ("mapsense", ["mapsense"])
    assert client.read_work_pool("mapsense").type == "process"
    assert made.job_variables["env"]["OMP_NUM_THREADS"] == "1"
    assert (made.global_concurrency_limit.limit, made.pull_steps) == (1, [])
    assert made.concurrency_options.collision_strategy == "ENQUEUE"
    (schedule,) = made.schedules
    assert (schedule.schedule.cron, schedule.schedule.timezone) == ("0 2 * * *", "Europe/Berlin")
    assert made.parameters["settings"] == {"hough": {"gamma_cell": 25}}
    scans = [str(tmp_path / "deployments" / "scans")]
    assert made.parameters["storeys"] == [{"storey": "1", "scans": scans}]

    rows, _ = deploy(north=DAILY + STOREY + "[params.hough]\ngamma_cell = 25\n")
    assert rows["north"]["deployment"] == "unchanged"
    again = client.read_deployment_by_name("mapping/north")
    assert (again.id, again.updated, len(again.schedules)) == (made.id, made.updated, 1)


def test_a_changed_file_updates_its_deployment_and_a_paused_schedule_stays_paused(deploy, client):
    deploy(east=DAILY + STOREY)
    made = client.read_deployment_by_name("mapping/east")
    client.update_deployment_schedule(made.id, made.schedules[0].id, active=False)
    rows, _ = deploy(east="tags = ['new']\nconcurrency = 3\n" + DAILY + STOREY)
    assert rows["east"]["deployment"] == "updated"
    assert rows["east"]["note"] == "its schedule is paused, and stays so"
    changed = client.read_deployment_by_name("mapping/east")
    assert (changed.id, changed.tags) == (made.id, ["mapsense", "new"])
    assert changed.global_concurrency_limit.limit == 3
    assert [schedule.active for schedule in changed.schedules] == [False]
    deploy(east=STOREY)
    assert client.read_deployment_by_name("mapping/east").schedules == []


def test_a_building_whose_file_is_gone_is_told(deploy):
    _, left = deploy(old=STOREY, new=STOREY)
    assert not {"mapping/old", "mapping/new"} & set(left)
    _, left = deploy(new=STOREY)
    assert "mapping/old" in left


def test_a_secret_block_reaches_a_runs_environment_and_no_deployment(deploy, client, tmp_path):
    from prefect.blocks.system import Secret
    from prefect.workers.process import ProcessJobConfiguration

    Secret(value="hunter2-s3").save("mapsense-s3", overwrite=True)
    path = tmp_path / "deployments" / "prefect.yaml"
    named = '          AWS_SECRET_ACCESS_KEY: "{{ prefect.blocks.secret.mapsense-s3 }}"\n'
    path.write_text(path.read_text().replace("        env:\n", "        env:\n" + named))
    deploy(vault=STOREY)
    made = client.read_deployment_by_name("mapping/vault")
    assert "hunter2-s3" not in made.model_dump_json()

    template = client.read_work_pool("mapsense").base_job_template
    job = run_coro_as_sync(
        ProcessJobConfiguration.from_template_and_values(template, made.job_variables)
    )
    assert job.env["AWS_SECRET_ACCESS_KEY"] == "hunter2-s3"
    assert job.env["OMP_NUM_THREADS"] == "1"


@pytest.fixture(scope="module")
def clouds():
    return [PointCloud(furnished_room(12_000, seed)[0], np.zeros(3)) for seed in (1, 2)]


@pytest.fixture
def site(prefect_server, tmp_path, clouds, monkeypatch, capfd):
    """A building of two storeys, and what ticks: its state, and the events by JSON line."""
    from flows.scheduled import map_new_scans

    monkeypatch.setenv("MAPSENSE_LOG", "json")
    monkeypatch.setenv("PREFECT_API_URL", prefect_server)
    write_bundle(tmp_path / "0" / "a.scan", clouds[0], none())
    write_bundle(tmp_path / "1" / "c.scan", clouds[1], none())
    storeys = [{"storey": s, "scans": [str(tmp_path / s)]} for s in ("0", "1")]

    def tick():
        capfd.readouterr()
        asked = {"store": str(tmp_path / "store"), "settle_s": 0, "jobs": 2}
        asked["settings"] = {"detect": []}  # rooms and walls are enough here
        state = map_new_scans("Hut", storeys, **asked, return_state=True)
        lines = capfd.readouterr().err.splitlines()
        return state, [json.loads(line) for line in lines if line.startswith("{")]

    return tick


def runs_of(store, storey):
    return [run.id for run in read_runs(store, "Hut", storey)]


def outcomes(store, storey):
    """Return how the stages of a storey's last run ended, by stage and scan."""
    run = runs_of(store, storey)[-1]
    place = Place(store=str(store), run=run, building="Hut", storey=storey)
    found = {"computed": set(), "cached": set(), "failed": set()}
    for row in of_run(place):
        found[row.outcome].add((row.scan, row.stage))
    return found


def test_a_tick_maps_what_is_new_and_nothing_else(site, tmp_path, clouds, client):
    store = tmp_path / "store"
    state, events = site()
    assert state.message == "0: mapped from 1 scans, 1 new; 1: mapped from 1 scans, 1 new"
    stage = next(e for e in events if e["event"] == "stage computed")
    assert {"time", "run", "building", "storey", "scan", "stage", "wall_s"} <= set(stage)

    before = [runs_of(store, storey) for storey in "01"]
    state, events = site()
    assert state.is_completed()
    assert state.message == "nothing new: 0: 1 scans, all known; 1: 1 scans, all known"
    assert [runs_of(store, storey) for storey in "01"] == before
    assert {e["event"] for e in events} == {"sources listed"}

    write_bundle(tmp_path / "0" / "b.scan", clouds[1], none())
    state, _ = site()
    assert state.message == "0: mapped from 2 scans, 1 new; 1: 1 scans, all known"
    assert runs_of(store, "1") == before[1]
    found = outcomes(store, "0")
    assert {scan for scan, _ in found["computed"]} == {"b", None}
    assert {scan for scan, _ in found["cached"]} == {"a"}

    shown = {a.key: a for a in client.read_artifacts(limit=200) if a.key and "-hut-" in a.key}
    kinds = {key.partition("-")[0]: artifact.type for key, artifact in shown.items()}
    assert kinds == {
        "plan": "image",
        "summary": "markdown",
        "metrics": "table",
        "stages": "table",
        "progress": "progress",
    }
    metrics = next(a for key, a in shown.items() if key.startswith("metrics-"))
    named = {row["metric"] for row in json.loads(metrics.data)}
    assert {"rooms", "walls", "doors", "windows", "furniture", "seconds"} <= named
    plan = next(a for key, a in shown.items() if key.startswith("plan-"))
    assert plan.data.startswith("data:image/png;base64,")
    progress = [a for a in client.read_artifacts(limit=200) if (a.key or "").startswith("progress")]
    assert {a.data for a in progress} == {100.0}


def test_a_broken_scan_fails_its_storey_alone_and_is_named_with_a_remedy(site, tmp_path, capfd):
    broken = tmp_path / "1" / "c.scan" / "points.parquet"
    whole = broken.read_bytes()
    broken.write_bytes(b"no Parquet")
    state, events = site()
    assert state.is_failed()
    assert state.message.startswith("1 of 2 storeys failed: 0: mapped from 1 scans, 1 new; 1: none")
    failed = next(e for e in events if e["event"] == "stage failed")
    assert (failed["level"], failed["scan"], failed["stage"]) == ("error", "c", "clouds")
    assert "points.parquet" in failed["error"]
    assert "mapsense rerun --building Hut --storey 1" in failed["remedy"]

    store = ["--store", str(tmp_path / "store")]
    rows = json.loads(command(capfd, "status", "--json", *store))
    assert [row["failed"] for row in rows] == [[], rows[1]["failed"]]
    assert [(f["scan"], f["stage"]) for f in rows[1]["failed"]] == [("c", "clouds")]
    assert "clouds c" in command(capfd, "status", *store)
    asked = ("--scan", "a"), ("--stage", "rooms"), ("--building", "Hut", "--storey", "0")
    for which in asked:
        assert command(capfd, "rerun", *which, *store).startswith("nothing to run again")

    broken.write_bytes(whole)
    (summary,) = json.loads(command(capfd, "rerun", "--scan", "c", "--json", *store))
    assert (summary["storey"], summary["state"]) == ("1", "completed")
    state, _ = site()
    assert state.is_completed()
    assert outcomes(tmp_path / "store", "1")["computed"] == set()


def command(capfd, *arguments):
    capfd.readouterr()
    with pytest.raises(SystemExit) as left:
        main(list(arguments))
    said = capfd.readouterr()
    assert left.value.code == 0, said.err
    return said.out


def test_a_missing_source_fails_its_storey_alone(prefect_server, tmp_path, clouds):
    from flows.scheduled import map_new_scans

    write_bundle(tmp_path / "0" / "a.scan", clouds[0], none())
    storeys = [{"storey": s, "scans": [str(tmp_path / s)]} for s in ("0", "2")]
    asked = {"store": str(tmp_path / "store"), "settle_s": 3600}
    state = map_new_scans("hut", storeys, **asked, return_state=True)
    assert state.is_failed()
    assert "0: no scan yet, still being written: a.scan" in state.message
    assert f"2: {tmp_path / '2'}: cannot be read (No such file or directory)" in state.message


@pytest.mark.parametrize("form", ["text", "json"])
def test_an_event_is_one_line_whatever_is_in_it(form, capsys):
    with written(form):
        event("stage failed", scan='a "b"\nc', stage="clouds", error="x=1; mend it")
    (line,) = capsys.readouterr().err.splitlines()
    if form == "json":
        said = json.loads(line)
        assert (said["scan"], said["error"]) == ('a "b"\nc', "x=1; mend it")
    else:
        assert line == r'stage failed scan="a \"b\"\nc" stage=clouds error="x=1; mend it"'
    event("not asked for")
    assert capsys.readouterr().err == ""


def test_an_artifacts_key_is_one_for_each_storey():
    from flows.artifacts import key_of

    keys = [key_of("plan", *of) for of in [("A", "b"), ("a", "b"), ("a-b", "c"), ("a", "b-c")]]
    assert len(set(keys)) == 4
    assert key_of("plan", "north", "1") == "plan-north-1"
    for key in keys:
        assert set(key) <= set("abcdefghijklmnopqrstuvwxyz0123456789-")
