"""A small furnished storey drawn from a seed: rooms on both sides of a corridor. Simulated."""

from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np
from pydantic import Field, PositiveFloat
from shapely import LineString, Polygon, box
from shapely.affinity import rotate

from storage.plan import Plan, PlanOpening, PlanRoom, PlanWall
from tasks.params import Params
from tasks.simulation.cells import Line, inner_faces, wall_lines
from tasks.simulation.furnishing import furnish

CORRIDOR = 0
"""Index of the corridor's cell; then the north rooms west to east, then the south rooms."""
NORTH = ("office", "storage", "office", "meeting")
SOUTH = ("office", "office", "kitchen", "office")
MARGIN_M = 0.35
"""Wall left on either side of an opening; more than half of any wall's thickness. Assumption."""


class StoreyParams(Params):
    """A small office storey. All sizes are assumptions unless a source is given."""

    seed: int = 0
    """Seed of widths, openings and furniture."""
    yaw_rad: float = 0.0
    """Turn of the storey in the building frame, radians."""
    corridor_m: PositiveFloat = 2.0
    """Clear width of the corridor, metres."""
    depth_m: PositiveFloat = 4.8
    """Depth of a room from corridor to facade, between centre lines, metres."""
    width_min_m: float = Field(default=3.4, ge=3.2)
    """Least width of a room between centre lines, metres; the L-shaped room needs 3.2."""
    width_max_m: float = Field(default=5.4, ge=3.2)
    """Greatest width of a room between centre lines, metres."""
    chamfer_m: float = Field(default=1.6, ge=0.5, le=2.4)
    """What the oblique wall cuts off the north-east corner along x and along y, metres."""
    outer_m: float = Field(default=0.2, ge=0.1, le=0.5)
    """Thickness of facade and corridor walls, metres."""
    inner_m: float = Field(default=0.12, ge=0.08, le=0.2)
    """Thickness of partitions, metres."""
    ceiling_m: float = Field(default=2.8, ge=2.3)
    """Height of the ceiling over the floor, metres."""
    door_width_m: PositiveFloat = 0.9
    """Clear width of a door, metres: the DIN 18101 leaf of 985 mm leaves about this."""
    door_head_m: PositiveFloat = 2.05
    """Clear height of a door, metres."""
    window_width_m: PositiveFloat = 1.3
    """Width of a window, metres."""
    sill_m: PositiveFloat = 0.9
    """Height of a window's sill, metres."""
    head_m: PositiveFloat = 2.2
    """Height of a window's head, metres."""


def make_storey(params: StoreyParams, building: str, storey: str) -> Plan:
    """Return a furnished storey: eight rooms, one L-shaped, one with an oblique wall, a corridor.

    The floor lies at z = 0. Doors stand open and their leaves are not modelled.
    """
    rng = np.random.default_rng(params.seed)
    cells, classes = _cells(params, rng)
    lines = wall_lines(cells, CORRIDOR, params.outer_m, params.inner_m)
    walls = tuple(_wall(f"w{i + 1}", line, params.ceiling_m) for i, line in enumerate(lines))
    rooms = tuple(
        PlanRoom(
            id=_room_id(i),
            polygon=inner_faces(cell, lines),
            class_=class_,
            name=_name(class_, storey, i),
            floor_m=0.0,
            ceiling_m=params.ceiling_m,
        )
        for i, (cell, class_) in enumerate(zip(cells, classes, strict=True))
    )
    doors = _doors(lines, len(rooms), params, rng)
    plan = Plan(
        building,
        storey,
        rooms,
        walls,
        doors,
        _windows(lines, params),
        furnish(rooms, doors, rng),
        simulated=True,
        notes=("simulated: a procedural storey, no real building",),
    )
    return _turned(plan, params.yaw_rad)


