"""The triangle mesh of a storey of an IFC building: elements as modelled, ready for ray casting.

Doors are shut as the model draws them, unless they are named as open. Where a model has no ceiling
or no floor over most of a room (architects' models often leave them to others), the room's IfcSpace
lends its own top or bottom faces: a scan would otherwise look into the void.
"""

import math
from collections.abc import Collection
from pathlib import Path

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field, NonNegativeFloat

from storage.errors import InputError
from storage.ifc.model import Entity, Model, Storey, ancestors, open_model
from storage.ifc.parse import strict
from storage.ifc.rooms import spaces
from storage.ifc.shapes import Shape, Shapes, built_shapes, footprint, whole_shapes
from tasks.params import Params
from tasks.simulation.materials import DARK, GLASS, MATT
from tasks.simulation.mesh import Mesh

FAR_M = 8192.0
"""From here on a float32 coordinate is coarser than half a millimetre."""
LUMA = np.array((0.2126, 0.7152, 0.0722))
"""Weights of red, green and blue in ITU-R BT.709."""
LEVEL_MIN = 0.3
"""Least vertical part of the normal of a floor or a ceiling: roofs up to 72 degrees steep."""
BOUNDARIES = ("IfcSlab", "IfcCovering", "IfcRoof", "IfcPlate")
"""Floors and ceilings, which may belong to the storey above or below."""


class IfcMeshParams(Params):
    """How the elements of a building model become what a depth sensor sees."""

    glass_transparency: float = Field(default=0.3, gt=0, le=1)
    """A style at least this transparent is glass; exporters write 0.4 to 0.9 for it. Assumption."""
    dark_luminance: float = Field(default=0.15, ge=0, lt=1)
    """A style whose colour is no lighter than this is dark (0 black, 1 white). Assumption."""
    overlap_m: NonNegativeFloat = 0.1
    """Height an element of another storey shares with this one to be in its mesh. Assumption."""
    boundary_m: NonNegativeFloat = 0.5
    """How far beyond the storey's height its slabs and ceilings are looked for. Assumption."""
    reach_m: NonNegativeFloat = 1.5
    """How far over a room's top or under its bottom a ceiling or a floor closes it. Assumption."""
    covered_min: float = Field(default=0.5, ge=0, le=1)
    """Least share of a room that a ceiling must cover; else its own top closes it. Assumption."""


def ifc_mesh(
    path: Path | str,
    storey: str,
    params: IfcMeshParams,
    open_doors: Collection[str] = (),
    building: str | None = None,
) -> Mesh:
    """Return the mesh of a storey's elements, in the frame of `storage.plan_ifc`'s plans.

    Parameters
    ----------
    path : an IFC file
    storey : name of the storey
    open_doors : GlobalIds of the doors that stand open: they are left out, the openings are holes
    building : name of the building; needed only where the file holds several

    Returns
    -------
    Mesh
        Everything with a body that is on the storey or reaches into it, with the openings cut:
        walls, slabs, ceilings, doors, windows, columns, stairs, furniture, appliances. Glass is
        what its style says (transparency or name), and what has no style in a window or a curtain
        wall's panel; dark is what has a dark colour.

    Raises
    ------
    InputError
        As `read_ifc_storey` does; if an open door is not in the file; if the building stands so far
        from the origin that single precision would blur it.
    """
    with strict(path):
        return _mesh(open_model(path, building), storey, params, open_doors)


def _mesh(model: Model, storey: str, params: IfcMeshParams, open_doors: Collection[str]) -> Mesh:
    chosen = model.storey(storey)
    elements = [e for e in model.of_type("IfcElement") if _is_solid(e)]
    _check_doors(model, elements, open_doors)
    rooms = spaces(model, chosen, whole := whole_shapes(model, model.of_type("IfcSpace")))
    room_shapes = [whole[room.id()] for room in rooms]
    there = [e for e in elements if e.GlobalId not in open_doors and _may_reach(model, chosen, e)]
    shapes = built_shapes(model, there)
    inside = _inside(model, chosen, elements, shapes, room_shapes, params)
    parts = [(shape, _materials(e, shape, params)) for e, shape in inside]
    surfaces = _Level([shape for shape, _ in parts])
    closing = [face for shape in room_shapes for face in _missing(shape, surfaces, params)]
    return _merged(model, [*parts, *((f, np.full(len(f.triangles), MATT)) for f in closing)])


def _is_solid(element: Entity) -> bool:
    """Whether an element is something that stands in a building: no hole, no virtual boundary."""
    virtual = ("IfcFeatureElement", "IfcOpeningElement", "IfcVirtualElement")
    return element.Representation is not None and not any(element.is_a(v) for v in virtual)


def _may_reach(model: Model, storey: Storey, element: Entity) -> bool:
    """Whether an element can be in a storey's mesh; another storey's furniture cannot."""
    return not element.is_a("IfcFurnishingElement") or model.storey_of(element) in (storey, None)


def _check_doors(model: Model, elements: list[Entity], open_doors: Collection[str]) -> None:
    doors = {element.GlobalId for element in elements if element.is_a("IfcDoor")}
    for id_ in open_doors:
        if id_ not in doors:
            model.fail(f"has no IfcDoor '{id_}' with a body", "name doors by their GlobalId")


