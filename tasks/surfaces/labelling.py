"""Plane labelling (Sec. 4.1, Eq. 6 and 7): floor, ceiling, and the faces of the walls."""

from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import NonNegativeFloat, PositiveFloat

from storage.coverage import Coverage
from storage.faces import NOT_SEEN, SEEN_LOW, SEEN_OVER, SEEN_WALL, Faces
from storage.segments import Segments
from tasks.params import Params


class LabelParams(Params):
    """Parameters of plane labelling."""

    eps_wall: PositiveFloat = 0.2
    """Greatest distance of two segments of one wall, metres (Fig. 13)."""
    eps_norm: PositiveFloat = 0.2
    """Greatest norm of the cross product of their normals (Fig. 13, read as 2 x 10^-1)."""
    room_extent_m2: PositiveFloat = 1.0
    """Area below which a level is a lamp, a hole or a piece of furniture, square metres. Not in
    the paper."""
    room_extent_share: PositiveFloat = 0.1
    """The same as a share of the largest level's area. Not in the paper."""
    headroom_m: PositiveFloat = 1.9
    """Least height of a ceiling above the floor, metres. Not in the paper."""
    below_ceiling_m: PositiveFloat = 0.5
    """How far below the ceiling a wall may end and still be a wall, metres: partitions, door
    leaves and cupboards end lower. Not in the paper."""
    wall_height_m: PositiveFloat = 1.5
    """Height above the floor a wall must reach where no ceiling was seen, metres. Not in the
    paper."""
    lintel_m: NonNegativeFloat = 2.1
    """Height of a door's opening, metres: what is seen above it closes a wall over a door. Not in
    the paper."""


LEVEL_STEP = 0.1
"""Horizontal segments closer than this are of one level, metres."""
SAME_FACE = 0.06
"""Segments of one face off its strongest one by less than this settle where it lies, metres; what
stands further before a wall is furniture."""
THINNEST, THICKEST = 0.04, 0.35
"""Thickness of a wall between two rooms, metres."""
MINOR = 0.25
"""Share of a face's area below which a parallel strip beside it is no face of its own."""
CEILING_RUNS_ON = 0.3
"""Share of a segment on both sides of which the ceiling is seen, from which it is no wall."""
BESIDE = 0.6
"""Depth of the strip before a face in which floor or ceiling tell of a room, metres."""


@dataclass(frozen=True)
class Levels:
    """Heights of a storey's floor and ceiling, metres; None where not seen."""

    floor: float | None
    ceiling: float | None
    low_ceiling: float | None
    """the height nine tenths of the ceiling lie above"""


def label_surfaces(scans: list[Segments], params: LabelParams) -> tuple[Faces, Coverage]:
    """Label floor and ceiling, and merge the wall segments of all scans into wall faces.

    Parameters
    ----------
    scans : list of Segments
        One per scan of the storey, building frame.

    Returns
    -------
    Faces
        The side of each wall that a room sees.
    Coverage
        Where floor and ceiling were seen.

    Notes
    -----
    Two segments are one wall if the distance of their hulls in plan is at most eps_wall and
    the cross product of their normals at most eps_norm (Fig. 3, line 12), and if they face the
    same way: the two sides of a thin wall, seen from two rooms, are closer than eps_wall, and
    are not one face but a wall with a thickness.
    """
    levels = find_levels(scans, params)
    coverage = _coverage(scans, levels, params)
    seen = _Seen(coverage)
    strips = [_candidates(scan, levels, seen, i, params) for i, scan in enumerate(scans)]
    every = _two_faced([s for strip in strips for s in strip])
    return _merge(every, seen.either, params), coverage


def find_levels(scans: list[Segments], params: LabelParams) -> Levels:
    """Find floor and ceiling: the lowest and highest level of room extent (Eq. 6, 7).

    A cloud with one level only is asked on which side of it its walls lie.
    """
    heights, areas = _horizontals(scans)
    if not len(heights):
        return Levels(None, None, None)
    large = _large_levels(heights, areas, params)
    floor, ceiling = float(large.min()), float(large.max())
    if ceiling - floor < params.headroom_m:
        if _walls_stand_on(scans, floor):
            return Levels(floor, None, None)
        return Levels(None, ceiling, ceiling)
    above = heights > floor + params.headroom_m
    order = np.argsort(heights[above])
    share = np.cumsum(areas[above][order]) / areas[above].sum()
    low = float(heights[above][order][np.searchsorted(share, 0.1)])
    return Levels(floor, ceiling, low)


