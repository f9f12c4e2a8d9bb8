"""The point common to three planes against a linear solver; directions of plan lines."""

import warnings

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from tasks.geometry import intersect_planes, unit_axes

finite = st.floats(-1, 1, allow_subnormal=False)


@settings(max_examples=300, deadline=None)
@given(arrays(float, (3, 3), elements=finite), arrays(float, 3, elements=st.floats(-100, 100)))
def test_the_point_is_the_one_a_linear_solver_finds(rows, offsets):
    lengths = np.linalg.norm(rows, axis=1, keepdims=True)
    assume((lengths > 0.1).all())
    normals = rows / lengths
    assume(abs(np.linalg.det(normals)) > 1e-3)
    point = intersect_planes(normals, offsets)
    expected = np.linalg.solve(normals, offsets)
    assert point == pytest.approx(expected, rel=1e-6, abs=1e-6)
    assert normals @ point == pytest.approx(offsets, abs=1e-6)


def test_many_triples_are_met_at_once():
    rng = np.random.default_rng(1)
    normals = rng.normal(size=(7, 5, 3, 3))
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    offsets = rng.uniform(-5, 5, (7, 5, 3))
    points = intersect_planes(normals, offsets)
    assert points.shape == (7, 5, 3)
    assert points == pytest.approx(np.linalg.solve(normals, offsets[..., None])[..., 0])


@pytest.mark.parametrize(
    "normals",
    [
        [(1, 0, 0), (1, 0, 0), (0, 0, 1)],
        [(1, 0, 0), (-1, 0, 0), (0, 0, 1)],
        [(0, 0, 1), (0, 0, 1), (0, 0, 1)],
        [(1, 0, 0), (0, 1, 0), (np.sqrt(0.5), np.sqrt(0.5), 0)],
        [(1, 0, 0), (np.cos(1e-11), np.sin(1e-11), 0), (0, 0, 1)],
    ],
    ids=["same", "opposite", "all same", "three walls round no corner", "nearly parallel"],
)
@pytest.mark.parametrize("offsets", [(0, 0, 0), (1, 2, 3)])
def test_planes_without_one_common_point_meet_nowhere_failure(normals, offsets):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        point = intersect_planes(np.array(normals, float), np.array(offsets, float))
    assert np.isnan(point).all()


def test_a_parallel_triple_does_not_spoil_the_others():
    normals = np.stack([np.eye(3), np.eye(3)[[0, 0, 2]]])
    points = intersect_planes(normals, np.array([[1.0, 2.0, 3.0], [1.0, 2.0, 3.0]]))
    assert points[0].tolist() == [1, 2, 3]
    assert np.isnan(points[1]).all()


def test_axes_are_unit_and_lead_from_first_to_second_end():
    lines = np.array([[[1.0, 2], [4, 6]], [[0, 0], [0, -3]], [[5, 5], [5, 5]]])
    np.testing.assert_allclose(unit_axes(lines), [[0.6, 0.8], [0, -1], [0, 0]])
