"""The plane cut into cells by the lines of the walls, and what is known of cells and edges."""

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from storage.coverage import Coverage
from storage.faces import SEEN_WALL, Faces
from tasks.surfaces.directions import face_angles, frames, off_frames
from tasks.surfaces.seen import CellSet, places_along

SNAP = 1e-4
"""Grid all corners of the arrangement are rounded to, metres."""


@dataclass(frozen=True, eq=False)
class Lines:
    """Carrier lines of the faces: faces in line share one."""

    normals: NDArray[np.float64]
    """(l, 2), unit"""
    offsets: NDArray[np.float64]
    """(l,), metres"""
    spans: NDArray[np.float64]
    """(l, 2), first and last point of the faces along the line"""
    of_face: NDArray[np.int64]
    """(k,), line of each face"""

    def along(self) -> NDArray[np.float64]:
        """Return the lines' unit directions, (l, 2)."""
        return np.column_stack((-self.normals[:, 1], self.normals[:, 0]))


def carrier_lines(
    faces: Faces, same_offset: float, same_angle: float, gap: float, snap: float, snap_angle: float
) -> Lines:
    """Let faces that are in line, and not far apart along it, share one line.

    Parameters
    ----------
    faces : Faces
        k faces.
    same_offset : float
        Greatest distance of a face's ends from the line of a stronger one, metres.
    same_angle : float
        Greatest angle between them, radians.
    gap : float
        Greatest gap between them along the line, metres.
    snap : float
        A line takes a main direction of the storey if that moves its ends by less, metres,
    snap_angle : float
        or turns it by less, radians.
    """
    k = len(faces)
    flat = faces.normals[:, :2] / np.linalg.norm(faces.normals[:, :2], axis=1, keepdims=True)
    segments = shapely.linestrings(faces.lines)
    tree = shapely.STRtree(segments)
    first, second = tree.query(segments, "dwithin", gap)
    ordered = first < second  # faces are sorted by weight: the first is the stronger one
    first, second = first[ordered], second[ordered]
    cross = np.abs(flat[first, 0] * flat[second, 1] - flat[first, 1] * flat[second, 0])
    away = np.einsum("pej,pj->pe", faces.lines[second] - faces.lines[first][:, :1], flat[first])
    joined = (cross < np.sin(same_angle)) & (np.abs(away).max(axis=1) < same_offset)
    graph = coo_array((np.ones(joined.sum()), (first[joined], second[joined])), shape=(k, k))
    count, of_face = connected_components(graph, directed=False)
    main = frames(face_angles(faces), faces.weights)
    normals, offsets, spans = np.empty((count, 2)), np.empty(count), np.empty((count, 2))
    for line in range(count):
        members = np.flatnonzero(of_face == line)
        normals[line], offsets[line] = _common_line(faces, flat, members, main, snap, snap_angle)
        along = np.array([-normals[line, 1], normals[line, 0]])
        t = faces.lines[members] @ along
        spans[line] = t.min(), t.max()
    return Lines(normals, offsets, spans, of_face)


def _common_line(
    faces: Faces,
    flat: NDArray[np.float64],
    members: NDArray[np.int64],
    main: NDArray[np.float64],
    snap: float,
    snap_angle: float,
) -> tuple[NDArray[np.float64], float]:
    weights = faces.weights[members]
    strongest = members[np.argmax(weights)]
    signs = np.sign(flat[members] @ flat[strongest])
    normal = (flat[members] * (signs * weights)[:, None]).sum(axis=0)
    angle = np.arctan2(normal[1], normal[0])
    off = float(off_frames(np.array([angle]), main)[0])
    ends = faces.lines[members].reshape(-1, 2)
    reach = np.linalg.norm(ends - ends.mean(axis=0), axis=1).max()
    if abs(off) * reach < snap or abs(off) < snap_angle:
        angle -= off
    normal = np.array([np.cos(angle), np.sin(angle)])
    middles = faces.lines[members].mean(axis=1)
    return normal, float(np.average(middles @ normal, weights=weights))


@dataclass(frozen=True, eq=False)
class Arrangement:
    """n cells and m edges between them."""

    cells: NDArray[np.object_]
    """(n,), polygons"""
    left: NDArray[np.int64]
    """(m,), cell on one side of each edge"""
    right: NDArray[np.int64]
    """(m,), cell on the other; -1 outside the arrangement"""
    edges: NDArray[np.float64]
    """(m, 2, 2), metres"""
    line: NDArray[np.int64]
    """(m,), line the edge lies on; -1 for the border"""


def arrange(lines: Lines, border: shapely.Polygon, extension: NDArray[np.float64]) -> Arrangement:
    """Cut the border's inside by the lines, each lengthened by its `extension`, (l,) metres."""
    along = lines.along()
    feet = lines.normals * lines.offsets[:, None]
    ends = lines.spans + extension[:, None] * np.array([-1.0, 1.0])
    drawn = shapely.linestrings(feet[:, None] + ends[..., None] * along[:, None])
    drawn = shapely.intersection(drawn, border)
    network = shapely.union_all(np.append(drawn, border.boundary), grid_size=SNAP)
    cells = np.array(shapely.get_parts(shapely.polygonize([network])))
    return _with_edges(cells, lines)


