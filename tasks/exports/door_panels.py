"""The steps of door detection on one wall face, panel by panel as Fig. 16 shows them."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from shapely import box

from storage.wall_images import EMPTY, NOT_SEEN, OCCLUDED, OCCUPIED, WallImages
from tasks.exports.sheet import (
    FOOT_IN,
    HEAD_IN,
    MARGIN_IN,
    WIDTH_IN,
    Sheet,
    new_sheet,
    save,
)
from tasks.exports.style import INK, MUTED

COLOURS = {NOT_SEEN: "#d9d9dc", OCCUPIED: "#7f8fa6", EMPTY: "#ffffff", OCCLUDED: "#d98c5f"}
"""Of the labels."""
NAMES = {NOT_SEEN: "not seen", OCCUPIED: "occupied", EMPTY: "empty", OCCLUDED: "occluded"}
NEAR, DEEP = np.array((253, 231, 160)) / 255, np.array((38, 42, 92)) / 255
"""Depth nearest to the room and furthest from it."""
DEPTHS_M = -0.1, 0.3
"""Depths between which the colours run, metres behind the face."""
UNKNOWN = np.array((1.0, 1.0, 1.0))
DRAWN = "#c0392b"
"""Lines and rectangles."""
GROUPS = (DRAWN, "#1f6fb2", "#2e8b57", "#8e44ad", "#c77700", "#0f8b8d")
"""Of rectangles in groups, in turn; those of none, a negative group, are MUTED."""
CANNY, SOBEL = "#1f6fb2", "#c0392b"
"""Edges that one detector alone has found."""
COLUMNS = 2
GAP_M, TITLE_M = 0.25, 0.32
"""Space between panels, and over each for its title, metres of the wall."""
TITLE_PT, HEAD_PT, NOTE_PT = 8, 14, 8


@dataclass(frozen=True, eq=False)
class Panel:
    """One picture of the wall, and what is drawn over it; metres along the face and up."""

    title: str
    image: NDArray[np.float64]
    """(a, b, 3), red, green and blue of 0 to 1; first axis along the face, second up"""
    lines: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 2, 2)))
    """(n, 2, 2), ends"""
    rectangles: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 4)))
    """(n, 4), from, bottom, to, top"""
    groups: NDArray[np.int64] | None = None
    """(n,), what each rectangle belongs to: told apart by colour; None: all are drawn alike"""


def label_image(label: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Return the picture of a face's labels, (a, b, 3)."""
    palette = np.array([_rgb(COLOURS[value]) for value in sorted(COLOURS)])
    return palette[label]


def depth_image(depth: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return the picture of a face's depths: from bright, before it, to dark; white is unknown."""
    low, high = DEPTHS_M
    share = np.clip((np.nan_to_num(depth, nan=low) - low) / (high - low), 0, 1)[..., None]
    return np.where(np.isnan(depth)[..., None], UNKNOWN, NEAR + share * (DEEP - NEAR))


def mask_image(mask: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return the picture of some of a face's pixels, such as its edges: black on white."""
    return np.repeat(np.where(mask, 0.1, 1.0)[..., None], 3, axis=2)


def edge_image(canny: NDArray[np.bool_], sobel: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return the picture of edges: black where two detectors agree, Canny's own blue, Sobel's own
    red."""
    picture = np.ones((*canny.shape, 3))
    for where, colour in ((canny, CANNY), (sobel, SOBEL), (canny & sobel, INK)):
        picture[where] = _rgb(colour)
    return picture


def share_image(share: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Return the picture of shares of 255: white is all."""
    return np.repeat((share / 255)[..., None], 3, axis=2)


def traced_panels(images: WallImages, face: int) -> list[Panel]:
    """Return the panels of what rays saw: labels, depths, and shares that went through."""
    return [
        Panel("label image", label_image(images.labels[face])),
        Panel("depth image", depth_image(images.depths[face])),
        Panel("rays that went through", share_image(images.empty[face])),
    ]


def draw_panels(
    panels: Sequence[Panel], pixel_m: float, title: str, note: str, path: Path | str
) -> None:
    """Draw panels of one face on one sheet, row by row.

    Parameters
    ----------
    panels : sequence of Panel
        n panels, n > 0, with images of one shape.
    pixel_m : float
        Edge of their pixels, metres.
    title, note : str
        What stands over and under them.
    path : Path or str
        Of an `.svg` or `.png` file.

    Raises
    ------
    ValueError
        If there is no panel, or their images differ in shape.
    """
    shapes = {panel.image.shape for panel in panels}
    if len(shapes) != 1:
        raise ValueError(f"panels: expected images of one shape, got {sorted(shapes)}")
    long, high = (n * pixel_m for n in next(iter(shapes))[:2])
    wide, tall = long + GAP_M, high + GAP_M + TITLE_M
    rows = -(-len(panels) // COLUMNS)
    sheet = new_sheet((0.0, 0.0, COLUMNS * wide - GAP_M, rows * tall - GAP_M))
    for number, panel in enumerate(panels):
        row, column = divmod(number, COLUMNS)
        corner = np.array([column * wide, (rows - 1 - row) * tall])
        _draw(sheet, panel, corner, (long, high))
    top = sheet.height_in - HEAD_IN / 2
    sheet.write(MARGIN_IN, top, title, HEAD_PT, weight="bold")
    sheet.write(MARGIN_IN, FOOT_IN / 2, note, NOTE_PT, color=MUTED)
    _draw_key(sheet)
    save(sheet, path)


def _draw(
    sheet: Sheet, panel: Panel, corner: NDArray[np.float64], size: tuple[float, float]
) -> None:
    x, y = (float(value) for value in corner)
    long, high = size
    limits = sheet.axes.axis()
    sheet.axes.imshow(
        panel.image.swapaxes(0, 1),
        origin="lower",
        extent=(x, x + long, y, y + high),
        interpolation="nearest",
        zorder=1,
    )
    sheet.axes.axis(limits)  # a picture would set them anew
    frame = np.array([(0, 0), (long, 0), (long, high), (0, high), (0, 0)], float)
    sheet.stroke(frame + corner, INK, 0.6, 3)
    for line in panel.lines:
        sheet.stroke(line + corner, DRAWN, 0.6, 2)
    groups = np.zeros(len(panel.rectangles), int) if panel.groups is None else panel.groups
    for (left, bottom, right, top), group in zip(panel.rectangles, groups, strict=True):
        around = np.array(box(left, bottom, right, top).exterior.coords)
        colour = MUTED if group < 0 else GROUPS[group % len(GROUPS)]
        sheet.stroke(around + corner, colour, 1.2, 2)
    over = y + high + 0.04
    sheet.axes.text(x, over, panel.title, fontsize=TITLE_PT, color=INK, parse_math=False)


def _draw_key(sheet: Sheet) -> None:
    """Write what the labels' colours mean at the foot of the sheet, from the right."""
    x = WIDTH_IN - MARGIN_IN
    for value in sorted(NAMES, reverse=True):
        sheet.write(x, FOOT_IN / 2, NAMES[value], NOTE_PT, color=INK, ha="right")
        x -= 0.62
        ink = {"facecolor": COLOURS[value], "edgecolor": MUTED, "pad": 1.5, "linewidth": 0.5}
        sheet.write(x, FOOT_IN / 2, "   ", NOTE_PT - 2, ha="right", bbox=ink)
        x -= 0.28


def _rgb(colour: str) -> tuple[float, float, float]:
    red, green, blue = (int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return red, green, blue
