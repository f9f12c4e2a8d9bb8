import numpy as np
from toy.numbers import step

from storage.points import PointCloud
from tasks.params import Params


class ShiftParams(Params):
    times: int = 1


def shift(points: PointCloud, params: ShiftParams) -> PointCloud:
    return PointCloud(points.xyz + np.float32(step() * params.times), points.origin)
