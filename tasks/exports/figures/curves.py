"""Precision against recall over the thresholds of each metric."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tasks.exports.figures.canvas import (
    GRID,
    MUTED,
    PAPER,
    SMALL_PT,
    TEXT_PT,
    WIDTH_IN,
    Picture,
    add_axes,
    colours,
    new_figure,
    note,
    picture,
    shortened,
    write,
)
from tasks.exports.figures.intervals import mean_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLUMNS = 2
PANEL_IN, HEAD_IN, FOOT_IN = 1.7, 0.55, 0.5
LEFT_IN, RIGHT_IN, APART_IN = 0.55, 0.12, 0.2
KEY_IN = 0.25
"""Height of the line that names the variants."""


@dataclass(frozen=True, eq=False)
class Operating:
    """What one variant reaches at one threshold; entry i is one seed in both arrays."""

    panel: str
    """class and metric: one panel each"""
    variant: str
    threshold: float
    recalls: NDArray[np.float64]
    """(n,), NaN if nothing is there"""
    precisions: NDArray[np.float64]
    """(n,), NaN if nothing was found"""


def draw_precision_recall(name: str, points: Sequence[Operating], told: str) -> Picture:
    """Draw a panel per class and metric: a line per variant over its thresholds, 95 % intervals.

    Parameters
    ----------
    told : written into the corner: whether it is simulated, how many seeds
    """
    panels = list(dict.fromkeys(point.panel for point in points))
    colour = colours([point.variant for point in points])
    rows = -(-len(panels) // COLUMNS)
    high = KEY_IN + rows * (PANEL_IN + HEAD_IN) + FOOT_IN
    figure = new_figure(high)
    width = figure.get_size_inches()[0]
    wide = (width - LEFT_IN - RIGHT_IN - (COLUMNS - 1) * APART_IN) / COLUMNS
    parts = []
    note(figure, told)
    for i, panel in enumerate(panels):
        row, column = divmod(i, COLUMNS)
        left = LEFT_IN + column * (wide + APART_IN)
        top = KEY_IN + row * (PANEL_IN + HEAD_IN) + HEAD_IN
        axes = add_axes(figure, left, high - top - PANEL_IN, width - left - wide, top)
        _prepare(axes, panel, i + COLUMNS >= len(panels), column == 0)
        here = [point for point in points if point.panel == panel]
        labelled: list[tuple[float, float]] = []
        for variant in dict.fromkeys(point.variant for point in here):
            line = [point for point in here if point.variant == variant]
            size = max(7.0 - 1.6 * list(colour).index(variant), 3.0)
            parts.append(_draw_line(axes, line, colour[variant], size, labelled))
    _name_axes(figure, high)
    if len(colour) > 1:
        _draw_key(figure, colour, high)
    return picture(figure, name, "Precision and recall. " + "; ".join(parts) + ".")


def _prepare(axes: "Axes", panel: str, lowest: bool, leftmost: bool) -> None:
    ticks = [0, 0.5, 1]
    axes.set(xlim=(-0.03, 1.04), ylim=(-0.03, 1.04), xticks=ticks, yticks=ticks)
    axes.set_xticklabels(["0", "50 %", "100 %"] if lowest else ["", "", ""])
    axes.set_yticklabels(["0", "50 %", "100 %"] if leftmost else ["", "", ""])
    axes.grid(color=GRID, linewidth=0.6)
    title: dict[str, Any] = {"transform": axes.transAxes, "fontweight": "bold", "va": "bottom"}
    class_, _, metric = panel.partition("\n")
    write(axes, 0, 1.12, class_, fontsize=TEXT_PT, **title)
    muted: dict[str, Any] = {"color": MUTED, "fontweight": "normal", "fontsize": SMALL_PT - 0.5}
    write(axes, 0, 1.03, metric, **(title | muted))


def _draw_line(
    axes: "Axes",
    line: Sequence[Operating],
    colour: str,
    size: float,
    labelled: list[tuple[float, float]],
) -> str:
    """Draw what a variant reaches; return it in words.

    Points of one place are rings within each other: the later the variant, the smaller.
    """
    known = [point for point in line if _defined(point)]
    told = []
    for point in known:
        recall, precision = mean_of(point.recalls), mean_of(point.precisions)
        x, y = recall.value, precision.value
        whisker: dict[str, Any] = {"color": colour, "linewidth": 0.8, "zorder": 2}
        axes.plot([recall.low, recall.high], [y, y], **whisker)
        axes.plot([x, x], [precision.low, precision.high], **whisker)
        told.append(f"{point.threshold:g}: recall {100 * x:.0f} %, precision {100 * y:.0f} %")
    xs = [mean_of(point.recalls).value for point in known]
    ys = [mean_of(point.precisions).value for point in known]
    axes.plot(xs, ys, color=colour, linewidth=1.2, marker="o", markersize=size, zorder=3)
    _label(axes, known, xs, ys, labelled)
    what = line[0].panel.replace("\n", ", ") + f", {line[0].variant}"
    return f"{what}: " + (", ".join(told) or "nothing found")


def _label(
    axes: "Axes",
    known: Sequence[Operating],
    x: list[float],
    y: list[float],
    taken: list[tuple[float, float]],
) -> None:
    """Write thresholds beside their points, on the inner side, none over another."""
    from matplotlib.patheffects import withStroke

    halo = [withStroke(linewidth=1.8, foreground=PAPER)]
    for i, point in enumerate(known):
        if any(abs(x[i] - a) < 0.14 and abs(y[i] - b) < 0.09 for a, b in taken):
            continue
        taken.append((x[i], y[i]))
        # beside the line, which mostly rises to the right, and within the panel
        side, up = ("right", 0.06) if x[i] > 0.5 else ("left", -0.06)
        up = -0.08 if y[i] > 0.93 else 0.09 if y[i] < 0.08 else up
        at = (x[i] - 0.04 if side == "right" else x[i] + 0.03, y[i] + up)
        style: dict[str, Any] = {"ha": side, "color": MUTED}
        write(axes, *at, f"{point.threshold:g}", fontsize=SMALL_PT - 1, path_effects=halo, **style)


def _defined(point: Operating) -> bool:
    return not (np.isnan(point.recalls).all() or np.isnan(point.precisions).all())


def _name_axes(figure: "Figure", high: float) -> None:
    place, axes = figure.transFigure, figure.axes[-1]
    middle: dict[str, Any] = {"ha": "center", "fontsize": TEXT_PT, "transform": place}
    write(axes, 0.5, 0.12 / high, "recall", **middle)
    write(axes, 0.1 / WIDTH_IN, 0.5, "precision", rotation=90, **middle)


def _draw_key(figure: "Figure", colour: dict[str, str], high: float) -> None:
    """Name the variants beside their colours."""
    from matplotlib.lines import Line2D

    axes, x = figure.axes[-1], LEFT_IN
    width = figure.get_size_inches()[0]
    y = 1 - 0.3 / high
    for name, each in colour.items():
        text = shortened(name, 18)
        dot = Line2D([x / width], [y], color=each, marker="o", markersize=5, linestyle="")
        dot.set_transform(figure.transFigure)
        figure.add_artist(dot)
        write(axes, (x + 0.08) / width, y, text, transform=figure.transFigure)
        x += 0.35 + 0.068 * len(text)
