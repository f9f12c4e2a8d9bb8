"""Plane detection by a randomized Hough transform (Sec. 4.1, Fig. 3 line 2).

Triplets drawn from a whole cloud meet a plane that holds a share f of it with probability f cubed:
fine in a room, hopeless on a storey. So the cloud is thinned to an even density, cut into tiles of
room size, and the transform runs in each: first with the wide range of distances, which finds
walls, floor and ceiling and finds them straight, then on what is left with the narrow range,
which reaches a chair's seat. Patches that a tile's border has cut are joined again; last, all
points are labelled and every plane is refitted to all its inliers.
"""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PositiveFloat, PositiveInt

from storage.planes import PlaneLabels, Planes
from storage.points import PointCloud
from tasks.params import Params
from tasks.surfaces import patches, thinning, voting
from tasks.surfaces.assignment import MIN_POINTS, label_all


class HoughParams(Params):
    """Parameters of plane detection."""

    gamma_cell: PositiveInt = 20
    """Votes that turn an accumulator cell into a plane (Fig. 13)."""
    beta_min: PositiveFloat = 0.2
    """Least distance between two points of one draw, metres (Fig. 13)."""
    beta_max: PositiveFloat = 5.0
    """Greatest distance between two points of one draw, metres (Fig. 13)."""
    beta_near: PositiveFloat = 0.5
    """Greatest distance in the second pass, which finds small surfaces, metres (Sec. 7.2, small
    rooms; its least distance is beta_min)."""
    cell_angle_rad: PositiveFloat = 0.035
    """Width of a direction cell, radians. Not in the paper; 2 degrees, as 3DTK's."""
    cell_offset_m: PositiveFloat = 0.05
    """Width of an offset cell, metres. Not in the paper; as 3DTK's."""
    tolerance_m: PositiveFloat | None = None
    """Greatest distance of an inlier from its plane, metres; None: four times the cloud's own
    noise, within 0.03 and 0.1. Not in the paper. Below four sigma a rim of each wall is left
    over and found again."""
    thin_m: PositiveFloat = 0.05
    """Edge of the voxels of which one point each takes part in draws, metres. Not in the paper."""
    tile_m: PositiveFloat = 7.0
    """Size of the tiles a storey is cut into, metres. Not in the paper; about a room."""
    min_area_m2: PositiveFloat = 0.12
    """Smallest patch, square metres. Not in the paper; two thirds of a chair's seat."""
    left_over: float = Field(default=0.003, ge=0, lt=1)
    """Share of a tile's points at which the search ends. Not in the paper."""
    tries: PositiveInt = 100_000
    """Draws without a plane after which the wide pass ends. Not in the paper."""
    draws_near: PositiveInt = 200
    """Draws for each point left, without a plane, after which the narrow pass ends. Not in the
    paper."""
    misses: PositiveInt = 12
    """Full cells in a row that turn out to be no plane, after which a pass ends. Not in the
    paper."""
    seed: int = 0
    """Seed of the draws. Not in the paper."""


FEWEST_DRAWS = 20_000
"""Draws in which a patch that is there at all would have been met."""
NARROWEST = 0.01
"""Breadth below which a patch is a line of points, metres."""
WIDE = 50.0
"""Extent beyond which a cloud may hold more than its storey, metres."""


def detect_planes(points: PointCloud, params: HoughParams) -> tuple[Planes, PlaneLabels]:
    """Detect the planar patches of a cloud, most inliers first.

    Parameters
    ----------
    points : PointCloud
        n registered points in the building frame.
    params : HoughParams

    Returns
    -------
    Planes
        m connected patches; m may be 0.
    PlaneLabels
        The patch of each point.

    Notes
    -----
    Sec. 4.1. The paper leaves the accumulator open; this is the ball of Borrmann et al. (2011).
    """
    xyz = points.xyz
    few = _evenly(xyz, params.thin_m)
    if len(few) < MIN_POINTS:
        return _nothing(points)
    grain = thinning.grain(few, np.random.default_rng(params.seed))
    cell = 2 * max(params.thin_m, grain.spacing)
    tolerance = params.tolerance_m or float(np.clip(4 * grain.noise, 0.03, 0.1))
    labels = _search_tiles(few, tolerance, cell, params)
    labels = patches.merge_coplanar(few, labels, tolerance, cell)
    if labels.max(initial=-1) < 0:
        return _nothing(points)
    return label_all(points, few, labels, tolerance, cell)


def _evenly(xyz: NDArray[np.float32], voxel: float) -> NDArray[np.float32]:
    """Return the building's points, thinned to an even density."""
    if len(xyz) < MIN_POINTS:
        return xyz
    low, high = thinning.bounds(xyz)
    if (high - low).max() > WIDE:
        xyz = xyz[thinning.body(xyz)]
    return xyz[thinning.thin(xyz, voxel)]


def _nothing(points: PointCloud) -> tuple[Planes, PlaneLabels]:
    none = np.empty(0)
    planes = Planes(np.empty((0, 3)), none, np.empty(0, np.int64), none, points.origin)
    return planes, PlaneLabels(np.full(len(points), -1, np.int32))


