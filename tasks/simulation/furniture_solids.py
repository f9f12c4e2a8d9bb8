"""Furniture as real shapes: what the sensor sees of a footprint, a class and two heights.

The kind is the first part of a piece's id (`desk-7`); ids of other people's plans say nothing, so
their tables stand on four legs, their chairs too, and everything else is a box.
"""

import zlib
from collections.abc import Iterator, Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import LineString

from storage.plan import PlanFurniture, PlanRoom
from tasks.simulation.heights import known
from tasks.simulation.materials import DARK, MATT
from tasks.simulation.solids import Quad, Solid, part_of, prism

TOP_M, SLAB_M, BOARD_M = 0.03, 0.04, 0.02
"""Thickness of table tops and backs, of seats, of boards. Assumption."""
TABLE_LEG_M, CHAIR_LEG_M, COLUMN_M = 0.05, 0.03, 0.06
"""Side of a leg, of the column of a swivel chair. Assumption."""
BACK_HEIGHT_M, SEAT_MIN_M, SEAT_MAX_M = 0.39, 0.40, 0.48
"""Usual height of a back over its seat; seats are 0.40 to 0.48 m high. Assumption."""
STOOL_M = 0.6
"""What is lower has no back. Assumption."""
NEAR_TABLE_M = 1.2
"""A chair this near to a table faces it. Assumption."""
LEVEL_M = 0.36
"""Distance of the boards of a shelf: one file and its board. Assumption."""
P_DARK = {"screen": 1.0, "swivel": 0.6, "chair": 0.25, "cabinet": 0.1, "shelf": 0.1, "desk": 0.05}
"""Share of black pieces by kind. Assumption."""


def furniture_solids(pieces: Sequence[PlanFurniture], rooms: Sequence[PlanRoom]) -> Iterator[Solid]:
    """Yield the parts of all furniture.

    Raises
    ------
    MapSenseError
        If the base or the top of a piece is unknown.
    """
    tables = np.array([p.footprint for p in pieces if p.class_ == "table"], dtype=object)
    outlines = {room.id: room.polygon.boundary for room in rooms}
    for piece in pieces:
        owner = f"furniture '{piece.id}'"
        base, top = known(piece.base_m, owner, "base_m"), known(piece.top_m, owner, "top_m")
        quad = shapely.get_coordinates(shapely.oriented_envelope(piece.footprint).exterior)[:4]
        kind, material = kind_of(piece), _material(piece)
        if piece.class_ == "chair":
            back = _back_side(quad, tables, outlines.get(piece.room or ""))
            quad = np.roll(quad, -back, axis=0)
            seat = base + seat_height_m(base, top)
            legs = _star(quad, base, seat) if kind == "swivel" else _legs(quad, base, seat, True)
            yield from (leg._replace(material=material) for leg in legs)
            yield prism(quad, seat - SLAB_M, seat, material)
            if top > seat:
                yield prism(part_of(quad, (0, _long(quad)), (0, TOP_M)), seat, top, material)
        elif kind == "desk":
            yield from _desk(quad, base, top, material)
        elif piece.class_ == "table":
            yield prism(quad, top - TOP_M, top, material)
            yield from _legs(quad, base, top - TOP_M + SLAB_M, False)
        elif kind == "shelf":
            yield from _shelf(quad, base, top, material, piece.id)
        elif kind == "screen":
            yield from _screen(quad, base, top, material)
        else:
            yield prism(quad, base, top, material)


def kind_of(piece: PlanFurniture) -> str:
    """Return the first part of a piece's id."""
    return piece.id.split("-")[0]


def seat_height_m(base_m: float, top_m: float) -> float:
    """Return how high the seat of a chair lies over its base.

    Heights of chairs are total heights: a back of 0.39 m is taken off, and the rest kept between
    0.40 and 0.48 m. A chair under 0.6 m is a stool, all seat.
    """
    total = top_m - base_m
    if total < STOOL_M:
        return total
    return float(np.clip(total - BACK_HEIGHT_M, SEAT_MIN_M, SEAT_MAX_M))


def _material(piece: PlanFurniture) -> int:
    """Return dark for some pieces of a kind, chosen by their ids."""
    drawn = zlib.crc32(f"material {piece.id}".encode()) / 2**32
    return DARK if drawn < P_DARK.get(kind_of(piece), 0.0) else MATT


def _legs(quad: Quad, base: float, seat: float, chair: bool) -> Iterator[Solid]:
    side = CHAIR_LEG_M if chair else TABLE_LEG_M
    for along in ((0, side), (-side, _long(quad))):
        for across in ((0, side), (-side, _deep(quad))):
            yield prism(part_of(quad, along, across), base, seat - SLAB_M)


