"""Named columns of labelled clouds as people have them: PLY, PCD, and text rows of x y z."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from storage.errors import InputError

Columns = dict[str, NDArray[Any]]
"""One array per property, all of one length."""

PLY_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1",
    "short": "i2", "int16": "i2", "ushort": "u2", "uint16": "u2",
    "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
PLY_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_LONGEST = 1 << 16  # bytes of header


def read_columns(path: Path) -> Columns:
    """Return all vertex properties of a PLY file, or all fields of a PCD file.

    Raises
    ------
    InputError
        If the file is missing, neither PLY nor PCD, cut short, or of a form that is not read:
        vertices with lists, elements before them, PCD compressed or with several values a field.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})", "check the path") from error
    if data.startswith((b"ply\n", b"ply\r\n")):
        return _ply(path, data)
    if path.suffix.lower() == ".pcd":
        return _pcd(path, data)
    raise InputError(path, "is neither PLY nor PCD", "export the labelled points as PLY")


def read_rows(path: Path) -> NDArray[np.float64]:
    """Return x, y and z, (n, 3), of the rows of a text file; what follows in a row is left out."""
    try:
        return np.loadtxt(path, usecols=(0, 1, 2), ndmin=2, dtype=np.float64).reshape(-1, 3)
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})", "check the path") from error
    except (ValueError, UnicodeDecodeError) as error:
        raise InputError(path, f"is no table of x y z ({error})", "correct the row") from error


def _ply(path: Path, data: bytes) -> Columns:
    end = data.find(b"end_header", 0, _LONGEST)
    start = data.find(b"\n", end) + 1
    if end < 0 or start == 0:
        raise _malformed(path, "PLY", "no line 'end_header'")
    order, count, names, types = None, None, [], []
    element = ""
    for line in data[:end].decode("ascii", "replace").splitlines():
        match line.split():
            case ["format", name, *_] if name in PLY_ORDERS:
                order = PLY_ORDERS[name]
            case ["element", name, number] if number.isdigit():
                if name != "vertex" and count is None and number != "0":
                    remedy = "write the vertices first"
                    raise InputError(path, f"element '{name}' before the vertices", remedy)
                element = name
                count = int(number) if name == "vertex" else count
            case ["property", type_, name] if type_ in PLY_TYPES and element == "vertex":
                names.append(name)
                types.append(PLY_TYPES[type_])
            case ["property", *_] if element == "vertex":
                raise InputError(path, f"'{line.strip()}' of the vertices", "export plain values")
    if order is None or count is None:
        raise _malformed(path, "PLY", "no known 'format', or no element 'vertex'")
    return _rows(path, "PLY", data[start:], order, names, types, count)


def _pcd(path: Path, data: bytes) -> Columns:
    header: dict[str, list[str]] = {}
    start = 0
    while "DATA" not in header and start < min(len(data), _LONGEST):
        stop = data.find(b"\n", start) + 1 or len(data)
        key, *values = data[start:stop].decode("ascii", "replace").split() or ["#"]
        header[key.upper()] = values
        start = stop
    lacking = [key for key in ("FIELDS", "SIZE", "TYPE", "POINTS", "DATA") if key not in header]
    if lacking:
        raise _malformed(path, "PCD", f"no line '{lacking[0]}'")
    if header["DATA"] not in (["ascii"], ["binary"]):
        remedy = "save it as ascii or binary (pcl_convert_pcd_ascii_binary)"
        raise InputError(path, f"DATA is {' '.join(header['DATA'])!r}", remedy)
    if any(count != "1" for count in header.get("COUNT", [])):
        raise InputError(path, "COUNT is not 1 for each field", "export plain values")
    kinds = {"F": "f", "I": "i", "U": "u"}
    types = [
        kinds.get(kind, "?") + size
        for kind, size in zip(header["TYPE"], header["SIZE"], strict=False)
    ]
    known = len(types) == len(header["FIELDS"]) and set(types) <= set(PLY_TYPES.values()) | {
        "i8",
        "u8",
    }
    if not known or not (header["POINTS"] and header["POINTS"][0].isdigit()):
        raise _malformed(path, "PCD", "FIELDS, SIZE, TYPE and POINTS do not agree")
    order = "" if header["DATA"] == ["ascii"] else "<"
    count = int(header["POINTS"][0])
    return _rows(path, "PCD", data[start:], order, header["FIELDS"], types, count)


def _rows(
    path: Path, form: str, body: bytes, order: str, names: list[str], types: list[str], count: int
) -> Columns:
    """Return the columns of so many rows, text where there is no byte order."""
    if len(set(names)) < len(names):
        raise _malformed(path, form, "a property stands twice")
    if order:
        row = np.dtype([(n, order + t) for n, t in zip(names, types, strict=True)])
        held = len(body) // max(row.itemsize, 1)
        if held < count:
            raise _cut(path, count, held)
        rows = np.frombuffer(body, row, count)
        return {name: np.ascontiguousarray(rows[name]) for name in names}
    try:
        values = np.loadtxt(
            body.decode("ascii", "replace").splitlines(), ndmin=2, max_rows=count or 1
        )
    except ValueError as error:
        raise InputError(path, f"is no table of numbers ({error})", "correct the row") from error
    values = values.reshape(-1, len(names)) if count else np.empty((0, len(names)))
    if len(values) < count:
        raise _cut(path, count, len(values))
    return {name: values[:, i] for i, name in enumerate(names)}


def _malformed(path: Path, form: str, what: str) -> InputError:
    return InputError(path, f"malformed {form} header: {what}", f"export the file again as {form}")


def _cut(path: Path, promised: int, held: int) -> InputError:
    wrong = f"the header promises {promised} rows, the file holds {held}"
    return InputError(path, wrong, "it is cut: copy it again")
