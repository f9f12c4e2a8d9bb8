"""A stage that does what the text of its source says: no module of tests, other processes load it.

Importable by name where its folder is on the path.
"""

import os
import re
import signal
from pathlib import Path

import numpy as np

from storage.errors import InputError
from storage.points import PointCloud
from storage.sources import Source
from tasks.params import Params


class PoisonedParams(Params):
    scale: float = 1.0


class Unpicklable(Exception):
    def __init__(self, one: int, two: int) -> None:
        super().__init__(f"{one} and {two}")
        self.held = lambda: one


def poisoned(source: Source, params: PoisonedParams) -> PointCloud:
    text = Path(source.path).read_text()
    if text == "hang":
        # one native call that never lets Python run: nothing thrown into its thread gets through
        re.match(r"(a+)+b", "a" * 60)
    elif text == "greedy":
        np.ones(10_000_000_000)
    elif text == "creeping":
        held = []
        while True:
            held.append(np.ones(1_000_000))
    elif text == "crash":
        os.kill(os.getpid(), signal.SIGSEGV)
    elif text == "strange":
        raise Unpicklable(1, 2)
    elif not text.isdigit():
        raise InputError(source.path, f"holds {text!r}", "write a number")
    xyz = np.arange(3 * int(text)).reshape(-1, 3) * params.scale
    return PointCloud(xyz.astype(np.float32), np.full(3, float(os.getpid())))
