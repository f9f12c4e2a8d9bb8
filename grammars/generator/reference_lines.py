"""Reference lines along both sides of a corridor, on its wall faces (Sec. 4.2.2)."""

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

Edges = NDArray[np.float64]
"""(n, 2, 2), starts and ends, metres"""

JOG_M = 0.3
"""Shorter edges are jambs and pilasters: the line goes on behind them. Assumption."""
OFFSET_M = 0.15
"""Faces of one line lie within this distance to its side. Assumption."""
TURN_RAD = np.deg2rad(3)
"""Faces of one line differ by less in direction. Assumption."""


def corridor_lines(corridor: Polygon, least_m: float) -> Edges:
    """Return the lines along a corridor's walls, rooms to the left of one who walks along them.

    They turn clockwise around the corridor, and anticlockwise around what it encloses; faces that
    follow each other in one direction are one line.

    Parameters
    ----------
    least_m : shortest line, metres

    Returns
    -------
    (n, 2, 2) float
        Starts and ends, each on the longest face of its line.
    """
    found: list[Edges] = []
    polygon = shapely.orient_polygons(corridor)  # the corridor to the left of its rings
    for ring in (polygon.exterior, *polygon.interiors):
        corners = np.asarray(ring.coords)[::-1, :2]
        found += [_along(run) for run in _runs(np.stack((corners[:-1], corners[1:]), axis=1))]
    lines = np.array(found).reshape(-1, 2, 2)
    return lines[np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1) >= least_m]


def _runs(edges: Edges) -> list[Edges]:
    """Return the edges of a ring in runs that each are one line."""
    edges = edges[_lengths(edges) >= JOG_M]
    if not len(edges):
        return []
    following = np.roll(edges, -1, axis=0)
    breaks = np.array([not _goes_on(a, b) for a, b in zip(edges, following, strict=True)])
    if not breaks.any():
        return [edges]
    first = int(np.argmax(breaks)) + 1
    edges, breaks = np.roll(edges, -first, axis=0), np.roll(breaks, -first)
    return np.split(edges, np.flatnonzero(breaks)[:-1] + 1)


def _goes_on(edge: Edges, following: Edges) -> bool:
    """Return whether two edges of a ring lie on one line."""
    u, v = (e[1] - e[0] for e in (edge, following))
    turn = np.arctan2(u[0] * v[1] - u[1] * v[0], u @ v)
    longer, other = (edge, following) if u @ u >= v @ v else (following, edge)
    return bool(abs(turn) < TURN_RAD and np.abs(_across(longer, other)).max() < OFFSET_M)


def _along(run: Edges) -> Edges:
    """Return the line on the longest edge of a run, as far as the run reaches."""
    longest = run[int(np.argmax(np.round(_lengths(run), 6)))]
    along = (longest[1] - longest[0]) / np.linalg.norm(longest[1] - longest[0])
    reach = (run.reshape(-1, 2) - longest[0]) @ along
    return longest[0] + np.array([[reach.min()], [reach.max()]]) * along


def _across(edge: Edges, other: Edges) -> NDArray[np.float64]:
    along = (edge[1] - edge[0]) / np.linalg.norm(edge[1] - edge[0])
    return (other - edge[0]) @ np.array((-along[1], along[0]))


def _lengths(edges: Edges) -> NDArray[np.float64]:
    return np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1)
