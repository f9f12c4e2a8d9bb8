"""The plan's file form: a GeoJSON FeatureCollection in local metres, read strictly.

Every feature carries every property of its kind, so a misspelt name is a missing one. `area_m2` and
`width_m` follow from the geometry: they are written for other tools and only compared on reading.
"""

import json
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NoReturn

import shapely
from shapely import LineString, Polygon

from storage.errors import InputError
from storage.files import write_whole
from storage.plan import Plan, PlanFurniture, PlanOpening, PlanRoom, PlanWall

KINDS = ("room", "wall", "door", "window", "furniture")
STATES = ("open", "ajar", "shut", "unknown")
FURNITURE_CLASSES = ("table", "chair", "other")
LENGTH_DECIMALS = 4
"""Decimals of metres: 0.1 mm, far below any depth sensor's noise."""
AREA_TOLERANCE_M2 = 0.02
"""How far a stated area may be from the polygon's: other tools round to two decimals."""
WIDTH_TOLERANCE_M = 0.01
"""How far a stated width may be from the line's length."""


def write_plan(plan: Plan, path: Path | str) -> None:
    """Write a plan beside its target, sync, rename; a plan that could not be read back is refused.

    Raises
    ------
    InputError
        If the plan contradicts itself: a duplicate id, a dangling reference, a bad number.
    StoreError
        If the file cannot be written.
    """
    path = Path(path)
    document = to_geojson(plan)
    from_geojson(document, path)
    text = json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    write_whole(path, text.encode(), "plan")


def read_plan(path: Path | str) -> Plan:
    """Read a plan; raise InputError naming file, feature and field if anything in it is wrong."""
    try:
        text = Path(path).read_text(encoding="utf-8")
        document = json.loads(text)
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})", "check the path") from error
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        raise InputError(path, f"is no JSON ({error})", "write it as UTF-8 GeoJSON") from error
    return from_geojson(document, path)


def to_geojson(plan: Plan) -> dict[str, Any]:
    """Return the plan as a FeatureCollection; same plan, same dict, keys in the same order."""
    return {
        "type": "FeatureCollection",
        "building": plan.building,
        "storey": plan.storey,
        "simulated": plan.simulated,
        "notes": list(plan.notes),
        "features": [
            *(_room(room) for room in plan.rooms),
            *(_wall(wall) for wall in plan.walls),
            *(_opening("door", door) for door in plan.doors),
            *(_opening("window", window) for window in plan.windows),
            *(_furniture(piece) for piece in plan.furniture),
        ],
    }


def _room(room: PlanRoom) -> dict[str, Any]:
    coordinates = _rings(room.polygon)
    properties = {
        "class": room.class_,
        "name": room.name,
        "floor_m": _length(room.floor_m),
        "ceiling_m": _length(room.ceiling_m),
        "area_m2": _length(Polygon(coordinates[0], coordinates[1:]).area),
        "rule": room.rule,
        "posterior": room.posterior,
        "scans": list(room.scans),
    }
    return _feature(room.id, "room", "Polygon", coordinates, properties)


def _wall(wall: PlanWall) -> dict[str, Any]:
    properties = {
        "thickness_m": _length(wall.thickness_m),
        "base_m": _length(wall.base_m),
        "top_m": _length(wall.top_m),
        "rooms": list(wall.rooms),
    }
    return _feature(wall.id, "wall", "LineString", _positions(wall.line.coords), properties)


def _opening(kind: str, opening: PlanOpening) -> dict[str, Any]:
    coordinates = _positions(opening.line.coords)
    of_door = kind == "door"
    properties = {
        **({"state": opening.state} if of_door else {}),
        "sill_m": _length(opening.sill_m),
        "head_m": _length(opening.head_m),
        "width_m": _length(LineString(coordinates).length),
        "wall": opening.wall,
        **({"rooms": list(opening.rooms)} if of_door else {}),
        "confidence": opening.confidence,
    }
    return _feature(opening.id, kind, "LineString", coordinates, properties)


