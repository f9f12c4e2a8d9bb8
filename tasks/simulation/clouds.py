"""Point clouds of furnished rooms with known surfaces, for benchmarks and tests. Simulated.

No sensor looks here: every surface is sampled evenly from its own side, so that what a cloud holds
is known in closed form.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tasks.simulation.patches import Box, Doors, Patches, furnished_patches

CLUTTER_SHARE = 0.005
"""Share of points that belong to no surface."""
YAW_RAD, SHIFT_M = np.deg2rad(7.0), np.array([1.3, -0.8, 0.2])
"""Where the cloud lies in the building frame: no surface on an axis, none through the origin."""
DOOR_M = 0.9
"""Width of a door opening."""
ROOMS_A_SIDE, FLOOR_LENGTH_M, ROOM_DEPTH_M, CORRIDOR_M, WALL_M = 10, 46.6, 5.0, 2.4, 0.2
"""The storey of `furnished_floor`: 47 x 13 m to the outside of its walls."""


@dataclass(frozen=True, eq=False)
class Surfaces:
    """s true surfaces of a cloud; row i is one surface in every array."""

    normals: NDArray[np.float64]
    """(s, 3), unit length, towards the side that was scanned"""
    offsets: NDArray[np.float64]
    """(s,), metres, normal . x = offset; of either sign"""
    centres: NDArray[np.float64]
    """(s, 3), metres, middle of the surface's rectangle"""
    roles: tuple[str, ...]
    """s of floor, ceiling, wall, table, seat, back, leg"""
    rooms: NDArray[np.int64]
    """(s,), the room the surface is in; a storey's corridor is 0"""
    points: NDArray[np.int64]
    """(s,), points of the cloud on the surface"""

    def __len__(self) -> int:
        return len(self.offsets)


def furnished_room(
    n_points: int, seed: int, noise_m: float = 0.01
) -> tuple[NDArray[np.float32], Surfaces]:
    """Return a 6 x 5 x 3 m room with a door opening, 2 tables and 5 chairs.

    Parameters
    ----------
    n_points : points of the cloud, clutter included
    seed : of the furniture's places, the points, the noise and their order
    noise_m : standard deviation along the normals, metres

    Returns
    -------
    xyz : (n_points, 3) float, metres, shuffled
    surfaces : the truth
    """
    rng = np.random.default_rng(seed)
    room = Box(0.0, 0.0, 6.0, 5.0, 3.0, doors={"S": ((4.2, 4.2 + DOOR_M),)})
    return _sample(furnished_patches(room, 0, 2, 5, rng), n_points, noise_m, rng)


def furnished_floor(
    n_points: int, seed: int, noise_m: float = 0.01
) -> tuple[NDArray[np.float32], Surfaces]:
    """Return a storey of 47 x 13 m: 20 furnished rooms on both sides of a corridor.

    Walls are 0.2 m thick and scanned from either side. Parameters and returns as `furnished_room`.
    """
    rng = np.random.default_rng(seed)
    south, north = _side(-WALL_M - ROOM_DEPTH_M, "N", rng), _side(CORRIDOR_M + WALL_M, "S", rng)
    doors = {
        side: tuple((room.x + a, room.x + b) for room in rooms for a, b in room.doors[towards])
        for side, rooms, towards in (("S", south, "N"), ("N", north, "S"))
    }
    corridor = Box(0.0, 0.0, FLOOR_LENGTH_M, CORRIDOR_M, 2.8, doors)
    patches = [furnished_patches(corridor, 0, 0, 0, rng)]
    for number, room in enumerate((*south, *north), start=1):
        tables, chairs = rng.integers(1, 3), rng.integers(2, 6)
        patches.append(furnished_patches(room, number, int(tables), int(chairs), rng))
    return _sample(Patches.joined(patches), n_points, noise_m, rng)


def _side(y: float, towards_corridor: str, rng: np.random.Generator) -> list[Box]:
    """Return the rooms of one side, west to east, each with a door to the corridor."""
    widths = rng.choice([2.4, 3.6, 4.8, 6.0], ROOMS_A_SIDE, p=[0.15, 0.45, 0.25, 0.15])
    widths *= (FLOOR_LENGTH_M - WALL_M * (ROOMS_A_SIDE - 1)) / widths.sum()
    starts = np.concatenate(([0.0], np.cumsum(widths[:-1] + WALL_M)))
    rooms = []
    for x, width in zip(starts, widths, strict=True):
        door = rng.uniform(0.3, width - DOOR_M - 0.3)
        doors: Doors = {towards_corridor: ((door, door + DOOR_M),)}
        rooms.append(Box(x, y, width, ROOM_DEPTH_M, 2.8, doors))
    return rooms


def _sample(
    patches: Patches, n_points: int, noise_m: float, rng: np.random.Generator
) -> tuple[NDArray[np.float32], Surfaces]:
    """Return a cloud sampled by area, with noise along the normals and clutter, shuffled."""
    n_clutter = int(n_points * CLUTTER_SHARE)
    n_surface = n_points - n_clutter
    areas = np.linalg.norm(patches.u, axis=1) * np.linalg.norm(patches.v, axis=1)
    counts = _shares(n_surface, areas)
    placed = patches.moved(_rotation(), SHIFT_M)
    xyz = np.empty((n_points, 3), np.float32)
    start = 0
    # patch by patch: a cloud of millions of points is never held in double precision
    for i, count in enumerate(counts):
        s, t, off = *rng.random((2, count, 1)), rng.normal(0.0, noise_m, (count, 1))
        points = placed.corners[i] + s * placed.u[i] + t * placed.v[i] + off * placed.normals[i]
        xyz[start : start + count] = points
        start += count
    low, high = patches.bounds()
    clutter = low + rng.random((n_clutter, 3)) * (high - low)
    xyz[n_surface:] = clutter @ _rotation().T + SHIFT_M
    return xyz[rng.permutation(n_points)], _surfaces(placed, counts)


def _shares(n: int, weights: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return whole shares of n by weight."""
    ends = np.rint(np.cumsum(weights) / weights.sum() * n).astype(np.int64)
    return np.diff(ends, prepend=0)


def _rotation() -> NDArray[np.float64]:
    cosine, sine = np.cos(YAW_RAD), np.sin(YAW_RAD)
    return np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])


def _surfaces(patches: Patches, counts: NDArray[np.int64]) -> Surfaces:
    """Return the surfaces the patches are parts of."""
    first = np.unique(patches.surface, return_index=True)[1]
    normals, centres = patches.normals[first], patches.centres[first]
    return Surfaces(
        normals=normals,
        offsets=np.einsum("ij,ij->i", normals, centres),
        centres=centres,
        roles=tuple(str(role) for role in patches.roles[first]),
        rooms=patches.rooms[first],
        points=np.bincount(patches.surface, weights=counts).astype(np.int64),
    )