def _inside(
    model: Model,
    storey: Storey,
    elements: list[Entity],
    shapes: Shapes,
    rooms: list[Shape],
    params: IfcMeshParams,
) -> list[tuple[Entity, Shape]]:
    """Return the elements of a storey and those of others that reach into its height."""
    low, high = _heights(storey, rooms)
    found = []
    for element in elements:
        shape = shapes.get(element.id())
        if shape is None:
            continue
        overlap = min(shape.high_m, high) - max(shape.low_m, low)
        bounds = any(element.is_a(type_) for type_ in BOUNDARIES)
        least = -params.boundary_m if bounds else params.overlap_m
        if model.storey_of(element) is storey or overlap >= least:
            found.append((element, shape))
    return found


def _heights(storey: Storey, rooms: list[Shape]) -> tuple[float, float]:
    """Return the z from which to which a storey reaches; from infinity down if nothing tells."""
    if storey.elevation_m is None and not rooms:
        return math.inf, -math.inf
    floors, ceilings = [room.low_m for room in rooms], [room.high_m for room in rooms]
    low = min(floors, default=math.inf)
    if storey.elevation_m is None:
        return low, float(np.median(ceilings))
    # some files call the height of the suspended ceilings a storey
    return min(low, storey.elevation_m), max([storey.next_m, *_median(ceilings)])


def _median(values: list[float]) -> list[float]:
    return [float(np.median(values))] if values else []


def _materials(element: Entity, shape: Shape, params: IfcMeshParams) -> NDArray[np.int64]:
    """Return (t,) the code of each triangle of an element."""
    transparency, luminance = shape.colours[:, 3], shape.colours[:, :3] @ LUMA
    # comparisons with NaN, the unknown, are false
    glass = shape.glazed | (transparency >= params.glass_transparency)
    if element.is_a("IfcWindow") or any(e.is_a("IfcCurtainWall") for e in ancestors(element)):
        panes = element.is_a("IfcWindow") or element.is_a("IfcPlate")
        glass |= panes & np.isnan(luminance)
    dark = luminance <= params.dark_luminance
    return np.where(glass, GLASS, np.where(dark, DARK, MATT))


class _Level:
    """The triangles of a mesh that lie more or less level, found by place and height."""

    def __init__(self, shapes: list[Shape]) -> None:
        corners = [_level(shape.vertices[shape.triangles]) for shape in shapes]
        self.corners = np.concatenate([*corners, np.empty((0, 3, 3))])
        self._areas = shapely.polygons(self.corners[:, :, :2])
        self._tree = shapely.STRtree(self._areas)

    def share(self, area: shapely.Geometry, low_m: float, high_m: float) -> float:
        """Return the share of an area that is covered between two heights."""
        near = self._tree.query(area, predicate="intersects")
        z = self.corners[near, :, 2]
        near = near[(z.min(axis=1) <= high_m) & (z.max(axis=1) >= low_m)]
        return float(shapely.union_all(self._areas[near]).intersection(area).area / area.area)


def _level(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the triangles of (t, 3, 3) corners that are not steep."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    return corners[(np.abs(normals[:, 2]) >= LEVEL_MIN * lengths) & (lengths > 0)]


def _missing(room: Shape, surfaces: _Level, params: IfcMeshParams) -> list[Shape]:
    """Return the room's own top and bottom faces, where nothing else closes it."""
    area, faces = footprint(room), _level(room.vertices[room.triangles])
    if area.is_empty or room.high_m - room.low_m <= params.overlap_m:
        return []
    upper = faces[:, :, 2].mean(axis=1) > room.middle_m
    slack = params.overlap_m / 2  # a finish or a panel may stand a little into the space
    # a sloping ceiling reaches from the lowest corner of the room's top upwards
    eaves = faces[upper][:, :, 2].min(initial=room.high_m)
    sides = (
        (upper, eaves - slack, room.high_m + params.reach_m),
        (~upper, room.low_m - params.reach_m, room.low_m + slack),
    )
    return [
        _faces(faces[side])
        for side, low, high in sides
        if side.any() and surfaces.share(area, low, high) < params.covered_min
    ]


def _faces(corners: NDArray[np.float64]) -> Shape:
    n = len(corners)
    return Shape(
        corners.reshape(-1, 3),
        np.arange(3 * n).reshape(-1, 3),
        np.full((n, 4), np.nan),
        np.zeros(n, np.bool_),
    )


def _merged(model: Model, parts: list[tuple[Shape, NDArray[np.int64]]]) -> Mesh:
    if not parts:
        return Mesh(
            np.empty((0, 3), np.float32), np.empty((0, 3), np.uint32), np.empty(0, np.uint8)
        )
    starts = np.cumsum([0] + [len(shape.vertices) for shape, _ in parts[:-1]])
    vertices = np.concatenate([shape.vertices for shape, _ in parts])
    if np.abs(vertices).max() > FAR_M:
        why = f"lies {np.abs(vertices).max() / 1000:.0f} km from its origin, too far for a mesh"
        raise InputError(model.path, why, "move the IfcSite's placement to the building")
    return Mesh(
        vertices.astype(np.float32),
        np.concatenate([s.triangles + n for (s, _), n in zip(parts, starts, strict=True)]).astype(
            np.uint32
        ),
        np.concatenate([codes for _, codes in parts]).astype(np.uint8),
    )
