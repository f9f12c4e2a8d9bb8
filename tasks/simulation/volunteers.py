"""How a simulated volunteer scans a room: a walk by a few spots with a turn at each."""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PositiveFloat, PositiveInt
from shapely import Polygon

from tasks.params import Params
from tasks.simulation.paths import Tour, tour
from tasks.simulation.rotations import Quaternions, about, product
from tasks.simulation.sensor import Views

SWAY_S = 1.0
"""Time over which the unsteadiness of a hand changes, seconds. Assumption."""

Spread = tuple[float, float]
"""A habit of somebody without skill (0) and of somebody with full skill (1)."""


class VolunteerParams(Params):
    """The habits of volunteers; pairs are those at skill 0 and at skill 1.

    The paper's were asked to scan slowly and to keep half a metre away (Sec. 7.1). All numbers
    are assumptions.
    """

    area_per_spot_m2: PositiveFloat = 8.0
    """Floor area served from one spot, m2."""
    spots_min: PositiveInt = 4
    """Spots in a small room."""
    spots_max: PositiveInt = 12
    """Spots in a large room or a corridor."""
    coverage: Spread = (0.4, 1.0)
    """Share of those spots that are visited."""
    from_wall_m: Spread = (0.5, 0.8)
    """Distance the body keeps from what is tall, metres: with 0.8 the device, held before it, has
    the half metre asked for."""
    speed_m_s: Spread = (1.0, 0.4)
    """Walking speed, metres a second."""
    turn_rad_s: Spread = (np.deg2rad(100), np.deg2rad(35))
    """Turning rate, radians a second."""
    turn_rad: Spread = (np.deg2rad(240), np.deg2rad(360))
    """How far is turned at a spot, radians."""
    look_up: Spread = (0.25, 1.0)
    """Chance that the upper walls and the ceiling are looked at from a spot; else they are
    skipped."""
    look_down: Spread = (0.6, 1.0)
    """Chance that the floor is looked at from a spot."""
    pitch_rad: float = Field(default=np.deg2rad(35), ge=0, lt=np.pi / 2)
    """How far up and down is looked, radians."""
    droop_rad: Spread = (np.deg2rad(45), 0.0)
    """How far the device leans back into the hand, so that it looks down, radians."""
    tilt_rad: Spread = (np.deg2rad(30), np.deg2rad(3))
    """Tilt of a scan about the view axis, radians (standard deviation)."""
    sway_rad: Spread = (np.deg2rad(8), np.deg2rad(2))
    """Unsteadiness of heading, pitch and tilt, radians (standard deviation)."""
    dropped: Spread = (0.15, 0.0)
    """Share of snapshots that are lost, as when tracking fails."""
    height_min_m: PositiveFloat = 1.3
    """Least height of the device over the floor, metres."""
    height_max_m: PositiveFloat = 1.6
    """Greatest height of the device over the floor, metres."""
    arm_m: float = Field(default=0.25, ge=0, le=0.3)
    """How far before the body the device is held, metres."""
    interval_s: PositiveFloat = 0.4
    """Time between two snapshots, seconds. (Tango: up to 5 a second.)"""


@dataclass(frozen=True, eq=False)
class Walk:
    """k true poses of the device."""

    times: NDArray[np.float64]
    """(k,), seconds from the scan's start, ascending"""
    views: Views
    """the (k,) poses"""
    path_m: float
    """length of the way walked, metres"""

    def __len__(self) -> int:
        return len(self.times)


@dataclass(frozen=True)
class Habits:
    """What one volunteer does; `VolunteerParams` says what and in which unit."""

    coverage: float
    from_wall_m: float
    speed_m_s: float
    turn_rad_s: float
    turn_rad: float
    look_up: float
    look_down: float
    droop_rad: float
    tilt_rad: float
    sway_rad: float
    dropped: float


def habits_of(skill: float, params: VolunteerParams) -> Habits:
    """Return the habits of a volunteer with a skill of 0 to 1."""
    spreads = {field.name: getattr(params, field.name) for field in fields(Habits)}
    return Habits(**{name: low + skill * (high - low) for name, (low, high) in spreads.items()})


