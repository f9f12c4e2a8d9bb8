"""The sheet a plan is drawn on: its size, its scale, and pens that draw shapely geometry."""

import threading
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from storage.files import write_whole

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH_IN, DPI = 10.0, 160
"""1600 pixels across."""
MARGIN_IN, HEAD_IN, FOOT_IN, AIR_IN = 0.45, 1.05, 0.95, 0.1
"""White border, title strip, footer strip, air within both strips."""
HEIGHT_MIN_IN, HEIGHT_MAX_IN = 2.6, 12.0
"""Bounds of the drawing's height between the strips."""
SCALE_MAX_IN_PER_M = 1.6
"""A closet alone on its sheet stays a closet: no drawing is larger than about 1:25."""
FONT = "DejaVu Sans"
"""Comes with matplotlib: the same drawing on every machine."""

_save_lock = threading.Lock()


@dataclass(frozen=True, eq=False)
class Sheet:
    """A figure with one drawing area in metres between a title and a footer strip."""

    figure: "Figure"
    axes: "Axes"
    height_in: float
    scale_in_per_m: float

    def fill(self, area: BaseGeometry, face: str, layer: float, **style: Any) -> None:
        """Fill an area; its outline is drawn only if `style` gives an edgecolor."""
        from matplotlib.patches import PathPatch
        from matplotlib.path import Path as Outline

        vertices, codes = _outline(area)
        if len(vertices):
            style = {"edgecolor": "none", "linewidth": 0.0, "joinstyle": "miter"} | style
            outline = Outline(vertices, codes)
            self.axes.add_patch(PathPatch(outline, facecolor=face, zorder=layer, **style))

    def hatch(self, area: BaseGeometry, colour: str, layer: float) -> None:
        """Hatch an area with thin diagonals."""
        style = {"edgecolor": colour, "linewidth": 0.0, "hatch": "////", "hatch_linewidth": 0.4}
        self.fill(area, "none", layer, **style)

    def stroke(
        self,
        line: NDArray[np.float64],
        colour: str,
        width_pt: float,
        layer: float,
        dashes: str = "-",
    ) -> None:
        """Draw an (n, 2) line."""
        from matplotlib.lines import Line2D

        style: dict[str, Any] = {
            "color": colour,
            "linewidth": width_pt,
            "linestyle": dashes,
            "zorder": layer,
        }
        self.axes.add_line(Line2D(line[:, 0], line[:, 1], solid_capstyle="butt", **style))

    def write(self, x_in: float, y_in: float, text: str, size_pt: float, **style: Any) -> None:
        """Write at a place of the sheet, inches from its lower left corner."""
        place = (x_in / WIDTH_IN, y_in / self.height_in)
        style = {"color": "#2b2b2e", "va": "baseline"} | style
        self.figure.text(*place, text, fontsize=size_pt, fontfamily=FONT, parse_math=False, **style)


def new_sheet(bounds: tuple[float, float, float, float]) -> Sheet:
    """Return an empty sheet whose drawing area shows `bounds` (low x, y, high x, y; metres)."""
    from matplotlib.figure import Figure

    low, high = np.array(bounds[:2]), np.array(bounds[2:])
    size = np.maximum(high - low, 0.5)
    wide = WIDTH_IN - 2 * MARGIN_IN
    scale = min(wide / size[0], HEIGHT_MAX_IN / size[1], SCALE_MAX_IN_PER_M)
    high_in = float(np.clip(scale * size[1], HEIGHT_MIN_IN, HEIGHT_MAX_IN))
    total = high_in + HEAD_IN + FOOT_IN
    figure = Figure(figsize=(WIDTH_IN, total), dpi=DPI, facecolor="white")
    # some air above and below, lest outlines on the edge are cut
    rise = high_in + 2 * AIR_IN
    axes = figure.add_axes((0, (FOOT_IN - AIR_IN) / total, 1, rise / total))
    half = np.array((WIDTH_IN, rise)) / scale / 2
    (left, bottom), (right, top) = (low + high) / 2 - half, (low + high) / 2 + half
    axes.set(xlim=(left, right), ylim=(bottom, top))
    axes.set_axis_off()
    return Sheet(figure, axes, total, scale)


def save(sheet: Sheet, path: Path | str) -> None:
    """Write the sheet in the format of the path's suffix, all of it or nothing, undated."""
    path = Path(path)
    write_whole(path, rendered(sheet.figure, path.suffix.lower()), "drawing")


def rendered(figure: "Figure", suffix: str) -> bytes:
    """Return a figure as the bytes of an `.svg` or `.png` file: undated, the same each time."""
    import matplotlib

    data = BytesIO()
    metadata = {".svg": {"Date": None, "Creator": "MapSense"}, ".png": {"Software": None}}
    settings = {"svg.hashsalt": "mapsense", "svg.fonttype": "path"}
    # the settings are matplotlib's own and global: one drawing at a time
    with _save_lock, matplotlib.rc_context(settings):
        figure.savefig(data, format=suffix[1:], dpi=DPI, metadata=metadata[suffix])
    return data.getvalue()


def text_width(text: str, size_pt: float) -> float:
    """Return the width of a line of text, points."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import text_to_path

    font = FontProperties(family=FONT, size=size_pt)
    return float(text_to_path.get_text_width_height_descent(text, font, ismath=False)[0])


def _outline(area: BaseGeometry) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
    """Return vertices and path codes of polygons, holes against the outer ring's sense."""
    polygons = [p for p in shapely.get_parts(shapely.orient_polygons(area)) if _is_area(p)]
    rings = [
        np.asarray(ring.coords)[:, :2] for p in polygons for ring in (p.exterior, *p.interiors)
    ]
    codes = [np.array([1] + [2] * (len(ring) - 2) + [79], np.uint8) for ring in rings]
    if not rings:
        return np.empty((0, 2)), np.empty(0, np.uint8)
    return np.concatenate(rings), np.concatenate(codes)


def _is_area(part: BaseGeometry) -> bool:
    return isinstance(part, Polygon) and not part.is_empty
