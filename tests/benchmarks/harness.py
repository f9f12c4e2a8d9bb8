"""Measurements: every case in a process of its own, rivals' runs interleaved with ours.

A case is prepared once (libraries loaded, compiled code warmed up, input in memory); then the
parent asks for one run at a time, so that whatever else the machine does meets ours and the rivals
alike. Memory is the peak of the resident set above what was resident before the run.
"""

import ctypes
import gc
import multiprocessing
import os
import resource
import statistics
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Ours runs with one thread, as the Makefile sets it; rivals have all cores."""
QUIET_CORES, QUIET_WAIT_S = 0.15, 5.0
"""Cores that other processes may use when a measurement begins, and how long to wait for that."""


class BenchmarkError(Exception):
    """A case did not run through."""


@dataclass(frozen=True)
class Prepared:
    """What is ready to be measured."""

    run: Callable[[], Any]
    judge: Callable[[Any], dict[str, Any]] = lambda _: {}
    """Figures about what a run returned; not timed."""


@dataclass(frozen=True)
class Case:
    """One way to do a thing; `prepare` is called in the case's own process."""

    name: str
    prepare: Callable[[], Prepared]
    rival: bool = False
    """Whether it is the alternative, and may use all cores."""


@dataclass
class Measured:
    """The runs of one case."""

    name: str
    seconds: list[float] = field(default_factory=list)
    cpu_seconds: list[float] = field(default_factory=list)
    """of all threads; suffers less than `seconds` when the machine is busy"""
    above_mb: float | None = None
    """peak above what was resident before the run; None where the system does not say"""
    peak_mb: float | None = None
    """peak of the whole process"""
    others: float = 0.0
    """cores other processes used during a run, the most of all runs"""
    figures: dict[str, Any] = field(default_factory=dict)
    """of the last run"""

    @property
    def median_s(self) -> float:
        return statistics.median(self.seconds)

    def ratio(self, rival: "Measured | None") -> float | None:
        """Return our time as a share of the rival's, None if the rival was not run."""
        return self.median_s / rival.median_s if rival is not None else None

    def add(self, reply: dict[str, Any]) -> None:
        """Take in one run."""
        self.seconds.append(reply["seconds"])
        self.cpu_seconds.append(reply["cpu_seconds"])
        self.above_mb = _most(self.above_mb, reply["above_mb"])
        self.peak_mb = _most(self.peak_mb, reply["peak_mb"])
        self.others = max(self.others, reply["others"])
        self.figures = reply["figures"]

    def row(self) -> dict[str, Any]:
        """Return the figures of the case, for a table."""
        return {
            "case": self.name,
            "seconds": self.median_s,
            "cpu_seconds": statistics.median(self.cpu_seconds),
            "runs": len(self.seconds),
            "all_seconds": self.seconds,
            "above_mb": self.above_mb,
            "peak_mb": self.peak_mb,
            "others": self.others,
        } | self.figures


def measure(
    ours: Case, rivals: Sequence[Case] = (), rounds: int = 3, ours_first: int = 1
) -> dict[str, Measured]:
    """Run ours and its rivals in turn, each in its own process.

    Parameters
    ----------
    ours : Case
    rivals : sequence of Case
    rounds : runs of each rival; without rivals, turns of ours
    ours_first : runs of ours before each run of a rival

    Returns
    -------
    dict
        Case name -> its runs.
    """
    cases = (ours, *rivals)
    with ExitStack() as stack:
        workers = {case.name: stack.enter_context(_worker(case)) for case in cases}
        for case in cases:
            _answer(workers[case.name], case.name)
        measured = {case.name: Measured(case.name) for case in cases}
        _wait_until_quiet()
        turn = [name for rival in rivals for name in (*[ours.name] * ours_first, rival.name)]
        for name in (turn or [ours.name] * ours_first) * rounds:
            workers[name].send("run")
            measured[name].add(_answer(workers[name], name))
    return measured


@contextmanager
def _worker(case: Case) -> Iterator[Connection]:
    """Start the process of a case; it ends with the context."""
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    process = context.Process(target=_serve, args=(there, case.prepare), daemon=True)
    with _threads(None if case.rival else "1"):
        process.start()
    there.close()
    try:
        yield here
    finally:
        here.close()
        process.join(5)
        if process.is_alive():
            process.kill()
            process.join()


@contextmanager
def _threads(number: str | None) -> Iterator[None]:
    """Set how many threads a process started in this context uses; None: as many as it likes."""
    before = {name: os.environ.pop(name, None) for name in THREADS}
    if number is not None:
        os.environ.update(dict.fromkeys(THREADS, number))
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name, None)
            if value is not None:
                os.environ[name] = value


def _answer(worker: Connection, name: str) -> dict[str, Any]:
    try:
        reply = worker.recv()
    except EOFError as error:
        raise BenchmarkError(f"{name}: its process died (out of memory?)") from error
    if "error" in reply:
        raise BenchmarkError(f"{name}:\n{reply['error']}")
    return reply


def _serve(parent: Connection, prepare: Callable[[], Prepared]) -> None:
    """Prepare a case, then make one run for each message, until the parent hangs up."""
    try:
        prepared = prepare()
        parent.send({})
        while parent.recv():
            parent.send(_one_run(prepared))
    except (EOFError, BrokenPipeError):
        return
    except BaseException:
        parent.send({"error": traceback.format_exc()})


def _one_run(prepared: Prepared) -> dict[str, Any]:
    _give_back()
    before = _resident("VmRSS")
    _reset_peak()
    others, start, cpu_start = _Others(), time.perf_counter(), time.process_time()
    result = prepared.run()
    seconds, cpu_seconds = time.perf_counter() - start, time.process_time() - cpu_start
    reply = {"seconds": seconds, "cpu_seconds": cpu_seconds, "others": others.cores()}
    peak = _resident("VmHWM")
    reply["peak_mb"] = peak
    reply["above_mb"] = None if peak is None or before is None else peak - before
    reply["figures"] = prepared.judge(result)
    return reply


def _give_back() -> None:
    """Return freed memory to the system: what an earlier run left must not hide the next peak."""
    gc.collect()
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).malloc_trim(0)


def _reset_peak() -> None:
    Path("/proc/self/clear_refs").write_text("5")


def _resident(entry: str) -> float | None:
    """Return VmRSS or VmHWM in MB."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith(entry):
            return int(line.split()[1]) * 1024 / 1e6
    return None


def _most(a: float | None, b: float | None) -> float | None:
    return max((x for x in (a, b) if x is not None), default=None)


class _Others:
    """How busy the machine's other processes keep it from now on."""

    def __init__(self) -> None:
        self.start = self._now()

    def cores(self) -> float:
        """Return the cores they used since."""
        wall, others = (b - a for a, b in zip(self.start, self._now(), strict=True))
        # the kernel counts in hundredths of a second: less tells nothing
        return max(0.0, others / wall) if wall > 0.2 else 0.0

    @staticmethod
    def _now() -> tuple[float, float]:
        """Return the time and the processor seconds all other processes have used."""
        user, nice, system, _, _, irq, soft_irq = map(
            int, Path("/proc/stat").read_text().split()[1:8]
        )
        own = resource.getrusage(resource.RUSAGE_SELF)
        used = (user + nice + system + irq + soft_irq) / os.sysconf("SC_CLK_TCK")
        return time.perf_counter(), used - own.ru_utime - own.ru_stime


def _wait_until_quiet() -> None:
    end = time.monotonic() + QUIET_WAIT_S
    while time.monotonic() < end:
        others = _Others()
        time.sleep(0.5)
        if others.cores() < QUIET_CORES:
            return
