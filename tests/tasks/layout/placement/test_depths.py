"""Fronts and backs of a row: what furniture hides, and what is a wall of its own."""

import numpy as np
import pytest
from shapely import box

from storage.layout import LINE_END
from tasks.layout.extraction.model import LineFrame
from tasks.layout.placement.decoded_rows import DecodedRow
from tasks.layout.placement.depths import SLOPE_RAD, _straight, depth_moves
from tasks.layout.placement.outline import edges_of
from tasks.layout.placement.widths import Chain


def row():
    none = np.zeros(0)
    chain = Chain(np.zeros(2), np.ones(2), np.full(1, np.nan), np.full(1, np.nan))
    return DecodedRow(
        frame=LineFrame.between(np.zeros(2), np.array([20.0, 0.0])),
        decoded=np.array([0]),
        chain=chain,
        faces_m=np.full((2, 2), np.nan),
        presence=np.zeros(2),
        cuts=np.array([LINE_END, LINE_END]),
        interval_m=np.zeros((0, 2)),
        standing=none.astype(int),
        line_faces_m=np.zeros((0, 2)),
        line_presence=none,
        depth_m=np.inf,
    )


def backs(depths, rule=np.nan):
    """Return how far the back of each room moves, NaN where none is asked to."""
    return moved("back", [box(4 * i, 0.2, 4 * i + 3.9, d) for i, d in enumerate(depths)], rule)


def fronts(places):
    """Return how far the front of each room moves, NaN where none is asked to."""
    return moved("front", [box(4 * i, t, 4 * i + 3.9, 5.0) for i, t in enumerate(places)])


def moved(kind, rooms, rule=np.nan):
    edges, n = edges_of(rooms), len(rooms)
    deep, spread = np.full(n, rule), np.full(n, 0.03 if rule > 0 else np.nan)
    seen = np.ones(len(edges))
    moves = depth_moves(
        0, row(), edges, np.arange(n), deep, spread, np.ones(n, bool), seen, 0.03, 0.12, 0.6, 3.0
    )
    found = np.full(n, np.nan)
    for edge, by, wall in zip(moves.edge, moves.by_m, moves.wall, strict=True):
        if wall.kind == kind:
            found[edges.shape[edge]] = by.mean()
            assert wall.number == edges.shape[edge]  # a fault of one room leaves the others alone
    return found


def test_a_single_room_s_back_before_its_row_s_wall_is_furniture():
    assert backs([5.0, 5.0, 4.7, 5.0]) == pytest.approx([0, 0, 0.3, 0], abs=1e-9)


def test_a_back_behind_its_row_s_wall_or_far_before_it_stays():
    assert backs([5.0, 5.0, 5.3, 5.0]) == pytest.approx([0, 0, 0, 0], abs=1e-9)
    assert backs([5.0, 5.0, 4.2, 5.0]) == pytest.approx([0, 0, 0, 0], abs=1e-9)


def test_two_rooms_before_their_row_s_wall_have_a_wall_of_their_own():
    assert backs([5.0, 5.0, 5.0, 4.7, 4.7]) == pytest.approx(np.zeros(5), abs=1e-9)


def test_a_rule_that_knows_the_smaller_depth_keeps_it():
    assert backs([5.0, 5.0, 4.7, 5.0], rule=4.7)[2] == pytest.approx(0, abs=1e-9)


def test_a_front_on_the_corridor_s_side_of_its_wall_goes_to_the_row_s_fronts():
    assert fronts([0.2, 0.0, 0.2, 0.03]) == pytest.approx([0, -0.2, 0, -0.17], abs=1e-9)


def test_a_front_off_the_line_has_a_wall_before_it_and_stays():
    assert fronts([0.2, 0.05, 0.2]) == pytest.approx([0, 0, 0], abs=1e-9)


def test_fronts_on_the_line_stay_where_no_room_shows_the_other_side():
    assert np.isnan(fronts([0.0, 0.0])).all()


def test_a_straight_wall_is_the_least_squares_line_with_a_prior_on_its_turn():
    rng = np.random.default_rng(4)
    s, sigma = np.sort(rng.uniform(0, 30, 7)), rng.uniform(0.005, 0.03, 7)
    t = 5 + 0.001 * s + rng.normal(0, sigma)
    wall = np.arange(1, 7)
    straight = _straight(wall, s, t, sigma)
    # unknown depth at s = 0 and slope; a last equation says what slopes are like
    rows = np.column_stack([np.ones(6), s[wall]]) / sigma[wall, None]
    rows = np.vstack([rows, [0, 1 / SLOPE_RAD]])
    (depth, slope), *_ = np.linalg.lstsq(rows, np.append(t[wall] / sigma[wall], 0), rcond=None)
    assert straight.slope == pytest.approx(slope)
    assert straight.at(s) == pytest.approx(depth + slope * s)


def test_a_wall_of_one_room_runs_along_the_line():
    straight = _straight(np.array([0]), np.array([3.0]), np.array([5.0]), np.array([0.01]))
    assert straight == (5.0, 3.0, 0.0, 0.01)
