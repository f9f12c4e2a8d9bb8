"""Plans read from an IFC building model, one per storey, in the file's world coordinates.

Lengths go through the project's units into metres; a site that is placed far from the origin stays
there. Ids are the file's GlobalIds. What cannot be part of a plan is left out and told in `notes`.
"""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from storage.ifc.furniture import furniture_elements, read_furniture
from storage.ifc.model import Entity, Model, Storey, open_model
from storage.ifc.openings import Hole, passages, read_holes, read_openings, with_rooms
from storage.ifc.parse import strict
from storage.ifc.rooms import read_rooms
from storage.ifc.shapes import Shapes, whole_shapes
from storage.ifc.walls import WALL_TYPES, read_walls
from storage.plan import Plan, PlanOpening, PlanRoom, PlanWall
from storage.plan_geojson import from_geojson, to_geojson


def read_ifc(path: Path | str, building: str | None = None) -> dict[str, Plan]:
    """Read every storey of a building, from the lowest up, by the storey's name.

    Parameters
    ----------
    path : an IFC file, STEP text of any IFC schema with storeys (IFC2x3, IFC4, IFC4x3)
    building : name of the building; needed only where the file holds several

    Raises
    ------
    InputError
        If the file is missing, no IFC, damaged, cut short or against its schema; if it states no
        unit of length, holds no building or storey, several buildings of which none was named, two
        storeys of one name, an id twice, or numbers that are not finite.

    Notes
    -----
    Rooms are IfcSpace footprints; walls IfcWall and straight IfcCurtainWall; doors and windows lie
    where their IfcOpeningElement cuts the wall. An opening that people walk through and that
    nothing fills is a door in state "open"; the state of every IfcDoor is "unknown". Furniture is
    IfcFurnishingElement. Heights are z of the file's world.
    """
    with strict(path):
        model = open_model(path, building)
        shapes = _shapes(model, model.storeys)
        return {storey.name: _plan(model, storey, shapes) for storey in model.storeys}


def read_ifc_storey(path: Path | str, storey: str, building: str | None = None) -> Plan:
    """Read one storey by its name; raise InputError as `read_ifc`, or if it is not there."""
    with strict(path):
        model = open_model(path, building)
        chosen = model.storey(storey)
        return _plan(model, chosen, _shapes(model, (chosen,)))


def ifc_storeys(path: Path | str, building: str | None = None) -> dict[str, float | None]:
    """Return the elevation of each storey by its name, metres, lowest first; None if unset."""
    with strict(path):
        return {storey.name: storey.elevation_m for storey in open_model(path, building).storeys}


def _shapes(model: Model, storeys: Iterable[Storey]) -> Shapes:
    """Return the bodies that plans need; walls of all storeys, for one may run through several."""
    fixed = model.of_type(*WALL_TYPES, "IfcSpace", "IfcDoor", "IfcWindow", "IfcOpeningElement")
    movable = {e.id(): e for storey in storeys for e in furniture_elements(model, storey)}
    return whole_shapes(model, [*fixed, *movable.values()])


def _plan(model: Model, storey: Storey, shapes: Shapes) -> Plan:
    notes: list[str] = []
    rooms = read_rooms(model, storey, shapes, notes)
    walls = read_walls(model, storey, shapes, rooms, notes)
    holes = read_holes(model, walls, shapes)
    doors, filled = _doors(model, storey, shapes, holes, walls, rooms, notes)
    free = {id_: hole for id_, hole in holes.items() if id_ not in filled}
    panes = _on_storey(model, storey, "IfcWindow", shapes)
    windows, glazed = read_openings(model, panes, shapes, free, walls, notes)
    # a hole in another storey's part of a tall wall is not this storey's passage
    free = {
        id_: hole
        for id_, hole in free.items()
        if id_ not in glazed
        and not hole.entity.HasFillings
        and model.is_on(storey, hole.entity, hole.shape.middle_m)
    }
    plan = Plan(
        building=model.building,
        storey=storey.name,
        rooms=rooms,
        walls=walls,
        doors=(*doors, *passages(storey, free.values(), rooms)),
        windows=windows,
        furniture=read_furniture(model, storey, shapes, rooms, notes),
        notes=tuple(notes),
    )
    _check_ids(model, plan)
    # absurd numbers in the file: what a plan's own file would not take is not handed on
    from_geojson(to_geojson(plan), model.path)
    return plan


def _doors(
    model: Model,
    storey: Storey,
    shapes: Shapes,
    holes: dict[int, Hole],
    walls: tuple[PlanWall, ...],
    rooms: tuple[PlanRoom, ...],
    notes: list[str],
) -> tuple[tuple[PlanOpening, ...], set[int]]:
    leaves = _on_storey(model, storey, "IfcDoor", shapes)
    doors, filled = read_openings(model, leaves, shapes, holes, walls, notes)
    by_id = {wall.id: wall for wall in walls}
    linked = [with_rooms(door, by_id.get(door.wall or ""), rooms) for door in doors]
    # a model draws its doors shut; how they stand in the building it does not say
    return tuple(_unknown(door) for door in linked), filled


def _unknown(door: PlanOpening) -> PlanOpening:
    return replace(door, state="unknown")


def _on_storey(model: Model, storey: Storey, type_: str, shapes: Shapes) -> list[Entity]:
    """Return a storey's elements of a type; one of unknown place counts by its storey alone."""
    found = []
    for element in model.of_type(type_):
        shape = shapes.get(element.id())
        z = float("nan") if shape is None else shape.middle_m
        if model.is_on(storey, element, z):
            found.append(element)
    return found


def _check_ids(model: Model, plan: Plan) -> None:
    seen: set[str] = set()
    pieces = (plan.rooms, plan.walls, plan.doors, plan.windows, plan.furniture)
    for id_ in (piece.id for group in pieces for piece in group):
        if id_ in seen:
            model.fail(f"GlobalId '{id_}' is used twice", "give each element its own GlobalId")
        seen.add(id_)
