"""IFC files of STEP text, parsed and checked: nothing damaged goes on to the geometry kernel."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache, partial
from pathlib import Path
from typing import Any

import ifcopenshell
import ifcopenshell.util.unit
import shapely
from ifcopenshell.validate import ValidationError, assert_valid

from storage.errors import InputError

CHECKED = ("IfcRepresentationItem", "IfcProfileDef", "IfcObjectPlacement")
"""What the geometry kernel draws; an attribute must not be empty where the schema wants a value."""
LINKS = (
    "IfcProduct",
    "IfcProductRepresentation",
    "IfcRelationship",
    "IfcRepresentation",
    "IfcRepresentationMap",
)
"""What leads it there; exporters leave some of their lists and values empty."""
UNCHECKED = ("IfcCartesianPoint", "IfcDirection", "IfcCartesianPointList3D")
"""The bulk of a file; a wrong number in them is an error of the kernel's that can be caught."""
REMEDY = "check it with an IFC validator and export it again"
FAULTS = (
    ifcopenshell.Error,
    shapely.errors.ShapelyError,
    ArithmeticError,
    AssertionError,
    AttributeError,
    LookupError,
    RecursionError,
    RuntimeError,
    TypeError,
    ValueError,
)
"""What reading a value of the wrong type leads to."""


@contextmanager
def strict(path: Path | str) -> Iterator[None]:
    """Tell a file that parses and yet breaks its schema's rules as InputError.

    Any attribute may then hold a value of another type; the library that reads it fails with
    whatever error that leads to.
    """
    try:
        yield
    except FAULTS as error:
        why = f"breaks the rules of its IFC schema ({type(error).__name__}: {error})"
        raise InputError(path, why, REMEDY) from error


def parse(path: Path) -> Any:
    """Return the `ifcopenshell.file` of an IFC file, or raise InputError if it is damaged."""
    text = "is no IFC file of STEP text"
    remedy = "export the building as IFC2x3 or IFC4 (.ifc), unpacked"
    try:
        with path.open("rb") as stream:
            head = stream.read(4096)
            stream.seek(max(0, stream.seek(0, 2) - 4096))
            tail = stream.read()
    except OSError as error:
        why = f"cannot be read ({error.strerror})"
        raise InputError(path, why, "check the path") from error
    if b"ISO-10303-21;" not in head:
        raise InputError(path, text, remedy)
    if b"END-ISO-10303-21;" not in tail:
        why = "is cut short: it does not end with END-ISO-10303-21"
        raise InputError(path, why, "copy or export the file again")
    ifcopenshell.get_log()  # what earlier files left
    try:
        file = ifcopenshell.open(str(path))
    except (ifcopenshell.Error, RuntimeError, OSError) as error:
        raise InputError(path, f"{text} ({error})", remedy) from error
    complaints = re.findall(r"\[error\] (?:\[[^\]]*\] )?(.*)", ifcopenshell.get_log(), re.I)
    if complaints:
        why = f"is damaged ({complaints[0].strip()}; {len(complaints)} such faults)"
        raise InputError(path, why, "export the file again")
    _check_geometry(path, file)
    return file


def _check_geometry(path: Path, file: Any) -> None:
    """Refuse geometry whose attributes are of other types than its schema says.

    The geometry kernel takes them for granted, and a polyline of no points ends the process.
    """
    schema = ifcopenshell.schema_by_name(file.schema_identifier)
    attributes = cache(partial(_attributes, schema))
    for type_ in (*CHECKED, *LINKS):
        for item in file.by_type(type_):
            if item.is_a() in UNCHECKED:
                continue
            expected = attributes(item.is_a())
            sound = len(item) == len(expected) and all(
                (type_ in LINKS and value in (None, ())) or _fits(schema, attribute, value)
                for attribute, value in zip(expected, item, strict=True)
            )
            if not sound:
                why = f"{item.is_a()} #{item.id()}: breaks the rules of {file.schema_identifier}"
                raise InputError(path, why, REMEDY)


def _attributes(schema: Any, type_: str) -> list[Any]:
    """Return the attributes of a type; None for one that follows from others."""
    declaration = schema.declaration_by_name(type_).as_entity()
    pairs = zip(declaration.all_attributes(), declaration.derived(), strict=True)
    return [None if derived else attribute for attribute, derived in pairs]


def _fits(schema: Any, attribute: Any, value: Any) -> bool:
    if attribute is None:
        return True
    if value is None:
        return bool(attribute.optional())
    try:
        return bool(assert_valid(attribute.type_of_attribute(), value, schema, attr=attribute))
    except (ValidationError, TypeError):
        return False


def metres_per_unit(path: Path, file: Any) -> float:
    """Return the metres per unit of length, or raise InputError if the file states none."""
    unit = next(
        (
            ifcopenshell.util.unit.get_project_unit(file, "LENGTHUNIT")
            for assignment in file.by_type("IfcUnitAssignment")[:1]
        ),
        None,
    )
    if unit is None:
        remedy = "export the project with an IfcUnitAssignment that has a LENGTHUNIT"
        raise InputError(path, "IfcProject: states no unit of length", remedy)
    return float(ifcopenshell.util.unit.calculate_unit_scale(file))
