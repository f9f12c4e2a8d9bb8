"""Furniture of a storey: oriented footprints and classes of IfcFurnishingElement."""

import re

import numpy as np
import shapely
from shapely import Polygon

from storage.ifc.model import Entity, Model, Storey
from storage.ifc.rooms import at_height, shared_areas
from storage.ifc.shapes import Shape, Shapes
from storage.plan import PlanFurniture, PlanRoom

FURNITURE_TYPES = ("IfcFurnishingElement",)
SIDE_MIN_M = 0.01
"""A thinner footprint is a sheet or a line, not a piece of furniture."""
PREDEFINED = {
    "TABLE": "table",
    "DESK": "table",
    "CHAIR": "chair",
    **dict.fromkeys(
        ("BED", "BOOKCASE", "FILECABINET", "SHELF", "SOFA", "TECHNICALCABINET"), "other"
    ),
}
"""IfcFurnitureTypeEnum of IFC4 and the classes of a plan."""
WORDS = {
    "other": r"(?:table|desk)[ -](?:lamp|light)s?|\w*lamp(?:s|e|en)?|\w*lights?|\w*leuchten?"
    r"|\w*cabinets?|\w*schränke?|\w*schrank|\w*sofas?|\w*couch(?:es)?|\w*tops?",
    "table": r"tables?|desks?|\w*tische?|bureaux?|mesas?|escritorios?|tavol[oi]|scrivani[ae]"
    r"|tafels?|workstations?|bord",
    "chair": r"\w*chairs?|\w*st(?:u|ü|ue)hle?n?|\w*hocker|\w*stools?|chaises?|fauteuils?"
    r"|tabourets?|sill(?:as?|ones|ón)|sedi[ae]|stoel(?:en)?|seats?|cadeiras?|stol(?:ar)?",
}
"""What the classes are called in English, German, French, Spanish, Italian, Dutch, Portuguese and
Swedish: whole words, German compounds by their end ("Schreibtisch", but not "Tischlampe")."""
LETTER = r"[^\W\d_]"
FIRST_WORD = re.compile(
    "|".join(rf"(?P<{c}>(?<!{LETTER})(?:{w})(?!{LETTER}))" for c, w in WORDS.items())
)


def furniture_elements(model: Model, storey: Storey) -> list[Entity]:
    """Return the furniture that may be on a storey; one in no storey may be on any."""
    return [
        element
        for element in model.of_type(*FURNITURE_TYPES)
        if model.storey_of(element) in (storey, None)
    ]


def read_furniture(
    model: Model,
    storey: Storey,
    shapes: Shapes,
    rooms: tuple[PlanRoom, ...],
    notes: list[str],
) -> tuple[PlanFurniture, ...]:
    """Return the pieces of furniture of a storey, each in the room that holds most of it."""
    found = []
    for element in furniture_elements(model, storey):
        shape = shapes.get(element.id())
        if shape is None:
            notes.append(f"{element.is_a()} {element.GlobalId} has no body: left out")
            continue
        if not model.is_on(storey, element, shape.middle_m):
            continue
        rectangle = _rectangle(shape)
        if rectangle is None:
            notes.append(f"{element.is_a()} {element.GlobalId} covers no area: left out")
            continue
        found.append(
            PlanFurniture(
                id=element.GlobalId,
                footprint=rectangle,
                class_=furniture_class(element),
                base_m=shape.low_m,
                top_m=shape.high_m,
                room=_room(rectangle, at_height(rooms, shape.low_m, shape.high_m)),
            )
        )
    return tuple(found)


def furniture_class(element: Entity) -> str | None:
    """Return table, chair or other by an element's predefined type, else by its names.

    The first word that names a class decides: a "table with chairs" is a table. None if the
    element has no name at all.
    """
    types = [
        relation.RelatingType
        for name in ("IsTypedBy", "IsDefinedBy")
        for relation in getattr(element, name, ())
        if relation.is_a("IfcRelDefinesByType") and relation.RelatingType is not None
    ]
    for owner in (element, *types):
        predefined = getattr(owner, "PredefinedType", None)
        if predefined in PREDEFINED:
            return PREDEFINED[predefined]
    texts = [
        text
        for text in (element.Name, element.ObjectType, *(type_.Name for type_ in types))
        if text and text.strip()
    ]
    for text in texts:
        # underscores join words in the names of families: M_Chair-Breuer
        word = FIRST_WORD.search(text.lower().replace("_", " "))
        if word is not None:
            return word.lastgroup
    return "other" if texts else None


def _rectangle(shape: Shape) -> Polygon | None:
    around = shapely.oriented_envelope(shapely.multipoints(shape.vertices[:, :2]))
    if not isinstance(around, Polygon):
        return None
    a, b, c = shapely.points(shapely.get_coordinates(around.exterior)[:3])
    return around if min(a.distance(b), b.distance(c)) >= SIDE_MIN_M else None


def _room(area: Polygon, rooms: list[PlanRoom]) -> str | None:
    shared = shared_areas(area, rooms)
    return rooms[int(np.argmax(shared))].id if shared.max(initial=0.0) > 0 else None