def _with_edges(cells: NDArray[np.object_], lines: Lines) -> Arrangement:
    rings, cell = shapely.get_rings(cells, return_index=True)
    coords, ring = shapely.get_coordinates(rings, return_index=True)
    at = np.rint(coords / SNAP).astype(np.int64)
    same = ring[:-1] == ring[1:]
    pairs = np.concatenate([at[:-1], at[1:]], axis=1)[same]
    owner = cell[ring[:-1][same]]
    swap = (pairs[:, 0] > pairs[:, 2]) | (
        (pairs[:, 0] == pairs[:, 2]) & (pairs[:, 1] > pairs[:, 3])
    )
    pairs[swap] = pairs[swap][:, [2, 3, 0, 1]]
    keys, which, counts = np.unique(pairs, axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(which.ravel(), kind="stable")
    starts = np.concatenate(([0], np.cumsum(counts)))[:-1]
    left = owner[order[starts]]
    right = np.where(counts > 1, owner[order[np.minimum(starts + 1, len(order) - 1)]], -1)
    edges = keys.reshape(-1, 2, 2) * SNAP
    return Arrangement(cells, left, right, edges, _nearest_line(edges, lines))


def _nearest_line(edges: NDArray[np.float64], lines: Lines) -> NDArray[np.int64]:
    if not len(lines.offsets):
        return np.full(len(edges), -1)
    away = np.abs(edges @ lines.normals.T - lines.offsets).max(axis=1)  # (m, l)
    nearest = away.argmin(axis=1)
    return np.where(away[np.arange(len(edges)), nearest] < 10 * SNAP, nearest, -1)


def seen_share(arrangement: Arrangement, coverage: Coverage) -> NDArray[np.float64]:
    """Return the share of each cell in which floor or ceiling was seen, (n,)."""
    cells, size = closed(coverage)
    centres = (cells + 0.5) * size
    tree = shapely.STRtree(arrangement.cells)
    _, hit = tree.query(shapely.points(centres), "intersects")
    areas = shapely.area(arrangement.cells)
    seen = np.bincount(hit, minlength=len(areas)) * size**2
    return np.clip(seen / np.maximum(areas, size**2), 0, 1)


def closed(coverage: Coverage) -> tuple[NDArray[np.int64], float]:
    """Return the covered cells with gaps of one cell filled, and the cell's edge in metres.

    A coarse scan leaves every third cell of a seen floor empty.
    """
    if not len(coverage):
        return np.empty((0, 2), np.int64), coverage.cell_m
    low = coverage.cells.min(axis=0).astype(np.int64) - 2
    grid = np.zeros(coverage.cells.max(axis=0) - low + 3, bool)
    at = coverage.cells - low
    grid[at[:, 0], at[:, 1]] = True
    return np.argwhere(ndimage.binary_closing(grid, np.ones((3, 3)))) + low, coverage.cell_m


def wall_share(
    arrangement: Arrangement, lines: Lines, faces: Faces, beside: float, worth: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the share of each edge along which a wall was seen, (m,).

    Parameters
    ----------
    beside : float
        A face off the edge by less counts as well, metres: the other face of a thin wall.
    worth : (4,) float
        How much of a wall each code of a face's profile is.
    """
    shares = np.zeros(len(arrangement.edges))
    for line in range(len(lines.offsets)):
        on = np.flatnonzero(arrangement.line == line)
        profile = _line_profile(lines, line, faces, beside, worth) if len(on) else None
        if profile is None:
            continue
        along = np.array([-lines.normals[line, 1], lines.normals[line, 0]])
        t = np.sort(arrangement.edges[on] @ along, axis=1)
        shares[on] = _means(profile, t, faces.bin_m)
    return shares


def _line_profile(
    lines: Lines, line: int, faces: Faces, beside: float, worth: NDArray[np.float64]
) -> tuple[float, NDArray[np.float64]] | None:
    """Return where the profile starts along the line, and per bin what was seen of a wall; None
    for a line without a face."""
    normal, offset = lines.normals[line], lines.offsets[line]
    along = np.array([-normal[1], normal[0]])
    away = np.abs(faces.lines @ normal - offset).max(axis=1)
    cross = np.abs(faces.normals[:, :2] @ along)
    near = np.flatnonzero(((away < beside) & (cross < 0.09)) | (lines.of_face == line))
    if not len(near):
        return None
    t = faces.lines[near] @ along
    start, bin_m = float(t.min()), faces.bin_m
    profile = np.zeros(int(np.ceil((t.max() - start) / bin_m)) + 2)
    for face, (a, b) in zip(near, t, strict=True):
        steps = (np.arange(len(faces.profiles[face])) + 0.5) * bin_m * np.sign(b - a)
        at = ((a + steps - start) / bin_m).astype(int).clip(0, len(profile) - 1)
        np.maximum.at(profile, at, worth[faces.profiles[face]])
    return start, profile


def _means(
    profile: tuple[float, NDArray[np.float64]], t: NDArray[np.float64], bin_m: float
) -> NDArray[np.float64]:
    """Return the mean of a profile over each interval, nothing counting as not seen."""
    start, values = profile
    total = np.concatenate(([0.0], np.cumsum(values)))
    at = np.clip((t - start) / bin_m, 0, len(values))
    whole = at.astype(int)
    part = np.append(values, 0.0)[whole]
    upto = total[whole] + (at - whole) * part
    return (upto[:, 1] - upto[:, 0]) * bin_m / np.maximum(t[:, 1] - t[:, 0], 1e-9)


def open_share(arrangement: Arrangement, coverage: Coverage) -> NDArray[np.float64]:
    """Return the share of each edge across which floor or ceiling was seen to run on, (m,)."""
    cells, size = closed(coverage)
    seen = CellSet(cells, size)
    places = places_along(arrangement.edges, size)
    run_on = np.ones(len(places.edge), bool)
    for step in (-1.5, 0.0, 1.5):
        run_on &= seen.holds(places.at + step * size * places.across)
    return places.mean(run_on)


def solid_share(
    arrangement: Arrangement, faces: Faces, thinnest: float, thickest: float
) -> NDArray[np.float64]:
    """Return the share of each cell that lies between the two faces of one wall, (n,)."""
    solids = [box for i in range(len(faces)) for box in _walls_behind(faces, i, thinnest, thickest)]
    if not solids:
        return np.zeros(len(arrangement.cells))
    union = shapely.union_all(solids, grid_size=SNAP)
    shapely.prepare(arrangement.cells)
    inside = shapely.area(shapely.intersection(arrangement.cells, union, grid_size=SNAP))
    return inside / np.maximum(shapely.area(arrangement.cells), SNAP)


def across_slivers(
    arrangement: Arrangement, sliver: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the pairs of edges at which two cells face each other across a thin one, (p,) each.

    Two rooms on either side of a wall have no edge in common but where the wall has a gap; the
    wall between them must count, or the gap would be all their border.
    """
    spans = arrangement.edges[:, 1] - arrangement.edges[:, 0]
    units = spans / np.maximum(np.linalg.norm(spans, axis=1, keepdims=True), 1e-12)
    sides: dict[int, list[int]] = {}
    for e in range(len(spans)):
        a, b = int(arrangement.left[e]), int(arrangement.right[e])
        if b >= 0 and sliver[a] != sliver[b]:
            sides.setdefault(a if sliver[a] else b, []).append(e)
    pairs = [
        (e, f)
        for around in sides.values()
        for i, e in enumerate(around)
        for f in around[i + 1 :]
        if abs(units[e] @ units[f]) > 0.98
    ]
    table = np.array(pairs, int).reshape(-1, 2)
    return table[:, 0], table[:, 1]


def _walls_behind(faces: Faces, i: int, thinnest: float, thickest: float) -> list[shapely.Polygon]:
    """Return the wall pieces between face i and the faces behind it that look the other way."""
    if not faces.sides[i]:
        return []
    flat = faces.normals[i, :2] / np.linalg.norm(faces.normals[i, :2])
    start, end = faces.lines[i]
    length = np.linalg.norm(end - start)
    along = (end - start) / max(length, 1e-9)
    relative = faces.lines - start
    depth = -(relative @ flat)
    opposite = (faces.normals @ faces.normals[i] < -0.98) & (faces.sides == 1)
    behind = opposite & (depth.min(axis=1) > thinnest / 2) & (depth.max(axis=1) < thickest)
    pieces = []
    for j in np.flatnonzero(behind).tolist():
        a, b = np.sort(relative[j] @ along)
        a, b = max(a, 0.0), min(b, length)
        if b - a < 0.1 or depth[j].mean() < thinnest:
            continue
        if _stands(faces, i, start, along, a, b) + _stands(faces, j, start, along, a, b) < 1:
            continue  # a beam, or a frame one walks through
        back = depth[j][np.argsort(relative[j] @ along)]
        near = [start + a * along, start + b * along]
        far = [near[1] - back[1] * flat, near[0] - back[0] * flat]
        pieces.append(shapely.Polygon([*near, *far]).buffer(0))
    return pieces


def _stands(
    faces: Faces,
    i: int,
    start: NDArray[np.float64],
    along: NDArray[np.float64],
    a: float,
    b: float,
) -> float:
    """Return the share of a face's profile between a and b that is wall down to the floor."""
    profile = faces.profiles[i]
    p0, p1 = (faces.lines[i] - start) @ along
    t = p0 + (np.arange(len(profile)) + 0.5) * faces.bin_m * np.sign(p1 - p0)
    inside = (t >= a) & (t <= b)
    return float((profile[inside] == SEEN_WALL).mean()) if inside.any() else 0.0
