"""Lines where the seen floor and ceiling end and no wall was seen: glass, or an unscanned side."""

import cv2
import numpy as np
from numpy.typing import NDArray

from storage.coverage import Coverage
from tasks.surfaces.arrangement import Lines, closed
from tasks.surfaces.directions import off_frames

STRAIGHT = 0.15
"""How far an outline may wander from a straight line, metres: the raster's own steps."""
SHORTEST = 1.5
"""Shortest straight piece that says where a room ends, metres."""
ALIGNED = np.radians(8)
"""Outlines turned further from the storey's directions are the shadows of things."""
TOUCHES = 2.5
"""Cells no further than this from a side, in cells, touch it."""
BESIDE = 0.4
"""A piece this near to a wall's line is that wall, metres."""


def outline_lines(
    coverage: Coverage, lines: Lines, main: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return normals (k, 2), offsets (k,) and spans (k, 2) of outlines without a wall."""
    kept: list[tuple[NDArray[np.float64], float, tuple[float, float]]] = []
    seen = _image(coverage)
    for a, b in [*_pieces(*seen), *_limits(*seen, main)]:
        length = float(np.linalg.norm(b - a))
        if length < SHORTEST:
            continue
        angle = np.array([np.arctan2(b[0] - a[0], a[1] - b[1])])
        off = float(off_frames(angle, main)[0])
        if abs(off) > ALIGNED:
            continue
        normal = np.array([np.cos(angle[0] - off), np.sin(angle[0] - off)])
        offset = float((a + b) / 2 @ normal)
        t = np.sort(np.array([a, b]) @ np.array([-normal[1], normal[0]]))
        if not _beside(normal, offset, t, lines, kept):
            kept.append((normal, offset, (float(t[0]), float(t[1]))))
    return (
        np.array([k[0] for k in kept]).reshape(-1, 2),
        np.array([k[1] for k in kept], float),
        np.array([k[2] for k in kept]).reshape(-1, 2),
    )


Piece = tuple[NDArray[np.float64], NDArray[np.float64]]


def _image(coverage: Coverage) -> tuple[NDArray[np.uint8], NDArray[np.int64], float]:
    """Return the covered area as an image without stray cells, its low corner and cell size."""
    cells, size = closed(coverage)
    low = cells.min(axis=0) - 1
    image = np.zeros(cells.max(axis=0) - low + 2, np.uint8)
    image[cells[:, 0] - low[0], cells[:, 1] - low[1]] = 1
    opened = cv2.morphologyEx(image, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    return np.asarray(opened, np.uint8), low, size


def _limits(
    image: NDArray[np.uint8], low: NDArray[np.int64], size: float, main: NDArray[np.float64]
) -> list[Piece]:
    """Return the four sides of the covered area's box, along the storey's first direction.

    The largest covered area only: what was seen apart from it was seen through doors.
    """
    count, labels, stats, _ = cv2.connectedComponentsWithStats(image, connectivity=8)
    if count < 2:
        return []
    largest = 1 + int(stats[1:, cv2.CC_STAT_AREA].argmax())
    angle = main[0] if len(main) else 0.0
    axes = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    xy = (np.argwhere(labels == largest) + low + 0.5) * size @ axes.T
    (u0, v0), (u1, v1) = xy.min(axis=0), xy.max(axis=0)
    corners = np.array([(u0, v0), (u1, v0), (u1, v1), (u0, v1)]) @ axes
    sides = zip(corners, np.roll(corners, -1, axis=0), strict=True)
    depths = (xy[:, 1] - v0, u1 - xy[:, 0], v1 - xy[:, 1], xy[:, 0] - u0)
    along = (xy[:, 0], xy[:, 1], xy[:, 0], xy[:, 1])
    # a side that the area touches with a corner only limits nothing
    return [
        (p, q)
        for (p, q), depth, t in zip(sides, depths, along, strict=True)
        if np.ptp(t[depth < TOUCHES * size]) >= SHORTEST
    ]


def _pieces(image: NDArray[np.uint8], low: NDArray[np.int64], size: float) -> list[Piece]:
    """Return the straight pieces of the covered area's outlines, longest first."""
    contours, _ = cv2.findContours(image, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    pieces = []
    for contour in contours:
        corners = cv2.approxPolyDP(contour, STRAIGHT / size, True)[:, 0, ::-1].astype(float)
        # a contour runs through the outermost cells' centres
        xy = (corners + low + 0.5) * size
        pieces += [(p, q) for p, q in zip(xy, np.roll(xy, -1, axis=0), strict=True)]
    pieces.sort(key=lambda piece: (-float(np.linalg.norm(piece[1] - piece[0])), *piece[0]))
    return pieces


def _beside(
    normal: NDArray[np.float64],
    offset: float,
    t: NDArray[np.float64],
    lines: Lines,
    kept: list[tuple[NDArray[np.float64], float, tuple[float, float]]],
) -> bool:
    """Whether a line along this piece, at no more than BESIDE from it, is there already."""
    foot = normal * offset
    along = np.array([-normal[1], normal[0]])
    ends = foot + t[:, None] * along
    known = [
        *zip(lines.normals, lines.offsets, lines.spans, strict=True),
        *kept,
    ]
    for other, at, span in known:
        if np.abs(ends @ other - at).max() > BESIDE:
            continue
        s = np.sort(ends @ np.array([-other[1], other[0]]))
        if min(s[1], span[1]) - max(s[0], span[0]) > 0.3 * (s[1] - s[0]):
            return True
    return False