def _horizontals(scans: list[Segments]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    heights, areas = [], []
    for scan in scans:
        flat = scan.of_kind("horizontal")
        heights.append(scan.heights[flat].mean(axis=1))
        areas.append(scan.areas[flat])
    return np.concatenate([*heights, np.empty(0)]), np.concatenate([*areas, np.empty(0)])


def _large_levels(
    heights: NDArray[np.float64], areas: NDArray[np.float64], params: LabelParams
) -> NDArray[np.float64]:
    """Return the mean heights of the levels of room extent; the largest one at least."""
    order = np.argsort(heights)
    heights, areas = heights[order], areas[order]
    level = np.concatenate(([0], np.cumsum(np.diff(heights) > LEVEL_STEP)))
    extents = np.bincount(level, areas)
    means = np.bincount(level, areas * heights) / extents
    enough = max(params.room_extent_m2, params.room_extent_share * extents.max())
    return means[extents >= min(enough, extents.max())]


def _walls_stand_on(scans: list[Segments], level: float) -> bool:
    above = below = 0.0
    for scan in scans:
        walls = scan.of_kind("vertical")
        middle = scan.heights[walls].mean(axis=1)
        above += scan.areas[walls][middle > level].sum()
        below += scan.areas[walls][middle <= level].sum()
    return above >= below


def _coverage(scans: list[Segments], levels: Levels, params: LabelParams) -> Coverage:
    """Rasterise floor and ceiling of all scans, the lowest floor and the highest ceiling a cell."""
    cell = scans[0].cell_m if scans else 0.1
    rows: list[NDArray[np.float64]] = [np.empty((0, 5))]
    for number, scan in enumerate(scans):
        for i in scan.of_kind("horizontal"):
            height = scan.heights[i].mean()
            role = _role(height, levels, params)
            if role is None:
                continue
            raster = scan.rasters[i]
            at = np.argwhere(raster.cells) + np.rint(np.array(raster.start) / cell).astype(int)
            row = np.full((len(at), 5), np.nan)
            row[:, :2], row[:, 4] = at, number
            row[:, 2 if role == "floor" else 3] = height
            rows.append(row)
    seen = np.concatenate(rows)
    cells, which = np.unique(seen[:, :2].astype(np.int32), axis=0, return_inverse=True)
    which = which.ravel()
    floor, ceiling = np.full(len(cells), np.inf), np.full(len(cells), -np.inf)
    np.fmin.at(floor, which, seen[:, 2])
    np.fmax.at(ceiling, which, seen[:, 3])
    pairs = np.unique(np.column_stack((which, seen[:, 4])), axis=0)
    return Coverage(
        cells=cells.reshape(-1, 2),
        floor_m=np.where(np.isfinite(floor), floor, np.nan),
        ceiling_m=np.where(np.isfinite(ceiling), ceiling, np.nan),
        scans=np.bincount(pairs[:, 0].astype(int), minlength=len(cells)),
        seen_by=pairs[:, 1].astype(np.int32),
        cell_m=cell,
        floor_level_m=levels.floor,
        ceiling_level_m=levels.ceiling,
    )


def _role(height: float, levels: Levels, params: LabelParams) -> str | None:
    if levels.floor is not None and height < levels.floor + 3 * LEVEL_STEP:
        return "floor" if height > levels.floor - 3 * LEVEL_STEP else None
    base = levels.floor if levels.floor is not None else levels.ceiling - params.headroom_m  # type: ignore[operator]
    if levels.ceiling is not None and height >= base + params.headroom_m:
        return "ceiling" if height < levels.ceiling + 3 * LEVEL_STEP else None
    return None


class _CellSet:
    """Which plan cells were seen, to be asked for many points at once."""

    def __init__(self, cells: NDArray[np.int32], cell: float) -> None:
        self.cell = cell
        self.low = cells.min(axis=0) if len(cells) else np.zeros(2, int)
        shape = cells.max(axis=0) - self.low + 1 if len(cells) else np.ones(2, int)
        self.grid = np.zeros(shape, bool)
        at = cells - self.low
        self.grid[at[:, 0], at[:, 1]] = True

    def holds(self, xy: NDArray[np.float64]) -> NDArray[np.bool_]:
        at = np.floor(xy / self.cell).astype(int) - self.low
        inside = ((at >= 0) & (at < self.grid.shape)).all(axis=-1)
        at = np.where(inside[..., None], at, 0)
        return inside & self.grid[at[..., 0], at[..., 1]]


class _Seen:
    """Where floor, ceiling and either of them were seen."""

    def __init__(self, coverage: Coverage) -> None:
        floor, ceiling = np.isfinite(coverage.floor_m), np.isfinite(coverage.ceiling_m)
        self.either = _CellSet(coverage.cells, coverage.cell_m)
        self.floor = _CellSet(coverage.cells[floor], coverage.cell_m)
        self.ceiling = _CellSet(coverage.cells[ceiling], coverage.cell_m)


@dataclass(frozen=True, eq=False)
class _Strip:
    """One wall segment, ready to be merged."""

    scan: int
    normal: NDArray[np.float64]
    offset: float
    side: int
    line: NDArray[np.float64]
    heights: NDArray[np.float64]
    area: float
    profile: NDArray[np.uint8]


def _candidates(
    scan: Segments, levels: Levels, seen: _Seen, number: int, params: LabelParams
) -> list[_Strip]:
    """Return the vertical segments of one scan that are walls by their height."""
    strips = []
    for i in scan.of_kind("vertical"):
        hidden = not _reaches_ceiling(scan.heights[i, 1], levels, params)
        if hidden and not _may_go_on(scan, int(i), levels, seen, params):
            continue
        normal, offset, line = scan.normals[i], scan.offsets[i], scan.lines[i]
        side = 1 if scan.side_known[i] else _side(line, normal[:2], seen.either)
        if side < 0:
            normal, offset, side = -normal, -offset, 1
        strips.append(
            _Strip(
                scan=number,
                normal=normal,
                offset=float(offset),
                side=side,
                line=line,
                heights=scan.heights[i],
                area=float(scan.areas[i]),
                profile=_profile(scan, int(i), hidden, levels, seen, params),
            )
        )
    return strips


def _reaches_ceiling(top: float, levels: Levels, params: LabelParams) -> bool:
    if levels.low_ceiling is not None:
        return bool(top >= levels.low_ceiling - params.below_ceiling_m)
    return levels.floor is None or bool(top >= levels.floor + params.wall_height_m)


def _may_go_on(
    scan: Segments, i: int, levels: Levels, seen: _Seen, params: LabelParams
) -> bool:
    """Whether a segment that ends below the ceiling may be a wall whose top was not seen.

    Seen through a door, a room's walls end at the lintel's shadow. Over a partition or a cupboard
    the ceiling runs on; a wall interrupts it.
    """
    if levels.floor is not None and scan.heights[i, 1] < levels.floor + params.wall_height_m:
        return False
    return _share_through(scan.lines[i], scan.normals[i, :2], seen.ceiling) < CEILING_RUNS_ON


def _share_through(
    line: NDArray[np.float64], normal: NDArray[np.float64], seen: _CellSet
) -> float:
    """Return the share of a line on both sides of which the cells were seen."""
    return float(_through(line, normal, _steps(line, seen.cell), seen).mean())


def _steps(line: NDArray[np.float64], step: float) -> NDArray[np.float64]:
    count = max(1, int(np.ceil(np.linalg.norm(line[1] - line[0]) / step)))
    return (np.arange(count) + 0.5) / count


def _through(
    line: NDArray[np.float64],
    normal: NDArray[np.float64],
    shares: NDArray[np.float64],
    seen: _CellSet,
) -> NDArray[np.bool_]:
    """Return whether the cells on both sides of each place along a line were seen."""
    flat = normal / np.linalg.norm(normal) * 1.5 * seen.cell
    along = line[0] + shares[:, None] * (line[1] - line[0])
    return seen.holds(along + flat) & seen.holds(along - flat)


def _profile(
    scan: Segments, i: int, hidden: bool, levels: Levels, seen: _Seen, params: LabelParams
) -> NDArray[np.uint8]:
    """Return per bin along the segment what was seen there."""
    raster = scan.rasters[i]
    tops = raster.start[1] + scan.cell_m * (np.arange(raster.cells.shape[1]) + 1)
    lintel = _lintel(levels, params)
    low = raster.cells[:, tops <= lintel].any(axis=1)
    high = raster.cells[:, tops > lintel].any(axis=1)
    if hidden:  # no top to tell by
        return np.where(low | high, SEEN_WALL, NOT_SEEN).astype(np.uint8)
    length = np.linalg.norm(scan.lines[i, 1] - scan.lines[i, 0])
    shares = np.clip((np.arange(len(low)) + 0.5) * scan.cell_m / max(length, 1e-9), 0, 1)
    beneath = _through(scan.lines[i], scan.normals[i, :2], shares, seen.floor)
    profile = np.full(len(low), NOT_SEEN, np.uint8)
    profile[low] = SEEN_LOW
    profile[high] = SEEN_WALL
    profile[high & ~low & beneath] = SEEN_OVER
    return profile


def _lintel(levels: Levels, params: LabelParams) -> float:
    """Return the height above which a wall closes its doors too."""
    if levels.low_ceiling is None:
        return -np.inf if levels.floor is None else levels.floor + params.wall_height_m
    below = levels.low_ceiling - params.below_ceiling_m
    return below if levels.floor is None else min(below, levels.floor + params.lintel_m)


def _side(line: NDArray[np.float64], normal: NDArray[np.float64], seen: _CellSet) -> int:
    """Return 1 if a room lies before the face, -1 if behind it, 0 if on both sides or neither."""
    length = np.linalg.norm(line[1] - line[0])
    t = np.linspace(0.02, 0.98, max(3, int(length / seen.cell)))
    along = line[0] + t[:, None] * (line[1] - line[0])
    depth = np.arange(1.5 * seen.cell, BESIDE, seen.cell)
    flat = normal / np.linalg.norm(normal)
    before = seen.holds(along[:, None] + depth[:, None] * flat).mean()
    behind = seen.holds(along[:, None] - depth[:, None] * flat).mean()
    if max(before, behind) < 0.1 or min(before, behind) > 0.5 * max(before, behind):
        return 0
    return 1 if before > behind else -1


def _two_faced(strips: list[_Strip]) -> list[_Strip]:
    """Turn the two faces of a thin wall apart.

    Floor and ceiling are seen on either side of both; but a wall has no room between its faces.
    """
    if not strips:
        return strips
    lines = np.array([s.line for s in strips])
    tree = shapely.STRtree(shapely.linestrings(lines))
    turned = []
    for strip in strips:
        if strip.side:
            turned.append(strip)
            continue
        near = tree.query(shapely.linestrings(strip.line), "dwithin", THICKEST)
        votes = sum(_twin(strip, strips[j]) for j in near)
        if votes == 0:
            turned.append(strip)
        elif votes > 0:  # the other face lies before this one: the room is behind
            turned.append(replace(strip, normal=-strip.normal, offset=-strip.offset, side=1))
        else:
            turned.append(replace(strip, side=1))
    return turned


def _twin(strip: _Strip, other: _Strip) -> float:
    """Return by how many metres `other` accompanies the strip: positive before it, else behind."""
    if np.linalg.norm(np.cross(strip.normal, other.normal)) > 0.09:  # five degrees
        return 0.0
    away = _away(other.line, strip).mean()
    if not THINNEST <= abs(away) <= THICKEST:
        return 0.0
    length = _length(strip.line)
    along = (strip.line[1] - strip.line[0]) / max(length, 1e-9)
    a, b = np.sort((other.line - strip.line[0]) @ along)
    return float(np.sign(away) * max(0.0, min(b, length) - max(a, 0.0)))


def _merge(strips: list[_Strip], seen: _CellSet, params: LabelParams) -> Faces:
    """Merge the strips of one wall into one face (Fig. 3 line 12, Fig. 4)."""
    bin_m = seen.cell
    faces = [_face(group, bin_m, seen) for group in _one_wall(strips, params)]
    faces.sort(key=lambda f: (-f["weight"], *f["line"].ravel()))
    return Faces(
        normals=np.array([f["normal"] for f in faces]).reshape(-1, 3),
        offsets=np.array([f["offset"] for f in faces], float),
        sides=np.array([f["side"] for f in faces], np.int8),
        lines=np.array([f["line"] for f in faces]).reshape(-1, 2, 2),
        heights=np.array([f["heights"] for f in faces]).reshape(-1, 2),
        weights=np.array([f["weight"] for f in faces], float),
        scans=np.array([f["scans"] for f in faces], np.int64),
        profiles=tuple(f["profile"] for f in faces),
        bin_m=bin_m,
    )


def _one_wall(strips: list[_Strip], params: LabelParams) -> list[list[_Strip]]:
    """Return groups of strips of one wall face each, the strongest strip of a group first.

    Each strip joins the strongest face that takes it. Chains of pairs would lead from one face of
    a wall over a door's frame to the other.
    """
    strips = sorted(strips, key=lambda s: (-s.area, *s.line.ravel()))
    lines = shapely.linestrings(np.array([s.line for s in strips]).reshape(-1, 2, 2))
    tree = shapely.STRtree(lines)
    group = np.full(len(strips), -1)
    groups: list[list[int]] = []
    for i, strip in enumerate(strips):
        near = np.sort(tree.query(lines[i], "dwithin", params.eps_wall))
        beside = dict.fromkeys(group[near[group[near] >= 0]].tolist())
        for g in beside:
            if _same_wall(strips[groups[g][0]], strip, params):
                group[i] = g
                groups[g].append(i)
                break
        else:
            group[i] = len(groups)
            groups.append([i])
    return [[strips[i] for i in members] for members in groups]


def _same_wall(face: _Strip, strip: _Strip, params: LabelParams) -> bool:
    if np.linalg.norm(np.cross(face.normal, strip.normal)) > params.eps_norm:
        return False
    away = float(np.abs(_away(strip.line, face)).max())
    if face.side and strip.side and face.normal @ strip.normal < 0:
        return False
    if away <= SAME_FACE:
        return True
    # a strip further off is something standing before the wall, unless it is as large as one
    return away <= params.eps_wall and strip.area < MINOR * face.area


def _length(line: NDArray[np.float64]) -> float:
    return float(np.linalg.norm(line[1] - line[0]))


def _away(points: NDArray[np.float64], strip: _Strip) -> NDArray[np.float64]:
    """Return the signed distances of plan points from a strip's line."""
    flat = strip.normal[:2] / np.linalg.norm(strip.normal[:2])
    return (points - strip.line[0]) @ flat


def _face(members: list[_Strip], bin_m: float, seen: _CellSet) -> dict:  # type: ignore[type-arg]
    """Average the strips of one face into one line, and lay their profiles together."""
    best = members[0]
    near = [s for s in members if np.abs(_away(s.line, best)).max() <= SAME_FACE]
    areas = np.array([s.area for s in near])
    normals = np.array([s.normal * np.sign(s.normal @ best.normal) for s in near])
    flat, foot = _fit_line(np.array([s.line for s in near]), areas, best)
    tilt = float(np.average(normals[:, 2], weights=areas))
    normal = np.append(flat * np.sqrt(1 - tilt**2), tilt)
    height = float(np.average([s.heights.mean() for s in near], weights=areas))
    along = np.array([-flat[1], flat[0]])
    ends = np.array([(s.line - foot) @ along for s in near])
    line = foot + np.array([ends.min(), ends.max()])[:, None] * along
    side = 1 if any(s.side for s in near) else _side(line, flat, seen)
    if side < 0:
        normal, line, side = -normal, line[::-1], 1
    along = (line[1] - line[0]) / max(_length(line), 1e-9)
    return {
        "normal": normal,
        "offset": float(normal @ np.append(foot, height)),
        "side": side,
        "line": line,
        "heights": np.array([min(s.heights[0] for s in near), max(s.heights[1] for s in near)]),
        "weight": float(areas.sum()),
        "scans": len({s.scan for s in near}),
        "profile": _joint_profile(near, line[0], along, _length(line), bin_m),
    }


def _fit_line(
    lines: NDArray[np.float64], weights: NDArray[np.float64], best: _Strip
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the unit normal and a point of the least-squares line through weighted segments."""
    middles = lines.mean(axis=1)
    foot = np.average(middles, axis=0, weights=weights)
    spans = lines[:, 1] - lines[:, 0]
    away = middles - foot
    # a uniform segment scatters by a twelfth of its square along itself
    scatter = np.einsum("k,ki,kj->ij", weights, spans, spans) / 12
    scatter += np.einsum("k,ki,kj->ij", weights, away, away)
    flat = np.linalg.eigh(scatter)[1][:, 0]
    return flat * (1 if flat @ best.normal[:2] > 0 else -1), foot


def _joint_profile(
    strips: list[_Strip],
    start: NDArray[np.float64],
    along: NDArray[np.float64],
    length: float,
    bin_m: float,
) -> NDArray[np.uint8]:
    profile = np.zeros(max(1, int(np.ceil(length / bin_m))), np.uint8)
    for strip in strips:
        step = (strip.line[1] - strip.line[0]) / max(_length(strip.line), 1e-9)
        centres = strip.line[0] + ((np.arange(len(strip.profile)) + 0.5) * bin_m)[:, None] * step
        at = ((centres - start) @ along / bin_m).astype(int)
        inside = (at >= 0) & (at < len(profile))
        np.maximum.at(profile, at[inside], strip.profile[inside])
    return profile