def _furniture(piece: PlanFurniture) -> dict[str, Any]:
    properties = {
        "class": piece.class_,
        "base_m": _length(piece.base_m),
        "top_m": _length(piece.top_m),
        "room": piece.room,
        "confidence": piece.confidence,
    }
    return _feature(piece.id, "furniture", "Polygon", _rings(piece.footprint), properties)


def _feature(
    id_: str, kind: str, geometry: str, coordinates: list[Any], properties: dict[str, Any]
) -> dict[str, Any]:
    return {
        "type": "Feature",
        "id": id_,
        "geometry": {"type": geometry, "coordinates": coordinates},
        "properties": {"kind": kind, **properties},
    }


def _rings(polygon: Polygon) -> list[list[list[float]]]:
    # the outer ring anticlockwise, holes clockwise: RFC 7946, section 3.1.6
    oriented = shapely.orient_polygons(polygon)
    return [_positions(ring.coords) for ring in (oriented.exterior, *oriented.interiors)]


def _positions(coordinates: Iterable[tuple[float, ...]]) -> list[list[float]]:
    return [[_round(value) for value in position[:2]] for position in coordinates]


def _length(value: float | None) -> float | None:
    return None if value is None else _round(value)


def _round(value: float) -> float:
    return round(float(value), LENGTH_DECIMALS) + 0.0  # no negative zero


def from_geojson(document: Any, source: Path | str) -> Plan:
    """Return the plan of a FeatureCollection, or raise InputError; `source` names it in errors."""
    top = _Fields(source, "the collection", document)
    if top.value("type") != "FeatureCollection":
        top.fail("type", "is no FeatureCollection", "hand over a plan as `mapsense` writes it")
    features = [_Feature(source, i, item) for i, item in enumerate(top.items("features"))]
    _check_ids(features)
    ids = {kind: {f.id for f in features if f.kind == kind} for kind in KINDS}
    of = {kind: [f for f in features if f.kind == kind] for kind in KINDS}
    return Plan(
        building=top.name("building"),
        storey=top.name("storey"),
        rooms=tuple(_read_room(f) for f in of["room"]),
        walls=tuple(_read_wall(f, ids["room"]) for f in of["wall"]),
        doors=tuple(_read_door(f, ids["wall"], ids["room"]) for f in of["door"]),
        windows=tuple(_read_window(f, ids["wall"]) for f in of["window"]),
        furniture=tuple(_read_furniture(f, ids["room"]) for f in of["furniture"]),
        simulated=top.flag("simulated"),
        notes=top.texts("notes"),
    )


