"""The occupied cubes against sets of cubes, and what stands upright against closed forms."""

import numpy as np
import pytest

from storage.coverage import Coverage
from storage.occupancy import Occupancy
from storage.points import PointCloud
from tasks.surfaces.occupancy import OccupancyParams, occupied_space
from tasks.surfaces.upright import Columns

FLOOR, CEILING = 0.0, 2.8


def cloud_of(xyz, origin=(0.0, 0.0, 0.0)):
    return PointCloud(np.asarray(xyz, np.float32).reshape(-1, 3), np.array(origin, float))


@pytest.mark.parametrize("cell", [0.1, 0.25])
@pytest.mark.parametrize("far", [0.0, 1e5], ids=["near", "one point far away"])
@pytest.mark.parametrize("origin", [(0, 0, 0), (5e5, -4e6, 120)])
def test_every_cube_with_a_point_is_occupied_and_no_other(cell, far, origin):
    xyz = np.random.default_rng(1).uniform(-3, 3, (2000, 3)).astype(np.float32)
    xyz[0] += np.float32(far)
    found = occupied_space(cloud_of(xyz, origin), OccupancyParams(cell_m=cell))
    exact = xyz.astype(float) + np.array(origin, float)
    expected = sorted({tuple(int(np.floor(v / cell)) for v in p) for p in exact})
    assert found.cubes.tolist() == [list(cube) for cube in expected]
    assert found.cell_m == cell


def test_a_cloud_without_points_occupies_nothing():
    assert len(occupied_space(cloud_of([]), OccupancyParams())) == 0


def coverage_of(floor, ceiling):
    no = np.empty(0)
    return Coverage(
        np.empty((0, 2), np.int32),
        no,
        no,
        np.empty(0, np.int64),
        np.empty(0, np.int32),
        0.1,
        floor,
        ceiling,
    )


def wall(x0, x1, z0, z1, turn=0.0):
    """Return the occupied space of an upright sheet over y = 0 from x0 to x1, turned."""
    x, z = np.meshgrid(np.arange(x0, x1, 0.02), np.arange(z0, z1, 0.02), indexing="ij")
    xyz = np.column_stack([x.ravel(), np.full(x.size, 0.001), z.ravel()])
    xyz[:, :2] = xyz[:, :2] @ turned(turn).T
    return occupied_space(cloud_of(xyz), OccupancyParams())


def turned(angle):
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def share(space, *lines, turn=0.0):
    edges = np.array(lines, float) @ turned(turn).T
    return Columns(space, coverage_of(FLOOR, CEILING)).share(edges)


@pytest.mark.parametrize("turn", [0.0, 0.3, 2.0])
def test_along_a_wall_all_of_the_height_is_occupied_and_beside_it_none(turn):
    space = [wall(0, 4, FLOOR, CEILING, turn)]
    on, half, off = share(
        space, [(0.2, 0), (3.8, 0)], [(2, 0), (6, 0)], [(0.2, 0.5), (3.8, 0.5)], turn=turn
    )
    assert on == 1
    assert half == pytest.approx(0.5, abs=0.05)
    assert off == 0


def test_over_a_door_only_what_is_above_its_head_is_occupied():
    space = [wall(0, 4, 2.0, CEILING)]
    bins = int((CEILING - 0.25 - 0.3) / 0.2)
    (over,) = share(space, [(1, 0), (3, 0)])
    edges = 0.3 + np.arange(bins) * (CEILING - 0.55) / bins
    assert over == pytest.approx((edges > 2.0 - 2.25 / bins).mean(), abs=0.01)


def test_what_several_scans_saw_counts_together():
    low, high = wall(0, 4, FLOOR, 1.4), wall(0, 4, 1.4, CEILING)
    along = [(0.2, 0), (3.8, 0)]
    assert share([low], along)[0] < 0.6
    assert share([low, high], along)[0] == 1


def test_floor_and_ceiling_themselves_tell_nothing():
    xyz = np.random.default_rng(0).uniform((-3, -3, 0), (3, 3, 0.1), (20_000, 3))
    xyz[::2, 2] += CEILING - 0.1
    space = [occupied_space(cloud_of(xyz), OccupancyParams())]
    assert share(space, [(-2, 0), (2, 0)])[0] == 0


def test_without_scans_or_levels_there_is_nothing_upright():
    nothing = Occupancy(np.empty((0, 3), np.int32), 0.1)
    for scans in ([], [nothing]):
        columns = Columns(scans, coverage_of(None, None))
        assert columns.share(np.array([[(0.0, 0.0), (1.0, 0.0)]])).tolist() == [0]
        assert len(columns.share(np.empty((0, 2, 2)))) == 0
