"""Fig. 15: the plans of one storey beside each other, at one scale."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from storage.plan import Plan
from tasks.exports.drawing import bounds, draw_storey
from tasks.exports.figures.canvas import (
    MUTED,
    TEXT_PT,
    VERMILLION,
    WIDTH_IN,
    Picture,
    add_axes,
    new_figure,
    note,
    picture,
    write,
)
from tasks.exports.sheet import Sheet
from tasks.exports.style import INK

BAR_M = (20, 10, 5, 2, 1)
"""Lengths a scale bar may have."""
HIGH_MAX_IN, MARGIN_IN, HEAD_IN, FOOT_IN = 4.6, 0.12, 0.62, 0.3


@dataclass(frozen=True, eq=False)
class Panel:
    """One plan, and what it is."""

    title: str
    plan: Plan


def draw_plans(name: str, panels: Sequence[Panel], truth: Plan | None) -> list[Picture]:
    """Draw each plan, and all of them beside each other.

    Parameters
    ----------
    panels : the plans to draw, the truth too if it is to be seen
    truth : outlined over every other plan; None if there is none

    Returns
    -------
    list of Picture
        One of all panels, then one of each.
    """
    boxes = [bounds(panel.plan, None) for panel in panels]
    low, high = np.min(boxes, axis=0)[:2], np.max(boxes, axis=0)[2:]
    frame = (*low, *high)
    whole = _drawn(name, panels, truth, frame)
    return [whole, *(_drawn(f"{name}_{i}", [p], truth, frame) for i, p in enumerate(panels, 1))]


def _drawn(
    name: str,
    panels: Sequence[Panel],
    truth: Plan | None,
    frame: tuple[float, float, float, float],
) -> Picture:
    """Draw panels in a row, all showing the same frame."""
    size = np.maximum(np.subtract(frame[2:], frame[:2]), 0.5)
    inside = WIDTH_IN - 2 * MARGIN_IN
    scale = float(min(inside / size[0], HIGH_MAX_IN / size[1]))
    high_in = scale * size[1] + 2 * 0.05
    total = high_in + HEAD_IN + FOOT_IN
    figure = new_figure(total, WIDTH_IN * len(panels))
    for i, panel in enumerate(panels):
        left, right = i * WIDTH_IN, (len(panels) - 1 - i) * WIDTH_IN
        axes = add_axes(figure, left, FOOT_IN, right, HEAD_IN)
        axes.set_axis_off()
        half = np.array((WIDTH_IN, high_in)) / scale / 2
        middle = np.add(frame[:2], frame[2:]) / 2
        (x0, y0), (x1, y1) = middle - half, middle + half
        axes.set(xlim=(x0, x1), ylim=(y0, y1))
        sheet = Sheet(figure, axes, total, scale)
        draw_storey(sheet, panel.plan, None)
        if truth is not None and truth is not panel.plan:
            for room in truth.rooms:
                sheet.stroke(shapely.get_coordinates(room.polygon.exterior), VERMILLION, 0.45, 7.0)
        above, below = y1 + 0.32 / scale, y0 - 0.13 / scale
        edge = x0 + MARGIN_IN / scale
        write(axes, edge, above, panel.title, fontsize=TEXT_PT + 1, fontweight="bold")
        write(axes, edge, above - 0.19 / scale, _counts(panel.plan), color=MUTED)
        _draw_bar(sheet, edge, below)
    told = "Floor plans"
    if any(panel.plan.simulated for panel in panels) or (truth is not None and truth.simulated):
        note(figure, "simulated data")
        told = "Floor plans, simulated data"
    alt = "; ".join(f"{panel.title}: {_counts(panel.plan)}" for panel in panels)
    return picture(figure, name, f"{told}. {alt}.", themed=False)


def _draw_bar(sheet: Sheet, x: float, y: float) -> None:
    """Draw a scale bar and say how long it is."""
    long = next((m for m in BAR_M if m * sheet.scale_in_per_m < 1.4), BAR_M[-1])
    sheet.axes.plot([x, x + long], [y, y], color=INK, linewidth=1.6, clip_on=False)
    write(sheet.axes, x + long + 0.07 / sheet.scale_in_per_m, y, f"{long} m", clip_on=False)


def _counts(plan: Plan) -> str:
    """Return what a plan holds, in words; what it lacks is said."""
    rooms, area = len(plan.rooms), sum(room.polygon.area for room in plan.rooms)
    doors, pieces = len(plan.doors), len(plan.furniture)
    told = [f"{rooms} rooms, {area:,.0f} m²" if rooms else "no rooms"]
    told += [f"{doors} doors" if doors else "no doors", f"{pieces} furniture"]
    return ", ".join(told if pieces else [*told[:-1], "no furniture"])
