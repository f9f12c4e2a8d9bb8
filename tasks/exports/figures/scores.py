"""Fig. 18b: how much of what is there was found, and how much of what was found is there."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tasks.exports.figures.areas import GOLDEN
from tasks.exports.figures.canvas import (
    BLUE,
    GRID,
    INK,
    MUTED,
    SMALL_PT,
    TEXT_PT,
    VERMILLION,
    Picture,
    add_axes,
    name_axis,
    new_figure,
    note,
    picture,
    shortened,
    width_in,
    write,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LANE_IN, GAP_IN, HEAD_IN = 0.2, 0.1, 0.34
"""Height of recall or precision of one row, between rows, and of a class's name."""
LEFT_IN, RIGHT_IN = 1.1, 1.12


@dataclass(frozen=True, eq=False)
class Scores:
    """What one variant found of one class; entry i is one plan in every array."""

    class_: str
    """what was looked for, as people say it: walls, doors, ..."""
    criterion: str
    """when it counts as found"""
    variant: str
    recalls: NDArray[np.float64]
    """(n,), share of the true that was found; NaN if there is none"""
    precisions: NDArray[np.float64]
    """(n,), share of the found that is true; NaN if nothing was found"""


def draw_scores(name: str, rows: Sequence[Scores], told: str) -> Picture:
    """Draw recall and precision beneath each other, a point per plan and a tick at the mean.

    Parameters
    ----------
    told : written into the corner: whether it is simulated, how many seeds
    """
    places, high, last = [], 0.0, None
    for row in rows:
        high += HEAD_IN if row.class_ != last else GAP_IN
        places.append(high)
        high, last = high + 2 * LANE_IN, row.class_
    figure = new_figure(high + 0.8)
    axes = add_axes(figure, LEFT_IN, 0.5, RIGHT_IN, 0.25)
    note(figure, told)
    axes.set(ylim=(high + 0.05, 0), xlim=(-0.015, 1.015))
    axes.set_yticks([])
    axes.set_xticks(np.linspace(0, 1, 5), ["0", "25", "50", "75", "100 %"])
    axes.grid(axis="x", color=GRID, linewidth=0.6)
    last = None
    for row, y in zip(rows, places, strict=True):
        if row.class_ != last:
            _name_class(axes, row, y - HEAD_IN / 2 + 0.03)
        last = row.class_
        _beside(axes, y + LANE_IN, shortened(row.variant, 14), 0.08)
        _draw_lane(axes, row.recalls, y + LANE_IN / 2, BLUE, "recall")
        _draw_lane(axes, row.precisions, y + 1.5 * LANE_IN, VERMILLION, "precision")
    name_axis(axes, "x", "recall (upper) and precision (lower)")
    return picture(figure, name, _described(rows))


def _name_class(axes: "Axes", row: Scores, y: float) -> None:
    """Write what was looked for, and when it counts as found."""
    _beside(axes, y, row.class_, 0.08, fontsize=TEXT_PT, fontweight="bold")
    style: dict[str, Any] = {"color": MUTED, "fontsize": SMALL_PT - 1}
    _beside(axes, y, shortened(row.criterion, 40), LEFT_IN, **style)


def _beside(axes: "Axes", y: float, text: str, left_in: float, **style: Any) -> None:
    """Write at a distance from the figure's left edge."""
    left = (left_in - LEFT_IN) / width_in(axes)
    write(axes, left, y, text, transform=axes.get_yaxis_transform(), **style)


def _draw_lane(axes: "Axes", values: NDArray[np.float64], y: float, colour: str, what: str) -> None:
    known = np.sort(values[~np.isnan(values)])
    right: dict[str, Any] = {"transform": axes.get_yaxis_transform(), "fontsize": SMALL_PT - 0.5}
    beside = 1 + 0.08 / width_in(axes)
    if not len(known):
        nothing = "none found" if what == "precision" else "none there"
        write(axes, beside, y, nothing, color=MUTED, **right)
        return
    axes.plot([0, 1], [y, y], color=GRID, linewidth=0.6, zorder=1)
    shift = (np.arange(len(known)) * GOLDEN % 1 - 0.5) * LANE_IN * 0.5 * (len(known) > 1)
    axes.scatter(known, y + shift, s=15, color=colour, alpha=0.6, linewidths=0, zorder=3)
    mean, half = known.mean(), LANE_IN * 0.42
    axes.plot([mean, mean], [y - half, y + half], color=INK, linewidth=1.6, zorder=4)
    write(axes, beside, y, f"{what} {100 * mean:.1f} %", **right)


def _described(rows: Sequence[Scores]) -> str:
    def percent(values: NDArray[np.float64]) -> str:
        known = values[~np.isnan(values)]
        return f"{100 * known.mean():.1f} %" if len(known) else "not defined"

    parts = [
        f"{row.class_}, {row.variant}: recall {percent(row.recalls)}, "
        f"precision {percent(row.precisions)}"
        for row in rows
    ]
    return "Recall and precision per class, means: " + "; ".join(parts) + "."
