"""Areas of irregular hulls by triangles and distances of planes (Sec. 6, Fig. 11, Eq. 12)."""

import numpy as np
from numpy.typing import NDArray


def triangulated_area(
    vertices: NDArray[np.float64], apex: NDArray[np.float64] | None = None
) -> float:
    """Return the area within a closed outline, as the sum of its triangles (Fig. 11).

    Parameters
    ----------
    vertices : (n, 2) float
        v_1 .. v_n, metres, either way round; the first is not repeated.
    apex : (2,) float, optional
        p_0, the corner that all triangles share; the mean of the vertices. Any other gives the
        same area.

    Returns
    -------
    float
        Square metres.

    Notes
    -----
    Triangle i is half of |v_i v_{i+1}| times the distance of p_0 from that edge. The distance has
    a sign here: seen from p_0, parts of an irregular outline lie behind others, and their
    triangles must be taken off for the sum to be the area.
    """
    if len(vertices) < 3:
        return 0.0
    p0 = vertices.mean(axis=0) if apex is None else apex
    edges = np.roll(vertices, -1, axis=0) - vertices
    lengths = np.linalg.norm(edges, axis=1)
    real = lengths > 0
    edges, lengths, starts = edges[real], lengths[real], vertices[real]
    to_apex = p0 - starts
    distances = (edges[:, 0] * to_apex[:, 1] - edges[:, 1] * to_apex[:, 0]) / lengths
    return float(abs(np.sum(lengths * distances) / 2))


def plane_distance(normal: NDArray[np.float64], offset: float, at: NDArray[np.float64]) -> float:
    """Return the distance of a point, as of the floor, from a plane in Hesse form (Eq. 12).

    Parameters
    ----------
    normal : (3,) float
        a, b, c; of any length but zero.
    offset : float
        d, metres times the normal's length: a x + b y + c z = d.
    at : (3,) float
        x_1, y_1, z_1, metres.

    Returns
    -------
    float
        Metres.

    Raises
    ------
    ValueError
        If the normal is zero.
    """
    length = float(np.linalg.norm(normal))
    if length == 0:
        raise ValueError("normal: expected a direction, got zero")
    return abs(float(normal @ at) - offset) / length


def level_plane(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Return normal and offset of the plane z = a x + b y + c nearest to points, in Hesse form.

    Fewer than three points, or points on a line, say nothing of a slope: the plane is level then.

    Parameters
    ----------
    points : (n, 3) float
        n > 0, metres.
    """
    centre = points.mean(axis=0)
    spread = points - centre
    system = spread[:, :2].T @ spread[:, :2]
    slope = np.zeros(2)
    if np.linalg.eigvalsh(system)[0] > len(points) * NARROW_M**2:
        slope = np.linalg.solve(system, spread[:, :2].T @ spread[:, 2])
    normal = np.array((-slope[0], -slope[1], 1.0))
    normal /= np.linalg.norm(normal)
    return normal, float(normal @ centre)


NARROW_M = 0.02
"""Standard deviation across a patch below which it is a line, metres: half a column."""
