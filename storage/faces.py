"""Wall faces of a storey: the side of a wall that a room sees, merged over all scans."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from storage.artifacts import Kind, column, register, schema

NOT_SEEN, SEEN_LOW, SEEN_OVER, SEEN_WALL = 0, 1, 2, 3
"""What a bin of a face's profile says: nothing was seen there; only something lower than a door's
lintel; only something above it, with the floor running through beneath; a wall."""


@dataclass(frozen=True, eq=False)
class Faces:
    """k wall faces; entry i is one face everywhere. Building frame, metres."""

    normals: NDArray[np.float64]
    """(k, 3), unit; faces the room where `sides` is 1"""
    offsets: NDArray[np.float64]
    """(k,), normal . x = offset"""
    sides: NDArray[np.int8]
    """(k,), 1: a room lies before the face only; 0: one lies on either side, or none is known"""
    lines: NDArray[np.float64]
    """(k, 2, 2), plan ends"""
    heights: NDArray[np.float64]
    """(k, 2), lowest and highest point"""
    weights: NDArray[np.float64]
    """(k,), square metres seen, over all scans"""
    scans: NDArray[np.int64]
    """(k,), scans that saw the face"""
    profiles: tuple[NDArray[np.uint8], ...]
    """along each face from p0, per bin of `bin_m`: NOT_SEEN, SEEN_LOW, SEEN_OVER or SEEN_WALL"""
    bin_m: float

    def __len__(self) -> int:
        return len(self.offsets)

    def take(self, rows: Sequence[int] | NDArray[np.int64]) -> "Faces":
        """Return some of the faces, in the order asked for."""
        index = np.asarray(rows, np.int64)
        return replace(
            self,
            normals=self.normals[index],
            offsets=self.offsets[index],
            sides=self.sides[index],
            lines=self.lines[index],
            heights=self.heights[index],
            weights=self.weights[index],
            scans=self.scans[index],
            profiles=tuple(self.profiles[i] for i in index),
        )


_FLOATS = (
    ("normal_x", "unit normal"),
    ("normal_y", "unit normal"),
    ("normal_z", "unit normal"),
    ("offset_m", "normal . x, building frame"),
    ("p0_x_m", "plan line"),
    ("p0_y_m", "plan line"),
    ("p1_x_m", "plan line"),
    ("p1_y_m", "plan line"),
    ("low_m", "lowest point"),
    ("high_m", "highest point"),
    ("weight_m2", "area seen, over all scans"),
)
SCHEMA = schema(
    "faces",
    [
        *(column(name, pa.float64(), about) for name, about in _FLOATS),
        column("side", pa.int8(), "1: a room before it only; 0: either side, or not known"),
        column("scans", pa.int64(), "scans that saw it"),
        column(
            "profile",
            pa.binary(),
            "a byte per bin: 0 not seen, 1 seen low, 2 seen over an opening, 3 wall",
        ),
    ],
)


def to_table(faces: Faces) -> pa.Table:
    """Return one row per face."""
    numbers = np.column_stack(
        [faces.normals, faces.offsets, faces.lines.reshape(-1, 4), faces.heights, faces.weights]
    )
    metadata = SCHEMA.metadata | {b"mapsense.bin_m": repr(faces.bin_m).encode()}
    return pa.table(
        [
            *(pa.array(numbers[:, i]) for i in range(len(_FLOATS))),
            pa.array(faces.sides),
            pa.array(faces.scans),
            pa.array([p.tobytes() for p in faces.profiles], pa.binary()),
        ],
        schema=SCHEMA.with_metadata(metadata),
    )


def from_table(table: pa.Table) -> Faces:
    """Return the faces a table holds."""
    numbers = np.column_stack([table[name].to_numpy() for name, _ in _FLOATS])
    return Faces(
        normals=numbers[:, :3],
        offsets=numbers[:, 3],
        lines=numbers[:, 4:8].reshape(-1, 2, 2),
        heights=numbers[:, 8:10],
        weights=numbers[:, 10],
        sides=table["side"].to_numpy(),
        scans=table["scans"].to_numpy(),
        profiles=tuple(np.frombuffer(p, np.uint8) for p in table["profile"].to_pylist()),
        bin_m=float(table.schema.metadata[b"mapsense.bin_m"]),
    )


FACES = register(Kind("faces", Faces, SCHEMA, to_table, from_table))
