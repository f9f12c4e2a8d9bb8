"""Wall segments of all scans become wall faces (Sec. 4.1, Fig. 3 line 12, Fig. 4)."""

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from storage.faces import Faces
from tasks.surfaces.label_params import LabelParams
from tasks.surfaces.seen import CellSet
from tasks.surfaces.strips import Strip, away_from, length_of, side_of

SAME_FACE = 0.06
"""Segments of one face off its strongest one by less than this settle where it lies, metres; what
stands further before a wall is furniture."""
MINOR = 0.25
"""Share of a face's area below which a parallel strip beside it is no face of its own."""


def merge_strips(strips: list[Strip], seen: CellSet, params: LabelParams) -> Faces:
    """Merge the strips of one wall into one face (Fig. 3 line 12, Fig. 4)."""
    bin_m = seen.cell
    faces = [_face(group, bin_m, seen) for group in _one_wall(strips, params)]
    faces.sort(key=lambda f: (-f.weight, *f.line.ravel()))
    return Faces(
        normals=np.array([f.normal for f in faces]).reshape(-1, 3),
        offsets=np.array([f.offset for f in faces], float),
        sides=np.array([f.side for f in faces], np.int8),
        lines=np.array([f.line for f in faces]).reshape(-1, 2, 2),
        heights=np.array([f.heights for f in faces]).reshape(-1, 2),
        weights=np.array([f.weight for f in faces], float),
        scans=np.array([f.scans for f in faces], np.int64),
        profiles=tuple(f.profile for f in faces),
        bin_m=bin_m,
    )


def _one_wall(strips: list[Strip], params: LabelParams) -> list[list[Strip]]:
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


def _same_wall(face: Strip, strip: Strip, params: LabelParams) -> bool:
    if np.linalg.norm(np.cross(face.normal, strip.normal)) > params.eps_norm:
        return False
    away = float(np.abs(away_from(strip.line, face)).max())
    if face.side and strip.side and face.normal @ strip.normal < 0:
        return False
    if away <= SAME_FACE:
        return True
    # a strip further off is something standing before the wall, unless it is as large as one
    return away <= params.eps_wall and strip.area < MINOR * face.area


@dataclass(frozen=True, eq=False)
class _Face:
    """One row of `Faces`."""

    normal: NDArray[np.float64]
    offset: float
    side: int
    line: NDArray[np.float64]
    heights: NDArray[np.float64]
    weight: float
    scans: int
    profile: NDArray[np.uint8]


def _face(members: list[Strip], bin_m: float, seen: CellSet) -> _Face:
    """Average the strips of one face into one line, and lay their profiles together."""
    best = members[0]
    near = [s for s in members if np.abs(away_from(s.line, best)).max() <= SAME_FACE]
    areas = np.array([s.area for s in near])
    normals = np.array([s.normal * np.sign(s.normal @ best.normal) for s in near])
    flat, foot = _fit_line(np.array([s.line for s in near]), areas, best)
    tilt = float(np.average(normals[:, 2], weights=areas))
    normal = np.append(flat * np.sqrt(1 - tilt**2), tilt)
    height = float(np.average([s.heights.mean() for s in near], weights=areas))
    along = np.array([-flat[1], flat[0]])
    ends = np.array([(s.line - foot) @ along for s in near])
    line = foot + np.array([ends.min(), ends.max()])[:, None] * along
    side = 1 if any(s.side for s in near) else side_of(line, flat, seen)
    if side < 0:
        normal, line, side = -normal, line[::-1], 1
    along = (line[1] - line[0]) / max(length_of(line), 1e-9)
    return _Face(
        normal=normal,
        offset=float(normal @ np.append(foot, height)),
        side=side,
        line=line,
        heights=np.array([min(s.heights[0] for s in near), max(s.heights[1] for s in near)]),
        weight=float(areas.sum()),
        scans=len({s.scan for s in near}),
        profile=_joint_profile(near, line[0], along, length_of(line), bin_m),
    )


def _fit_line(
    lines: NDArray[np.float64], weights: NDArray[np.float64], best: Strip
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
    strips: list[Strip],
    start: NDArray[np.float64],
    along: NDArray[np.float64],
    length: float,
    bin_m: float,
) -> NDArray[np.uint8]:
    profile = np.zeros(max(1, int(np.ceil(length / bin_m))), np.uint8)
    for strip in strips:
        step = (strip.line[1] - strip.line[0]) / max(length_of(strip.line), 1e-9)
        centres = strip.line[0] + ((np.arange(len(strip.profile)) + 0.5) * bin_m)[:, None] * step
        at = ((centres - start) @ along / bin_m).astype(int)
        inside = (at >= 0) & (at < len(profile))
        np.maximum.at(profile, at[inside], strip.profile[inside])
    return profile
