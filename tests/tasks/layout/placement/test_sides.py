"""Which outline edges lie on the side walls of a row's rooms."""

import numpy as np
import pytest
from shapely import Polygon, box

from storage.layout import LINE_END
from tasks.layout.extraction.model import LineFrame
from tasks.layout.placement.decoded_rows import DecodedRow
from tasks.layout.placement.outline import edges_of
from tasks.layout.placement.sides import find_sides
from tasks.layout.placement.widths import Chain

BEFORE_M = 0.3
"""How far a cupboard stands before the wall."""
CUPBOARD = [(0, 0.2), (4, 0.2), (4, 0.6), (4 - BEFORE_M, 0.6), (4 - BEFORE_M, 5), (0, 5)]
"""A room whose wall at 4 m is seen for 0.4 m only; the rest a cupboard hides."""
NEXT = box(4.1, 0.2, 8, 5)


def row(presence, upper=4.1):
    """Return a row of two rooms with a wall from 4 to 4.1 m between them."""
    nan = np.nan
    return DecodedRow(
        frame=LineFrame.between(np.zeros(2), np.array([8.0, 0.0])),
        decoded=np.array([0, 1]),
        chain=Chain(np.array([0, 4.05, 8]), np.full(3, 0.02), np.full(2, nan), np.full(2, nan)),
        faces_m=np.array([(nan, nan), (4.0, upper), (nan, nan)]),
        presence=np.array([0, presence, 0]),
        cuts=np.array([LINE_END, 0, LINE_END]),
        interval_m=np.array([(0, 4.05), (4.05, 8)]),
        standing=np.array([0, 1]),
        line_faces_m=np.array([(4.0, upper)]),
        line_presence=np.array([presence]),
        depth_m=np.inf,
    )


def edges_on_wall(room, of):
    """Return where along the line the first room's edges are that lie on the wall between."""
    edges = edges_of([room, NEXT])
    sides = find_sides([of], edges, np.ones((1, 2), bool), np.arange(2), 0.1, 0.15, 0.9)
    mine = (sides.boundary == 1) & (sides.side == 0)
    return sorted(sides.at_m[mine].mean(axis=1).tolist())


def test_a_cupboard_before_a_well_observed_wall_is_on_the_room_s_side():
    assert edges_on_wall(Polygon(CUPBOARD), row(0.99)) == pytest.approx([4 - BEFORE_M, 4.0])


@pytest.mark.parametrize("of", [row(0.5), row(0.99, upper=np.nan)])
def test_before_a_wall_that_is_not_well_observed_only_what_lies_on_it_is(of):
    assert edges_on_wall(Polygon(CUPBOARD), of) == pytest.approx([4.0])


def test_a_short_jog_before_the_wall_is_none_of_its_sides():
    niche = [(0, 0.2), (4, 0.2), (4, 4.5), (4 - BEFORE_M, 4.5), (4 - BEFORE_M, 5), (0, 5)]
    assert edges_on_wall(Polygon(niche), row(0.99)) == pytest.approx([4.0])


def test_a_step_further_before_the_wall_than_furniture_is_deep_is_a_wall_of_its_own():
    ell = [(0, 0.2), (4, 0.2), (4, 0.6), (2, 0.6), (2, 5), (0, 5)]
    assert edges_on_wall(Polygon(ell), row(0.99)) == pytest.approx([4.0])


def test_a_side_behind_the_wall_is_not_taken_for_furniture():
    behind = [(0, 0.2), (4, 0.2), (4, 0.6), (4.3, 0.6), (4.3, 5), (0, 5)]
    assert edges_on_wall(Polygon(behind), row(0.99)) == pytest.approx([4.0])
