"""The triangle mesh of a furnished storey: what a depth sensor would see of a plan."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from storage.plan import Plan, PlanRoom
from tasks.simulation.furniture_solids import furniture_solids
from tasks.simulation.heights import known
from tasks.simulation.materials import MATT
from tasks.simulation.solids import Solid
from tasks.simulation.wall_solids import wall_solids


@dataclass(frozen=True, eq=False)
class Mesh:
    """t triangles over v vertices."""

    vertices: NDArray[np.float32]
    """(v, 3), metres, building frame"""
    triangles: NDArray[np.uint32]
    """(t, 3), indices of vertices"""
    materials: NDArray[np.uint8]
    """(t,), code of each triangle: an index of `MATERIALS`"""


def storey_mesh(plan: Plan) -> Mesh:
    """Return the mesh of any plan: floors, ceilings, walls, openings and furniture.

    Walls are solid between their openings. A door that is open, ajar or shut has a frame that
    stands out of the wall a little and a leaf: turned by 80 to 100 or by 10 to 35 degrees into its
    smaller room, or in the frame, recessed from the wall's other face. A door of unknown state is
    open and has no leaf. A window has a frame and a pane of glass in the middle of its wall.
    Furniture is oriented by its footprint and shaped by its class and kind; a chair's `top_m` is
    its total height, `furniture_solids.seat_height_m` that of its seat.

    Raises
    ------
    MapSenseError
        If a height or a thickness the mesh needs is unknown; `defaults.complete_plan` sets them.
    """
    solids = [
        *_surfaces(plan.rooms),
        *wall_solids(plan),
        *furniture_solids(plan.furniture, plan.rooms),
    ]
    if not solids:
        return Mesh(
            np.empty((0, 3), np.float32), np.empty((0, 3), np.uint32), np.empty(0, np.uint8)
        )
    starts = np.cumsum([0] + [len(solid.vertices) for solid in solids[:-1]])
    triangles = [solid.triangles + start for solid, start in zip(solids, starts, strict=True)]
    codes = np.array([solid.material for solid in solids], np.uint8)
    return Mesh(
        np.concatenate([solid.vertices for solid in solids]).astype(np.float32),
        np.concatenate(triangles).astype(np.uint32),
        np.repeat(codes, [len(part) for part in triangles]),
    )


def _surfaces(rooms: Iterable[PlanRoom]) -> Iterator[Solid]:
    """Yield the floor and the ceiling of each room."""
    for room in rooms:
        parts = shapely.get_parts(shapely.constrained_delaunay_triangles(room.polygon))
        corners = np.array([shapely.get_coordinates(part)[:3] for part in parts])
        xy = corners.reshape(-1, 2)
        triangles = np.arange(len(xy)).reshape(-1, 3)
        for name, height in (("floor_m", room.floor_m), ("ceiling_m", room.ceiling_m)):
            z = known(height, f"room '{room.id}'", name)
            yield Solid(np.column_stack((xy, np.full(len(xy), z))), triangles, MATT)
