"""What the final plan says of each room: class, rule, posterior, where it comes from."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely
from shapely import Polygon

from storage.layout import Layout
from storage.layout_rooms import LayoutRooms
from storage.rooms import Rooms
from tasks.layout.placement.decoded_rows import DecodedRow
from tasks.layout.placement.shapes import CONTRADICTS, Shape
from tasks.layout.placement.wishes import Boundaries


class Label(NamedTuple):
    """One final room."""

    polygon: Polygon
    sources: tuple[int, ...]
    class_: str
    rule: str
    posterior: float
    refused: str


def label_rooms(
    shapes: Sequence[Shape],
    pieces: Sequence[Sequence[Polygon]],
    reasons: Sequence[str],
    boundaries: Boundaries,
    rows: Sequence[DecodedRow],
    layout: Layout,
    initial: Rooms,
) -> LayoutRooms:
    """Return the final rooms.

    Parameters
    ----------
    pieces : per outline its rooms, in the order of the decoded ones
    reasons : per outline why a correction was refused, '' for none

    Notes
    -----
    Heights of a room made of several are those of the largest that has any; shares of what was
    seen are weighted by area; its scans are those of all of them. A room whose rule the guard
    refused keeps the decoded class, but no rule explains it.
    """
    labels = [
        _label(shape, polygon, i, reason, boundaries, rows, layout)
        for shape, rooms, reason in zip(shapes, pieces, reasons, strict=True)
        for i, polygon in enumerate(rooms)
    ]
    return LayoutRooms(
        rooms=_rooms([(label.polygon, label.sources) for label in labels], initial),
        classes=np.array([label.class_ for label in labels], np.str_),
        rules=np.array([label.rule for label in labels], np.str_),
        posteriors=np.array([label.posterior for label in labels], float),
        sources=tuple(label.sources for label in labels),
        refused=np.array([label.refused for label in labels], np.str_),
    )


def _label(
    shape: Shape,
    polygon: Polygon,
    piece: int,
    reason: str,
    boundaries: Boundaries,
    rows: Sequence[DecodedRow],
    layout: Layout,
) -> Label:
    if not shape.decoded:
        posterior = float("nan") if shape.row < 0 else 0.0
        return Label(polygon, shape.sources, "", "", posterior, reason)
    parts = shape.decoded[piece]
    widths = np.diff(rows[shape.row].chain.observed_m)
    place = max(parts, key=lambda d: float(widths[d]))
    decoded = rows[shape.row].decoded[place]
    explained = bool(boundaries.explained[shape.row][place])
    contradicts = bool(boundaries.refused[shape.row][place])
    return Label(
        polygon,
        shape.sources,
        str(layout.classes[decoded]),
        str(layout.rules[decoded]) if explained else "",
        float(layout.posteriors[decoded]),
        CONTRADICTS if contradicts else reason,
    )


def _rooms(made: Sequence[tuple[Polygon, tuple[int, ...]]], initial: Rooms) -> Rooms:
    area = shapely.area(initial.polygons)

    def height(of: np.ndarray, sources: tuple[int, ...]) -> float:
        known = [i for i in sources if not np.isnan(of[i])]
        return float(of[max(known, key=lambda i: area[i])]) if known else float("nan")

    def share(of: np.ndarray, sources: tuple[int, ...]) -> float:
        return float(np.average(of[list(sources)], weights=area[list(sources)]))

    polygons = np.empty(len(made), object)
    polygons[:] = [polygon for polygon, _ in made]
    return Rooms(
        polygons=polygons,
        floor_m=np.array([height(initial.floor_m, s) for _, s in made], float),
        ceiling_m=np.array([height(initial.ceiling_m, s) for _, s in made], float),
        seen=np.array([share(initial.seen, s) for _, s in made], float),
        walled=np.array([share(initial.walled, s) for _, s in made], float),
        scans=tuple(tuple(sorted({n for i in s for n in initial.scans[i]})) for _, s in made),
    )
