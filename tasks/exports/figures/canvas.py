"""What the figures have in common: size, colours, axes, and the files they become."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from tasks.exports.sheet import FONT, rendered

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH_IN = 4.3
"""A figure is 413 CSS pixels wide: its text is still legible when a phone's 390 hold it."""
INK, MUTED, GRID, PAPER = "#2b2b2e", "#77777d", "#dcdce0", "#ffffff"
"""Text and lines, secondary ones, grid, background: a dark page replaces these, nothing else."""
BLUE, VERMILLION, GREEN, VIOLET, SKY, SLATE = (
    "#1f78b4",
    "#d95f02",
    "#44aa99",
    "#5b4bb5",
    "#56b4e9",
    "#6e6e75",
)
"""Told apart by colour-blind eyes; of middling lightness, to be seen on white and on black."""
SERIES = (BLUE, VERMILLION, GREEN, VIOLET, SKY, SLATE)
"""Colours in the order series take them."""
TEXT_PT, SMALL_PT = 9.0, 8.0


@dataclass(frozen=True)
class Picture:
    """One figure as files."""

    name: str
    """of the files, without suffix"""
    alt: str
    """what is to be seen, for those who cannot"""
    svg: bytes
    png: bytes
    themed: bool = True
    """whether ink and paper may be exchanged on a dark page"""
    caption: str = ""
    """what is written beneath it on a page"""


def new_figure(height_in: float, width_in: float = WIDTH_IN) -> "Figure":
    """Return an empty figure."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width_in, height_in), facecolor=PAPER)


def add_axes(figure: "Figure", left: float, bottom: float, right: float, top: float) -> "Axes":
    """Return plain axes within margins given in inches: no frame but the lower spine."""
    width, height = figure.get_size_inches()
    wide, high = width - left - right, height - bottom - top
    axes = figure.add_axes((left / width, bottom / height, wide / width, high / height))
    axes.set_facecolor("none")
    axes.set_axisbelow(True)
    for side, spine in axes.spines.items():
        spine.set(visible=side == "bottom", color=MUTED, linewidth=0.7)
    axes.tick_params(colors=MUTED, labelsize=SMALL_PT, length=2.5, width=0.6, labelfontfamily=FONT)
    axes.tick_params(axis="y", length=0)
    return axes


def write(axes: "Axes", x: float, y: float, text: str, **style: Any) -> None:
    """Write at a place of the axes' data."""
    style = {"fontsize": SMALL_PT, "color": INK, "va": "center", **style}
    axes.text(x, y, text, fontfamily=FONT, parse_math=False, **style)


def note(figure: "Figure", text: str) -> None:
    """Write in the upper right corner what a reader must know of the data."""
    width, height = figure.get_size_inches()
    style: dict[str, Any] = {"fontsize": SMALL_PT - 0.5, "ha": "right", "va": "center"}
    place = ((width - 0.08) / width, (height - 0.1) / height)
    figure.text(*place, text, color=MUTED, fontfamily=FONT, parse_math=False, **style)


def width_in(axes: "Axes") -> float:
    """Return how wide axes are, inches."""
    return float(axes.get_window_extent().width / axes.figure.dpi)


def name_axis(axes: "Axes", which: str, text: str) -> None:
    """Say what an axis shows, with its unit."""
    axis = axes.xaxis if which == "x" else axes.yaxis
    axis.set_label_text(text, fontsize=TEXT_PT, color=INK, fontfamily=FONT, parse_math=False)


def picture(figure: "Figure", name: str, alt: str, themed: bool = True) -> Picture:
    """Return a figure as files."""
    return Picture(name, alt, rendered(figure, ".svg"), rendered(figure, ".png"), themed)


def colours(names: Iterable[str]) -> dict[str, str]:
    """Return a colour per name, in the order of their first appearance."""
    return {name: SERIES[i % len(SERIES)] for i, name in enumerate(dict.fromkeys(names))}


def shortened(text: str, at_most: int) -> str:
    """Return a text cut to a number of characters."""
    return text if len(text) <= at_most else text[: at_most - 1] + "…"
