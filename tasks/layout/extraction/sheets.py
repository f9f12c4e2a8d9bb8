"""Wall faces across a reference line: edges of rooms and faces in one plane are one sheet."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import PositiveFloat

from storage.faces import SEEN_WALL
from tasks.layout.extraction.fusion import ENOUGH, fuse
from tasks.layout.extraction.model import LineFrame, Model
from tasks.layout.extraction.pieces import Pieces, pieces_across
from tasks.params import Params


class SheetParams(Params):
    """What counts as a branch of a reference line (Sec. 4.2.2)."""

    margin_m: PositiveFloat = 0.4
    """How far from the corridor's wall a branch may end, metres: what the authors' group published
    of its tool. Reckoned from the faces that rooms turn to the corridor."""
    angle_rad: PositiveFloat = 0.2
    """Greatest turn of a branch off the square on its line, radians: as eps_norm (Fig. 13)."""
    shortest_m: PositiveFloat = 0.5
    """Shortest branch, metres. Assumption."""
    same_m: PositiveFloat = 0.12
    """Pieces that face the same way this near to each other are of one face, metres. Assumption:
    twice what the initial model's lines are apart at least."""
    sigma_scan_m: PositiveFloat = 0.02
    """Standard deviation of a wall's place in one scan, metres: mostly how the scan is registered.
    Assumption."""
    sigma_unseen_m: PositiveFloat = 0.15
    """Standard deviation of a wall that no scan saw and the initial model extended, metres.
    Assumption."""


STRIP_REACH, STRIP_NEAR = 0.25, 0.06
"""How far off its face a scan's own strip of wall is looked for, metres: where enough scans tell
which of them is off, and where they do not (as faces are merged)."""
MOSTLY = 0.5
"""Share of the shorter piece that must lie beside the longer one for both to be one sheet: in line
with it, further off, may stand the wall of another row."""
CORRIDOR_EDGE = 1.0
"""A corridor's own edges across the line that are shorter are jogs, metres."""


@dataclass(frozen=True, eq=False)
class Sheet:
    """One side of a wall across a line."""

    at: float
    """along the line, metres"""
    facing: int
    """1: seen by one further along the line, the wall's upper face; -1: its lower; 0: unknown"""
    near: float
    far: float
    """where it begins and ends to the left of the line, metres"""
    seen: bool
    """whether a face was found there, not an outline's edge alone"""
    bounds: bool
    """whether the outline of a room lies on it"""
    sigma: float
    scans: frozenset[int]
    """those that tell where it is; empty where scans are not known one by one"""
    n_scans: int
    outliers: tuple[int, ...]
    faint: bool
    """whether neither an outline lies on it nor any scan by itself shows it as a wall"""
    height: float
    """metres it was seen over"""
    stretches: NDArray[np.float64]
    """(s, 2), where to the left of the line wall was seen, metres"""


def find_sheets(
    frame: LineFrame,
    reach: tuple[float, float],
    front_m: float,
    corridors: NDArray[np.int64],
    model: Model,
    params: SheetParams,
) -> list[Sheet]:
    """Return the faces of walls across a line, along it.

    Parameters
    ----------
    frame : the line
    reach : where along it to look, metres
    front_m : where the rooms' faces towards the corridor are, to the left of the line, metres
    corridors : rooms that do not stand on the line
    """
    edges = pieces_across(model.edges, frame, reach, params.angle_rad, params.shortest_m)
    lengths = np.linalg.norm(model.edges[:, 1] - model.edges[:, 0], axis=1)
    rooms = ~np.isin(model.owners, corridors) | (lengths >= CORRIDOR_EDGE)
    close = edges.near <= front_m + params.margin_m
    e = np.flatnonzero(edges.across & close & rooms)
    # inside is left of an edge: one that leads away from the line has its room at the lower side
    steps = (model.edges[e, 1] - model.edges[e, 0]) @ frame.left
    of_edge = np.where(steps > 0, -1, 1)
    e_order = np.argsort(-(edges.far[e] - edges.near[e]), kind="stable")

    faces = pieces_across(model.faces.lines, frame, reach, params.angle_rad, params.shortest_m)
    normals = model.faces.normals[:, :2] @ frame.along
    of_face = np.where(model.faces.sides == 1, np.sign(normals), 0).astype(int)
    f = np.flatnonzero(faces.across)
    f = f[np.lexsort((-(faces.far[f] - faces.near[f]), of_face[f] == 0))]

    groups: list[_Group] = []
    for i, side in zip(e[e_order].tolist(), of_edge[e_order].tolist(), strict=True):
        piece = float(edges.at[i]), side, float(edges.near[i]), float(edges.far[i])
        (_own(groups, *piece, params.same_m) or _new(groups, *piece)).edges.append(i)
    for j in f.tolist():
        piece = float(faces.at[j]), int(of_face[j]), float(faces.near[j]), float(faces.far[j])
        group = _own(groups, *piece, params.same_m)
        if group is None and faces.near[j] <= front_m + params.margin_m:
            group = _new(groups, *piece)
        if group is not None:
            group.faces.append(j)
    strips = pieces_across(model.strips.lines, frame, reach, params.angle_rad, params.shortest_m)
    sheets = [_sheet(g, edges, faces, strips, frame, model, params) for g in groups]
    return sorted(sheets, key=lambda s: (s.at, s.facing))


