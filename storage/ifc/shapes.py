"""The geometry of IFC elements as triangles in metres, in the file's world coordinates."""

import os
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import ifcopenshell.geom
import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import LineString

from storage.errors import InputError
from storage.ifc.model import Entity, Model, parts

GRID_M = 1e-4
"""Raster of footprints: 0.1 mm, the decimals of a plan's file form."""
STRAIGHT_M = 5e-4
"""A footprint's corner this near the line of its neighbours is no corner."""
CRACK_M = 5e-4
"""Half the width of gaps that are closed in footprints: rounding, not building."""
Shapes = dict[int, "Shape"]
"""Shapes by the id of their element; an element without a body is not in it."""


@dataclass(frozen=True, eq=False)
class Shape:
    """t triangles over v vertices."""

    vertices: NDArray[np.float64]
    """(v, 3), metres"""
    triangles: NDArray[np.int64]
    """(t, 3), indices of vertices"""
    colours: NDArray[np.float64]
    """(t, 4), red, green, blue and transparency from 0 to 1; NaN where the file states none"""
    glazed: NDArray[np.bool_]
    """(t,), whether the name of the style says glass"""

    @cached_property
    def bounds(self) -> NDArray[np.float64]:
        """(2, 3), the least and the greatest x, y and z, metres"""
        return np.stack((self.vertices.min(axis=0), self.vertices.max(axis=0)))

    @property
    def low_m(self) -> float:
        return float(self.bounds[0, 2])

    @property
    def high_m(self) -> float:
        return float(self.bounds[1, 2])

    @property
    def middle_m(self) -> float:
        return (self.low_m + self.high_m) / 2


GLASS_WORDS = ("glass", "glas", "glaz", "verre", "vidrio", "cristal", "vetro", "vidro")
"""Glass in the names of styles: English, German, French, Spanish, Italian, Portuguese."""


def whole_shapes(model: Model, elements: Iterable[Entity]) -> Shapes:
    """Return the elements' bodies without the openings cut into them."""
    return _shapes(model, elements, {"disable-opening-subtractions": True})


def built_shapes(model: Model, elements: Iterable[Entity]) -> Shapes:
    """Return the elements' bodies as built, with their openings."""
    return _shapes(model, elements, {})


def footprint(shape: Shape) -> shapely.Geometry:
    """Return what a shape covers seen from above: polygons in metres, maybe none."""
    corners = shape.vertices[shape.triangles][:, :, :2]
    triangles = shapely.polygons(corners)
    # upright faces cover nothing
    flat = triangles[shapely.area(triangles) > GRID_M**2]
    merged = shapely.union_all(flat)
    # rounding leaves cracks between triangles: widen by a hair and shrink again
    for distance in (CRACK_M, -CRACK_M):
        merged = merged.buffer(distance, join_style="mitre")
    return shapely.simplify(shapely.set_precision(merged, GRID_M), STRAIGHT_M)


def axis_line(model: Model, element: Entity) -> LineString | None:
    """Return an element's 'Axis' representation as one line in the plan, metres, or None."""
    curves = ifcopenshell.ifcopenshell_wrapper.CURVES
    settings = _settings({"dimensionality": curves, "use-world-coords": True})
    for representation in getattr(element.Representation, "Representations", None) or ():
        if (representation.RepresentationIdentifier or "").lower() != "axis":
            continue
        try:
            geometry = ifcopenshell.geom.create_shape(settings, element, representation).geometry
        except (ifcopenshell.Error, RuntimeError):
            return None  # the body still tells where the wall is
        xy = np.reshape(geometry.verts, (-1, 3))[:, :2]
        edges = np.reshape(geometry.edges, (-1, 2)).astype(np.int64)
        lines = [line for line in shapely.linestrings(xy[edges]) if line.length > GRID_M]
        merged = shapely.line_merge(shapely.multilinestrings(lines)) if lines else None
        return merged if isinstance(merged, LineString) else None
    return None