def _cells(params: StoreyParams, rng: np.random.Generator) -> tuple[list[Polygon], list[str]]:
    """Return the corridor's cell, the north cells, the south cells, and their classes."""
    width = params.corridor_m + params.outer_m
    north = np.round(rng.uniform(params.width_min_m, params.width_max_m, len(NORTH)), 2)
    south = rng.uniform(params.width_min_m, params.width_max_m, len(SOUTH))
    length = north.sum()
    x_north = np.concatenate(([0.0], np.cumsum(north)))
    x_south = np.round(np.concatenate(([0.0], np.cumsum(south * length / south.sum()))), 2)
    corridor = box(0, 0, length, width)
    cells = [corridor, *_north(x_north, width, params)]
    cells += [box(a, -params.depth_m, b, 0) for a, b in pairwise(x_south)]
    return cells, ["corridor", *NORTH, *SOUTH]


def _north(x: np.ndarray, y: float, params: StoreyParams) -> list[Polygon]:
    top, back = y + params.depth_m, y + 0.55 * params.depth_m
    cut = params.chamfer_m
    # the first room reaches behind the second: an L, and a second room without a window
    ell = Polygon([(x[0], y), (x[1], y), (x[1], back), (x[2], back), (x[2], top), (x[0], top)])
    last = [(x[3], y), (x[4], y), (x[4], top - cut), (x[4] - cut, top), (x[3], top)]
    return [ell, box(x[1], y, x[2], back), box(x[2], y, x[3], top), Polygon(last)]


def _wall(id_: str, line: Line, top_m: float) -> PlanWall:
    rooms = tuple(_room_id(cell) for cell in line.cells)
    return PlanWall(id_, line.line, line.thickness_m, 0.0, top_m, rooms)


def _room_id(cell: int) -> str:
    return f"r{cell}"


def _name(class_: str, storey: str, cell: int) -> str:
    return "Corridor" if cell == CORRIDOR else f"{class_.capitalize()} {storey}.{cell:02d}"


def _doors(
    lines: tuple[Line, ...], n_rooms: int, params: StoreyParams, rng: np.random.Generator
) -> tuple[PlanOpening, ...]:
    """Return a door from the corridor to every room, and one between the first south rooms."""
    first_south = 1 + len(NORTH)
    pairs = [(CORRIDOR, room) for room in range(1, n_rooms)] + [(first_south, first_south + 1)]
    doors = []
    for number, pair in enumerate(pairs):
        index = next(i for i, line in enumerate(lines) if line.cells == pair)
        line = lines[index].line
        room_for = line.length - params.door_width_m - 2 * MARGIN_M
        start = MARGIN_M + rng.uniform() * max(room_for, 0.0)
        doors.append(
            PlanOpening(
                id=f"d{number + 1}",
                line=_part(line, start, params.door_width_m),
                sill_m=0.0,
                head_m=params.door_head_m,
                wall=f"w{index + 1}",
                state="open",
                rooms=tuple(_room_id(cell) for cell in pair),
            )
        )
    return tuple(doors)


def _windows(lines: tuple[Line, ...], params: StoreyParams) -> tuple[PlanOpening, ...]:
    """Return windows spread evenly over every outer wall that is long enough."""
    width = params.window_width_m
    found = []
    for index, line in enumerate(lines):
        if len(line.cells) == 2:
            continue
        length = line.line.length
        n = int(length // (width + 2 * MARGIN_M))
        for i in range(n):
            middle = (i + 0.5) * length / n
            part = _part(line.line, middle - width / 2, width)
            found.append((part, f"w{index + 1}"))
    return tuple(
        PlanOpening(f"n{i + 1}", part, params.sill_m, params.head_m, wall)
        for i, (part, wall) in enumerate(found)
    )


def _part(line: LineString, start_m: float, width_m: float) -> LineString:
    return LineString([line.interpolate(start_m), line.interpolate(start_m + width_m)])


def _turned(plan: Plan, yaw_rad: float) -> Plan:
    turn = partial(rotate, angle=yaw_rad, origin=(0, 0), use_radians=True)
    return replace(
        plan,
        rooms=tuple(replace(r, polygon=turn(r.polygon)) for r in plan.rooms),
        walls=tuple(replace(w, line=turn(w.line)) for w in plan.walls),
        doors=tuple(replace(d, line=turn(d.line)) for d in plan.doors),
        windows=tuple(replace(n, line=turn(n.line)) for n in plan.windows),
        furniture=tuple(replace(f, footprint=turn(f.footprint)) for f in plan.furniture),
    )
