"""A furnished storey drawn from a seed. Simulated."""

from dataclasses import replace
from functools import partial
from typing import Literal

import numpy as np
from pydantic import Field
from shapely.affinity import rotate

from storage.plan import Plan, PlanRoom, PlanWall
from tasks.params import Params
from tasks.simulation.cells import Line, inner_faces, wall_lines
from tasks.simulation.furnishing import FurnishingParams, furnish
from tasks.simulation.layouts.double_loaded import DoubleLoadedParams, double_loaded_layout
from tasks.simulation.layouts.irregular import IrregularParams, irregular_layout
from tasks.simulation.layouts.open_plan import OpenPlanParams, open_plan_layout
from tasks.simulation.layouts.ring import RingParams, ring_layout
from tasks.simulation.layouts.rows import Space
from tasks.simulation.layouts.small import SmallParams, small_layout
from tasks.simulation.layouts.units import BEARING
from tasks.simulation.openings import OpeningParams, make_doors, make_windows

LAYOUTS = ("small", "ring", "double_loaded", "open_plan", "irregular")


class StoreyParams(Params):
    """A storey. All sizes are assumptions unless a source is given."""

    seed: int = 0
    """Seed of rooms, openings and furniture."""
    layout: Literal["small", "ring", "double_loaded", "open_plan", "irregular"] = "small"
    """How rooms lie about the corridor."""
    yaw_rad: float = 0.0
    """Turn of the storey in the building frame, radians."""
    ceiling_m: float = Field(default=2.8, ge=2.3)
    """Height of the ceiling over the floor, metres."""
    outer_m: float = Field(default=0.3, ge=0.1, le=0.5)
    """Thickness of outer walls, metres: a brick of 300 mm (DIN 105)."""
    bearing_m: float = Field(default=0.24, ge=0.1, le=0.4)
    """Thickness of the walls of corridors and stairs, metres: a brick of 240 mm (DIN 105)."""
    inner_m: float = Field(default=0.125, ge=0.08, le=0.2)
    """Thickness of partitions, metres: boards of 12.5 mm twice on a 75 mm stud (DIN 18183 W112)."""
    small: SmallParams = SmallParams()
    """Of the layout `small`."""
    ring: RingParams = RingParams()
    """Of the layout `ring`."""
    double_loaded: DoubleLoadedParams = DoubleLoadedParams()
    """Of the layout `double_loaded`."""
    open_plan: OpenPlanParams = OpenPlanParams()
    """Of the layout `open_plan`."""
    irregular: IrregularParams = IrregularParams()
    """Of the layout `irregular`."""
    openings: OpeningParams = OpeningParams()
    """Doors and windows."""
    furnishing: FurnishingParams = FurnishingParams()
    """Furniture."""


def make_storey(params: StoreyParams, building: str, storey: str) -> Plan:
    """Return a furnished storey; room `r0` is the corridor, the floor lies at z = 0.

    Valid by construction: rooms are apart by their walls, every room is entered by a door that lies
    on the wall between the two rooms it links, furniture stands in its room, clear of doors and of
    other furniture; only chairs reach under tables.
    """
    rng = np.random.default_rng(params.seed)
    spaces = _layout(params, rng)
    cells, classes = [s.cell for s in spaces], [s.class_ for s in spaces]
    bearing = [i for i, class_ in enumerate(classes) if class_ in BEARING]
    lines = wall_lines(cells, bearing, params.outer_m, params.bearing_m, params.inner_m)
    rooms = tuple(
        PlanRoom(
            id=_room_id(i),
            polygon=polygon,
            class_=class_,
            name=_name(class_, storey, i),
            floor_m=0.0,
            ceiling_m=params.ceiling_m,
        )
        for i, (polygon, class_) in enumerate(zip(inner_faces(cells, lines), classes, strict=True))
    )
    doors = make_doors(lines, classes, params.openings, rng)
    plan = Plan(
        building,
        storey,
        rooms,
        tuple(_wall(f"w{i + 1}", line, params.ceiling_m) for i, line in enumerate(lines)),
        doors,
        make_windows(lines, params.openings),
        furnish(rooms, doors, params.furnishing, rng),
        simulated=True,
        notes=("simulated: a procedural storey, no real building",),
    )
    return turned(plan, params.yaw_rad)


def turned(plan: Plan, yaw_rad: float) -> Plan:
    """Return a plan turned about the building frame's origin."""
    turn = partial(rotate, angle=yaw_rad, origin=(0, 0), use_radians=True)
    return replace(
        plan,
        rooms=tuple(replace(r, polygon=turn(r.polygon)) for r in plan.rooms),
        walls=tuple(replace(w, line=turn(w.line)) for w in plan.walls),
        doors=tuple(replace(d, line=turn(d.line)) for d in plan.doors),
        windows=tuple(replace(n, line=turn(n.line)) for n in plan.windows),
        furniture=tuple(replace(f, footprint=turn(f.footprint)) for f in plan.furniture),
    )


def _layout(params: StoreyParams, rng: np.random.Generator) -> list[Space]:
    match params.layout:
        case "small":
            return small_layout(params.small, rng)
        case "ring":
            return ring_layout(params.ring, params.bearing_m, rng)
        case "double_loaded":
            return double_loaded_layout(params.double_loaded, rng)
        case "open_plan":
            return open_plan_layout(params.open_plan, rng)
        case "irregular":
            return irregular_layout(params.irregular, rng)


def _wall(id_: str, line: Line, top_m: float) -> PlanWall:
    rooms = tuple(_room_id(cell) for cell in line.cells)
    return PlanWall(id_, line.line, line.thickness_m, 0.0, top_m, rooms)


def _room_id(cell: int) -> str:
    return f"r{cell}"


def _name(class_: str, storey: str, cell: int) -> str:
    title = "WC" if class_ == "wc" else class_.replace("_", " ").capitalize()
    return title if class_ == "corridor" else f"{title} {storey}.{cell:02d}"
