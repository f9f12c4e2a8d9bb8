"""Stages in processes of their own: stopped whatever they do, and the next one is served."""

import importlib
import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from hashlib import sha256
from pathlib import Path

import pytest

from storage.artifacts import Place, read
from storage.errors import InputError, MapSenseError
from storage.points import POINTS
from storage.sources import Source
from tasks.stage import apart
from tasks.stage.apart import compute_apart
from tasks.stage.limits import Limits, StageStopped, limits

FAULTS = Path(__file__).resolve().parents[2] / "faults"
LONG = Limits(timeout_s=120)


@pytest.fixture
def ask(tmp_path, monkeypatch):
    """Return what computes the stage of a text in a worker, and its cost."""
    monkeypatch.syspath_prepend(str(FAULTS))
    stage = importlib.import_module("poisoned")
    place = Place(store=str(tmp_path / "store"), run="r", building="b", storey="0", scan="s")

    def run(text, allowed=LONG):
        digest = sha256(text.encode()).hexdigest()
        path = tmp_path / f"{digest[:8]}.txt"
        path.write_text(text)
        source = Source(name="s", path=str(path), sha256=digest, size_bytes=len(text))
        inputs = {"place": place, "source": source, "params": stage.PoisonedParams()}
        (ref,), cost = compute_apart(stage.poisoned, "poisoned", inputs, allowed)
        return read(POINTS, ref, place.store), cost

    yield run
    apart._end_idle()


def process_of(cloud):
    return round(cloud.origin[0])


def test_a_worker_serves_one_stage_after_the_other_and_tells_what_it_cost(ask):
    first, cost = ask("10")
    second, _ = ask("20")
    assert (len(first), len(second)) == (10, 20)
    assert process_of(first) == process_of(second)
    assert cost.wall_s >= cost.cpu_s > 0
    assert cost.peak_memory_mb > 10


def test_stages_at_once_have_a_worker_each(ask):
    with ThreadPoolExecutor(2) as pool:
        clouds = [cloud for cloud, _ in pool.map(ask, ("10", "20"))]
    assert sorted(len(cloud) for cloud in clouds) == [10, 20]


def test_a_native_call_that_hangs_is_stopped_and_the_next_is_served(ask):
    began = time.monotonic()
    with pytest.raises(StageStopped, match=r"^s: stage 'poisoned' was stopped after 1 s; leave"):
        ask("hang", Limits(timeout_s=1))
    assert time.monotonic() - began < 60  # on its own it would take for ever
    cloud, _ = ask("10")
    assert len(cloud) == 10


def test_a_stage_whose_asker_was_killed_ends_by_itself(tmp_path):
    path = tmp_path / "hang.txt"
    path.write_text("hang")
    code = f"""
import os, sys, threading
from poisoned import PoisonedParams, poisoned
from storage.artifacts import Place
from storage.sources import Source
from tasks.stage import apart
from tasks.stage.limits import Limits

place = Place(store={str(tmp_path)!r}, run="r", building="b", storey="0", scan="s")
source = Source(name="s", path={str(path)!r}, sha256="0", size_bytes=4)
inputs = {{"place": place, "source": source, "params": PoisonedParams()}}
ask = threading.Thread(
    target=apart.compute_apart, args=(poisoned, "p", inputs, Limits(timeout_s=0.5)), daemon=True
)
worker = apart._Worker(None)
apart._idle.append(worker)
print(worker._process.pid, flush=True)
recv = worker._connection.recv

def ready():
    recv()
    print(worker._process.poll() is None, flush=True)
    os.kill(os.getpid(), 9)  # it computes from now on

worker._connection.recv = ready
ask.start()
ask.join()
"""
    paths = os.pathsep.join([str(FAULTS), str(FAULTS.parents[1])])
    run = [sys.executable, "-c", code]
    killed = subprocess.run(run, capture_output=True, env=os.environ | {"PYTHONPATH": paths})
    assert killed.returncode == -9, killed.stderr
    worker, was_alive = killed.stdout.split()
    assert was_alive == b"True"
    status = Path(f"/proc/{int(worker)}/status")
    end = time.monotonic() + 60
    while goes_on(status):
        assert time.monotonic() < end, "it goes on"
        time.sleep(0.1)


def goes_on(status):
    try:
        return "\nState:\tZ" not in status.read_text()
    except OSError:
        return False


@pytest.mark.parametrize("text", ["greedy", "creeping"])
def test_memory_beyond_the_limit_is_refused_and_harms_nobody(ask, text):
    allowed = Limits(memory_mb=600)
    with pytest.raises(StageStopped, match="needs more than the 600 MB of memory it may take"):
        ask(text, allowed)
    cloud, cost = ask("10", allowed)
    assert len(cloud) == 10
    assert cost.peak_memory_mb < 600


def test_a_crash_is_the_stages_own(ask):
    with pytest.raises(StageStopped, match=r"took its process down \(SIGSEGV\)"):
        ask("crash")
    cloud, _ = ask("10")
    assert len(cloud) == 10


def test_an_error_of_the_function_is_raised_as_it_is(ask):
    with pytest.raises(InputError, match="holds 'ten'; write a number") as found:
        ask("ten")
    assert found.value.remedy == "write a number"
    with pytest.raises(RuntimeError, match="Unpicklable: 1 and 2"):
        ask("strange")
    assert process_of(ask("10")[0]) == process_of(ask("20")[0])  # none was lost for it


def test_a_function_that_no_other_process_finds_is_refused_failure(tmp_path):
    def local(source, params):
        raise AssertionError

    with pytest.raises(TypeError, match="a module defines"):
        compute_apart(local, "local", {}, LONG)


def test_limits_come_from_the_environment(monkeypatch):
    assert not limits()
    monkeypatch.setenv("MAPSENSE_STAGE_TIMEOUT_S", "1.5")
    monkeypatch.setenv("MAPSENSE_STAGE_MEMORY_MB", "2000")
    assert limits() == Limits(1.5, 2000)
    for wrong in ("0", "-1", "x", "nan", "inf"):
        monkeypatch.setenv("MAPSENSE_STAGE_TIMEOUT_S", wrong)
        with pytest.raises(MapSenseError, match=f"MAPSENSE_STAGE_TIMEOUT_S={wrong}: expected"):
            limits()
