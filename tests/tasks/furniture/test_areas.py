"""Triangulated areas against shapely, Eq. 12 against planes worked out by hand."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from tasks.furniture.areas import level_plane, plane_distance, triangulated_area
from tasks.furniture.features import concave_hull

U_SHAPE = [(0, 0), (6, 0), (6, 4), (4, 4), (4, 1), (2, 1), (2, 4), (0, 4)]
STAR = [
    (np.cos(a) * r, np.sin(a) * r)
    for a, r in zip(np.arange(14) * np.pi / 7, [3, 1] * 7, strict=True)
]


@pytest.mark.parametrize("outline", [U_SHAPE, STAR], ids=["U", "star"])
@pytest.mark.parametrize("apex", [None, (0.0, 0.0), (17.0, -5.0)])
def test_triangles_sum_to_the_area_from_any_apex_and_either_way_round(outline, apex):
    expected = shapely.Polygon(outline).area
    vertices = np.array(outline, float)
    at = None if apex is None else np.array(apex)
    assert triangulated_area(vertices, at) == pytest.approx(expected, rel=1e-12)
    assert triangulated_area(vertices[::-1], at) == pytest.approx(expected, rel=1e-12)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(20, 200))
def test_irregular_hulls_have_the_area_shapely_finds(seed, n):
    rng = np.random.default_rng(seed)
    hull = concave_hull(rng.normal(0, 1, (n, 2)), 0.04)
    area = triangulated_area(shapely.get_coordinates(hull.exterior)[:-1])
    assert area == pytest.approx(hull.area, rel=1e-9)


def test_repeated_vertices_and_less_than_three_do_no_harm():
    assert triangulated_area(np.array([(0, 0), (1, 0), (1, 0), (1, 1), (0, 1)], float)) == 1.0
    assert triangulated_area(np.array([(0.0, 0.0), (1.0, 0.0)])) == 0.0


@pytest.mark.parametrize(
    ("normal", "offset", "at", "expected"),
    [
        ((0, 0, 1), 0.74, (3, 4, 0), 0.74),
        ((0, 0, -2), -1.48, (3, 4, 0), 0.74),  # twice the normal, the other way
        ((3, 0, 4), 10.0, (0, 0, 0), 2.0),  # 3 x + 4 z = 10 is 10 / 5 off the origin
        ((1, 2, 2), 3.0, (1, 1, 3), 2.0),  # |1 + 2 + 6 - 3| / 3
    ],
)
def test_distances_from_planes_worked_out_by_hand(normal, offset, at, expected):
    found = plane_distance(np.array(normal, float), offset, np.array(at, float))
    assert found == pytest.approx(expected, abs=1e-12)


def test_a_plane_without_a_normal_is_refused():
    with pytest.raises(ValueError, match="normal"):
        plane_distance(np.zeros(3), 1.0, np.zeros(3))


def test_the_plane_through_a_slanting_patch_is_found_and_a_line_is_taken_for_level():
    rng = np.random.default_rng(1)
    xy = rng.uniform(-1, 1, (50, 2))
    patch = np.column_stack((xy, 0.5 + 0.1 * xy[:, 0] - 0.2 * xy[:, 1]))
    normal, offset = level_plane(patch)
    assert patch @ normal == pytest.approx(np.full(50, offset), abs=1e-12)
    assert np.linalg.norm(normal) == pytest.approx(1)
    line = np.column_stack((np.linspace(0, 1, 9), np.zeros(9), np.linspace(0.7, 0.8, 9)))
    normal, offset = level_plane(line)
    assert normal.tolist() == [0, 0, 1] and offset == pytest.approx(0.75)