class _Fields:
    """The members of one JSON object, each checked as it is taken."""

    def __init__(self, source: Path | str, owner: str, values: Any) -> None:
        self.source, self.owner, self.values = source, owner, values
        if not isinstance(values, dict):
            self.fail("itself", f"is {_shown(values)}", "expected a JSON object")

    def fail(self, field: str, wrong: str, remedy: str) -> NoReturn:
        raise InputError(self.source, f"{self.owner}: '{field}' {wrong}", remedy)

    def value(self, name: str) -> Any:
        if name not in self.values:
            self.fail(name, "is missing", "add it; write null where the value is unknown")
        return self.values[name]

    def items(self, name: str) -> list[Any]:
        value = self.value(name)
        if not isinstance(value, list):
            self.fail(name, f"is {_shown(value)}", "expected a list")
        return value

    def name(self, name: str) -> str:
        value = self.text(name)
        if not value:
            self.fail(name, f"is {_shown(value)}", "expected a text that is not empty")
        return value

    def flag(self, name: str) -> bool:
        value = self.value(name)
        if not isinstance(value, bool):
            self.fail(name, f"is {_shown(value)}", "expected true or false")
        return value

    def text(self, name: str, choices: tuple[str, ...] = ()) -> str | None:
        value = self.value(name)
        if value is not None and not isinstance(value, str):
            self.fail(name, f"is {_shown(value)}", "expected a text, or null if unknown")
        if value is not None and choices and value not in choices:
            self.fail(name, f"is {_shown(value)}", f"expected one of {', '.join(choices)} or null")
        return value

    def texts(self, name: str) -> tuple[str, ...]:
        values = self.items(name)
        if not all(isinstance(value, str) for value in values):
            self.fail(name, f"is {_shown(values)}", "expected a list of texts")
        return tuple(values)

    def number(self, name: str, low: float = -math.inf, high: float = math.inf) -> float | None:
        value = self.value(name)
        if value is None:
            return None
        if not _is_number(value):
            self.fail(name, f"is {_shown(value)}", "expected a finite number, or null if unknown")
        if not low <= value <= high:
            bounds = f"from {low:g} to {high:g}" if math.isfinite(high) else f"of {low:g} or more"
            self.fail(name, f"is {_shown(value)}", f"expected {bounds}, or null if unknown")
        return float(value)

    def interval(self, low: str, high: str) -> tuple[float | None, float | None]:
        """Return two heights after checking that the first is not above the second."""
        bottom, top = self.number(low), self.number(high)
        if bottom is not None and top is not None and bottom > top:
            self.fail(low, f"({bottom:g}) is above '{high}' ({top:g})", "swap or correct them")
        return bottom, top

    def derived(self, name: str, value: float, tolerance: float) -> None:
        """Check a number that follows from the geometry, where it is stated at all."""
        stated = self.number(name)
        if stated is not None and abs(stated - value) > tolerance + 1e-3 * value:
            wrong = f"is {stated:g}, but the geometry gives {value:.4f}"
            self.fail(name, wrong, "correct the geometry, or set the property to null")

    def reference(self, name: str, kind: str, known: set[str]) -> str | None:
        value = self.text(name)
        self._check_references(name, kind, known, () if value is None else (value,))
        return value

    def references(self, name: str, kind: str, known: set[str]) -> tuple[str, ...]:
        values = self.texts(name)
        self._check_references(name, kind, known, values)
        return values

    def _check_references(
        self, name: str, kind: str, known: set[str], values: tuple[str, ...]
    ) -> None:
        for value in values:
            if value not in known:
                wrong = f"names {_shown(value)}, and no {kind} of the plan has that id"
                self.fail(name, wrong, f"add the {kind} or correct the reference")
        if len(set(values)) < len(values):
            self.fail(name, f"is {_shown(list(values))}", f"name each {kind} once")


class _Feature(_Fields):
    """One feature: its id and kind, its geometry, and its properties as checked fields."""

    def __init__(self, source: Path | str, index: int, item: Any) -> None:
        feature = _Fields(source, f"feature number {index + 1}", item)
        self.id = feature.name("id")
        owner = f"feature '{self.id}'"
        super().__init__(source, f"{owner}, properties", feature.value("properties"))
        self.owner = owner
        self.geometry = feature.value("geometry")
        kind = self.text("kind")
        if kind not in KINDS:
            self.fail("kind", f"is {_shown(kind)}", f"expected one of {', '.join(KINDS)}")
        self.kind = kind

    def polygon(self) -> Polygon:
        rings = [self._checked(ring, at_least=4) for ring in self._coordinates("Polygon")]
        if not rings:
            self.fail("geometry", "has no ring", "give the polygon an outer ring")
        if any(ring[0] != ring[-1] for ring in rings):
            self.fail("geometry", "has an open ring", "end each ring where it begins")
        polygon = Polygon(rings[0], rings[1:])
        if not polygon.is_valid:
            why = shapely.is_valid_reason(polygon)
            self.fail("geometry", f"is no simple polygon ({why})", "redraw its outline")
        return polygon

    def line(self) -> LineString:
        line = LineString(self._checked(self._coordinates("LineString"), at_least=2))
        if line.length == 0:
            self.fail("geometry", "has no length", "give the line two different ends")
        return line

    def _coordinates(self, type_: str) -> list[Any]:
        geometry = _Fields(self.source, f"{self.owner}, geometry", self.geometry)
        if geometry.value("type") != type_:
            wrong = f"is {_shown(geometry.value('type'))}"
            geometry.fail("type", wrong, f"expected {type_} for a {self.kind}")
        return geometry.items("coordinates")

    def _checked(self, positions: Any, at_least: int) -> list[tuple[float, float]]:
        if not isinstance(positions, list) or len(positions) < at_least:
            remedy = f"expected a list of {at_least} positions or more"
            self.fail("geometry", f"has {_shown(positions)} for coordinates", remedy)
        for position in positions:
            pair = isinstance(position, list) and len(position) == 2
            if not (pair and all(_is_number(value) for value in position)):
                remedy = "expected two finite numbers, x and y in metres"
                self.fail("geometry", f"has the position {_shown(position)}", remedy)
        return [(float(x), float(y)) for x, y in positions]


