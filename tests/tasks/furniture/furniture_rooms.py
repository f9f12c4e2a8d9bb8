"""Rooms with furniture of level tops and upright panels, as point clouds, for tests."""

import numpy as np
import shapely

from storage.points import PointCloud
from storage.rooms import Rooms

STEP = 0.02


def one_room(width=6.0, depth=5.0, floor=0.0):
    return Rooms(
        np.array([shapely.box(0, 0, width, depth)], object),
        np.array([floor]),
        np.array([floor + 2.8]),
        np.ones(1),
        np.ones(1),
        ((0,),),
    )


def cloud(*parts, noise=0.004, seed=0):
    xyz = np.concatenate(parts)
    xyz = xyz + np.random.default_rng(seed).normal(0, noise, xyz.shape)
    return PointCloud(xyz.astype(np.float32), np.zeros(3))


def plate(x, y, width, depth, z, turn=0.0):
    """Return a level lattice of points around a middle."""
    u, v = np.meshgrid(_line(width), _line(depth), indexing="ij")
    return _placed(np.column_stack((u.ravel(), v.ravel())), np.full(u.size, z), x, y, turn)


def panel(x, y, width, low, high, turn=0.0):
    """Return an upright lattice of points, `width` along x before it is turned."""
    u, z = np.meshgrid(_line(width), np.arange(low, high + 1e-9, STEP), indexing="ij")
    return _placed(np.column_stack((u.ravel(), np.zeros(u.size))), z.ravel(), x, y, turn)


def floor(width=6.0, depth=5.0, but=()):
    points = plate(width / 2, depth / 2, width, depth, 0.0)
    for shape in but:
        points = points[~shapely.contains_xy(shape, points[:, 0], points[:, 1])]
    return points


def chair(x, y, turn=0.0, side=0.48, seat=0.45, top=0.86):
    """Return seat and back of a chair that looks to -y before it is turned."""
    back = np.array((0.0, side / 2 - 0.015))
    c, s = np.cos(turn), np.sin(turn)
    at = back @ np.array([(c, s), (-s, c)])
    return np.concatenate(
        [
            plate(x, y, side, side, seat, turn),
            panel(x + at[0], y + at[1], side, seat, top, turn),
        ]
    )


def _line(length):
    n = round(length / STEP)
    return (np.arange(n) + 0.5) * length / n - length / 2


def _placed(xy, z, x, y, turn):
    c, s = np.cos(turn), np.sin(turn)
    return np.column_stack((xy @ np.array([(c, s), (-s, c)]) + (x, y), z))
