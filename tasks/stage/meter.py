"""What a stage costs while it runs: time, processor time, memory."""

import os
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from tasks.threads import counted

INTERVAL_S = 0.02
_STATM = Path("/proc/self/statm")


@dataclass
class Cost:
    """What a stage cost; complete when it has ended."""

    wall_s: float = 0.0
    cpu_s: float = 0.0
    """of the thread the stage ran in, and of those it spread its work over"""
    peak_memory_mb: float | None = None
    """greatest resident memory of the whole process meanwhile, sampled; None where the system
    does not tell it"""


@contextmanager
def metered() -> Iterator[Cost]:
    """Measure what happens within, also if it fails."""
    cost = Cost()
    done = threading.Event()
    sampler = threading.Thread(target=_sample, args=(cost, done), daemon=True)
    sampler.start()
    wall, cpu = time.perf_counter(), time.thread_time()
    try:
        with counted() as others:
            yield cost
    finally:
        cost.wall_s = time.perf_counter() - wall
        cost.cpu_s = time.thread_time() - cpu + others.cpu_s
        done.set()
        sampler.join()


def _sample(cost: Cost, done: threading.Event) -> None:
    while True:
        if (now := resident_mb()) is not None:
            cost.peak_memory_mb = max(cost.peak_memory_mb or 0.0, now)
        if done.wait(INTERVAL_S):
            return


def resident_mb() -> float | None:
    """Return the process's resident memory, None where the system does not tell it."""
    try:
        pages = int(_STATM.read_text().split()[1])
    except OSError:
        return None
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6
