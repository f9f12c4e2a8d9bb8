from pathlib import Path

import numpy as np

from storage.errors import InputError
from storage.points import PointCloud
from storage.sources import Source
from tasks.params import Params


class MakeParams(Params):
    scale: float = 1.0


def make(source: Source, params: MakeParams) -> PointCloud:
    text = Path(source.path).read_text()
    if not text.isdigit():
        raise InputError(source.path, f"holds {text!r}", "write a number")
    xyz = np.arange(3 * int(text)).reshape(-1, 3) * params.scale
    return PointCloud(xyz.astype(np.float32), np.zeros(3))
