"""Where a room's label goes and how large it may be: inside the room, clear of what is in it."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import shapely
from shapely import Point, Polygon, box
from shapely.affinity import scale
from shapely.geometry.base import BaseGeometry

from storage.plan import PlanRoom

SIZES_PT = (10.5, 9.5, 8.5, 7.5, 6.5, 5.5)
"""Font sizes tried, largest first."""
LEGIBLE_PT = 7.5
"""A fuller label is taken if it reaches this size, else a shorter one is tried."""
LINE_SPACING = 1.35
"""Distance of lines in font sizes."""
PADDING = 1.12
"""Free space around a label."""

Width = Callable[[str, float], float]
"""Width of a text at a font size, both in points"""


@dataclass(frozen=True)
class Label:
    """Lines of text centred on a point."""

    lines: tuple[str, ...]
    x_m: float
    y_m: float
    size_pt: float
    upright: bool
    """whether the text runs along y"""


def place_label(
    room: PlanRoom, obstacles: BaseGeometry, points_per_m: float, width: Width
) -> Label | None:
    """Return the fullest legible label that fits a room, None if not even its id does.

    Parameters
    ----------
    obstacles : what the label had better not cover (furniture, door swings), metres
    points_per_m : scale of the drawing
    width : measures a text
    """
    best: Label | None = None
    for region in (room.polygon.difference(obstacles), room.polygon):
        for lines in _forms(room):
            label = _fit(lines, region, points_per_m, width)
            if label and label.size_pt >= LEGIBLE_PT:
                return label
            if label and (best is None or label.size_pt > best.size_pt):
                best = label
    return best


def _forms(room: PlanRoom) -> Iterator[tuple[str, ...]]:
    """Yield the label's forms, fullest first."""
    name, area = room.name or room.id, f"{room.polygon.area:.1f} m²"
    yield name, area
    words = name.split()
    if len(words) > 1:
        half = (len(words) + 1) // 2
        yield " ".join(words[:half]), " ".join(words[half:]), area
    yield (name,)
    if room.name:
        yield (room.id,)


def _fit(
    lines: tuple[str, ...], region: BaseGeometry, points_per_m: float, width: Width
) -> Label | None:
    """Return the largest label of these lines inside a region, along x before along y."""
    best: Label | None = None
    for upright in (False, True):
        text_w, text_h = (PADDING * side / points_per_m for side in _size(lines, width))
        w, h = (text_h, text_w) if upright else (text_w, text_h)
        for centre in _centres(region, w / h):
            size = _largest(region, centre, w, h)
            if size and (best is None or size > best.size_pt):
                best = Label(lines, centre.x, centre.y, size, upright)
        if best and best.size_pt >= LEGIBLE_PT:
            break
    return best


def _largest(region: BaseGeometry, centre: Point, w: float, h: float) -> float | None:
    """Return the largest size at which a box of w x h metres per point lies inside a region."""
    shapely.prepare(region)
    for size in SIZES_PT:
        dx, dy = size * w / 2, size * h / 2
        if region.contains(box(centre.x - dx, centre.y - dy, centre.x + dx, centre.y + dy)):
            return size
    return None


def _size(lines: tuple[str, ...], width: Width) -> tuple[float, float]:
    """Return width and height of a label at one point of font size, points."""
    return max(width(line, 10.0) for line in lines) / 10, LINE_SPACING * len(lines)


def _centres(region: BaseGeometry, aspect: float) -> Iterator[Point]:
    """Yield the centre, then the middle of the roomiest place for a box of width / height `aspect`.

    Squeezed along x by the aspect the box is a square: its place is that of the largest circle.
    """
    yield region.centroid
    squeezed = scale(region, xfact=1 / aspect, origin=(0, 0))
    parts = [part for part in shapely.get_parts(squeezed) if isinstance(part, Polygon)]
    radii = [shapely.maximum_inscribed_circle(p, tolerance=0.01) for p in parts if p.area > 0]
    if radii:
        middle = Point(max(radii, key=lambda radius: radius.length).coords[0])
        yield scale(middle, xfact=aspect, origin=(0, 0))
