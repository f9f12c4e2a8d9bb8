"""Alpha shapes against closed forms and shapely."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import Polygon, box

from tasks.surfaces.hulls import alpha_shape

U_SHAPE = Polygon([(0, 0), (6, 0), (6, 4), (4, 4), (4, 1), (2, 1), (2, 4), (0, 4)])
WITH_HOLE = box(0, 0, 5, 5).difference(box(1, 1, 3.5, 4))
L_SHAPE = Polygon([(0, 0), (5, 0), (5, 2), (2, 2), (2, 6), (0, 6)])
SQUARE = box(0, 0, 4, 4)
INNER_CORNERS = {SQUARE: 0, L_SHAPE: 1, U_SHAPE: 2, WITH_HOLE: 4}


def lattice(polygon, step=0.1):
    """Return the lattice points in a polygon whose corners lie on the lattice, border included."""
    low, high = np.reshape(polygon.bounds, (2, 2))
    counts = np.rint((high - low) / step).astype(int) + 1
    xy = low + np.argwhere(np.ones(counts, bool)) * step
    return xy[shapely.dwithin(polygon, shapely.points(xy), 1e-9)]


@pytest.mark.parametrize("polygon", INNER_CORNERS, ids=["square", "L", "U", "hole"])
@pytest.mark.parametrize("turn_deg", [0, 30])
def test_a_dense_sample_of_a_polygon_gives_the_polygon(polygon, turn_deg):
    turned = shapely.affinity.rotate(polygon, turn_deg, origin=(0, 0))
    xy = lattice(polygon, step=0.1)
    angle = np.radians(turn_deg)
    xy = xy @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    hull = alpha_shape(xy, 0.12)
    # one triangle of half a lattice square fits into each inner corner
    corners = INNER_CORNERS[polygon]
    assert hull.area == pytest.approx(polygon.area + corners * 0.1**2 / 2, rel=1e-6)
    assert turned.difference(hull.buffer(1e-9)).area < 1e-6
    assert len(hull.interiors) == len(polygon.interiors)


def test_a_random_sample_of_a_u_stays_within_it_and_fills_it():
    rng = np.random.default_rng(1)
    xy = rng.uniform((0, 0), (6, 4), (20_000, 2))
    xy = xy[shapely.contains_xy(U_SHAPE, *xy.T)]
    hull = alpha_shape(xy, 0.25)
    assert hull.is_valid
    assert hull.area == pytest.approx(U_SHAPE.area, rel=0.02)
    assert hull.within(U_SHAPE.buffer(0.25))
    # the circle rolls into the two inner corners of the notch, but for what its roundness leaves
    assert hull.difference(U_SHAPE).area < 2 * (0.25**2)


def test_a_gap_narrower_than_the_circle_closes_and_a_wider_one_stays_open():
    xy = lattice(WITH_HOLE)
    assert len(alpha_shape(xy, 1.0).interiors) == 1
    assert alpha_shape(xy, 3.0).area == pytest.approx(25)


def test_of_two_parts_the_larger_is_the_hull():
    xy = np.concatenate([lattice(box(0, 0, 2, 2)), lattice(box(5, 0, 8, 2))])
    hull = alpha_shape(xy, 0.3)
    assert hull.area == pytest.approx(6)
    assert hull.bounds == pytest.approx((5, 0, 8, 2))


@pytest.mark.parametrize(
    "xy",
    [
        [(1, 2)],
        [(1, 2)] * 10,
        [(0, 0), (3, 1)],
        [(0, 0), (1, 0), (2, 0), (7, 0)],
        [(0.1 * i, 0.3 * i) for i in range(50)],
    ],
    ids=["one", "one, ten times", "two", "level line", "slanting line"],
)
def test_points_without_an_area_get_a_thin_box_around_them(xy):
    xy = np.array(xy, float)
    hull = alpha_shape(xy, 0.3)
    assert hull.geom_type == "Polygon" and hull.is_valid
    assert shapely.dwithin(hull, shapely.points(xy), 1e-9).all()
    reach = np.ptp(xy, axis=0)
    assert 0 < hull.area <= 0.1 * (np.linalg.norm(reach) + 0.1)


places = st.lists(st.tuples(st.integers(0, 40), st.integers(0, 40)), max_size=40)
clouds = places.map(lambda xy: np.array(list({*xy, (0, 0), (1, 0), (0, 1)}), float) / 4)
"""Places on a lattice of 0.25 m, some of them neighbours: a circle of 0.2 m fits somewhere."""


@settings(max_examples=100, deadline=None)
@given(clouds)
def test_with_an_endless_radius_it_is_the_convex_hull(xy):
    convex = shapely.MultiPoint(xy).convex_hull
    assert alpha_shape(xy, 1e9).area == pytest.approx(convex.area, rel=1e-6)


@settings(max_examples=150, deadline=None)
@given(clouds, st.floats(0.2, 10), st.floats(1, 5))
def test_a_bigger_radius_never_gives_a_smaller_area(xy, radius, factor):
    small, large = alpha_shape(xy, radius), alpha_shape(xy, radius * factor)
    assert large.area >= small.area - 1e-9


@settings(max_examples=100, deadline=None)
@given(clouds, st.floats(0.2, 10))
def test_the_hull_is_a_valid_part_of_the_convex_hull(xy, radius):
    hull = alpha_shape(xy, radius)
    assert hull.is_valid and hull.geom_type == "Polygon"
    assert hull.area > 0
    assert hull.difference(shapely.MultiPoint(xy).convex_hull.buffer(1e-9)).area < 1e-9


def test_places_too_far_apart_for_the_circle_span_no_area():
    three = np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 4.0]])
    assert alpha_shape(three, 0.3).area < alpha_shape(three, 5.0).area
