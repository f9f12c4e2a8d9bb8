"""Furniture put into rooms by their class; doors stay clear, and only chairs reach under tables."""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
import shapely
from pydantic import Field, PositiveFloat
from shapely import Polygon

from storage.plan import PlanFurniture, PlanOpening, PlanRoom
from tasks.params import Params
from tasks.simulation import furniture
from tasks.simulation.furniture import BEHIND_M, Corners, Group, Piece
from tasks.simulation.placing import Maker, Places, along_walls, extent, in_the_open, on_grid

ALL = 1000
"""More than any room holds."""
MOST_RUNS = 10
"""Runs of cabinets, and pieces of clutter, that a large hall holds. Assumption."""
P_SIDEWAYS = 0.5
"""Share of desks with a narrow side to the wall. Assumption."""
DOOR_SIDE_M, DOOR_DEPTH_M = 0.2, 0.45
"""Floor kept clear beside a door, and before it beyond the leaf's width (half the thickest wall
included). Assumption."""


class FurnishingParams(Params):
    """How densely rooms are furnished. Assumptions unless a source is given."""

    workplace_m2: PositiveFloat = 8.0
    """Floor area of one workplace, m2 (ASR A1.2: 8 m2 for one, 6 m2 for each further)."""
    open_workplace_m2: PositiveFloat = 8.0
    """Floor area of one workplace of an open-plan office, m2; fuller than ASR A1.2's 12 to 15."""
    cabinet_m2: PositiveFloat = 8.0
    """Floor area per run of cabinets or shelves, m2."""
    clutter_m2: PositiveFloat = 12.0
    """Floor area per bin, box or plant, m2."""
    corridor_m2: PositiveFloat = 25.0
    """Corridor area per run of cabinets, m2."""
    p_pushed_in: float = Field(default=0.45, ge=0, le=1)
    """Share of chairs pushed under their table, half hidden."""
    column_grid_m: float = Field(default=4.8, ge=3.0)
    """Distance of the columns in an open-plan office, metres: two facade modules."""
    column_m: float = Field(default=0.3, ge=0, le=0.8)
    """Side of a column, metres; 0 builds none."""


def furnish(
    rooms: Sequence[PlanRoom],
    doors: Sequence[PlanOpening],
    params: FurnishingParams,
    rng: np.random.Generator,
) -> tuple[PlanFurniture, ...]:
    """Return the furniture of all rooms; a group that finds no space is left out.

    Ids start with the kind of piece (`desk-7`), which decides its shape in the mesh.
    """
    clear = shapely.union_all([_clear_floor(door) for door in doors])
    placed: list[PlanFurniture] = []
    for room in rooms:
        for piece, corners in _furnish_room(room, clear, params, rng):
            placed.append(
                PlanFurniture(
                    id=f"{piece.kind}-{len(placed) + 1}",
                    footprint=Polygon(corners),
                    class_=piece.class_,
                    base_m=piece.base_m + (room.floor_m or 0.0),
                    top_m=piece.top_m + (room.floor_m or 0.0),
                    room=room.id,
                )
            )
    return tuple(placed)


def _clear_floor(door: PlanOpening) -> Polygon:
    """Return the floor on both sides of a door that its leaf and people need."""
    a, b = shapely.get_coordinates(door.line)
    along = (b - a) / door.line.length
    across = np.array((-along[1], along[0])) * (door.line.length + DOOR_DEPTH_M)
    a, b = a - DOOR_SIDE_M * along, b + DOOR_SIDE_M * along
    return Polygon((a - across, b - across, b + across, a + across))


def _furnish_room(
    room: PlanRoom,
    clear: shapely.Geometry,
    params: FurnishingParams,
    rng: np.random.Generator,
) -> Iterator[tuple[Piece, Corners]]:
    free = room.polygon.buffer(-BEHIND_M / 2, join_style="mitre").difference(clear)
    for places, make, most in _programme(room, params):
        for place, group in places(make, room.polygon, rng):
            if most == 0:
                break
            floor = Polygon(place(group.floor))
            shapely.prepare(free)
            if free.contains(floor):
                most -= 1
                free = free.difference(floor)
                yield from ((piece, place(piece.corners)) for piece in group.pieces)