@dataclass(eq=False)
class _Group:
    """Pieces of one sheet, told by the first of them."""

    at: float
    facing: int
    near: float
    far: float
    edges: list[int]
    faces: list[int]


def _new(groups: list[_Group], at: float, facing: int, near: float, far: float) -> _Group:
    groups.append(_Group(at, facing, max(near, 0.0), far, [], []))
    return groups[-1]


def _own(
    groups: list[_Group], at: float, facing: int, near: float, far: float, same: float
) -> _Group | None:
    """Return the group nearest to a piece that lies beside it for the most part.

    A piece of unknown facing fits any.
    """
    near = max(near, 0.0)
    fits = [
        g
        for g in groups
        if abs(g.at - at) <= same
        and facing in (0, g.facing)
        and min(far, g.far) - max(near, g.near) >= MOSTLY * min(far - near, g.far - g.near)
    ]
    return min(fits, key=lambda g: abs(g.at - at), default=None)


def _sheet(
    group: _Group,
    edges: Pieces,
    faces: Pieces,
    strips: Pieces,
    frame: LineFrame,
    model: Model,
    params: SheetParams,
) -> Sheet:
    e, f = group.edges, group.faces
    near = float(min([*edges.near[e], *faces.near[f]]))
    far = float(max(edges.far[e]) if e else max(faces.far[f]))
    stretches = np.concatenate([_stretches(j, frame, model) for j in f] or [np.empty((0, 2))])
    known = [j for j in f if model.faces.profiles[j].any()]
    drawn = float(np.average(edges.at[e], weights=edges.far[e] - edges.near[e])) if e else np.nan
    if known:
        at = float(np.average(faces.at[known], weights=model.faces.weights[known]))
        n_scans = int(model.faces.scans[known].max())
        sigma = params.sigma_scan_m / np.sqrt(max(n_scans, 1))
        heights = model.faces.heights[known]
        height = float(heights[:, 1].max() - heights[:, 0].min())
    else:
        at = drawn
        n_scans, sigma, height = 0, params.sigma_unseen_m, 0.0
    members: frozenset[int] = frozenset()
    outliers: tuple[int, ...] = ()
    mine = _strips_of(at, group.facing, (near, far), strips, frame, model)
    if len(mine):
        by = model.strips.scans[mine]
        fused = fuse(strips.at[mine], np.full(len(mine), params.sigma_scan_m), by)
        at, sigma, outliers = fused.position_m, fused.sigma_m, fused.outliers
        members = frozenset(by.tolist()) - set(outliers)
        n_scans = len(members)
    elif known and e and len(model.strips.scans):
        # too small to be any scan's wall by itself: as uncertain as what it is off the outline
        at, sigma = drawn, float(np.hypot(sigma, at - drawn))
    return Sheet(
        at=at,
        facing=group.facing,
        near=near,
        far=far,
        seen=bool(known),
        bounds=bool(e),
        sigma=float(sigma),
        scans=members,
        n_scans=n_scans,
        outliers=outliers,
        faint=not e and not len(mine) and len(model.strips.scans) > 0,
        height=height,
        stretches=stretches,
    )


def _stretches(j: int, frame: LineFrame, model: Model) -> NDArray[np.float64]:
    """Return where to the left of the line a face shows wall, (s, 2)."""
    start, end = frame.local(model.faces.lines[j])
    wall = np.flatnonzero(model.faces.profiles[j] == SEEN_WALL)
    length = float(np.linalg.norm(end - start))
    bins = np.minimum(np.column_stack([wall, wall + 1]) * model.faces.bin_m, length)
    left = start[1] + bins / max(length, 1e-9) * (end[1] - start[1])
    return np.asarray(np.sort(left, axis=1))


def _strips_of(
    at: float,
    facing: int,
    span: tuple[float, float],
    strips: Pieces,
    frame: LineFrame,
    model: Model,
) -> NDArray[np.int64]:
    """Return the largest strip of each scan on a face, if scans are known one by one."""
    if not len(strips.at) or facing == 0:
        return np.empty(0, np.int64)
    away = np.abs(strips.at - at)
    same = np.sign(model.strips.normals @ frame.along) == facing
    common = np.minimum(strips.far, span[1]) - np.maximum(strips.near, span[0])
    beside = common >= (strips.far - strips.near) / 2
    fits = np.flatnonzero(strips.across & same & beside & (away <= STRIP_REACH))
    best = _largest(fits, model)
    if len(best) < ENOUGH:
        best = _largest(fits[away[fits] <= STRIP_NEAR], model)
    return best


def _largest(strips: NDArray[np.int64], model: Model) -> NDArray[np.int64]:
    order = strips[np.lexsort((-model.strips.areas[strips], model.strips.scans[strips]))]
    return order[np.unique(model.strips.scans[order], return_index=True)[1]]
