"""The accumulator ball, in which no direction is easier to vote for than another, and the draws."""

import numpy as np
import pytest

from tasks.surfaces.voting import (
    ANYWHERE,
    LOG,
    _azimuth,
    _cell_of,
    _draw_anywhere,
    _draw_nearby,
    _polar,
    fill_bins,
    make_ball,
    seed_state,
    vote,
)

POLAR = np.radians(15)
"""Size of the caps left out: a pole's few cells cannot all be of one size."""


def solid_angles(ball):
    """Return each row's cell area by Archimedes: a zone's area is its height times 2 pi."""
    heights = np.cos(np.linspace(0, np.pi, len(ball.cells_of_row) + 1))
    return 2 * np.pi * (heights[:-1] - heights[1:]) / ball.cells_of_row


def away_from_poles(ball):
    edges = np.linspace(0, np.pi, len(ball.cells_of_row) + 1)
    return (edges[:-1] >= POLAR) & (edges[1:] <= np.pi - POLAR)


@pytest.mark.parametrize("degrees", [1, 2, 3, 5, 10])
def test_all_cells_away_from_the_poles_are_nearly_equal_in_area(degrees):
    ball = make_ball(np.radians(degrees))
    areas = solid_angles(ball)[away_from_poles(ball)]
    assert areas.max() / areas.min() < 1.3


@pytest.mark.parametrize("degrees", [1, 2, 3, 5, 10, 90])
def test_the_cells_cover_the_sphere_once(degrees):
    ball = make_ball(np.radians(degrees))
    assert (solid_angles(ball) * ball.cells_of_row).sum() == pytest.approx(4 * np.pi)
    assert ball.areas() == pytest.approx(solid_angles(ball))
    assert (np.diff(ball.first_of_row) == ball.cells_of_row).all()


@pytest.mark.parametrize("degrees", [1, 2, 5, 10])
def test_a_cell_is_about_as_wide_as_asked_for(degrees):
    ball = make_ball(np.radians(degrees))
    widths = np.degrees(np.sqrt(solid_angles(ball)[away_from_poles(ball)]))
    assert widths == pytest.approx(np.full(len(widths), degrees), rel=0.15)


def test_random_directions_fall_into_all_cells_in_proportion_to_their_areas():
    ball = make_ball(np.radians(15))
    rng = np.random.default_rng(1)
    normals = rng.normal(size=(50_000, 3))
    normals = (normals / np.linalg.norm(normals, axis=1, keepdims=True)).astype(np.float32)
    place = np.float32(0.0)
    cells = [
        _cell_of(*n, place, ball.cells_of_row, ball.first_of_row, 1, np.float32(1)) for n in normals
    ]
    hits = np.bincount(cells, minlength=ball.first_of_row[-1])
    assert len(hits) == ball.first_of_row[-1]
    expected = np.repeat(solid_angles(ball), ball.cells_of_row) / (4 * np.pi) * len(normals)
    # chi-square over its degrees of freedom: 1 on average, 1.3 is five standard deviations here
    assert ((hits - expected) ** 2 / expected).sum() / (len(hits) - 1) < 1.45
    assert (hits > 0).all()


def test_angles_are_known_to_a_ten_thousandth_of_a_radian():
    at = np.linspace(-1, 1, 4001, dtype=np.float32)
    assert np.array([_polar(z) for z in at]) == pytest.approx(np.arccos(at), abs=1e-4)
    turns = np.linspace(-3.14, 3.14, 4001)
    x, y = np.cos(turns).astype(np.float32), np.sin(turns).astype(np.float32)
    azimuths = np.array([_azimuth(b, a) for a, b in zip(x, y, strict=True)])
    assert azimuths == pytest.approx(np.arctan2(y, x), abs=1e-4)
    for a, b in ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)):
        assert _azimuth(np.float32(b), np.float32(a)) == pytest.approx(np.arctan2(b, a), abs=1e-4)


def binned(xyz, edge):
    low = xyz.min(axis=0) - np.float32(1e-3)
    shape = ((xyz.max(axis=0) - low) / np.float32(edge)).astype(np.int64) + 1
    return *fill_bins(xyz, low, np.float32(edge), shape), shape, low, np.float32(edge)


def spans(xyz, triplets):
    a, b, c = (xyz[triplets[:, k]].astype(float) for k in range(3))
    return np.linalg.norm([a - b, a - c, b - c], axis=2)


def test_the_bins_hold_every_point_once_and_in_its_place():
    xyz = np.random.default_rng(1).uniform(-3, 2, (3000, 3)).astype(np.float32)
    bins, members, shape, low, edge = binned(xyz, 0.4)
    assert sorted(members) == list(range(3000))
    at = ((xyz - low) / edge).astype(int)
    number = (at[:, 0] * shape[1] + at[:, 1]) * shape[2] + at[:, 2]
    assert (np.repeat(np.arange(len(bins) - 1), np.diff(bins)) == number[members]).all()


def test_all_distances_of_a_triplet_are_in_range():
    xyz = np.random.default_rng(2).uniform(0, 3, (4000, 3)).astype(np.float32)
    triplets = np.empty((5000, 3), np.int64)
    drawn = _draw_anywhere(xyz, 5000, np.float32(0.25), np.float32(4.0), seed_state(1), triplets)
    assert 500 < drawn < 4500
    away = spans(xyz, triplets[:drawn])
    assert away.min() > 0.5 - 1e-6 and away.max() < 2 + 1e-6
    assert len(np.unique(triplets[:drawn])) > 1500  # from all over the cloud
    low2, high2 = np.float32(0.04), np.float32(0.25)
    bins, members, shape, low, edge = binned(xyz, 0.25)
    drawn = _draw_nearby(
        xyz, 5000, bins, members, shape, low, edge, 2, low2, high2, seed_state(1), triplets
    )
    assert drawn > 1000
    away = spans(xyz, triplets[:drawn])
    assert away.min() > 0.2 - 1e-6 and away.max() < 0.5 + 1e-6


@pytest.mark.parametrize(("edge", "reach"), [(ANYWHERE, 5.0), (0.25, 0.5)])
def test_the_plane_voted_for_is_that_of_the_points_and_none_if_there_is_none(edge, reach):
    rng = np.random.default_rng(3)
    flat = rng.uniform(0, 3, (3000, 3)).astype(np.float32)
    clutter = rng.uniform(0, 3, (3000, 3)).astype(np.float32)
    normal = np.array([0.6, 0.0, 0.8])
    flat -= ((flat @ normal - 1.2)[:, None] * normal).astype(np.float32)
    ball = make_ball(0.035)
    cells = (ball.cells_of_row, ball.first_of_row, 200, 1 / 0.05)
    accumulator = np.zeros(int(ball.first_of_row[-1]) * 200, np.uint16)
    log = (np.empty(LOG, np.int64), np.empty((LOG, 4), np.float32))
    for xyz, holds in ((np.concatenate([flat, clutter]), True), (clutter, False)):
        found, *direction, offset = vote(
            xyz,
            *binned(xyz, edge),
            0.2,
            reach,
            accumulator,
            *cells,
            20,
            20_000,
            seed_state(4),
            *log,
        )
        assert found == holds
        assert not accumulator.any()
        if holds:
            assert abs(normal @ direction) > np.cos(0.04)
            assert offset == pytest.approx(1.2, abs=0.05)
