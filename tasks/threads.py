"""Work of one stage spread over threads, and the processor time that these take.

A thread's own clock does not know of the threads it started: whoever measures a stage asks here for
theirs.
"""

import os
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from typing import TypeVar

Given = TypeVar("Given")
Made = TypeVar("Made")


@dataclass
class Spent:
    """What threads that others started took so far."""

    cpu_s: float = 0.0
    _lock: threading.Lock = field(default_factory=threading.Lock, repr=False)

    def add(self, cpu_s: float) -> None:
        """Count a thread's time too."""
        with self._lock:
            self.cpu_s += cpu_s


_counted: ContextVar[Spent | None] = ContextVar("threads_cpu", default=None)


@contextmanager
def counted() -> Iterator[Spent]:
    """Count the processor time of all that `spread` does within, called from this thread."""
    spent = Spent()
    before = _counted.set(spent)
    try:
        yield spent
    finally:
        _counted.reset(before)


def spread(make: Callable[[Given], Made], items: Iterable[Given]) -> list[Made]:
    """Return what is made of each item, in their order; each thread takes the next one.

    One thread per processor: worth it for compiled work that releases the interpreter's lock.
    The first error is raised.
    """
    spent = _counted.get()

    def timed(item: Given) -> Made:
        start = time.thread_time()
        try:
            return make(item)
        finally:
            if spent is not None:
                spent.add(time.thread_time() - start)

    with ThreadPoolExecutor(os.cpu_count() or 1) as threads:
        return list(threads.map(timed, items))
