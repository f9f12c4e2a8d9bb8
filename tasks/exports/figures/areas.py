"""Fig. 18a: how far the areas of mapped rooms are from the true ones."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tasks.exports.figures.canvas import (
    GRID,
    INK,
    MUTED,
    SMALL_PT,
    TEXT_PT,
    Picture,
    add_axes,
    colours,
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

ROW_IN, HEAD_IN = 0.46, 0.3
"""Height of one distribution, and of a storey's name above its own."""
SPREAD_IN = 0.26
"""Height points are spread over: equal errors are not drawn over each other."""
BOX_IN = 0.2
GOLDEN = 0.618034
"""Multiples of it, less their whole part, are spread evenly: the same each time, no draw needed."""


@dataclass(frozen=True, eq=False)
class AreaErrors:
    """The rooms of one storey as one variant mapped them."""

    storey: str
    variant: str
    errors_m2: NDArray[np.float64]
    """(n,), |true - found| area of each room found (Sec. 7.3), over all seeds"""
    missed: int
    """true rooms of which nothing was found, over all seeds"""
    seeds: int
    """plans compared"""


def draw_area_errors(name: str, groups: Sequence[AreaErrors], told: str) -> Picture:
    """Draw a box plot with its points per storey and variant.

    Parameters
    ----------
    groups : in the order they are drawn; those of one storey are neighbours
    told : written into the corner: whether it is simulated, how many seeds
    """
    colour = colours([group.variant for group in groups])
    places, high, last = [], 0.0, None
    for group in groups:
        high += HEAD_IN if group.storey != last else 0.0
        places.append(high + ROW_IN / 2)
        high, last = high + ROW_IN, group.storey
    figure = new_figure(high + 0.7)
    axes = add_axes(figure, 1.15, 0.5, 0.2, 0.2)
    note(figure, told)
    worst = max((group.errors_m2.max(initial=0.0) for group in groups), default=0.0)
    axes.set(ylim=(high, 0), xlim=(-0.01 * worst, worst * 1.04 or 1.0))
    axes.set_yticks([])
    axes.grid(axis="x", color=GRID, linewidth=0.6)
    name_axis(axes, "x", "error of a room's area, m²")
    last = None
    for group, y in zip(groups, places, strict=True):
        if group.storey != last:
            above: dict[str, Any] = {"fontsize": TEXT_PT, "fontweight": "bold"}
            _beside(axes, y - ROW_IN / 2 - HEAD_IN / 2 + 0.05, group.storey, -1.05, **above)
        _name_group(axes, group, y)
        _draw_group(axes, group, y, colour[group.variant])
        last = group.storey
    return picture(figure, name, _described(groups))


def _beside(axes: "Axes", y: float, text: str, left_in: float, **style: Any) -> None:
    """Write left of the axes."""
    style = {"transform": axes.get_yaxis_transform()} | style
    write(axes, left_in / width_in(axes), y, shortened(text, 44), **style)


def _name_group(axes: "Axes", group: AreaErrors, y: float) -> None:
    n = len(group.errors_m2) + group.missed
    count = f"{n} rooms" if group.seeds < 2 else f"{n // group.seeds} rooms × {group.seeds}"
    _beside(axes, y - 0.075, shortened(group.variant, 16), -1.05)
    _beside(axes, y + 0.09, count, -1.05, color=MUTED, fontsize=SMALL_PT - 1)


def _draw_group(axes: "Axes", group: AreaErrors, y: float, colour: str) -> None:
    """Draw the points, and over them quartiles, median and Tukey's whiskers."""
    errors = np.sort(group.errors_m2)
    right = {"transform": axes.get_yaxis_transform(), "ha": "right", "color": MUTED}
    if group.missed:
        write(axes, 1, y - 0.16, f"{group.missed} missed", fontsize=SMALL_PT - 1, **right)
    if not len(errors):
        write(axes, 0, y, "no room found", color=MUTED)
        return
    shift = (np.arange(len(errors)) * GOLDEN % 1 - 0.5) * SPREAD_IN
    axes.scatter(errors, y + shift, s=8, color=colour, alpha=0.45, linewidths=0, zorder=2)
    low, middle, high = np.quantile(errors, (0.25, 0.5, 0.75))
    reach = 1.5 * (high - low)
    within = errors[(errors >= low - reach) & (errors <= high + reach)]
    up, down = y - BOX_IN / 2, y + BOX_IN / 2
    line: dict[str, Any] = {"color": INK, "linewidth": 0.9, "zorder": 3, "solid_capstyle": "butt"}
    axes.plot([within[0], low], [y, y], **line)
    axes.plot([high, within[-1]], [y, y], **line)
    axes.plot([low, high, high, low, low], [up, up, down, down, up], **line)
    axes.plot([middle, middle], [up, down], **(line | {"linewidth": 2.4}))


def _described(groups: Sequence[AreaErrors]) -> str:
    parts = [
        f"{group.storey}, {group.variant}: "
        + (
            f"median {np.median(group.errors_m2):.2f} m², worst {group.errors_m2.max():.2f} m²"
            if len(group.errors_m2)
            else "no room found"
        )
        for group in groups
    ]
    return "Box plots of the error of room areas. " + "; ".join(parts) + "."
