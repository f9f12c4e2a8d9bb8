"""Plane filtering (Sec. 4.1, Eq. 5): planes become vertical, horizontal or clutter segments."""

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import PositiveFloat
from scipy.spatial import cKDTree

from storage.planes import PlaneLabels, Planes
from storage.points import PointCloud
from storage.segments import KINDS, Raster, Segments
from storage.snapshots import Snapshots
from tasks.params import Params
from tasks.surfaces.hulls import alpha_shape
from tasks.surfaces.patches import members

SIDED = 500
"""Points of a plane that tell from which side it was seen."""


class FilterParams(Params):
    """Parameters of plane filtering."""

    eps_sur: PositiveFloat = 0.1
    """Greatest |n_z| of a vertical plane and greatest 1 - |n_z| of a horizontal one (Fig. 13)."""
    cell_m: PositiveFloat = 0.1
    """Edge of the cells that say where a segment was seen, metres. Not in the paper."""
    alpha_m: PositiveFloat = 0.3
    """Radius of the concave hulls' alpha shapes, metres. Not in the paper."""


def extract_segments(
    points: PointCloud,
    snapshots: Snapshots,
    planes: Planes,
    labels: PlaneLabels,
    params: FilterParams,
) -> Segments:
    """Turn each plane's inlier patch into a segment with its concave hull.

    Notes
    -----
    Eq. 5 with the components of the unit normal: the printed eigenvalues make no sense there
    (a plane's eigenvalues say how flat it is, not how it lies).
    """
    inliers = members(labels.labels)
    ups = np.abs(planes.normals[:, 2])
    kinds = np.full(len(planes), KINDS.index("clutter"), np.int8)
    kinds[ups < params.eps_sur] = KINDS.index("vertical")
    kinds[1 - ups < params.eps_sur] = KINDS.index("horizontal")
    seen_from = _Sensors(points, snapshots)
    rows = [
        _segment(points, planes, i, inliers[i], KINDS[kinds[i]], seen_from, params)
        for i in range(len(planes))
    ]
    return Segments(
        cell_m=params.cell_m,
        kinds=kinds,
        normals=np.array([r.normal for r in rows]).reshape(-1, 3),
        offsets=np.array([r.offset for r in rows], float),
        side_known=np.array([r.side_known for r in rows], bool),
        lines=np.array([r.line for r in rows], float).reshape(-1, 2, 2),
        heights=np.array([r.heights for r in rows], float).reshape(-1, 2),
        areas=np.array([r.area for r in rows], float),
        inliers=planes.inliers,
        rms=planes.rms,
        hulls=tuple(r.hull for r in rows),
        rasters=tuple(r.raster for r in rows),
    )


class _Sensors:
    """From where each point was seen; nothing is known of a cloud without poses."""

    def __init__(self, points: PointCloud, snapshots: Snapshots) -> None:
        self._snapshot = points.snapshot
        self._positions = snapshots.positions - points.origin
        self._tree = cKDTree(self._positions) if len(snapshots) else None

    def of(
        self, inliers: NDArray[np.int64], xyz: NDArray[np.float64]
    ) -> NDArray[np.float64] | None:
        """Return (m, 3) places of the sensor, relative to the cloud's origin; None if unknown.

        A voxel of many snapshots, or a decoded point, tells none: the nearest one stands for it.
        """
        if self._tree is None:
            return None
        if self._snapshot is not None:
            return self._positions[self._snapshot[inliers]]
        step = max(1, len(xyz) // SIDED)
        return self._positions[self._tree.query(xyz[::step])[1]]


@dataclass(frozen=True, eq=False)
class _Row:
    """One row of `Segments`."""

    normal: NDArray[np.float64]
    offset: float
    side_known: bool
    line: NDArray[np.float64]
    heights: NDArray[np.float64]
    area: float
    hull: bytes
    raster: Raster


def _segment(
    points: PointCloud,
    planes: Planes,
    i: int,
    inliers: NDArray[np.int64],
    kind: str,
    seen_from: _Sensors,
    params: FilterParams,
) -> _Row:
    xyz = points.xyz[inliers].astype(np.float64)
    normal, offset = planes.normals[i], planes.offsets[i]
    known = False
    sensors = seen_from.of(inliers, xyz)
    if sensors is not None:
        before = sensors @ normal - offset
        known = bool(np.abs(np.mean(np.sign(before))) > 0.5)
        if known and np.median(before) < 0:
            normal, offset = -normal, -offset
    heights = np.percentile(xyz[:, 2], [1, 99]) + points.origin[2]
    offset = offset + float(normal @ points.origin)
    xyz += points.origin
    line = np.full((2, 2), np.nan)
    if kind == "vertical":
        line, plane_xy = _upright(xyz, normal, offset)
        start = np.array([0.0, np.floor(plane_xy[:, 1].min() / params.cell_m) * params.cell_m])
    else:
        plane_xy = xyz[:, :2]
        start = np.floor(plane_xy.min(axis=0) / params.cell_m) * params.cell_m
    raster = _raster(plane_xy, start, params.cell_m)
    hull = _hull(raster, params)
    return _Row(
        normal=normal,
        offset=offset,
        side_known=known,
        line=line,
        heights=heights,
        area=hull.area,
        hull=shapely.to_wkb(hull),
        raster=raster,
    )


def _upright(
    xyz: NDArray[np.float64], normal: NDArray[np.float64], offset: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a vertical segment's plan line (2, 2) and its inliers in (along, height).

    The line is taken at the inliers' middle height: a wall that leans is met where it was seen.
    """
    flat = normal[:2] / np.linalg.norm(normal[:2])
    height = np.median(xyz[:, 2])
    foot = flat * (offset - normal[2] * height) / np.linalg.norm(normal[:2])
    along = np.array([-flat[1], flat[0]])
    t = xyz[:, :2] @ along
    first, last = np.percentile(t, [0.5, 99.5])
    line = np.array([foot + first * along, foot + last * along])
    return line, np.column_stack((t - first, xyz[:, 2]))


def _raster(xy: NDArray[np.float64], start: NDArray[np.float64], cell: float) -> Raster:
    at = np.floor((xy - start) / cell + 1e-9).astype(np.int64)
    at = at[(at >= 0).all(axis=1)]
    cells = np.zeros(at.max(axis=0, initial=0) + 1, bool)
    cells[at[:, 0], at[:, 1]] = True
    return Raster((float(start[0]), float(start[1])), cells)


def _hull(raster: Raster, params: FilterParams) -> shapely.Polygon:
    """Return the alpha shape of the occupied cells' centres, grown to the cells' outer edges.

    Cells instead of points: a hull costs what the segment's area asks, not the number of points.
    """
    at = np.argwhere(raster.cells)
    centres = np.array(raster.start) + (at + 0.5) * params.cell_m
    hull = alpha_shape(centres, max(params.alpha_m, params.cell_m))
    grown = hull.buffer(params.cell_m / 2, join_style="mitre", mitre_limit=2)
    return grown if grown.geom_type == "Polygon" else hull