def walk(
    room: Polygon,
    furniture: tuple[Polygon, ...],
    floor_m: float,
    skill: float,
    params: VolunteerParams,
    rng: np.random.Generator,
) -> Walk:
    """Return the poses of one scan: from spot to spot, with a turn at each, level, up and down.

    Parameters
    ----------
    room : the floor one can stand on, without what is as tall as a person, metres
    furniture : footprints of what one looks over, metres
    floor_m : height of the floor, metres
    skill : 0 to 1
    """
    habits = habits_of(skill, params)
    spots = np.clip(
        np.ceil(room.area / params.area_per_spot_m2), params.spots_min, params.spots_max
    )
    visited = max(1, round(float(spots) * habits.coverage))
    way = tour(room, furniture, habits.from_wall_m, visited, rng)
    frames = _key_frames(way, habits, params.pitch_rad, rng)
    duration = frames[-1, 0]
    times = np.arange(0.0, duration + params.interval_s, params.interval_s)
    x, y, heading, pitch = (np.interp(times, frames[:, 0], column) for column in frames.T[1:])
    unsteady = habits.sway_rad * _smooth_noise(times, 3, rng)
    heading, pitch = heading + unsteady[0], pitch - habits.droop_rad + unsteady[1]
    tilt = rng.normal(0, habits.tilt_rad) + unsteady[2]
    height = rng.uniform(params.height_min_m, params.height_max_m)
    kept = rng.random(len(times)) >= habits.dropped
    kept[0] = True
    positions = np.column_stack(
        (
            x - params.arm_m * np.sin(heading),
            y + params.arm_m * np.cos(heading),
            np.full(len(times), floor_m + height),
        )
    )
    rates = np.hypot(_rate(heading, times), _rate(pitch, times))
    views = Views(positions[kept], looking(heading, pitch, tilt)[kept], rates[kept])
    path_m = float(np.linalg.norm(np.diff(way.places, axis=0), axis=1).sum())
    return Walk(times[kept], views, path_m)


def looking(
    heading_rad: NDArray[np.float64], pitch_rad: NDArray[np.float64], tilt_rad: NDArray[np.float64]
) -> Quaternions:
    """Return the (k, 4) rotations of a device held upright that looks somewhere.

    At heading 0 the camera looks along the building's y, anticlockwise from there; a pitch above 0
    looks up; tilt turns the device about its view axis. The roll of Eq. 1 is then
    atan2(cos(pitch) cos(tilt), -sin(pitch)).
    """
    upright = about("x", np.pi / 2 + pitch_rad)
    return product(product(about("z", heading_rad), upright), about("z", tilt_rad))


def _key_frames(
    way: Tour, habits: Habits, look_rad: float, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Return (m, 5) time, x, y, heading and pitch; between two of them all change evenly."""
    heading = rng.uniform(0, 2 * np.pi)
    frames = [(0.0, *way.places[0], heading, 0.0)]
    stops = set(way.stops.tolist())

    def go_on(place: NDArray[np.float64], heading: float, pitch: float) -> None:
        time, x, y, before, pitched = frames[-1]
        walked = float(np.hypot(*(place - (x, y)))) / habits.speed_m_s
        turned = (abs(heading - before) + abs(pitch - pitched)) / habits.turn_rad_s
        frames.append((time + max(walked, turned), *place, heading, pitch))

    for index, place in enumerate(way.places):
        if index:
            x, y = frames[-1][1:3]
            ahead = np.arctan2(x - place[0], place[1] - y)
            heading += (ahead - heading + np.pi) % (2 * np.pi) - np.pi
            go_on(np.array((x, y)), heading, 0.0)
            go_on(place, heading, 0.0)
        if index in stops:
            for pitch in _pitches(habits, look_rad, rng):
                go_on(place, heading, pitch)
                heading += habits.turn_rad
                go_on(place, heading, pitch)
    return np.array(frames)


def _pitches(habits: Habits, look_rad: float, rng: np.random.Generator) -> list[float]:
    """Return the pitches of a spot's turns: level, and up and down unless they are skipped."""
    up, down = rng.random(2) < (habits.look_up, habits.look_down)
    return [0.0] + [look_rad] * bool(up) + [-look_rad] * bool(down)


def _smooth_noise(
    times: NDArray[np.float64], n: int, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Return (n, k) noise of standard deviation about 1 that changes within `SWAY_S`."""
    nodes = np.arange(0.0, times[-1] + 2 * SWAY_S, SWAY_S)
    return np.array([np.interp(times, nodes, rng.normal(size=len(nodes))) for _ in range(n)])


def _rate(angles: NDArray[np.float64], times: NDArray[np.float64]) -> NDArray[np.float64]:
    rate: NDArray[np.float64] = np.abs(np.gradient(angles, times))
    return rate