def _search_tiles(
    xyz: NDArray[np.float32], tolerance: float, cell: float, params: HoughParams
) -> NDArray[np.int32]:
    """Return the patch of each thinned point, tile by tile; -1 for none."""
    low, high = thinning.bounds(xyz)
    across = np.maximum(1, np.ceil((high - low)[:2] / params.tile_m)).astype(int)
    size = np.maximum((high - low)[:2] / across, 1e-3)
    at = np.minimum(((xyz[:, :2] - low[:2]) / size).astype(int), across - 1)
    tile = at[:, 0] * across[1] + at[:, 1]
    order = np.argsort(tile, kind="stable")
    starts = np.searchsorted(tile[order], np.arange(across.prod() + 1))
    labels = np.full(len(xyz), -1, np.int32)
    found = 0
    for t, (a, b) in enumerate(pairwise(starts)):
        inside = order[a:b]
        for members in _search(xyz[inside], tolerance, cell, params, params.seed + 7919 * t):
            labels[inside[members]] = found
            found += 1
    return labels


def _search(
    xyz: NDArray[np.float32], tolerance: float, cell: float, params: HoughParams, seed: int
) -> list[NDArray[np.int64]]:
    """Return the members of each patch of one tile, in the order found."""
    if len(xyz) < MIN_POINTS:
        return []
    left = np.arange(len(xyz))
    here = xyz - xyz.mean(axis=0)
    enough = max(params.left_over * len(xyz), MIN_POINTS)
    found: list[NDArray[np.int64]] = []
    ballot = _Ballot(here, params, seed)
    wide = (voting.ANYWHERE, params.beta_max, 0, params.tries)
    near = (params.beta_near / 2, params.beta_near, params.draws_near, FEWEST_DRAWS)
    for edge, reach, draws_each, draws in (wide, near):
        ballot.fill(here, edge)
        missed = 0
        while len(left) > enough and missed < params.misses:
            vote = ballot.vote(here, reach, max(draws, draws_each * len(left)))
            if vote is None:
                break
            patch = _patch(here, *vote, tolerance, cell, params)
            if patch is None:
                missed += 1
                continue
            missed = 0
            inliers, removed = patch
            found.append(left[inliers])
            keep = np.ones(len(left), bool)
            keep[removed] = False
            left, here = left[keep], here[keep]
            ballot.fill(here, edge)
    return found


def _patch(
    xyz: NDArray[np.float32],
    normal: NDArray[np.float64],
    offset: float,
    tolerance: float,
    cell: float,
    params: HoughParams,
) -> tuple[NDArray[np.int64], NDArray[np.int64]] | None:
    """Return (inliers, points to remove) of the patch a vote stands for, None if it is none.

    What is removed reaches half a tolerance further than the inliers, or the rim would be found
    again as a plane of its own.
    """
    around = patches.near_plane(xyz, normal, offset, 2 * tolerance)
    if len(around) < MIN_POINTS:
        return None
    fit = patches.fit_plane(xyz, around)
    near = patches.near_plane(xyz, fit.normal, fit.offset, tolerance)
    if len(near) < MIN_POINTS:
        return None
    cluster, area = patches.largest_cluster(xyz, near, fit.normal, cell)
    if area < params.min_area_m2 or len(cluster) < MIN_POINTS:
        return None
    fit = patches.fit_plane(xyz, cluster)
    if fit.breadth < NARROWEST:
        return None
    wide = patches.near_plane(xyz, fit.normal, fit.offset, 1.5 * tolerance)
    if len(wide) < MIN_POINTS:
        return None
    remove, _ = patches.largest_cluster(xyz, wide, fit.normal, cell)
    keep = patches.near_plane(xyz[remove], fit.normal, fit.offset, tolerance)
    return (remove[keep], remove) if len(keep) else None


class _Ballot:
    """One tile's accumulator, and the bins its points are drawn from."""

    def __init__(self, xyz: NDArray[np.float32], params: HoughParams, seed: int) -> None:
        self.params = params
        self.state = voting.seed_state(seed)
        self.low = xyz.min(axis=0) - np.float32(1e-3)
        self.extent = xyz.max(axis=0) - self.low
        ball = voting.make_ball(params.cell_angle_rad)
        rho_cells = int(np.linalg.norm(xyz, axis=1).max() / params.cell_offset_m) + 2
        self.cells = (ball.cells_of_row, ball.first_of_row, rho_cells, 1 / params.cell_offset_m)
        self.accumulator = np.zeros(int(ball.first_of_row[-1]) * rho_cells, np.uint16)
        self.log = (np.empty(voting.LOG, np.int64), np.empty((voting.LOG, 4), np.float32))

    def fill(self, xyz: NDArray[np.float32], edge: float) -> None:
        """Sort points into bins of some edge, metres."""
        shape = (self.extent / np.float32(edge)).astype(np.int64) + 1
        self.bins = (
            *voting.fill_bins(xyz, self.low, np.float32(edge), shape),
            shape,
            self.low,
            np.float32(edge),
        )

    def vote(
        self, xyz: NDArray[np.float32], reach: float, draws: int
    ) -> tuple[NDArray[np.float64], float] | None:
        """Return the plane most voted for by points no further apart than a reach, metres."""
        p = self.params
        found, *normal, offset = voting.vote(
            xyz,
            *self.bins,
            p.beta_min,
            reach,
            self.accumulator,
            *self.cells,
            p.gamma_cell,
            draws,
            self.state,
            *self.log,
        )
        return (np.array(normal), offset) if found else None
