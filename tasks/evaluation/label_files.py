"""Truth that is point labels: labelled clouds named by a TOML or JSON file, and the S3DIS layout.

Coordinates are metres in the building frame, z up: labels have to lie where the scans lie.
"""

import json
import re
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationError

from storage.errors import InputError
from tasks.evaluation.label_columns import Columns, read_columns, read_rows
from tasks.params import Params

FLOOR, CEILING, WALL, DOOR, WINDOW = "floor", "ceiling", "wall", "door", "window"
TABLE, CHAIR, OTHER = "table", "chair", "other"
ROLES = (FLOOR, CEILING, WALL, DOOR, WINDOW, TABLE, CHAIR, OTHER)
"""What is compared; the last three are classes of furniture."""
NOTHING = "clutter"
"""The role of labels that nothing found is compared with."""
Role = Literal["floor", "ceiling", "wall", "door", "window", "table", "chair", "other", "clutter"]
S3DIS = {
    "floor": FLOOR, "ceiling": CEILING, "wall": WALL, "door": DOOR, "window": WINDOW,
    "table": TABLE, "chair": CHAIR, "sofa": OTHER, "bookcase": OTHER,
    "beam": NOTHING, "column": NOTHING, "board": NOTHING, "clutter": NOTHING, "stairs": NOTHING,
}  # fmt: skip
"""Role of each class of S3DIS (Armeni et al. 2016)."""
ANNOTATIONS = "Annotations"
CLASS_NAMES, OBJECT_NAMES = ("label", "class"), ("instance", "object")
"""Names by which a property is found that the file does not name."""


@dataclass(frozen=True, eq=False)
class LabelledPoints:
    """n points of which somebody has said what they are; entry i is one point in every array."""

    building: str
    storey: str
    simulated: bool
    xyz: NDArray[np.float64]
    """(n, 3), metres, building frame"""
    roles: NDArray[np.int8]
    """(n,), index into ROLES; -1 where nothing is compared"""
    objects: NDArray[np.int64]
    """(n,), number of the object within its room and role; -1 where unknown"""
    rooms: NDArray[np.int64]
    """(n,), index into `room_names`"""
    room_names: tuple[str, ...]
    room_classes: tuple[str | None, ...]
    """class of each room, None if unknown"""

    def __len__(self) -> int:
        return len(self.xyz)

    def of_role(self, role: str) -> NDArray[np.int64]:
        """Return the indices of the points of one role."""
        return np.flatnonzero(self.roles == ROLES.index(role))


class _Manifest(Params):
    """A TOML or JSON file that says what the numbers in labelled clouds mean."""

    building: str = Field(min_length=1)
    storey: str = Field(min_length=1)
    simulated: bool = False
    points: tuple[str, ...] = Field(min_length=1)
    """PLY or PCD files, relative to the file that names them"""
    class_property: str | None = None
    """property that holds a point's class; None: label or class"""
    object_property: str | None = None
    """property that numbers objects; None: instance or object, where there is one"""
    room_property: str | None = None
    """property that numbers rooms; None: each file is one room"""
    classes: dict[int, Role]
    """role of each number"""


def is_labels(path: Path) -> bool:
    """Return whether a path is read as point labels: TOML, a folder, or JSON that names points."""
    if path.suffix.lower() != ".json":
        return path.is_dir() or path.suffix.lower() == ".toml"
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, json.JSONDecodeError):
        return False  # whoever reads it as what it may be else says what is wrong
    return isinstance(document, dict) and "points" in document


def label_files(path: Path) -> tuple[Path, ...]:
    """Return every file the labels are read from, sorted: their bytes are the labels' content."""
    if path.is_dir():
        return tuple(file for room in _s3dis_rooms(path) for file in _annotations(room))
    return (path, *(path.parent / name for name in _manifest(path).points))


def read_labels(path: Path) -> LabelledPoints:
    """Return labelled points.

    Parameters
    ----------
    path : one of
        a TOML or JSON file: `building`, `storey`, `points` (PLY or PCD files), `classes` (number ->
        one of ROLES or "clutter") and, where needed, `class_property`, `object_property`,
        `room_property`, `simulated`;
        a folder in S3DIS layout, an area of rooms or one room: `<room>/Annotations/<class>_<n>.txt`
        with x y z in each row. A room `office_3` is of class office; building and storey are named
        as the folder.

    Raises
    ------
    InputError
        Naming the file, the field that is wrong, and the remedy.
    """
    return _s3dis(path) if path.is_dir() else _named(path)


