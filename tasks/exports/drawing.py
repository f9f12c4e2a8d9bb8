"""The plan as a drawing a person likes to look at: SVG and PNG, the same bytes each time."""

from pathlib import Path

import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from storage.plan import Plan
from tasks.exports.coverage import Coverage, seen_area, unseen_area
from tasks.exports.labels import LINE_SPACING, Label, place_label
from tasks.exports.margins import draw_footer, draw_title
from tasks.exports.openings import door_lines, window_lines
from tasks.exports.poche import assumed_walls, known_walls, opening_area
from tasks.exports.sheet import FONT, Sheet, new_sheet, save, text_width
from tasks.exports.style import (
    AREA_INK,
    ASSUMED,
    INK,
    LAYERS,
    MUTED,
    POCHE,
    SEEN,
    SEEN_ONCE,
    UNSEEN,
    room_tints,
)


def draw_plan(
    plan: Plan, coverage: Coverage | None, path_svg: Path | str, path_png: Path | str
) -> None:
    """Draw a storey to an SVG and a PNG file; the same plan gives the same bytes.

    Parameters
    ----------
    coverage : where the scans looked, drawn beneath the furniture; None if not known
    path_svg, path_png : files to write

    Raises
    ------
    StoreError
        If a file cannot be written.
    """
    sheet = new_sheet(bounds(plan, coverage))
    draw_storey(sheet, plan, coverage)
    _draw_labels(sheet, plan)
    draw_title(sheet, plan)
    draw_footer(sheet, plan, covered=coverage is not None and len(coverage.scans) > 0)
    save(sheet, path_svg)
    save(sheet, path_png)


def draw_storey(sheet: Sheet, plan: Plan, coverage: Coverage | None) -> None:
    """Draw rooms, walls, openings and furniture, without a word."""
    _draw_rooms(sheet, plan)
    if coverage is not None:
        _draw_coverage(sheet, plan, coverage)
    _draw_walls(sheet, plan)
    _draw_openings(sheet, plan)
    _draw_furniture(sheet, plan)


def bounds(plan: Plan, coverage: Coverage | None) -> tuple[float, float, float, float]:
    """Return low x, y and high x, y of what is drawn, metres."""
    areas = [room.polygon for room in plan.rooms]
    areas += [wall.line.buffer((wall.thickness_m or 0) / 2) for wall in plan.walls]
    areas += [piece.footprint for piece in plan.furniture]
    areas += [opening.line for opening in (*plan.doors, *plan.windows)]
    if not areas and coverage is not None and len(coverage.scans):
        areas = [seen_area(coverage, 1)]
    return shapely.union_all(areas).bounds if areas else (0.0, 0.0, 10.0, 5.0)


def _draw_coverage(sheet: Sheet, plan: Plan, coverage: Coverage) -> None:
    """Hatch the floor that no scan saw, darken what several saw; show all of it without rooms."""
    if not plan.rooms:
        sheet.fill(seen_area(coverage, 1), SEEN_ONCE, LAYERS["coverage"])
    floor = shapely.union_all([room.polygon for room in plan.rooms])
    for least, darker in SEEN:
        area = seen_area(coverage, least)
        area = area.intersection(floor) if plan.rooms else area
        sheet.fill(area, "black", LAYERS["coverage"], alpha=darker)
    sheet.hatch(unseen_area(coverage, floor), UNSEEN, LAYERS["coverage"])


def _draw_rooms(sheet: Sheet, plan: Plan) -> None:
    tints = room_tints({room.class_ for room in plan.rooms})
    for room in plan.rooms:
        sheet.fill(room.polygon, tints[room.class_], LAYERS["rooms"])
        sheet.fill(room.polygon, "none", LAYERS["outlines"], edgecolor="#8f8f95", linewidth=0.5)


def _draw_walls(sheet: Sheet, plan: Plan) -> None:
    sheet.fill(assumed_walls(plan), ASSUMED, LAYERS["walls"])
    sheet.fill(known_walls(plan), POCHE, LAYERS["walls"], edgecolor=INK, linewidth=0.6)


def _draw_openings(sheet: Sheet, plan: Plan) -> None:
    for opening in (*plan.doors, *plan.windows):
        sheet.fill(opening_area(plan, opening), "white", LAYERS["walls"])
    for window in plan.windows:
        for line in window_lines(plan, window):
            sheet.stroke(line, INK, 0.6, LAYERS["openings"])
    for door in plan.doors:
        lines = door_lines(plan, door)
        dashes = "-" if lines.certain else "--"
        sheet.stroke(lines.leaf, INK, 1.4, LAYERS["openings"])
        sheet.stroke(lines.swing, MUTED, 0.6, LAYERS["openings"], dashes)


def _draw_furniture(sheet: Sheet, plan: Plan) -> None:
    for piece in plan.furniture:
        style = {"edgecolor": "#8a8a90", "linewidth": 0.7, "joinstyle": "round"}
        sheet.fill(piece.footprint, "#ffffffb0", LAYERS["furniture"], **style)
        if piece.class_ == "other":  # a cupboard's diagonal
            corners = shapely.get_coordinates(shapely.oriented_envelope(piece.footprint))
            sheet.stroke(corners[[0, 2]], "#b0b0b5", 0.5, LAYERS["furniture"])


def _draw_labels(sheet: Sheet, plan: Plan) -> None:
    obstacles = _obstacles(plan)
    for room in plan.rooms:
        label = place_label(room, obstacles, sheet.scale_in_per_m * 72, text_width)
        if label is not None:
            _draw_label(sheet, label)


def _draw_label(sheet: Sheet, label: Label) -> None:
    from matplotlib.patheffects import withStroke

    pitch = LINE_SPACING * label.size_pt / 72 / sheet.scale_in_per_m
    for i, line in enumerate(label.lines):
        below = (i - (len(label.lines) - 1) / 2) * pitch
        x, y = (below, 0.0) if label.upright else (0.0, -below)
        sheet.axes.text(
            label.x_m + x,
            label.y_m + y,
            line,
            fontsize=label.size_pt,
            fontfamily=FONT,
            color=AREA_INK if line.endswith("m²") else INK,
            ha="center",
            va="center_baseline",
            rotation=90 if label.upright else 0,
            parse_math=False,
            zorder=LAYERS["labels"],
            path_effects=[withStroke(linewidth=2.0, foreground="#ffffffc0")],
        )


def _obstacles(plan: Plan) -> BaseGeometry:
    """Return what labels keep clear of: furniture, and the floor under door leaves."""
    swings = [door_lines(plan, door) for door in plan.doors]
    sectors = [Polygon([*s.leaf, *s.swing]).convex_hull for s in swings if len(s.swing)]
    return shapely.union_all([*(piece.footprint for piece in plan.furniture), *sectors])
