"""What each step of door detection makes of one wall face, to be looked at (Fig. 16)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from storage.candidates import SHARES, Candidates
from storage.forest import Forest
from storage.openings import DOOR, Openings
from storage.snapshots import Snapshots
from storage.wall_images import WallImages
from storage.walls import Walls
from tasks.doors.candidates import CandidateParams
from tasks.doors.classifying import classified
from tasks.doors.crosscheck import on_walls
from tasks.doors.edges import Edges, find_edges
from tasks.doors.lines import Lines, level_lines, upright_lines
from tasks.doors.merging import Rectangles, per_door, per_wall
from tasks.doors.openings import OpeningsParams, door_probabilities
from tasks.doors.straightening import straightened

Boxes = NDArray[np.float64]
"""(n, 4), begin and end along the face, lower and upper side over its foot, metres"""


@dataclass(frozen=True, eq=False)
class FaceSteps:
    """One wall face, step by step; places on it in metres along it and over its foot."""

    depth: NDArray[np.float32]
    """(a, b), metres behind the wall around, NaN not seen"""
    edges: Edges
    uprights: Lines
    levels: Lines
    candidates: Boxes
    likely: Boxes
    """candidates that are doors by the classifier"""
    clustered: Boxes
    """candidates that may be doors, those of the wall's other face too"""
    clusters: NDArray[np.int64]
    """the cluster of each, -1 for none"""
    doors: Boxes
    """doors found"""


def face_steps(
    face: int,
    images: WallImages,
    walls: Walls,
    candidates: Candidates,
    openings: Openings,
    snapshots: list[Snapshots],
    forest: Forest,
    params: tuple[CandidateParams, OpeningsParams],
) -> FaceSteps:
    """Return what the steps make of a face.

    Parameters
    ----------
    face : row of `images`
    candidates : found on `images`
    openings : found among the candidates
    snapshots : of the storey's scans
    forest : the one that told the openings
    params : of both stages
    """
    finding, telling = params
    labels, pixel_m = images.labels[face], images.pixel_m
    straight = straightened(labels, images.depths[face], pixel_m, finding.straight)
    edges = find_edges(labels, straight, finding.straight, finding.edges)
    alike = candidates.take(images.walls[candidates.faces] == images.walls[face])
    on = images.walls[alike.faces]
    boxes = on_walls(alike, images, walls)
    told = classified(alike, forest)
    p = door_probabilities(told, on, boxes, walls, snapshots, telling)
    own = alike.faces == face
    to_merge = (p >= telling.least_p) & (own | (telling.faces == "both"))
    here = on_face(boxes, face, images, walls)
    mine = (openings.kinds == DOOR) & (openings.walls == images.walls[face])
    return FaceSteps(
        depth=straight.depth,
        edges=edges,
        uprights=upright_lines(edges.upright, pixel_m, finding.lines),
        levels=level_lines(edges.level, pixel_m, finding.lines),
        candidates=here[own],
        likely=here[own & (p >= telling.door_p)],
        clustered=here[to_merge],
        clusters=_clusters(alike.take(to_merge), boxes[to_merge], p[to_merge], telling),
        doors=_found(openings, mine, face, images),
    )


def on_face(boxes: Boxes, face: int, images: WallImages, walls: Walls) -> Boxes:
    """Return boxes along a wall's centre line, as of `on_walls`, as they lie on one of its faces.

    Returns
    -------
    (n, 4) float
        Begin and end along the face, lower and upper side over its foot.
    """
    begin, end = walls.lines[images.walls[face]]
    along_wall = (end - begin) / np.linalg.norm(end - begin)
    axis = images.axes[face]
    shift = (begin - images.origins[face]) @ axis
    along = shift + boxes[:, :2] * (along_wall @ axis)
    up = boxes[:, 2:] - images.base_m[face]
    return np.column_stack([along.min(axis=1), along.max(axis=1), up])


def _clusters(
    rows: Candidates, boxes: Boxes, p: NDArray[np.float64], params: OpeningsParams
) -> NDArray[np.int64]:
    if not len(rows):
        return np.empty(0, np.int64)
    merge = per_door if params.winner == "door" else per_wall
    shares = np.column_stack([rows.feature(name) for name in SHARES])
    return merge(Rectangles(boxes, p, shares), params.merging)[0]


def _found(openings: Openings, rows: NDArray[np.bool_], face: int, images: WallImages) -> Boxes:
    along = (openings.lines[rows] - images.origins[face]) @ images.axes[face]
    up = np.column_stack([openings.sill_m[rows], openings.head_m[rows]]) - images.base_m[face]
    return np.column_stack([along.min(axis=1), along.max(axis=1), up])