def _shapes(model: Model, elements: Iterable[Entity], settings: dict[str, Any]) -> Shapes:
    """Return a shape per element; an assembly without a body of its own is its parts' bodies."""
    wanted = list(elements)
    bodies = {e.id(): _bodies(e) for e in wanted}
    shaped = _triangulate(model, [b for group in bodies.values() for b in group], settings)
    found: Shapes = {}
    for id_, group in bodies.items():
        pieces = [shaped[body.id()] for body in group if body.id() in shaped]
        if pieces:
            found[id_] = _joined(pieces)
    return found


def _bodies(element: Entity) -> list[Entity]:
    if element.Representation is not None:
        return [element]
    bodies: list[Entity] = []
    seen, waiting = {element.id()}, parts(element)
    while waiting:
        part = waiting.pop(0)
        if part.id() in seen or not part.is_a("IfcProduct"):
            continue
        seen.add(part.id())
        if part.Representation is None:
            waiting.extend(parts(part))
        else:
            bodies.append(part)
    return bodies


def _triangulate(model: Model, elements: list[Entity], settings: dict[str, Any]) -> Shapes:
    unique = list({e.id(): e for e in elements}.values())
    if not unique:
        return {}
    threads = os.cpu_count() or 1
    try:
        iterator = ifcopenshell.geom.iterator(
            _settings(settings), model.file, threads, include=unique
        )
        more = iterator.initialize()
        found: Shapes = {}
        while more:
            element = iterator.get()
            shape = _shape(element)
            if shape is not None:
                found[element.id] = shape
            more = iterator.next()
    except (ifcopenshell.Error, RuntimeError) as error:
        why = f"its geometry cannot be computed ({error})"
        raise InputError(model.path, why, "export the file again") from error
    # threads finish in any order
    return {id_: found[id_] for id_ in sorted(found)}


def _settings(values: dict[str, Any]) -> Any:
    settings = ifcopenshell.geom.settings()
    # apply-default-materials off: an element without a style has an unknown colour, not grey
    # use-material-names on: a style is called what the file calls it
    common = {"apply-default-materials": False, "use-material-names": True}
    for name, value in {**common, **values}.items():
        settings.set(name, value)
    return settings


def _shape(element: Any) -> Shape | None:
    geometry = element.geometry
    # placed here, not by the kernel: so it triangulates thirty equal chairs only once
    world_from_element = np.reshape(element.transformation.matrix, (4, 4), order="F")
    local = np.reshape(np.asarray(geometry.verts, np.float64), (-1, 3))
    vertices = local @ world_from_element[:3, :3].T + world_from_element[:3, 3]
    triangles = np.reshape(np.asarray(geometry.faces, np.int64), (-1, 3))
    if not len(triangles) or not np.isfinite(vertices).all():
        return None
    index = np.asarray(geometry.material_ids, np.int64)
    styles = geometry.materials
    # the last row stands for "no style": material_ids are -1 there
    colours = np.full((len(styles) + 1, 4), np.nan)
    glazed = np.zeros(len(styles) + 1, np.bool_)
    for i, style in enumerate(styles):
        colour = style.diffuse
        colours[i] = (colour.r(), colour.g(), colour.b(), style.transparency)
        glazed[i] = any(word in style.name.lower() for word in GLASS_WORDS)
    return Shape(vertices, triangles, colours[index], glazed[index])


def _joined(shapes: list[Shape]) -> Shape:
    if len(shapes) == 1:
        return shapes[0]
    starts = np.cumsum([0] + [len(shape.vertices) for shape in shapes[:-1]])
    return Shape(
        np.concatenate([shape.vertices for shape in shapes]),
        np.concatenate([s.triangles + n for s, n in zip(shapes, starts, strict=True)]),
        np.concatenate([shape.colours for shape in shapes]),
        np.concatenate([shape.glazed for shape in shapes]),
    )
