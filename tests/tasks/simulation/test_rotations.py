"""Quaternions and turned vectors against products of matrices."""

import numpy as np
import pytest

from tasks.simulation.rotations import about, matrices, product, turned


def test_a_product_of_rotations_is_the_product_of_their_matrices():
    p, q = product(about("x", 0.3), about("y", -1.1)), about("z", 2.0)
    assert matrices(product(p, q)) == pytest.approx(matrices(p) @ matrices(q))


def test_every_vector_is_turned_by_its_own_matrix():
    rng = np.random.default_rng(0)
    quaternions = rng.normal(size=(5, 4))
    turns = matrices(quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True))
    of, vectors = rng.integers(0, 5, 50).astype(np.int32), rng.normal(size=(50, 3))
    expected = [turns[i] @ vector for i, vector in zip(of, vectors, strict=True)]
    assert turned(turns, of, vectors) == pytest.approx(np.array(expected))
