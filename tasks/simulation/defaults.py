"""What a simulation assumes of a plan that does not say: only on request, never silently."""

from dataclasses import replace

from pydantic import Field, PositiveFloat

from storage.plan import Plan
from tasks.params import Params


class SimulationDefaults(Params):
    """Heights and thicknesses of a plan that knows none. All are assumptions."""

    floor_m: float = 0.0
    """Height of the floor, metres; also where walls and furniture start."""
    height_m: float = Field(default=2.8, ge=2.0)
    """Clear height of a room and height of a wall, metres."""
    thickness_m: PositiveFloat = 0.15
    """Thickness of a wall, metres."""
    door_head_m: PositiveFloat = 1.97
    """Height of a door, metres."""
    window_sill_m: PositiveFloat = 0.9
    """Height of a window's sill over the floor, metres."""
    window_head_m: PositiveFloat = 2.2
    """Height of a window's head over the floor, metres."""
    table_top_m: PositiveFloat = 0.74
    """Height of a table, metres (EN 527-1)."""
    chair_top_m: PositiveFloat = 0.87
    """Total height of a chair, metres: the median of a furnisher's catalogue."""
    other_top_m: PositiveFloat = 1.2
    """Height of other furniture, metres: the median of the catalogue's cabinets."""


def complete_plan(plan: Plan, defaults: SimulationDefaults) -> Plan:
    """Return a plan with its unknown heights and thicknesses set; what is known stays.

    The notes say that something was assumed.
    """
    d = defaults
    rooms = tuple(
        replace(r, floor_m=_or(r.floor_m, d.floor_m), ceiling_m=_above(r.ceiling_m, r.floor_m, d))
        for r in plan.rooms
    )
    walls = tuple(
        replace(
            w,
            thickness_m=_or(w.thickness_m, d.thickness_m),
            base_m=_or(w.base_m, d.floor_m),
            top_m=_above(w.top_m, w.base_m, d),
        )
        for w in plan.walls
    )
    doors = tuple(
        replace(o, sill_m=_or(o.sill_m, d.floor_m), head_m=_or(o.head_m, d.floor_m + d.door_head_m))
        for o in plan.doors
    )
    windows = tuple(
        replace(
            o,
            sill_m=_or(o.sill_m, d.floor_m + d.window_sill_m),
            head_m=_or(o.head_m, d.floor_m + d.window_head_m),
        )
        for o in plan.windows
    )
    tops = {"table": d.table_top_m, "chair": d.chair_top_m}
    furniture = tuple(
        replace(
            f,
            base_m=_or(f.base_m, d.floor_m),
            top_m=_or(f.top_m, _or(f.base_m, d.floor_m) + tops.get(f.class_ or "", d.other_top_m)),
        )
        for f in plan.furniture
    )
    note = "simulated: heights and thicknesses the plan does not give are assumed"
    return replace(
        plan,
        rooms=rooms,
        walls=walls,
        doors=doors,
        windows=windows,
        furniture=furniture,
        notes=(*plan.notes, note),
    )


def _or(value: float | None, default: float) -> float:
    return default if value is None else value


def _above(value: float | None, base_m: float | None, defaults: SimulationDefaults) -> float:
    return _or(value, _or(base_m, defaults.floor_m) + defaults.height_m)
