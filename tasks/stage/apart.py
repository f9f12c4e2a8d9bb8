"""A stage in a process of its own, which can be stopped whatever it does.

A thread cannot be stopped: an exception thrown into it waits until the native call it is in
returns, and memory taken in one process is missing in all of its stages. So a stage that has
limits is handed to a worker process. It is killed when the time is up; the kernel refuses it more
data than it may have (RLIMIT_DATA), which is a MemoryError there and harms no other. A worker that
lives on serves the next stage: only the first pays for its imports.
"""

import atexit
import importlib
import os
import pickle
import resource
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import Any

from storage.artifacts import Place, Ref
from storage.stages import reason
from tasks.stage.compute import compute
from tasks.stage.limits import Limits, StageStopped
from tasks.stage.meter import Cost, metered
from tasks.stage.signature import signature_of

MB = 1_000_000
GRACE_S = 3.0
"""After so much more than it may take, a stage ends by itself: who should stop it is gone."""

_idle: list["_Worker"] = []
_mutex = threading.Lock()


def compute_apart(
    fn: Callable[..., Any], stage: str, inputs: Mapping[str, Any], limits: Limits
) -> tuple[list[Ref], Cost]:
    """Return what a stage made in a worker, and what it cost there.

    Raises
    ------
    StageStopped
        If it took more than it may, or its process died.
    TypeError
        If its function is not a module's own: no other process finds it.
    """
    if "<locals>" in fn.__qualname__ or fn.__module__ == "__main__":
        raise TypeError(f"stage '{stage}': limits are for functions that a module defines")
    place: Place = inputs["place"]
    about = f"{place.scan or f'{place.building}/{place.storey}'}: stage '{stage}'"
    worker = _worker(limits.memory_mb)
    try:
        asked = (fn.__module__, fn.__qualname__, stage, dict(inputs), limits.timeout_s)
        made = worker.ask(asked, limits, about)
    except BaseException:
        worker.kill()
        raise
    with _mutex:
        _idle.append(worker)
    if isinstance(made, BaseException):
        raise made
    return made


class _Worker:
    """A process that computes one stage after the other."""

    def __init__(self, memory_mb: int | None) -> None:
        self.memory_mb = memory_mb
        self._connection, theirs = Pipe()
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tasks.stage.apart", str(theirs.fileno()), str(memory_mb or 0)],
            env=os.environ | {"PYTHONPATH": os.pathsep.join(part for part in sys.path if part)},
            stdin=subprocess.PIPE,  # held open by us: its end tells the worker that we are gone
            pass_fds=(theirs.fileno(),),
        )
        theirs.close()

    def ask(self, asked: Any, limits: Limits, about: str) -> Any:
        """Return what was made and its cost, or the error of the function."""
        try:
            self._connection.send(asked)
            self._connection.recv()  # once all is imported
            if not self._connection.poll(limits.timeout_s):
                raise StageStopped(
                    f"{about} was stopped after {limits.timeout_s:g} s; leave the scan out, or set "
                    "a longer stage_timeout_s"
                )
            made = self._connection.recv()
        except (EOFError, ConnectionError) as error:
            ended = self._process.wait()
            raise StageStopped(
                f"{about} took its process down ({_ended(ended)}); leave the scan out, or give it "
                "more memory"
            ) from error
        if isinstance(made, MemoryError):
            raise StageStopped(
                f"{about} needs more than the {limits.memory_mb} MB of memory it may take; leave "
                "the scan out, or set a greater stage_memory_mb"
                if limits.memory_mb
                else f"{about} needs more memory than there is; leave the scan out"
            ) from made
        return made

    def kill(self) -> None:
        """End the process, whatever it does."""
        self._process.kill()
        self._process.wait()
        self._connection.close()
        if self._process.stdin is not None:
            self._process.stdin.close()

    def is_alive(self) -> bool:
        """Return whether it can be asked."""
        return self._process.poll() is None


def _worker(memory_mb: int | None) -> _Worker:
    """Return an idle worker of that much memory, or a new one."""
    with _mutex:
        fit = [w for w in _idle if w.memory_mb == memory_mb]
        for worker in fit:
            _idle.remove(worker)
            if worker.is_alive():
                return worker
            worker.kill()
    return _Worker(memory_mb)


@atexit.register
def _end_idle() -> None:
    with _mutex:
        while _idle:
            _idle.pop().kill()


def _ended(code: int) -> str:
    if code >= 0:
        return f"exit code {code}"
    with suppress(ValueError):
        return signal.Signals(-code).name
    return f"signal {-code}"


def main() -> None:
    """Compute what the process that started this one asks for, until it is gone."""
    connection = Connection(int(sys.argv[1]))
    memory = int(sys.argv[2]) * MB
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # who started us decides
    threading.Thread(target=_leave_with_parent, daemon=True).start()
    if memory:
        resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))
    with suppress(EOFError, ConnectionError):
        while True:
            connection.send(_answer(connection))


def _answer(connection: Connection) -> Any:
    """Take one stage, and return what it made and what that cost, or its error."""
    module, name, stage, inputs, timeout_s = connection.recv()
    try:
        fn: Any = importlib.import_module(module)
        for part in name.split("."):
            fn = getattr(fn, part)
        signature = signature_of(fn, stage)
    except Exception as error:
        connection.send(None)
        return portable(error)
    connection.send(None)
    if timeout_s is not None:
        # its signal is the system's to deal with: it ends the process in any native call
        signal.setitimer(signal.ITIMER_REAL, timeout_s + GRACE_S)
    try:
        with metered() as cost:
            refs = compute(fn, signature, inputs)
        return refs, cost
    except Exception as error:
        return portable(error)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)


def portable(error: Exception) -> Exception:
    """Return an error that another process can be told."""
    if isinstance(error, MemoryError):
        return MemoryError(str(error))
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(reason(error))
    return error


def _leave_with_parent() -> None:
    sys.stdin.buffer.read()
    os._exit(0)


if __name__ == "__main__":
    main()
