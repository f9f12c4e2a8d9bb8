"""The accumulator ball: no direction is easier to vote for than another."""

import numpy as np
import pytest

from tasks.surfaces.voting import _cell_of, make_ball

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
