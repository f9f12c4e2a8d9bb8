"""Tops round a corner against the rectangles they were made of."""

import numpy as np
import pytest
from furniture_rooms import cloud, floor, one_room, plate
from shapely import box

from tasks.furniture.boxes import fit_box
from tasks.furniture.candidates import TOP
from tasks.furniture.elbows import cut_at_corner
from tasks.furniture.features import FEATURES
from tasks.furniture.segments import FurnitureSegmentParams, find_furniture_segments

CELL = 0.04


def columns(*shapes):
    x, y = np.meshgrid(np.arange(100) * CELL, np.arange(100) * CELL, indexing="ij")
    xy = np.column_stack((x.ravel(), y.ravel()))
    held = [
        (xy > (s.bounds[0], s.bounds[1])).all(1) & (xy < (s.bounds[2], s.bounds[3])).all(1)
        for s in shapes
    ]
    return xy[np.any(held, axis=0)]


def test_a_corner_is_cut_into_its_two_arms():
    xy = columns(box(0, 0, 3.0, 0.6), box(0, 0, 0.6, 2.4))
    before = cut_at_corner(xy, fit_box(xy, np.zeros(1), CELL), CELL)
    parts = [np.ptp(xy[side], axis=0) + CELL for side in (before, ~before)]
    areas = sorted(float(part.prod()) for part in parts)
    assert sum(areas) == pytest.approx(0.6 * 3.0 + 0.6 * 1.8, rel=0.1)


@pytest.mark.parametrize("shape", [box(0, 0, 1.6, 0.8), box(0, 0, 3.0, 0.6)])
def test_an_oblong_is_not_cut(shape):
    xy = columns(shape)
    assert cut_at_corner(xy, fit_box(xy, np.zeros(1), CELL), CELL) is None


def test_an_oblong_with_a_corner_hidden_is_not_cut():
    xy = columns(box(0, 0, 1.6, 0.8))
    xy = xy[~((xy > (1.0, 0.4)).all(axis=1))]
    assert cut_at_corner(xy, fit_box(xy, np.zeros(1), CELL), CELL) is None


def test_no_segment_of_a_worktop_round_a_corner_is_deeper_than_its_arms():
    arms = (plate(1.5, 0.32, 3.0, 0.6, 0.9), plate(0.32, 1.6, 0.6, 2.0, 0.9))
    segments = find_furniture_segments(
        one_room(), [cloud(floor(), *arms)], FurnitureSegmentParams()
    )
    tops = segments.features[:, FEATURES.index("found_by")] == TOP
    assert tops.sum() >= 2
    assert (segments.features[tops, FEATURES.index("box_depth_m")] < 0.72).all()
