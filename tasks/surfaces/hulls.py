"""Concave hulls by the two-dimensional alpha shape (Sec. 4.1; Edelsbrunner et al. 1983)."""

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import Delaunay, QhullError, cKDTree


def alpha_shape(points: NDArray[np.float64], radius: float) -> shapely.Polygon:
    """Return the concave hull of points: the union of the Delaunay triangles that fit a circle.

    Parameters
    ----------
    points : (n, 2) float
        Metres.
    radius : float
        Radius of the greatest circumscribed circle, metres: gaps narrower than its double close.

    Returns
    -------
    shapely.Polygon
        The largest part, holes included. For fewer than three points, or points on one line, the
        thin box around them.
    """
    triangles = _triangles(points)
    if triangles is None:
        return _thin_box(points, radius)
    corners = points[triangles]
    kept = corners[_circumradius(corners) <= radius]
    if not len(kept):
        return _thin_box(_together(points, 2 * radius), radius)
    union = shapely.coverage_union_all(shapely.polygons(kept))  # triangles share their edges
    parts = shapely.get_parts(union)
    parts = parts[shapely.get_type_id(parts) == shapely.GeometryType.POLYGON]
    return parts[np.argmax(shapely.area(parts))] if len(parts) else _thin_box(points, radius)


def _triangles(points: NDArray[np.float64]) -> NDArray[np.int32] | None:
    if len(points) < 3:
        return None
    try:
        return Delaunay(points - points.mean(axis=0)).simplices
    except QhullError:  # all on one line
        return None


def _together(points: NDArray[np.float64], gap: float) -> NDArray[np.float64]:
    """Return the largest group of points that gaps up to this width hold together."""
    pairs = cKDTree(points).query_pairs(gap, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(points), len(points)))
    group = connected_components(graph, directed=False)[1]
    return points[group == np.bincount(group).argmax()]


def _circumradius(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    a = np.linalg.norm(corners[:, 1] - corners[:, 2], axis=1)
    b = np.linalg.norm(corners[:, 0] - corners[:, 2], axis=1)
    c = np.linalg.norm(corners[:, 0] - corners[:, 1], axis=1)
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / 2
    with np.errstate(divide="ignore"):
        return np.where(area > 1e-12, a * b * c / (4 * area), np.inf)


def _thin_box(points: NDArray[np.float64], radius: float) -> shapely.Polygon:
    around = shapely.MultiPoint(points).minimum_rotated_rectangle
    return shapely.buffer(around, radius / 10, cap_style="square", join_style="mitre")
