"""What tells tables, chairs and other furniture apart: the paper's features and cues besides."""

import numpy as np
import shapely
from numpy.typing import NDArray

from tasks.furniture.areas import level_plane, plane_distance, triangulated_area
from tasks.furniture.boxes import Box
from tasks.furniture.candidates import Candidate
from tasks.furniture.chairs import TABLE_M
from tasks.furniture.scene import Scene

FEATURES = (
    "area_m2",
    "distance_m",
    "width_m",
    "depth_m",
    "aspect",
    "top_m",
    "box_width_m",
    "box_depth_m",
    "rectangularity",
    "fill",
    "thickness_m",
    "wall_m",
    "wall_share",
    "back_share",
    "back_rise_m",
    "below",
    "rim_below",
    "floor_share",
    "above",
    "siblings",
    "found_by",
    "table_near_m",
    "higher_share",
    "panel_width_m",
    "panel_thickness_m",
    "panel_share",
    "seat_cells",
    "table_share",
    "panel_below",
    "closed_below",
    "level_around",
)
"""In the order of the columns: the five of Sec. 6 (the area by triangles, the distance to the floor
of Eq. 12, width and depth of what was seen, their ratio), then cues of its surroundings."""
HULL_RATIO = 0.25
"""How closely a concave hull follows its points: 0 closest, 1 convex. Assumption."""
APART_M = 0.3
"""How far apart along x or y the middles of a candidate and another table are, metres."""
LEVEL_M, AROUND_M = 0.04, 0.16
"""How far heights of one level may differ, and how far around a box it is looked for, metres."""
RIM_M = 0.06
"""Width of the rim in which fronts, panels and legs stand, metres."""


def concave_hull(xy: NDArray[np.float64], cell: float) -> shapely.Polygon:
    """Return the concave hull of columns by their middles, grown by half a column."""
    hull = shapely.concave_hull(shapely.MultiPoint(xy), HULL_RATIO)
    grown = shapely.buffer(hull, cell / 2, join_style="mitre", cap_style="square")
    return shapely.Polygon(grown.exterior)


def features_of(
    scene: Scene, candidate: Candidate, tables: list[Box], outlines: NDArray[np.object_]
) -> tuple[shapely.Polygon, NDArray[np.float64]]:
    """Return the hull of a candidate's surface and its features, NaN where one is unknown.

    Parameters
    ----------
    tables : list of Box
        What in the room lies at the height of tables, the candidate itself included.
    outlines : (k,) of shapely polygons
        The same boxes.
    """
    box, cell = candidate.box, scene.columns.cell_m
    seen_box = candidate.seen_box or box
    places = scene.where[candidate.seen]
    hull, area, distance, thickness = box.polygon, np.nan, np.nan, np.nan
    if len(places) >= 3:
        xy, heights = scene.xy[places], scene.heights[candidate.seen]
        hull = concave_hull(xy, cell)
        area = triangulated_area(shapely.get_coordinates(hull.exterior)[:-1])
        # tilts of a few noisy columns mean nothing: the distance below the patch's middle
        points = np.column_stack((xy, heights))
        normal, offset = level_plane(points)
        distance = plane_distance(normal, offset, np.array((*xy.mean(axis=0), 0.0)))
        thickness = float(np.std(heights))
    width, depth = max(seen_box.length, seen_box.depth), min(seen_box.length, seen_box.depth)
    inside = scene.within(box)
    rim = inside[
        ~Box(
            box.centre,
            box.axis,
            max(box.length - 2 * RIM_M, 0.01),
            max(box.depth - 2 * RIM_M, 0.01),
        ).holds(scene.xy[inside])
    ]
    cells = max(len(inside), 1)
    centres = np.array([table.centre for table in tables]).reshape(-1, 2)
    others = (np.abs(centres - box.centre) > APART_M).any(axis=1)
    nearest = shapely.distance(outlines[others], box.polygon)
    row = (
        area,
        distance,
        width,
        depth,
        width / max(depth, cell),
        candidate.top,
        max(box.length, box.depth),
        min(box.length, box.depth),
        area / max(hull_box_area(hull), 1e-6),
        len(np.unique(places)) / cells,
        thickness,
        float(scene.from_wall[inside].min()) if len(inside) else np.nan,
        max(box.area / cell**2 - len(inside), 0.0) * cell**2 / box.area,
        *_back(scene, candidate, inside),
        scene.filled(inside, 0.08, candidate.height - 0.08),
        scene.filled(rim, 0.08, candidate.height - 0.08),
        float(scene.floor_seen[inside].mean()) if len(inside) else np.nan,
        scene.filled(inside, candidate.height + 0.1, candidate.height + 0.5),
        float(candidate.siblings),
        float(candidate.found_by),
        float(nearest.min()) if len(nearest) else np.nan,
        _higher(scene, box, inside, candidate.height),
        *candidate.panel,
        float(len(places)),
        len(scene.surfaces_in(box, *TABLE_M)) / cells,
        _under_panel(scene, inside),
        scene.closed(box, 0.12, candidate.height - 0.08),
        _level_around(scene, box, cells, candidate.height),
    )
    return hull, np.array(row)


def hull_box_area(hull: shapely.Polygon) -> float:
    """Return the area of the smallest box around a hull, square metres."""
    return float(shapely.minimum_rotated_rectangle(hull).area)


def _back(scene: Scene, candidate: Candidate, inside: NDArray[np.int64]) -> tuple[float, float]:
    """Return which share of the columns shows a panel that rises over the surface, and how high."""
    if not len(inside):
        return 0.0, np.nan
    tops = scene.panels[inside]
    with np.errstate(invalid="ignore"):
        rising = tops > candidate.height + 0.15
    if not rising.any():
        return 0.0, 0.0
    return float(rising.mean()), float(np.median(tops[rising]) - candidate.height)


def _under_panel(scene: Scene, inside: NDArray[np.int64]) -> float:
    """Return the share of slices under the panels that hold points: a cabinet's front goes down
    to the floor, a chair's back has legs under it at most."""
    return scene.filled(inside[~np.isnan(scene.panels[inside])], 0.05, 0.35)


def _higher(scene: Scene, box: Box, inside: NDArray[np.int64], height: float) -> float:
    """Return the share of the columns that show a surface well above the candidate's."""
    if not len(inside):
        return np.nan
    over = scene.surfaces_in(box, height + 0.08, np.inf)
    return len(np.unique(scene.where[over])) / len(inside)


def _level_around(scene: Scene, box: Box, cells: int, height: float) -> float:
    """Return how much of the same level goes on around a box, as a share of the box.

    A chair's seat ends at its edges; part of a bed or of a low table goes on.
    """
    near = scene.surfaces_in(box, height - LEVEL_M, height + LEVEL_M, AROUND_M)
    outside = ~box.holds(scene.xy[scene.where[near]], 0.02)
    return float(outside.sum()) / cells
