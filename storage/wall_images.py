"""Label and depth images of the walls of a storey, one of each per wall face (Sec. 5)."""

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from storage.artifacts import Kind, column, register, schema

NOT_SEEN, OCCUPIED, EMPTY, OCCLUDED = 0, 1, 2, 3
"""What rays say of a pixel: none was cast at it; the wall was hit; a ray went through; all were
stopped before it."""


@dataclass(frozen=True, eq=False)
class WallImages:
    """f wall faces, each the side of one wall piece that one room looks at. Building frame, metres.

    Column i, row j of a face's images covers [i, i + 1) `pixel_m` along the face from its origin
    and [j, j + 1) `pixel_m` up from its base.
    """

    pixel_m: float
    """edge of a pixel"""
    walls: NDArray[np.int32]
    """(f,), row of the wall piece"""
    rooms: NDArray[np.int32]
    """(f,), room that looks at the face"""
    opposite: NDArray[np.int32]
    """(f,), face on the other side of the wall piece; -1 for none"""
    origins: NDArray[np.float64]
    """(f, 2), plan point on the face where column 0 begins"""
    axes: NDArray[np.float64]
    """(f, 2), unit, along the columns; the room lies to the left"""
    base_m: NDArray[np.float64]
    """(f,), height where row 0 begins"""
    labels: tuple[NDArray[np.uint8], ...]
    """per face (a, b): NOT_SEEN, OCCUPIED, EMPTY or OCCLUDED"""
    depths: tuple[NDArray[np.float32], ...]
    """per face (a, b), metres by which the surface seen there lies behind the face (+) or before
    it (-); of an EMPTY pixel what was seen through it, capped; NaN unknown"""
    empty: tuple[NDArray[np.uint8], ...]
    """per face (a, b), share of the rays that reached the face and went through, 255 for all"""
    rays: NDArray[np.int64]
    """(f,), rays cast at the face"""

    def __len__(self) -> int:
        return len(self.walls)

    def normals(self) -> NDArray[np.float64]:
        """Return the faces' unit plan normals, (f, 2), which point into their rooms."""
        return np.column_stack([-self.axes[:, 1], self.axes[:, 0]])


_FLOATS = (
    ("origin_x_m", "plan point where column 0 begins"),
    ("origin_y_m", "plan point where column 0 begins"),
    ("axis_x", "unit, along the columns; the room lies to the left"),
    ("axis_y", "unit, along the columns; the room lies to the left"),
    ("base_m", "height where row 0 begins"),
)
_IMAGES = (
    ("label", "a byte per pixel: 0 not seen, 1 occupied, 2 empty, 3 occluded"),
    ("depth_m", "float32 per pixel: behind the face (+) or before it (-); NaN unknown"),
    ("empty_share", "a byte per pixel: 255 where all rays that reached the face went through"),
)
SCHEMA = schema(
    "wall_images",
    [
        column("face", pa.int32(), "number of the face"),
        column("wall", pa.int32(), "row of the wall piece"),
        column("room", pa.int32(), "room that looks at it"),
        column("opposite", pa.int32(), "face on the wall's other side", nullable=True),
        *(column(name, pa.float64(), about) for name, about in _FLOATS),
        column("rays", pa.int64(), "rays cast"),
        column("columns", pa.int32(), "pixels along the face"),
        column("rows", pa.int32(), "pixels up"),
        *(column(name, pa.binary(), about + ", column by column") for name, about in _IMAGES),
    ],
)


def to_table(images: WallImages) -> pa.Table:
    """Return one row per face."""
    shapes = np.array([label.shape for label in images.labels], np.int32).reshape(-1, 2)
    numbers = np.column_stack([images.origins, images.axes, images.base_m])
    metadata = SCHEMA.metadata | {b"mapsense.pixel_m": repr(images.pixel_m).encode()}
    stacks = (images.labels, images.depths, images.empty)
    return pa.table(
        [
            pa.array(np.arange(len(images), dtype=np.int32)),
            pa.array(images.walls),
            pa.array(images.rooms),
            pa.array(images.opposite, mask=images.opposite < 0),
            *(pa.array(numbers[:, i]) for i in range(len(_FLOATS))),
            pa.array(images.rays),
            pa.array(shapes[:, 0]),
            pa.array(shapes[:, 1]),
            *(pa.array([image.tobytes() for image in s], pa.binary()) for s in stacks),
        ],
        schema=SCHEMA.with_metadata(metadata),
    )


def from_table(table: pa.Table) -> WallImages:
    """Return the images a table holds."""
    numbers = np.column_stack([table[name].to_numpy() for name, _ in _FLOATS])
    shapes = np.column_stack([table["columns"].to_numpy(), table["rows"].to_numpy()])
    label, depth, empty = (table[name].to_pylist() for name, _ in _IMAGES)
    return WallImages(
        pixel_m=float(table.schema.metadata[b"mapsense.pixel_m"]),
        walls=table["wall"].to_numpy(),
        rooms=table["room"].to_numpy(),
        opposite=table["opposite"].fill_null(-1).to_numpy(),
        origins=numbers[:, 0:2],
        axes=numbers[:, 2:4],
        base_m=numbers[:, 4],
        labels=tuple(
            np.frombuffer(b, np.uint8).reshape(s) for b, s in zip(label, shapes, strict=True)
        ),
        depths=tuple(
            np.frombuffer(b, np.float32).reshape(s) for b, s in zip(depth, shapes, strict=True)
        ),
        empty=tuple(
            np.frombuffer(b, np.uint8).reshape(s) for b, s in zip(empty, shapes, strict=True)
        ),
        rays=table["rays"].to_numpy(),
    )


WALL_IMAGES = register(Kind("wall_images", WallImages, SCHEMA, to_table, from_table))
