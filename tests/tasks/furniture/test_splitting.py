"""Grids of tables under one top."""

import numpy as np
import pytest

from tasks.furniture.boxes import Box
from tasks.furniture.dimensions import TABLES_M, widths_m
from tasks.furniture.splitting import RunParams, SplitParams, pieces, split_grid, split_run

NONE = np.empty((0, 2))


def grid(length, depth, supports=NONE):
    return split_grid((length, depth), np.asarray(supports, float), TABLES_M, SplitParams())


@pytest.mark.parametrize("error", [-0.03, 0.0, 0.03])
@pytest.mark.parametrize(
    ("length", "depth", "expected"),
    [
        (1.6, 0.8, (1, 1)),
        (1.2, 0.6, (1, 1)),
        (2.0, 0.8, (1, 1)),
        (2.25, 1.1, (1, 1)),  # a conference table is no row of desks
        (3.0, 1.1, (1, 1)),
        (2.8, 0.7, (2, 1)),
        (4.2, 0.7, (3, 1)),
        (1.6, 1.6, (1, 2)),
        (1.8, 1.5, (1, 2)),
        (3.2, 1.6, (2, 2)),
    ],
)
def test_standard_sizes_tell_how_many_tables_there_are(length, depth, expected, error):
    assert grid(length + error, depth + error / 2) == expected


def test_side_panels_under_a_joint_decide_between_two_grids():
    along = {3: np.array([-0.8, 0.8]), 4: np.array([-1.2, 0.0, 1.2])}
    for n, joints in along.items():
        at = np.concatenate([[-2.4, 2.4], joints]).repeat(15)
        supports = np.column_stack((at, np.tile(np.linspace(-0.7, 0.7, 15), len(at) // 15)))
        assert grid(4.8, 1.6, supports) == (n, 2)


def test_pieces_tile_their_box():
    box = Box(np.array([1.0, 2.0]), np.array([0.6, 0.8]), 4.8, 1.6)
    parts = pieces(box, (3, 2))
    assert len(parts) == 6
    assert sum(part.area for part in parts) == pytest.approx(box.area)
    assert all(part.polygon.within(box.polygon.buffer(1e-9)) for part in parts)
    union = parts[0].polygon
    for part in parts[1:]:
        union = union.union(part.polygon)
    assert union.symmetric_difference(box.polygon).area < 1e-9


@pytest.mark.parametrize(
    ("length", "depth", "n"),
    [
        (0.8, 0.42, 1),
        (1.6, 0.42, 2),  # 2 x 0.8 m
        (2.04, 0.42, 2),  # 2 x 1.0 m, measured 4 cm off
        (3.6, 0.42, 3),  # 3 x 1.2 m
        (1.8, 0.6, 3),  # cupboards, 0.6 m each
        (1.4, 0.6, 2),  # washstands, 0.7 m each
        (0.35, 0.42, 1),  # of no standard width
    ],
)
def test_a_run_is_as_many_pieces_as_make_its_length(length, depth, n):
    assert split_run(length, widths_m(depth), RunParams()) == n
