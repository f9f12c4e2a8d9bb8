"""An IFC file opened and checked: its building, its storeys, and which storey an element is on."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import ifcopenshell
import ifcopenshell.util.placement

from storage.errors import InputError
from storage.ifc.parse import metres_per_unit, parse

Entity = Any
"""An instance of the file: an `ifcopenshell.entity_instance`."""


@dataclass(frozen=True, eq=False)
class Storey:
    """One storey of the building."""

    name: str
    entity: Entity
    elevation_m: float | None
    """z of the storey in the file's world, metres"""
    next_m: float = math.inf
    """elevation of the storey above, metres; infinite at the top"""

    def holds(self, z: float) -> bool:
        """Whether a height lies between this storey's elevation and the next one's."""
        return self.elevation_m is not None and self.elevation_m <= z < self.next_m


@dataclass(frozen=True, eq=False)
class Model:
    """One building of an IFC file."""

    path: Path
    file: Any
    metres: float
    """metres per unit of the file's lengths"""
    entity: Entity
    """the IfcBuilding"""
    building: str
    """name of the building; the file's name where it has none"""
    storeys: tuple[Storey, ...]

    def fail(self, field: str, remedy: str) -> NoReturn:
        raise InputError(self.path, field, remedy)

    def storey(self, name: str) -> Storey:
        """Return a storey by its name, or raise InputError naming those there are."""
        by_name = {storey.name: storey for storey in self.storeys}
        if name not in by_name:
            there = ", ".join(f"'{name}'" for name in by_name)
            self.fail(f"has no storey '{name}'", f"choose one of {there}")
        return by_name[name]

    def length(self, value: float | None) -> float | None:
        """Return an attribute's length in metres; None if unset, not finite or not > 0."""
        if value is None or not math.isfinite(value) or value <= 0:
            return None
        return float(value) * self.metres

    def of_type(self, *types: str) -> list[Entity]:
        """Return the building's instances of some types, in the order of the file."""
        known = [type_ for type_ in types if self._has_type(type_)]
        found = {e.id(): e for type_ in known for e in self.file.by_type(type_)}
        return [found[id_] for id_ in sorted(found) if self._is_ours(found[id_])]

    def storey_of(self, element: Entity) -> Storey | None:
        """Return the storey an element is placed in, through rooms, assemblies and openings."""
        own = {storey.entity.id(): storey for storey in self.storeys}
        # the nearest: a door may be placed in one storey and fill a wall of another
        return next((own[e.id()] for e in ancestors(element) if e.id() in own), None)

    def is_on(self, storey: Storey, element: Entity, z: float) -> bool:
        """Whether an element is on a storey; one in no storey is where its middle `z` lies."""
        own = self.storey_of(element)
        return storey.holds(z) if own is None else own is storey

    def _has_type(self, type_: str) -> bool:
        # IFC2X3 and IFC4 name some things differently
        schema = ifcopenshell.schema_by_name(self.file.schema_identifier)
        try:
            return schema.declaration_by_name(type_) is not None
        except RuntimeError:
            return False

    def _is_ours(self, element: Entity) -> bool:
        building = next((e for e in ancestors(element) if e.is_a("IfcBuilding")), None)
        return building is None or building == self.entity


def open_model(path: Path | str, building: str | None = None) -> Model:
    """Open an IFC file (STEP text) and return one building of it.

    Parameters
    ----------
    path : the file
    building : name of the building; needed only where the file holds several

    Raises
    ------
    InputError
        If the file is missing, no IFC, damaged or cut short, states no unit of length, holds no
        storey, several buildings of which none was named, or two storeys of one name.
    """
    path = Path(path)
    file = parse(path)
    metres = metres_per_unit(path, file)
    entity = _choose(path, file.by_type("IfcBuilding"), building)
    storeys = [e for e in file.by_type("IfcBuildingStorey") if entity in ancestors(e)]
    if not storeys:
        raise InputError(path, "holds no IfcBuildingStorey", "export the building with its storeys")
    return Model(
        path=path,
        file=file,
        metres=metres,
        entity=entity,
        building=label(entity) or path.stem,
        storeys=_stacked(path, storeys, metres),
    )


def ancestors(element: Entity) -> Iterator[Entity]:
    """Yield what holds an element (assembly, opening, wall, room, storey ...), nearest first."""
    seen: set[int] = set()
    waiting = [element]
    while waiting:
        current = waiting.pop(0)
        for holder in _holders(current):
            # a damaged file may go round in circles
            if holder is not None and holder.id() not in seen:
                seen.add(holder.id())
                waiting.append(holder)
                yield holder


def label(entity: Entity) -> str | None:
    """Return an instance's name, or its long name; None if it has neither."""
    for value in (entity.Name, getattr(entity, "LongName", None)):
        if value and value.strip():
            return str(value.strip())
    return None


def parts(element: Entity) -> list[Entity]:
    """Return the parts an element is assembled of."""
    return [
        part
        for relation in getattr(element, "IsDecomposedBy", ())
        for part in relation.RelatedObjects or ()
    ]


def _holders(element: Entity) -> Iterator[Entity]:
    for relation in getattr(element, "ContainedInStructure", ()):
        yield relation.RelatingStructure
    for name in ("Decomposes", "Nests"):
        for relation in getattr(element, name, ()):
            yield relation.RelatingObject
    for relation in getattr(element, "FillsVoids", ()):
        yield relation.RelatingOpeningElement
    for relation in getattr(element, "VoidsElements", ()):
        yield relation.RelatingBuildingElement


def _choose(path: Path, buildings: list[Entity], name: str | None) -> Entity:
    names = ", ".join(f"'{label(building) or '(unnamed)'}'" for building in buildings)
    if not buildings:
        raise InputError(path, "holds no IfcBuilding", "export the building, not only its parts")
    if name is None:
        if len(buildings) > 1:
            why = f"holds {len(buildings)} buildings: {names}"
            raise InputError(path, why, "name the building to be read")
        return buildings[0]
    found = [building for building in buildings if label(building) == name]
    if len(found) != 1:
        why = f"has {len(found)} buildings named '{name}'"
        raise InputError(path, why, f"choose one of {names}, each with its own name")
    return found[0]


def _stacked(path: Path, entities: list[Entity], metres: float) -> tuple[Storey, ...]:
    """Return the storeys from the lowest up, each with the elevation of the next."""
    storeys = [Storey(label(e) or f"#{e.id()}", e, _elevation(e, metres)) for e in entities]
    for storey in storeys:
        if sum(storey.name == other.name for other in storeys) > 1:
            why = f"IfcBuildingStorey: two storeys are named '{storey.name}'"
            raise InputError(path, why, "give each storey its own name")
    heights = sorted(s.elevation_m for s in storeys if s.elevation_m is not None)
    return tuple(
        Storey(s.name, s.entity, s.elevation_m, _next(heights, s.elevation_m))
        for s in sorted(storeys, key=lambda s: math.inf if s.elevation_m is None else s.elevation_m)
    )


def _next(heights: list[float], elevation_m: float | None) -> float:
    above = [h for h in heights if elevation_m is not None and h > elevation_m]
    return above[0] if above else math.inf


def _elevation(storey: Entity, metres: float) -> float | None:
    if storey.ObjectPlacement is not None:
        matrix = ifcopenshell.util.placement.get_local_placement(storey.ObjectPlacement)
        return float(matrix[2, 3]) * metres
    return None if storey.Elevation is None else float(storey.Elevation) * metres