def _named(path: Path) -> LabelledPoints:
    manifest = _manifest(path)
    parts = []
    names: list[str] = []
    for file in manifest.points:
        source = path.parent / file
        columns = read_columns(source)
        xyz = np.column_stack([_column(source, columns, (axis,)) for axis in "xyz"])
        if not np.isfinite(xyz).all():
            raise InputError(source, "holds coordinates that are not finite", "leave them out")
        classes = _numbers(source, columns, _asked(manifest.class_property, CLASS_NAMES))
        objects = np.full(len(xyz), -1)
        if manifest.object_property is not None or columns.keys() & set(OBJECT_NAMES):
            objects = _numbers(source, columns, _asked(manifest.object_property, OBJECT_NAMES))
        rooms = np.full(len(xyz), len(names))
        if manifest.room_property is None:
            names.append(Path(file).stem)
        else:
            rooms = _numbers(source, columns, (manifest.room_property,))
        roles = _roles(path, source, classes, manifest)
        parts.append((xyz.astype(np.float64), roles, objects, rooms))
    xyz, roles, objects, rooms = (np.concatenate(some) for some in zip(*parts, strict=True))
    if manifest.room_property is not None:
        numbers, rooms = np.unique(rooms, return_inverse=True)
        names = [str(number) for number in numbers]
    return LabelledPoints(
        building=manifest.building,
        storey=manifest.storey,
        simulated=manifest.simulated,
        xyz=xyz,
        roles=roles,
        objects=objects,
        rooms=rooms,
        room_names=tuple(names),
        room_classes=(None,) * len(names),
    )


def _manifest(path: Path) -> _Manifest:
    try:
        text = path.read_text(encoding="utf-8")
        given = tomllib.loads(text) if path.suffix.lower() == ".toml" else json.loads(text)
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})", "check the path") from error
    except (UnicodeDecodeError, tomllib.TOMLDecodeError, json.JSONDecodeError) as error:
        raise InputError(path, f"is neither TOML nor JSON ({error})", "correct it") from error
    try:
        return _Manifest.model_validate(given)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "the file"
        known = "see read_labels for the fields of a file of point labels"
        raise InputError(path, f"'{where}': {first['msg'].lower()}", known) from error


def _roles(
    path: Path, source: Path, classes: NDArray[np.int64], manifest: _Manifest
) -> NDArray[np.int8]:
    numbers, at = np.unique(classes, return_inverse=True)
    unknown = [int(number) for number in numbers if int(number) not in manifest.classes]
    if unknown:
        wrong = f"'classes' does not say what {unknown[0]} in {source.name} is"
        raise InputError(path, wrong, f"add it as one of {', '.join((*ROLES, NOTHING))}")
    roles = [manifest.classes[int(number)] for number in numbers]
    return np.array([_index(role) for role in roles], np.int8)[at]


def _index(role: str) -> int:
    return -1 if role == NOTHING else ROLES.index(role)


def _asked(name: str | None, usual: tuple[str, ...]) -> tuple[str, ...]:
    return usual if name is None else (name,)


def _column(path: Path, columns: Columns, names: tuple[str, ...]) -> NDArray[Any]:
    for name in names:
        if name in columns:
            return columns[name]
    wrong = f"has no property {' or '.join(repr(name) for name in names)}"
    raise InputError(path, wrong, f"it has {', '.join(columns)}: name the right one")


def _numbers(path: Path, columns: Columns, names: tuple[str, ...]) -> NDArray[np.int64]:
    values = _column(path, columns, names)
    if not np.array_equal(values, np.rint(values)):
        wrong = f"property {' or '.join(repr(name) for name in names)} holds fractions"
        raise InputError(path, wrong, "expected whole numbers")
    return values.astype(np.int64)


def _s3dis(path: Path) -> LabelledPoints:
    rooms = _s3dis_rooms(path)
    xyz, roles, objects, of = [], [], [], []
    for i, room in enumerate(rooms):
        for number, file in enumerate(_annotations(room)):
            points = read_rows(file)
            xyz.append(points)
            roles.append(np.full(len(points), _index(S3DIS[_class_of(file)]), np.int8))
            objects.append(np.full(len(points), number))
            of.append(np.full(len(points), i))
    return LabelledPoints(
        building=path.resolve().name,
        storey=path.resolve().name,
        simulated=False,
        xyz=np.concatenate(xyz),
        roles=np.concatenate(roles),
        objects=np.concatenate(objects),
        rooms=np.concatenate(of),
        room_names=tuple(room.resolve().name for room in rooms),
        room_classes=tuple(re.sub(r"_\d+$", "", room.resolve().name) for room in rooms),
    )


def _s3dis_rooms(path: Path) -> list[Path]:
    if (path / ANNOTATIONS).is_dir():
        return [path]
    rooms = sorted(room for room in path.iterdir() if (room / ANNOTATIONS).is_dir())
    if not rooms:
        remedy = "expected the S3DIS layout, ROOM/Annotations/CLASS_N.txt"
        raise InputError(path, f"holds no folder with '{ANNOTATIONS}'", remedy)
    return rooms


def _annotations(room: Path) -> list[Path]:
    files = sorted((room / ANNOTATIONS).glob("*.txt"))
    if not files:
        raise InputError(room / ANNOTATIONS, "holds no '*.txt'", "copy the annotations again")
    for file in files:
        if _class_of(file) not in S3DIS:
            wrong = f"'{_class_of(file)}' is no class of S3DIS"
            raise InputError(file, wrong, f"expected one of {', '.join(S3DIS)}")
    return files


def _class_of(file: Path) -> str:
    return re.sub(r"_\d+$", "", file.stem)
