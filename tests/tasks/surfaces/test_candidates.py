"""The patches listed for a voxel, and the labels that follow, against trying every patch."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tasks.surfaces import candidates
from tasks.surfaces.assignment import _assign
from tasks.surfaces.candidates import find_candidates, make_atlas
from tasks.surfaces.patches import Footprint, plane_axes

CELL, TOLERANCE = 0.1, 0.04


def random_patches(seed, n=12, tilt=0.0):
    """Return footprints with holes anywhere in a room, and planes tilted against them, radians."""
    rng = np.random.default_rng(seed)
    prints, normals, offsets = [], [], []
    for turn in Rotation.random(n, rng=rng):
        normal = turn.apply([0.0, 0.0, 1.0])
        u, v = plane_axes(normal)
        cells = rng.random(rng.integers(3, 30, 2)) < 0.7
        prints.append(Footprint(u, v, rng.uniform(-2, 1, 2), cells))
        normals.append(Rotation.from_rotvec(tilt * u).apply(normal))
        offsets.append(rng.uniform(0, 2))
    return prints, np.array(normals), np.array(offsets)


def holding(xyz, prints, normals, offsets):
    """Return (n, m): the distance of each point to each patch, infinite where it is not of it."""
    away = np.abs(xyz @ normals.T - offsets)
    away[away >= TOLERANCE] = np.inf
    for p, column in zip(prints, away.T, strict=True):
        at = np.floor((np.stack((xyz @ p.u, xyz @ p.v), axis=1) - p.low) / CELL).astype(int)
        inside = ((at >= 0) & (at < p.cells.shape)).all(axis=1)
        inside[inside] = p.cells[tuple(at[inside].T)]
        column[~inside] = np.inf
    return away


@pytest.mark.parametrize("tilt", [0.0, 0.05, 0.5])
@pytest.mark.parametrize("max_voxels", [candidates.MAX_VOXELS, 100])
def test_no_patch_of_a_point_is_missing_from_its_voxel(tilt, max_voxels, monkeypatch):
    monkeypatch.setattr(candidates, "MAX_VOXELS", max_voxels)
    prints, normals, offsets = random_patches(1, tilt=tilt)
    near = find_candidates(make_atlas(prints, normals, offsets), TOLERANCE, CELL)
    assert len(near.starts) <= max_voxels + 1
    xyz = np.random.default_rng(2).uniform(-4, 4, (400_000, 3))
    held = np.argwhere(np.isfinite(holding(xyz, prints, normals, offsets)))
    assert len(held) > 500
    at = np.floor((xyz[held[:, 0]] - near.low) / near.edge).astype(int)
    assert ((at >= 0) & (at < near.shape)).all()
    voxel = (at[:, 0] * near.shape[1] + at[:, 1]) * near.shape[2] + at[:, 2]
    for v, patch in zip(voxel, held[:, 1], strict=True):
        assert patch in near.patches[near.starts[v] : near.starts[v + 1]]


def test_few_patches_are_listed_where_hundreds_are_about():
    prints, normals, offsets = random_patches(3, n=300)
    near = find_candidates(make_atlas(prints, normals, offsets), TOLERANCE, CELL)
    listed = np.diff(near.starts)
    assert listed[listed > 0].mean() < 300 / 20
    for a, b in zip(near.starts, near.starts[1:], strict=False):
        assert len(set(near.patches[a:b])) == b - a


@pytest.mark.parametrize("tilt", [0.0, 0.05])
def test_every_point_is_labelled_with_the_nearest_patch_that_holds_it(tilt):
    prints, normals, offsets = random_patches(5, n=40, tilt=tilt)
    xyz = np.random.default_rng(6).uniform(-3, 3, (200_000, 3)).astype(np.float32)
    labels = np.zeros(len(xyz), np.int32)
    hit, sums = _assign(xyz, prints, normals, offsets, TOLERANCE, CELL, labels)
    away = holding(xyz.astype(float), prints, normals, offsets)
    held = np.isfinite(away).any(axis=1)
    assert (np.isfinite(away).sum(axis=1) > 1).sum() > 20  # where patches cross
    assert (labels == np.where(held, away.argmin(axis=1), -1)).all()
    for patch, (p, cells) in enumerate(zip(prints, hit, strict=True)):
        own = xyz[labels == patch].astype(float)
        x, y, z = own.T
        expected = [x, y, z, x * x, y * y, z * z, x * y, x * z, y * z, np.ones(len(own))]
        assert sums[patch] == pytest.approx(np.sum(expected, axis=1))
        at = np.floor((np.stack((own @ p.u, own @ p.v), axis=1) - p.low) / CELL).astype(int)
        reached = np.zeros(p.cells.shape, bool)
        reached[tuple(at.T)] = True
        assert (cells == reached).all()
