import os
import signal

import numpy as np

from storage.points import PointCloud
from storage.snapshots import Snapshots, none
from tasks.params import Params


class MergeParams(Params):
    order: int = 1


def merge(clouds: list[PointCloud], params: MergeParams) -> tuple[PointCloud, Snapshots]:
    if "TOY_KILL" in os.environ:
        os.kill(os.getpid(), signal.SIGKILL)
    xyz = np.concatenate([cloud.xyz for cloud in clouds])[:: params.order]
    return PointCloud(xyz, np.zeros(3)), none()