def _star(quad: Quad, base: float, seat: float) -> Iterator[Solid]:
    """Yield the column of a swivel chair on two crossed bars."""
    length, depth = _long(quad), _deep(quad)
    middle = [((size - COLUMN_M) / 2, (size + COLUMN_M) / 2) for size in (length, depth)]
    yield prism(part_of(quad, middle[0], middle[1]), base, seat - SLAB_M)
    yield prism(part_of(quad, (0, length), middle[1]), base + 0.02, base + 0.08)
    yield prism(part_of(quad, middle[0], (0, depth)), base + 0.02, base + 0.08)


def _desk(quad: Quad, base: float, top: float, material: int) -> Iterator[Solid]:
    """Yield a top between two side panels."""
    if _long(quad) < _deep(quad):
        quad = np.roll(quad, -1, axis=0)
    yield prism(quad, top - TOP_M, top, material)
    inset = (0.03, -0.03)
    yield prism(part_of(quad, (0, BOARD_M), inset), base, top - TOP_M, material)
    yield prism(part_of(quad, (-BOARD_M, _long(quad)), inset), base, top - TOP_M, material)


def _shelf(quad: Quad, base: float, top: float, material: int, id_: str) -> Iterator[Solid]:
    """Yield sides and boards, open at both long sides, and what stands on the boards."""
    if _long(quad) < _deep(quad):
        quad = np.roll(quad, -1, axis=0)
    length = _long(quad)
    yield prism(part_of(quad, (0, BOARD_M), (0, _deep(quad))), base, top, material)
    yield prism(part_of(quad, (-BOARD_M, length), (0, _deep(quad))), base, top, material)
    levels = max(1, round((top - base - BOARD_M) / LEVEL_M))
    heights = np.linspace(base, top - BOARD_M, levels + 1)
    for i, height in enumerate(heights):
        yield prism(part_of(quad, (BOARD_M, -BOARD_M), (0, _deep(quad))), height, height + BOARD_M)
        share = 0.2 + 0.7 * zlib.crc32(f"files {id_} {i}".encode()) / 2**32
        if i < levels:
            files = part_of(quad, (BOARD_M, BOARD_M + share * length), (0.03, -0.03))
            yield prism(files, height + BOARD_M, height + BOARD_M + 0.7 * LEVEL_M, material)


def _screen(quad: Quad, base: float, top: float, material: int) -> Iterator[Solid]:
    """Yield an upright panel on a foot."""
    if _long(quad) < _deep(quad):
        quad = np.roll(quad, -1, axis=0)
    length, middle = _long(quad), _deep(quad) / 2
    panel = part_of(quad, (0, length), (middle - 0.02, middle + 0.02))
    yield prism(panel, base + 0.1, top, material)
    centre = (length / 2 - 0.1, length / 2 + 0.1)
    yield prism(part_of(quad, centre, (0, _deep(quad))), base, base + 0.015, material)
    neck = part_of(quad, (length / 2 - 0.02, length / 2 + 0.02), (middle - 0.02, middle + 0.02))
    yield prism(neck, base + 0.015, base + 0.1, material)


def _back_side(quad: Quad, tables: NDArray[np.object_], outline: shapely.Geometry | None) -> int:
    """Return the side of a chair its back is on.

    Away from a near table, else to the nearest wall of its room, else the first.
    """
    sides = [LineString((quad[i], quad[(i + 1) % 4])).centroid for i in range(4)]
    middle = shapely.Point(quad.mean(axis=0))
    away = shapely.distance(tables, middle) if len(tables) else np.empty(0)
    if away.min(initial=np.inf) < NEAR_TABLE_M:
        # from the table's middle: of a chair pushed in, three sides touch the table
        table = tables[away.argmin()]
        across = _across(table, middle)
        return int(np.argmax([(side.x - middle.x, side.y - middle.y) @ across for side in sides]))
    if outline is not None:
        return int(np.argmin([side.distance(outline) for side in sides]))
    return 0


def _across(table: shapely.Polygon, at: shapely.Point) -> NDArray[np.float64]:
    """Return the direction in which a point leaves a table on the shortest way."""
    quad = shapely.get_coordinates(shapely.oriented_envelope(table).exterior)[:4]
    centre, position = quad.mean(axis=0), np.array((at.x, at.y))
    best, found = -np.inf, np.zeros(2)
    for i in range(4):
        outward = (quad[i] + quad[(i + 1) % 4]) / 2 - centre
        half = np.linalg.norm(outward)
        beyond = float((position - centre) @ outward / half - half)
        if beyond > best:
            best, found = beyond, outward / half
    return found


def _long(quad: Quad) -> float:
    return float(np.linalg.norm(quad[1] - quad[0]))


def _deep(quad: Quad) -> float:
    return float(np.linalg.norm(quad[3] - quad[0]))
