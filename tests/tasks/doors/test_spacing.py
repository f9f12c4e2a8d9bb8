"""The distance of neighbouring points against that of drawn lattices."""

import numpy as np
import pytest

from storage.points import PointCloud
from tasks.doors.spacing import FINEST_M, spacing_m

LOW, HIGH = np.array([-1.0, -1.0, -1.0]), np.array([9.0, 9.0, 4.0])


def wall(step, origin=(0.0, 0.0, 0.0), shift=0.0):
    """Return a wall along x, 8 m long and 3 m high, with a point every step."""
    x, z = np.meshgrid(np.arange(0, 8, step) + shift, np.arange(0, 3, step) + shift)
    xyz = np.column_stack([x.ravel(), np.full(x.size, 2.0), z.ravel()]) - np.array(origin)
    return PointCloud(xyz.astype(np.float32), np.array(origin))


@pytest.mark.parametrize(("step", "within"), [(0.04, 0.1), (0.05, 0.1), (0.1, 0.1), (0.2, 0.25)])
@pytest.mark.parametrize("origin", [(0.0, 0.0, 0.0), (3.1, -2.0, 0.7)])
def test_a_lattice_has_its_own_spacing(step, within, origin):
    assert spacing_m([wall(step, origin)], LOW, HIGH) == pytest.approx(step, rel=within)


def test_scans_of_one_wall_count_together():
    both = [wall(0.1), wall(0.1, shift=0.05)]  # twice as many points a square metre
    assert spacing_m(both, LOW, HIGH) == pytest.approx(0.1 / np.sqrt(2), rel=0.12)


def test_points_outside_the_box_and_stray_ones_leave_it_as_it_is():
    far = PointCloud(wall(0.03).xyz, np.array([500.0, 0.0, 0.0]))
    stray = PointCloud(np.random.default_rng(0).uniform(LOW, HIGH, (60, 3)).astype(np.float32),
                       np.zeros(3))  # fmt: skip
    assert spacing_m([wall(0.1), far, stray], LOW, HIGH) == pytest.approx(0.1, rel=0.12)


def test_dense_clouds_and_none_have_the_finest_spacing():
    assert spacing_m([wall(0.008)], LOW, HIGH) == FINEST_M
    assert spacing_m([], LOW, HIGH) == FINEST_M
