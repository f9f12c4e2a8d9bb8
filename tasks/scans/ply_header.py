"""The header of a PLY file."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from storage.errors import InputError

TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1",
    "short": "i2", "int16": "i2", "ushort": "u2", "uint16": "u2",
    "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}

_LONGEST = 1 << 20  # bytes; a header is a few hundred, comments may make it long


@dataclass(frozen=True)
class Property:
    """One property of an element."""

    name: str
    type: str
    """numpy type of the value, or of a list's values, without byte order"""
    count: str | None = None
    """numpy type of a list's length; None for a plain value"""


@dataclass(frozen=True)
class Element:
    """One element: a table of `count` rows."""

    name: str
    count: int
    properties: tuple[Property, ...]

    @property
    def has_lists(self) -> bool:
        """Whether rows vary in size."""
        return any(p.count is not None for p in self.properties)

    def dtype(self, order: str) -> np.dtype:
        """Return the packed type of a row without lists."""
        return np.dtype([(p.name, order + p.type) for p in self.properties])


@dataclass(frozen=True)
class Header:
    """What a PLY file says it holds."""

    order: str
    """byte order '<' or '>'; '' for text"""
    elements: tuple[Element, ...]
    size: int
    """bytes before the first element"""
    lines: int
    """lines before the first element"""

    def up_to_vertices(self) -> tuple[tuple[Element, ...], Element]:
        """Return the elements before the vertices, and the vertices."""
        index = [element.name for element in self.elements].index("vertex")
        return self.elements[:index], self.elements[index]


def read_header(path: Path) -> Header:
    """Return the header of a PLY file with vertices that have x, y and z."""
    with open(path, "rb") as file:
        head = file.read(_LONGEST)
    if not head.startswith((b"ply\n", b"ply\r")):
        raise _malformed(path, "the first line is not 'ply'")
    lines = _lines(path, head)
    order = _order(path, lines)
    elements = _elements(path, lines)
    _check_vertices(path, elements)
    size = sum(len(line) + 1 for line in lines)
    return Header(order, elements, size, len(lines))


def _lines(path: Path, head: bytes) -> list[bytes]:
    lines = []
    for line in head.split(b"\n"):
        lines.append(line)
        if line.strip() == b"end_header":
            return lines
    raise _malformed(path, "no line 'end_header'")


def _order(path: Path, lines: list[bytes]) -> str:
    for line in lines:
        words = line.decode("ascii", "replace").split()
        if words[:1] == ["format"]:
            if len(words) > 1 and words[1] in ORDERS:
                return ORDERS[words[1]]
            raise _malformed(path, f"unknown 'format' in {' '.join(words)!r}")
    raise _malformed(path, "no line 'format'")


def _elements(path: Path, lines: list[bytes]) -> tuple[Element, ...]:
    elements: list[Element] = []
    for number, line in enumerate(lines, 1):
        match line.decode("ascii", "replace").split():
            case ["element", name, count] if count.isdigit():
                elements.append(Element(name, int(count), ()))
            case ["element", *_]:
                raise _malformed(path, f"line {number} is no 'element NAME COUNT'")
            case ["property", *words]:
                if not elements or (new := _property(words)) is None:
                    raise _malformed(path, f"line {number} is no 'property TYPE NAME'")
                last = elements[-1]
                elements[-1] = Element(last.name, last.count, (*last.properties, new))
    return tuple(elements)


def _property(words: list[str]) -> Property | None:
    match words:
        case ["list", count, type_, name] if {count, type_} <= TYPES.keys():
            return Property(name, TYPES[type_], TYPES[count])
        case [type_, name] if type_ in TYPES:
            return Property(name, TYPES[type_])
    return None


def _check_vertices(path: Path, elements: tuple[Element, ...]) -> None:
    for element in elements:
        names = [p.name for p in element.properties]
        if len(set(names)) < len(names):
            raise _malformed(path, f"element '{element.name}' has a property twice")
    vertices = [element for element in elements if element.name == "vertex"]
    if len(vertices) != 1:
        raise _malformed(path, f"{len(vertices)} elements 'vertex', expected one")
    plain = {p.name for p in vertices[0].properties if p.count is None}
    for name in "xyz":
        if name not in plain:
            raise _malformed(path, f"element 'vertex' has no property '{name}'")


def _malformed(path: Path, what: str) -> InputError:
    return InputError(path, f"malformed PLY header: {what}", "export the file again as PLY")


def cut(path: Path, promised: int, found: str) -> InputError:
    """Return the error for a file that ends before its header's promise."""
    return InputError(
        path, f"the header promises {promised} rows, the file {found}", "it is cut: copy it again"
    )
