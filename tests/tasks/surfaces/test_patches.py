"""Fitting and clustering of patches, against numpy on the same points."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tasks.surfaces.patches import (
    fit_plane,
    footprint,
    largest_cluster,
    members,
    merge_coplanar,
    near_plane,
    plane_axes,
)


def rectangle(size_a, size_b, n, seed, noise=0.01):
    """Return points of a level rectangle with one corner in the origin, with noise."""
    rng = np.random.default_rng(seed)
    xyz = rng.random((n, 3)) * [size_a, size_b, 0]
    xyz[:, 2] = rng.normal(0, noise, n)
    return xyz.astype(np.float32)


@pytest.mark.parametrize("seed", range(5))
def test_the_fitted_plane_is_that_of_the_least_singular_value(seed):
    turn, rng = Rotation.random(rng=seed), np.random.default_rng(seed)
    xyz = (turn.apply(rectangle(3, 0.5, 2000, seed)) + rng.uniform(-30, 30, 3)).astype(np.float32)
    some = np.flatnonzero(rng.random(2000) < 0.5)
    fit = fit_plane(xyz, some)
    mean = xyz[some].mean(axis=0, dtype=float)
    _, _, axes = np.linalg.svd(xyz[some] - mean, full_matrices=False)
    assert abs(fit.normal @ axes[2]) == pytest.approx(1, abs=1e-9)
    assert fit.offset == pytest.approx(fit.normal @ mean, abs=1e-9)
    assert fit.breadth == pytest.approx(0.5, rel=0.05)


@pytest.mark.parametrize(
    "normal",
    [(0, 0, 1), (0, 0, -1), (0.05, 0, 1), (0, 0.05, -1), (0.2, 0.1, 1), (1, 0, 0), (0, -1, 0)],
)
def test_the_axes_of_a_plane_are_orthonormal_and_right_handed(normal):
    n = np.array(normal) / np.linalg.norm(normal)
    u, v = plane_axes(n)
    frame = np.stack((u, v, n))
    assert frame @ frame.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(frame) == pytest.approx(1)
    if np.hypot(*n[:2]) > 0.1:
        assert u[2] == 0


def test_the_points_near_a_plane_are_those_within_the_distance():
    xyz = np.random.default_rng(1).uniform(-2, 2, (5000, 3)).astype(np.float32)
    normal = np.array([0.6, 0.0, 0.8])
    away = np.abs(xyz @ normal - 0.5)
    sure = np.abs(away - 0.1) > 1e-5
    near = np.zeros(len(xyz), bool)
    near[near_plane(xyz, normal, 0.5, 0.1)] = True
    assert (near == (away < 0.1))[sure].all()


def test_the_largest_cluster_is_the_larger_of_two_rectangles():
    large, small = rectangle(2, 1, 3000, 1), rectangle(1, 1, 2900, 2) + np.float32([4, 0, 0])
    xyz = np.concatenate([small, large])
    inside, area = largest_cluster(xyz, np.arange(len(xyz)), np.array([0.0, 0.0, 1.0]), 0.1)
    assert inside.tolist() == list(range(2900, 5900))
    assert area == pytest.approx(2, rel=0.15)


def test_a_footprint_holds_its_members_and_has_an_empty_margin():
    xyz = rectangle(2, 1, 500, 3)
    some = np.arange(0, 500, 2)
    cut = footprint(xyz, some, np.array([0.0, 0.0, 1.0]), 0.1)
    ab = np.stack((xyz @ cut.u, xyz @ cut.v), axis=1)[some]
    at = np.floor((ab - cut.low) / 0.1 + 1e-9)  # the lowest lies on a cell's border
    expected = np.zeros(cut.cells.shape, bool)
    expected[tuple(at.astype(int).T)] = True
    assert (cut.cells == expected).all()
    inner = np.zeros_like(expected)
    inner[3:-3, 3:-3] = True
    assert not cut.cells[~inner].any()
    assert cut.cells[3].any() and cut.cells[:, 3].any()


@pytest.mark.parametrize("labels", [[], [-1, -1], [0], [2, 0, -1, 2, 0, 1, -1, 2], [3, -1, 3]])
def test_the_members_of_each_label_are_in_ascending_order(labels):
    labels = np.array(labels, np.int32)
    found = members(labels)
    assert len(found) == labels.max(initial=-1) + 1
    for label, indices in enumerate(found):
        assert indices.tolist() == np.flatnonzero(labels == label).tolist()


@pytest.mark.parametrize(
    ("shift", "patches"),
    [((2, 0, 0), 1), ((2.3, 0, 0), 2), ((2, 0, 0.2), 2)],
    ids=["touching", "apart", "a step higher"],
)
def test_patches_are_joined_if_they_touch_in_one_plane(shift, patches):
    a, b = rectangle(2, 2, 4000, 1), rectangle(1, 2, 2000, 2) + np.float32(shift)
    labels = np.repeat(np.int32([1, 0]), [4000, 2000])
    joined = merge_coplanar(np.concatenate([a, b]), labels, 0.04, 0.1)
    assert joined.max() + 1 == patches
    assert (joined[:4000] == 0).all() and (joined[4000:] == patches - 1).all()
