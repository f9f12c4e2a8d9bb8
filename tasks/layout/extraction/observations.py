"""Knowledge extraction (Sec. 4.2.2, Fig. 8 lines 2-9): an initial model told along its lines."""

from typing import Literal

import numpy as np
import shapely
from numpy.typing import NDArray

from grammars.model import Grammar
from storage.faces import Faces
from storage.observations import Observations
from storage.rooms import Rooms
from storage.segments import Segments
from tasks.layout.extraction.branches import (
    Branches,
    BranchParams,
    all_branches,
    without_slivers,
)
from tasks.layout.extraction.fronts import fronts_on, share_out
from tasks.layout.extraction.joints import GapParams, find_joints
from tasks.layout.extraction.model import LineFrame, Model, lay_out
from tasks.layout.extraction.reference_lines import LineParams, place_lines
from tasks.layout.extraction.rows import DEPTH_MAX_M, Row, lay_row
from tasks.params import Params


class ExtractParams(Params):
    """Parameters of knowledge extraction."""

    line: LineParams = LineParams()
    """Where reference lines come from."""
    branch: BranchParams = BranchParams()
    """What counts as a wall across them."""
    joints: Literal["found", "ignored"] = "found"
    """Whether walls that nobody saw are looked for where they join others."""
    gap: GapParams = GapParams()
    """What tells of walls that nobody saw."""


STRIP_M = 1.5
"""How deep behind a row's front it is asked which room stands there, metres."""
STANDS = 0.3
"""Least share of that strip a room fills to stand there."""
RAYS = np.array([0.15, 0.325, 0.5, 0.675, 0.85])
"""Where in an interval its room's depth is taken; the median counts."""


def extract_observations(
    rooms: Rooms,
    faces: Faces,
    segments: list[Segments],
    grammar: Grammar,
    params: ExtractParams,
) -> Observations:
    """Extract from an initial model the walls and rooms along its reference lines.

    Parameters
    ----------
    segments : list of Segments
        One table per scan, in the storey's order, to compare what scans say of one wall; or none
        at all: then the faces' average stands.

    Returns
    -------
    Observations
        Lines on which no room stands are left out, but for those the grammar gives where no room
        was seen at all.

    Raises
    ------
    MapSenseError
        If the grammar's reference lines are asked for and cannot be placed.
    """
    model = lay_out(rooms, faces, segments)
    lines = place_lines(model, grammar, params.line)
    frames = lines.frames()
    fronts = [fronts_on(f, lines.corridors, model) for f in frames]
    partition = grammar.partition_m, grammar.partition_spread_m
    ids, rows, standing = [], [], []
    for i, mine in enumerate(share_out(fronts)):
        if len(mine) or (lines.given and not len(fronts[i].rooms)):
            ids.append(lines.ids[i])
            standing.append(fronts[i].rooms[mine])
            rows.append(
                lay_row(
                    frames[i], fronts[i], mine, lines.corridors, model, partition, params.branch
                )
            )
    return _observations(ids, rows, standing, model, params)


def _observations(
    ids: list[str],
    rows: list[Row],
    standing: list[NDArray[np.int64]],
    model: Model,
    params: ExtractParams,
) -> Observations:
    branch = params.branch
    cuts = []
    for row, rooms in zip(rows, standing, strict=True):
        found = row.branches
        if params.joints == "found":
            own = np.unique(rooms).tolist()
            joints = find_joints(row.frame, own, branch.sliver_m, model, params.gap)
            found = all_branches(found, joints)
        cuts.append(without_slivers(_off_ends(row.frame, found, branch), branch))
    bounds = [
        np.concatenate([[0.0], b.at, [row.frame.length]]) for row, b in zip(rows, cuts, strict=True)
    ]
    stands = [_rooms_between(row, at, model) for row, at in zip(rows, bounds, strict=True)]
    outliers = tuple(o for b in cuts for o in b.outliers) if len(model.strips.scans) else ()
    none, points = np.empty(0), np.empty((0, 2))
    ends = [row.frame.start + row.frame.length * row.frame.along for row in rows]
    return Observations(
        line_ids=np.array(ids, np.str_),
        starts=np.array([row.frame.start for row in rows]).reshape(-1, 2),
        ends=np.array(ends).reshape(-1, 2),
        end_sigma_m=np.array([row.end_sigma for row in rows]).reshape(-1, 2),
        end_faces_m=np.array([row.end_faces for row in rows]).reshape(-1, 2, 2),
        lines=np.repeat(np.arange(len(rows)), [len(b.at) for b in cuts]),
        cut_m=np.concatenate([none, *(b.at for b in cuts)]),
        sigma_m=np.concatenate([none, *(b.sigma for b in cuts)]),
        faces_m=np.concatenate([points, *(b.faces for b in cuts)]),
        scans=np.concatenate([none, *(b.scans for b in cuts)]).astype(np.int64),
        presence=np.concatenate([none, *(b.presence for b in cuts)]),
        interval_lines=np.repeat(np.arange(len(rows)), [len(b.at) + 1 for b in cuts]),
        from_m=np.concatenate([none, *(at[:-1] for at in bounds)]),
        to_m=np.concatenate([none, *(at[1:] for at in bounds)]),
        rooms=np.concatenate([none, *(s[0] for s in stands)]).astype(np.int64),
        depth_m=np.concatenate([none, *(s[1] for s in stands)]),
        outliers=outliers,
    )


def _off_ends(frame: LineFrame, branches: Branches, params: BranchParams) -> Branches:
    """Return the branches that are no slivers with the walls at the line's ends."""
    inside = (branches.at >= params.sliver_m) & (branches.at <= frame.length - params.sliver_m)
    return branches.take(np.flatnonzero(inside))


def _rooms_between(
    row: Row, bounds: NDArray[np.float64], model: Model
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return which room stands in each interval of a row, -1 none, and its depth, NaN unknown."""
    low, high = bounds[:-1, None], bounds[1:, None]
    rooms = np.full(len(low), -1, np.int64)
    depths = np.full(len(low), np.nan)
    bottom, top = row.front_m, min(row.front_m + STRIP_M, row.depth_m)
    corners = np.stack(
        [
            np.hstack([low, high, high, low]),
            np.broadcast_to([bottom, bottom, top, top], (len(low), 4)),
        ],
        axis=-1,
    )
    strips = shapely.polygons(row.frame.building(corners))
    for i, strip in enumerate(strips):
        near = np.sort(model.tree.query(strip, "intersects"))
        filled = shapely.area(shapely.intersection(model.rooms.polygons[near], strip))
        if len(near) and filled.max() >= STANDS * strip.area:
            rooms[i] = near[filled.argmax()]
            depths[i] = _depth(row, low[i, 0], high[i, 0], model.rooms.polygons[rooms[i]])
    return rooms, depths


def _depth(row: Row, low: float, high: float, room: shapely.Polygon) -> float:
    """Return how far a room reaches from the line until the first wall, the median of rays."""
    along = low + RAYS * (high - low)
    start = np.column_stack([along, np.full(len(along), row.front_m)])
    end = np.column_stack([along, np.full(len(along), DEPTH_MAX_M)])
    rays = shapely.linestrings(row.frame.building(np.stack([start, end], axis=1)))
    reach = []
    for part in shapely.intersection(rays, room):
        pieces = [p for p in shapely.get_parts(part) if p.length > 0]
        if pieces:
            first = [row.frame.local(shapely.get_coordinates(p))[:, 1] for p in pieces]
            reach.append(float(min(first, key=np.min).max()))
    return float(np.median(reach)) if reach else float("nan")
