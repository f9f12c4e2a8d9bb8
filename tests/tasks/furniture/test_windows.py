"""Compiled questions about boxes of columns against numpy and shapely."""

import numpy as np
import pytest
import shapely

from tasks.furniture.boxes import Box
from tasks.furniture.windows import closed_side, filled_share, from_edges, quantile, rows_in

RNG = np.random.default_rng(5)


@pytest.mark.parametrize("turn", [0.0, 0.4, 2.0])
def test_the_columns_in_a_box_are_those_whose_middles_it_holds(turn):
    index = np.full((40, 50), -1, np.int32)
    inside = RNG.uniform(size=index.shape) < 0.8
    index[inside] = np.arange(inside.sum())
    xy = (np.argwhere(inside) + 0.5) * 0.04
    box = Box(np.array((0.8, 1.0)), np.array((np.cos(turn), np.sin(turn))), 0.7, 0.31)
    first, last = 100, len(xy) - 60
    found = rows_in(
        index, (0, 40, 0, 50), first, last, xy[first:], box.centre, box.axis, (0.35, 0.155)
    )
    held = np.flatnonzero(box.holds(xy))
    assert len(found) > 50
    assert np.array_equal(np.sort(found) + first, held[(held >= first) & (held <= last)])


def test_the_share_of_filled_slices_is_numpys():
    counts = RNG.integers(0, 2, (30, 20)).astype(np.uint8)
    columns = np.array([3, 7, 29])
    assert filled_share(counts, columns, 4, 11) == (counts[columns, 4:11] > 0).mean()


def test_a_front_closes_one_side_and_four_legs_none():
    places = np.stack(np.meshgrid(np.arange(30), np.arange(15)), axis=2).reshape(-1, 2)
    local = (places + 0.5) * 0.04 - (0.6, 0.3)
    columns = np.arange(len(local))
    front, legs = np.zeros((2, len(local), 40), np.uint8)
    front[places[:, 1] == 14] = 3
    legs[(places[:, 0] % 29 == 0) & (places[:, 1] % 14 == 0)] = 3
    shares = [
        closed_side(counts, columns, local, (0.6, 0.3), 0.1, 0.04, 5, 35)
        for counts in (front, legs)
    ]
    assert shares[0] == 1
    assert shares[1] == pytest.approx(2 / 15)


def test_distances_from_edges_are_shapelys():
    edges = RNG.uniform(0, 5, (7, 2, 2))
    xy = RNG.uniform(-1, 6, (200, 2))
    lines = shapely.MultiLineString([shapely.LineString(edge) for edge in edges])
    assert from_edges(xy, edges) == pytest.approx(shapely.distance(lines, shapely.points(xy)))


@pytest.mark.parametrize("share", [0.0, 0.02, 0.5, 0.95, 1.0])
@pytest.mark.parametrize("n", [1, 2, 17])
def test_quantiles_are_numpys(n, share):
    values = RNG.normal(size=n)
    assert quantile(values, share) == pytest.approx(np.quantile(values, share))