def _programme(room: PlanRoom, params: FurnishingParams) -> Iterator[tuple[Places, Maker, int]]:
    """Yield what a room of a class holds, where it is tried and how often, the bulky first."""
    area, pushed = room.polygon.area, params.p_pushed_in
    length, depth = extent(room.polygon)
    match room.class_:
        case "office" | "assistant":
            yield from _times(area / params.workplace_m2, along_walls, _workplace(pushed))
        case "executive":
            yield along_walls, _workplace(pushed), 1
            yield in_the_open, lambda r: furniture.table_with_chairs(1.4, 0.8, 2, pushed, r), 1
        case "open_office":
            if params.column_m > 0 and room.ceiling_m is not None:
                column = furniture.column(room.ceiling_m, params.column_m, params.column_grid_m)
                yield on_grid, lambda _: column, ALL
            pairs = 3 if area > 100 else 2
            blocks = max(1, round(area / params.open_workplace_m2 / (2 * pairs)))
            yield on_grid, lambda r: furniture.desk_block(pairs, pushed, r), blocks
            yield in_the_open, lambda r: furniture.desk_block(1, pushed, r), 1
            yield from _times(2, along_walls, lambda r: furniture.chair_row(3, r))
        case "seminar":
            tables = int(np.clip((depth - 1.6) // 1.4, 1, 4))
            row = lambda r: furniture.turned(furniture.seminar_row(tables, pushed, r))  # noqa: E731
            yield on_grid, row, ALL
            # before a door a shorter row may fit
            yield from _times(2, in_the_open, _short_row(tables, pushed))
            yield along_walls, lambda r: furniture.chair_row(4, r), 1
        case "meeting":
            yield in_the_open, _conference(int(np.clip((length - 2.4) // 0.75, 1, 6)), pushed), 1
            yield along_walls, lambda r: furniture.chair_row(2, r), 1
        case "lab":
            yield on_grid, furniture.bench, ALL
            yield from _times(2, along_walls, lambda _: furniture.wall_bench())
        case "kitchen":
            yield along_walls, furniture.kitchenette, 1
            table = lambda r: furniture.table_with_chairs(0.8, 0.8, 1, pushed, r)  # noqa: E731
            yield from _times(area / 12, in_the_open, table)
        case "storage":
            yield from _times(area / 3, along_walls, _run(furniture.shelves, 3))
        case "wc":
            yield along_walls, furniture.washbasins, 1
        case "corridor":
            yield from _times(area / params.corridor_m2, along_walls, _run(furniture.cabinets, 2))
        case _:
            return
    if room.class_ not in ("kitchen", "wc", "corridor"):
        runs = min(max(2, area / params.cabinet_m2), MOST_RUNS)
        yield from _times(runs / 2, along_walls, _run(furniture.cabinets, 3))
        yield from _times(runs / 2, along_walls, _run(furniture.shelves, 2))
    clutter = min(area / params.clutter_m2, MOST_RUNS)
    yield from _times(clutter, along_walls, furniture.clutter)


def _times(n: float, places: Places, make: Maker) -> Iterator[tuple[Places, Maker, int]]:
    yield from ((places, make, 1) for _ in range(max(1, round(n))))


def _short_row(most: int, pushed: float) -> Maker:
    def make(rng: np.random.Generator) -> Group:
        tables = int(rng.integers(1, most, endpoint=True))
        return furniture.turned(furniture.seminar_row(tables, pushed, rng))

    return make


def _conference(most: int, pushed: float) -> Maker:
    def make(rng: np.random.Generator) -> Group:
        seats = int(rng.integers(1, most, endpoint=True))
        length = max(0.75 * seats, 1.2)
        return furniture.table_with_chairs(length, 1.1 if seats > 2 else 0.8, seats, pushed, rng)

    return make


def _workplace(pushed: float) -> Maker:
    def make(rng: np.random.Generator) -> Group:
        desk = furniture.workplace(pushed, rng)
        return furniture.sideways(desk) if rng.uniform() < P_SIDEWAYS else desk

    return make


def _run(make: Callable[[int, np.random.Generator], Group], most: int) -> Maker:
    return lambda rng: make(int(rng.integers(1, most, endpoint=True)), rng)