def _check_ids(features: list[_Feature]) -> None:
    seen: set[str] = set()
    for feature in features:
        if feature.id in seen:
            feature.fail("id", "is taken by an earlier feature", "give each feature its own id")
        seen.add(feature.id)


def _read_room(feature: _Feature) -> PlanRoom:
    polygon = feature.polygon()
    floor, ceiling = feature.interval("floor_m", "ceiling_m")
    feature.derived("area_m2", polygon.area, AREA_TOLERANCE_M2)
    return PlanRoom(
        id=feature.id,
        polygon=polygon,
        class_=feature.text("class"),
        name=feature.text("name"),
        floor_m=floor,
        ceiling_m=ceiling,
        rule=feature.text("rule"),
        posterior=feature.number("posterior", 0, 1),
        scans=feature.texts("scans"),
    )


def _read_wall(feature: _Feature, rooms: set[str]) -> PlanWall:
    base, top = feature.interval("base_m", "top_m")
    return PlanWall(
        id=feature.id,
        line=feature.line(),
        thickness_m=feature.number("thickness_m", 0),
        base_m=base,
        top_m=top,
        rooms=feature.references("rooms", "room", rooms),
    )


def _read_door(feature: _Feature, walls: set[str], rooms: set[str]) -> PlanOpening:
    linked = feature.references("rooms", "room", rooms)
    if len(linked) > 2:
        feature.fail("rooms", f"is {_shown(list(linked))}", "name the two rooms the door links")
    return _read_opening(feature, walls, feature.text("state", STATES), linked)


def _read_window(feature: _Feature, walls: set[str]) -> PlanOpening:
    return _read_opening(feature, walls, None, ())


def _read_opening(
    feature: _Feature, walls: set[str], state: str | None, rooms: tuple[str, ...]
) -> PlanOpening:
    line = feature.line()
    sill, head = feature.interval("sill_m", "head_m")
    feature.derived("width_m", line.length, WIDTH_TOLERANCE_M)
    return PlanOpening(
        id=feature.id,
        line=line,
        sill_m=sill,
        head_m=head,
        wall=feature.reference("wall", "wall", walls),
        confidence=feature.number("confidence", 0, 1),
        state=state,
        rooms=rooms,
    )


def _read_furniture(feature: _Feature, rooms: set[str]) -> PlanFurniture:
    base, top = feature.interval("base_m", "top_m")
    return PlanFurniture(
        id=feature.id,
        footprint=feature.polygon(),
        class_=feature.text("class", FURNITURE_CLASSES),
        base_m=base,
        top_m=top,
        room=feature.reference("room", "room", rooms),
        confidence=feature.number("confidence", 0, 1),
    )


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _shown(value: Any) -> str:
    text = json.dumps(value, ensure_ascii=False, default=str)
    return text if len(text) <= 60 else text[:57] + "..."
