"""Plane labelling (Sec. 4.1): floor, ceiling, and the faces of the walls."""

import numpy as np
from numpy.typing import NDArray

from storage.coverage import Coverage
from storage.faces import Faces
from storage.segments import Segments
from tasks.surfaces.label_params import LabelParams
from tasks.surfaces.levels import Levels, find_levels, role_of
from tasks.surfaces.merging import merge_strips
from tasks.surfaces.seen import Seen
from tasks.surfaces.strips import candidates, turn_two_faced


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
    seen = Seen(coverage)
    strips = [candidates(scan, levels, seen, i, params) for i, scan in enumerate(scans)]
    every = turn_two_faced([s for strip in strips for s in strip])
    return merge_strips(every, seen.either, params), coverage


def _coverage(scans: list[Segments], levels: Levels, params: LabelParams) -> Coverage:
    """Rasterise what all scans saw, the lowest floor and the highest ceiling of each cell."""
    cell = scans[0].cell_m if scans else 0.1
    rows: list[NDArray[np.float64]] = [np.empty((0, 5))]
    for number, scan in enumerate(scans):
        for i in scan.of_kind("horizontal"):
            height = scan.heights[i].mean()
            role = role_of(height, levels, params)
            if role is None:
                continue
            raster = scan.rasters[i]
            at = np.argwhere(raster.cells) + np.rint(np.array(raster.start) / cell).astype(int)
            row = np.full((len(at), 5), np.nan)
            row[:, :2], row[:, 4] = at, number
            if role != "within":  # a table's top says that there is a room, not how high it is
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
