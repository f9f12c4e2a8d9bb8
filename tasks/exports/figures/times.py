"""Fig. 18c: seconds of each stage against the points it works on."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tasks.exports.figures.canvas import (
    BLUE,
    GRID,
    INK,
    MUTED,
    PAPER,
    SMALL_PT,
    TEXT_PT,
    WIDTH_IN,
    Picture,
    add_axes,
    new_figure,
    picture,
    write,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLUMNS = 2
PANEL_IN = 1.5
LEFT_IN, RIGHT_IN, FOOT_IN, HEAD_IN, APART_IN = 0.58, 0.12, 0.5, 0.1, 0.2


@dataclass(frozen=True, eq=False)
class StageTimes:
    """The runs of one stage that computed; entry i is one of them in both arrays."""

    stage: str
    points: NDArray[np.float64]
    """(n,), points read, made or seen by the scans it works on; > 0"""
    seconds: NDArray[np.float64]
    """(n,), > 0"""
    runs: int
    """runs the line is fitted to: all of them, where only some are drawn"""
    exponent: float
    """slope of the line on log-log paper: seconds grow as points to this power; NaN: no line"""
    log_factor: float
    """natural logarithm of the seconds the line gives for one point; NaN: no line"""


def draw_times(name: str, stages: Sequence[StageTimes]) -> Picture:
    """Draw a panel per stage on common logarithmic axes, the lines of the others thin."""
    rows = -(-len(stages) // COLUMNS)
    high = HEAD_IN + rows * PANEL_IN + (rows - 1) * APART_IN + FOOT_IN
    figure = new_figure(high)
    wide = (figure.get_size_inches()[0] - LEFT_IN - RIGHT_IN - (COLUMNS - 1) * APART_IN) / COLUMNS
    points = np.concatenate([stage.points for stage in stages])
    seconds = np.concatenate([stage.seconds for stage in stages])
    for i, stage in enumerate(stages):
        row, column = divmod(i, COLUMNS)
        left = LEFT_IN + column * (wide + APART_IN)
        top = HEAD_IN + row * (PANEL_IN + APART_IN)
        right = figure.get_size_inches()[0] - left - wide
        axes = add_axes(figure, left, high - top - PANEL_IN, right, top)
        axes.set(xscale="log", yscale="log", xlim=_limits(points), ylim=_limits(seconds))
        axes.minorticks_off()
        axes.grid(color=GRID, linewidth=0.5)
        lowest = i + COLUMNS >= len(stages)
        axes.tick_params(labelbottom=lowest, labelleft=column == 0)
        _draw_stage(axes, stage, [other for other in stages if other is not stage])
    middle: dict[str, Any] = {"ha": "center", "fontsize": TEXT_PT}
    last = figure.axes[-1]
    place = figure.transFigure
    write(last, 0.5, 0.12 / high, "points", transform=place, **middle)
    upright: dict[str, Any] = {"rotation": 90, **middle}
    write(last, 0.1 / WIDTH_IN, 0.5, "seconds", transform=place, **upright)
    return picture(figure, name, _described(stages))


def _draw_stage(axes: "Axes", stage: StageTimes, others: Sequence[StageTimes]) -> None:
    for other in others:
        _draw_line(axes, other, MUTED, 0.5)
    axes.scatter(stage.points, stage.seconds, s=7, color=BLUE, alpha=0.5, linewidths=0, zorder=2)
    corner: dict[str, Any] = {"transform": axes.transAxes, "va": "top"}
    halo = _halo()
    write(axes, 0.03, 0.98, stage.stage, fontweight="bold", path_effects=halo, **corner)
    if np.isnan(stage.exponent):
        write(axes, 0.03, 0.82, "one size: no slope", color=MUTED, path_effects=halo, **corner)
        return
    _draw_line(axes, stage, INK, 1.2)
    told = f"slope {stage.exponent:.2f}, n {stage.runs}"
    small: dict[str, Any] = {"fontsize": SMALL_PT - 0.5, "path_effects": halo}
    write(axes, 0.03, 0.82, told, **small, **corner)


def _draw_line(axes: "Axes", stage: StageTimes, colour: str, width_pt: float) -> None:
    if not np.isnan(stage.exponent):
        ends = np.array([stage.points.min(), stage.points.max()])
        line = np.exp(stage.log_factor) * ends**stage.exponent
        axes.plot(ends, line, color=colour, linewidth=width_pt, zorder=3)


def _halo() -> list[object]:
    from matplotlib.patheffects import withStroke

    return [withStroke(linewidth=2.0, foreground=PAPER)]


def _limits(values: NDArray[np.float64]) -> tuple[float, float]:
    """Return limits on logarithmic paper with a little air, and room for the name above."""
    low, high = np.log10(values.min()), np.log10(values.max())
    air = max(0.06 * (high - low), 0.15)
    return float(10 ** (low - air)), float(10 ** (high + 3 * air))


def _described(stages: Sequence[StageTimes]) -> str:
    parts = [
        f"{stage.stage}: median {np.median(stage.seconds):.3g} s"
        + ("" if np.isnan(stage.exponent) else f", slope {stage.exponent:.2f}")
        for stage in stages
    ]
    return "Seconds against points on log-log axes. " + "; ".join(parts) + "."
