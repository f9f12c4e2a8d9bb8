"""The plan of one storey: the one type for truth, simulation, prediction and export.

Coordinates are the building frame's x and y in metres; heights are z. Unknown values are None,
never invented.
"""

from dataclasses import dataclass, field

from shapely import LineString, Polygon


@dataclass(frozen=True, eq=False)
class PlanRoom:
    """A room, bounded by the inner faces of its walls."""

    id: str
    polygon: Polygon
    class_: str | None = None
    name: str | None = None
    floor_m: float | None = None
    ceiling_m: float | None = None
    rule: str | None = None
    posterior: float | None = None
    scans: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class PlanWall:
    """A wall by its centre line; `rooms` are the rooms on its two sides."""

    id: str
    line: LineString
    thickness_m: float | None = None
    base_m: float | None = None
    top_m: float | None = None
    rooms: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class PlanOpening:
    """A door or a window: a line across the opening, on its wall."""

    id: str
    line: LineString
    sill_m: float | None = None
    head_m: float | None = None
    wall: str | None = None
    confidence: float | None = None
    state: str | None = None
    """open, ajar, shut or unknown; None for a window"""
    rooms: tuple[str, ...] = ()
    """the rooms a door links; empty for a window"""


@dataclass(frozen=True, eq=False)
class PlanFurniture:
    """A piece of furniture by its oriented footprint."""

    id: str
    footprint: Polygon
    class_: str | None = None
    base_m: float | None = None
    top_m: float | None = None
    room: str | None = None
    confidence: float | None = None


@dataclass(frozen=True, eq=False)
class Plan:
    """One storey of one building."""

    building: str
    storey: str
    rooms: tuple[PlanRoom, ...] = ()
    walls: tuple[PlanWall, ...] = ()
    doors: tuple[PlanOpening, ...] = ()
    windows: tuple[PlanOpening, ...] = ()
    furniture: tuple[PlanFurniture, ...] = ()
    simulated: bool = False
    """whether the plan, or the scans it was made from, are simulated"""
    notes: tuple[str, ...] = field(default=())
