"""Paths through walls, against shapely."""

import numpy as np
import pytest
import shapely

from storage.snapshots import Snapshots
from tasks.doors.trajectory import TrajectoryParams, crossed, crossings, steps

PARAMS = TrajectoryParams()


def path(xy, times=None):
    n = len(xy)
    positions = np.column_stack([np.array(xy, float), np.full(n, 1.5)])
    times = np.arange(n, dtype=float) if times is None else np.array(times, float)
    return Snapshots(times, positions, np.tile([1.0, 0, 0, 0], (n, 1)), np.ones(n, np.int64))


def test_steps_join_snapshots_of_one_scan_in_their_order():
    first, second = path([(0, 0), (1, 0), (1, 1)], times=[0, 2, 1]), path([(5, 5)])
    found = steps([first, second, path([])], PARAMS)
    assert found.tolist() == [[[0, 0], [1, 1]], [[1, 1], [1, 0]]]


@pytest.mark.parametrize(
    ("xy", "times"),
    [([(0, 0), (9, 0)], [0, 1]), ([(0, 0), (1, 0)], [0, 60])],
    ids=["far apart", "long after"],
)
def test_two_snapshots_that_leave_the_way_open_make_no_step(xy, times):
    assert len(steps([path(xy, times)], PARAMS)) == 0


def test_crossings_are_where_the_lines_meet():
    rng = np.random.default_rng(2)
    walks, walls = rng.uniform(0, 6, (80, 2, 2)), rng.uniform(0, 6, (30, 2, 2))
    wall, place = crossings(walks, walls)
    a, b = shapely.linestrings(walks), shapely.linestrings(walls)
    meet = shapely.intersects(a[:, None], b)
    assert np.bincount(wall, minlength=30).tolist() == meet.sum(axis=0).tolist()
    expected = [
        shapely.line_locate_point(b[j], shapely.intersection(a[i], b[j]))
        for j in range(30)
        for i in np.flatnonzero(meet[:, j])
    ]
    order = np.argsort(wall, kind="stable")
    assert place[order] == pytest.approx(expected, abs=1e-6)


def test_steps_through_an_opening_are_counted_and_those_beside_it_are_not():
    walls = np.array([[(0, 0), (10, 0)], [(0, 3), (10, 3)]], float)
    xs = (2.1, 2.5, 2.95, 3.3, 7.0)
    walks = np.array([[(x, -0.5), (x, 0.5)] for x in xs])
    where = crossings(walks, walls)
    on = np.array([0, 0, 1], np.int32)
    through = crossed(on, np.array([2.0, 5, 2]), np.array([3.0, 6, 3]), where, PARAMS)
    assert through.tolist() == [3, 0, 0]


def test_nobody_walked_and_nothing_is_crossed():
    where = crossings(steps([], PARAMS), np.array([[(0, 0), (1, 0)]], float))
    on = np.zeros(1, np.int32)
    assert crossed(on, np.zeros(1), np.ones(1), where, PARAMS).tolist() == [0]
