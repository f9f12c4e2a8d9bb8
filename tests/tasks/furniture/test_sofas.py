"""Sofas against the boxes their points were made from."""

import numpy as np
import pytest
import shapely
from furniture_rooms import cloud, floor, one_room, panel, plate

from tasks.furniture.candidates import SOFA
from tasks.furniture.features import FEATURES
from tasks.furniture.segments import FurnitureSegmentParams, find_furniture_segments


def found(*parts):
    segments = find_furniture_segments(
        one_room(), [cloud(floor(), *parts)], FurnitureSegmentParams()
    )
    return segments, np.flatnonzero(segments.features[:, FEATURES.index("found_by")] == SOFA)


def sofa(x, y, length=1.9, depth=0.85, seat=0.43, arm=0.16, back=0.2, arm_top=0.6, top=0.82):
    """Return what is seen from before it: seat, tops and inner faces of back and arms."""
    middle, behind = y - back / 2, y + depth / 2 - back / 2
    front = y + depth / 2 - back
    inner = length - 2 * arm
    parts = [
        plate(x, middle, inner, depth - back, seat),
        plate(x, behind, length, back, top),
        panel(x, front, inner, seat, top),
    ]
    for side in (-1, 1):
        parts.append(plate(x + side * (length - arm) / 2, middle, arm, depth - back, arm_top))
    return np.concatenate(parts)


@pytest.mark.parametrize("y", [2.5, 4.55])
def test_a_sofa_is_one_piece_with_its_back_and_arms(y):
    segments, rows = found(sofa(3, y))
    assert len(rows) == 1
    truth = shapely.box(2.05, y - 0.425, 3.95, y + 0.425)
    shape = segments.footprints[rows[0]]
    assert shape.intersection(truth).area / shape.union(truth).area > 0.8
    assert segments.surface_m[rows[0]] == pytest.approx(0.43, abs=0.03)
    assert segments.top_m[rows[0]] == pytest.approx(0.82, abs=0.05)


def test_a_low_table_is_no_sofa():
    assert not len(found(plate(3, 2.5, 1.4, 0.7, 0.45))[1])


def test_a_chair_is_no_sofa():
    assert not len(found(plate(3, 2.5, 0.48, 0.48, 0.45), panel(3, 2.73, 0.48, 0.45, 0.86))[1])
