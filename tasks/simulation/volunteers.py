"""How a simulated volunteer scans a room: a few spots, a turn at each, level, up and down."""

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field, PositiveFloat, PositiveInt
from shapely import Polygon

from tasks.params import Params
from tasks.simulation.rotations import Quaternions, about, product

FROM_WALL_M = 0.8
"""Distance of a standing person from what is tall: the device, held before the body, then keeps
the 0.5 m the paper's volunteers were asked for (Sec. 7.1)."""
FROM_FURNITURE_M = 0.35
"""Distance of a standing person from furniture one looks over. Assumption."""
CANDIDATES = 200
"""Places a volunteer considers; enough for one each 0.3 m in a room of 20 m2."""


class VolunteerParams(Params):
    """The habits of volunteers. Not in the paper: all are assumptions."""

    area_per_spot_m2: PositiveFloat = 8.0
    """Floor area served from one spot, m2."""
    spots_min: PositiveInt = 3
    """Spots in a small room."""
    spots_max: PositiveInt = 6
    """Spots in a large room or a corridor."""
    headings: PositiveInt = 8
    """Directions looked into during one turn."""
    pitches_rad: tuple[float, ...] = (0.0, np.deg2rad(35), np.deg2rad(-35))
    """Elevations looked at in every direction, radians: level, up, down."""
    height_min_m: PositiveFloat = 1.4
    """Least height of the device over the floor, metres."""
    height_max_m: PositiveFloat = 1.6
    """Greatest height of the device over the floor, metres."""
    arm_m: float = Field(default=0.25, ge=0, le=0.3)
    """How far before the turning body the device is held, metres."""
    sway_rad: float = Field(default=np.deg2rad(3), ge=0)
    """Unsteadiness of heading, pitch and tilt, radians (standard deviation)."""
    interval_s: PositiveFloat = 0.5
    """Time between two snapshots, seconds."""


@dataclass(frozen=True, eq=False)
class Walk:
    """k true poses of the device."""

    times: NDArray[np.float64]
    """(k,), seconds from the scan's start"""
    positions: NDArray[np.float64]
    """(k, 3), metres, building frame"""
    rotations: Quaternions
    """(k, 4), device frame -> building frame"""


def walk(
    room: Polygon,
    furniture: tuple[Polygon, ...],
    floor_m: float,
    params: VolunteerParams,
    rng: np.random.Generator,
) -> Walk:
    """Return the poses of one scan: at each spot a full turn at each pitch.

    Parameters
    ----------
    room : the floor one can stand on, without what is as tall as a person, metres
    furniture : footprints of what one looks over, metres
    floor_m : height of the floor, metres
    """
    per_area = np.ceil(room.area / params.area_per_spot_m2)
    n = int(np.clip(per_area, params.spots_min, params.spots_max))
    heights = floor_m + rng.uniform(params.height_min_m, params.height_max_m, n)
    spots = np.column_stack((_spots(room, furniture, n, rng), heights))
    heading, pitch, tilt = _turns(n, params, rng)
    k = len(heading)
    ahead = np.column_stack((-np.sin(heading), np.cos(heading), np.zeros(k)))
    return Walk(
        times=np.arange(k, dtype=np.float64) * params.interval_s,
        positions=np.repeat(spots, k // n, axis=0) + params.arm_m * ahead,
        rotations=looking(heading, pitch, tilt),
    )


def _turns(n: int, params: VolunteerParams, rng: np.random.Generator) -> NDArray[np.float64]:
    """Return (3, k) heading, pitch and tilt, radians: n spots, a full turn at each pitch."""
    turn = np.arange(params.headings) * 2 * np.pi / params.headings
    start = rng.uniform(0, 2 * np.pi, n)
    steady = np.array(
        [
            (first + step, pitch, 0.0)
            for first in start
            for pitch in params.pitches_rad
            for step in turn
        ]
    ).T
    return steady + rng.normal(0, params.sway_rad, steady.shape)


def looking(
    heading_rad: NDArray[np.float64], pitch_rad: NDArray[np.float64], tilt_rad: NDArray[np.float64]
) -> Quaternions:
    """Return the (k, 4) rotations of a device held upright that looks somewhere.

    At heading 0 the camera looks along the building's y, anticlockwise from there; a pitch above 0
    looks up; tilt turns the device about its view axis.
    """
    upright = about("x", np.pi / 2 + pitch_rad)
    return product(product(about("z", heading_rad), upright), about("z", tilt_rad))


def _spots(
    room: Polygon, furniture: tuple[Polygon, ...], n: int, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Return (n, 2) places to stand, each as far as can be from those before it."""
    candidates = _standing_room(room, furniture, rng)
    chosen = [int(rng.integers(len(candidates)))]
    gap = np.full(len(candidates), np.inf)
    for _ in range(n - 1):
        gap = np.minimum(gap, np.linalg.norm(candidates - candidates[chosen[-1]], axis=1))
        chosen.append(int(np.argmax(gap)))
    return candidates[chosen]


def _standing_room(
    room: Polygon, furniture: tuple[Polygon, ...], rng: np.random.Generator
) -> NDArray[np.float64]:
    """Return (m, 2) places with free floor around them, m >= 1."""
    free = room.buffer(-FROM_WALL_M)
    free = free.difference(shapely.union_all([f.buffer(FROM_FURNITURE_M) for f in furniture]))
    if free.is_empty:  # a closet: from the middle, if anywhere
        return shapely.get_coordinates(room.representative_point())
    low, high = np.split(np.array(free.bounds), 2)
    drawn = rng.uniform(low, high, (CANDIDATES, 2))
    inside = drawn[shapely.contains_xy(free, drawn)]
    return inside if len(inside) else shapely.get_coordinates(free.representative_point())
