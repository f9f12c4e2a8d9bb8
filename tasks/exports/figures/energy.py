"""Fig. 19: simulated energy of the crowd's devices, by method."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tasks.exports.figures.canvas import (
    BLUE,
    GRID,
    INK,
    MUTED,
    SLATE,
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
from tasks.exports.figures.intervals import mean_of

METHOD_COLOURS = {"MapSense": BLUE, "GraMap": VERMILLION, "No Processing": SLATE}
BAR_IN, HEAD_IN = 0.22, 0.34


@dataclass(frozen=True, eq=False)
class Spent:
    """Accumulated energy of one method at one number of queries of one storey. Simulated."""

    storey: str
    method: str
    n_queries: int
    totals_j: NDArray[np.float64]
    """(n,), joules, one per seed"""


def draw_energy_by_queries(name: str, storey: str, spent: Sequence[Spent], told: str) -> Picture:
    """Draw the energy of one storey over the number of queries (Fig. 19a): mean, 95 % interval."""
    figure = new_figure(3.0)
    axes = add_axes(figure, 0.62, 0.5, 1.3, 0.4)
    note(figure, told)
    axes.grid(axis="y", color=GRID, linewidth=0.6)
    ends = []
    for method in _methods(spent):
        of_method = sorted((s for s in spent if s.method == method), key=lambda s: s.n_queries)
        n = np.array([s.n_queries for s in of_method])
        means = [mean_of(s.totals_j / 1e3) for s in of_method]
        colour = METHOD_COLOURS.get(method, MUTED)
        low, high = np.array([m.low for m in means]), np.array([m.high for m in means])
        axes.fill_between(n, low, high, color=colour, alpha=0.2, linewidth=0)
        values = [m.value for m in means]
        axes.plot(n, values, color=colour, linewidth=1.6, marker="o", markersize=3)
        ends.append((values[-1], method))
    n = np.array([s.n_queries for s in spent])
    axes.set(xlim=(0, n.max() * 1.02), ylim=(0, None))
    axes.set_xticks(np.unique(n))
    top = axes.get_ylim()[1]
    for y, (value, method) in zip(_apart([v for v, _ in ends], top * 0.062), ends, strict=True):
        colour = METHOD_COLOURS.get(method, MUTED)
        axes.plot([n.max() * 1.035], [y], "o", color=colour, markersize=4, clip_on=False)
        write(axes, n.max() * 1.06, y, f"{method} {value:.1f}", clip_on=False)
    title: dict[str, Any] = {"transform": axes.transAxes, "fontsize": TEXT_PT, "fontweight": "bold"}
    write(axes, 0, 1.06, shortened(storey, 44), **title)
    name_axis(axes, "x", "sensing queries")
    name_axis(axes, "y", "energy, kJ (simulated)")
    described = ", ".join(f"{method} {value:.1f} kJ" for value, method in ends)
    alt = f"Accumulated simulated energy over queries, {storey}. At {n.max()} queries: {described}."
    return picture(figure, name, alt)


def draw_energy_by_storey(name: str, spent: Sequence[Spent], told: str) -> Picture:
    """Draw a bar per storey and method with its interval: one query for each room (Fig. 19b)."""
    storeys = list(dict.fromkeys(s.storey for s in spent))
    high = len(storeys) * HEAD_IN + len(spent) * BAR_IN
    figure = new_figure(high + 0.7)
    axes = add_axes(figure, 1.05, 0.5, 0.62, 0.2)
    note(figure, told)
    axes.grid(axis="x", color=GRID, linewidth=0.6)
    axes.set_yticks([])
    y, parts = 0.0, []
    for storey in storeys:
        here = [s for s in spent if s.storey == storey]
        y += HEAD_IN
        left = -0.97 / width_in(axes)
        aside = axes.get_yaxis_transform()
        head = f"{shortened(storey, 36)}, {here[0].n_queries} queries"
        bold: dict[str, Any] = {"fontsize": TEXT_PT, "fontweight": "bold"}
        write(axes, left, y - 0.11, head, transform=aside, **bold)
        for s in sorted(here, key=lambda s: _methods(spent).index(s.method)):
            mean = mean_of(s.totals_j / 1e3)
            centre = y + BAR_IN / 2
            colour = METHOD_COLOURS.get(s.method, MUTED)
            axes.barh(centre, mean.value, BAR_IN * 0.74, color=colour)
            axes.plot([mean.low, mean.high], [centre, centre], color=INK, linewidth=1.2)
            write(axes, left, centre, s.method, transform=aside)
            end = np.nanmax([mean.value, mean.high])
            write(axes, end, centre, f"  {mean.value:.1f}", fontsize=SMALL_PT)
            parts.append(f"{storey}, {s.method}: {mean.value:.1f} kJ")
            y += BAR_IN
    axes.set(ylim=(high, 0), xlim=(0, axes.get_xlim()[1]))
    name_axis(axes, "x", "energy, kJ (simulated)")
    return picture(figure, name, "Simulated energy, one query per room. " + "; ".join(parts) + ".")


def _methods(spent: Sequence[Spent]) -> list[str]:
    """Return the methods, MapSense first, others in the order of the paper."""
    known = list(METHOD_COLOURS)
    names = dict.fromkeys(s.method for s in spent)
    return sorted(names, key=lambda m: (known.index(m) if m in known else len(known), m))


def _apart(values: Sequence[float], least: float) -> list[float]:
    """Return heights of labels near their values and at least a distance apart."""
    heights = np.array(values, float)
    for _ in range(20):
        order = np.argsort(heights, kind="stable")
        gaps = np.diff(heights[order])
        for at in np.flatnonzero(gaps < least * 0.999):
            push = (least - gaps[at]) / 2
            heights[order[at]] -= push
            heights[order[at + 1]] += push
    return [float(h) for h in heights]
