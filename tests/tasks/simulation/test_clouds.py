"""Benchmark clouds: their points lie on the surfaces their truth names."""

import numpy as np
import pytest

from tasks.simulation.clouds import (
    CLUTTER_SHARE,
    SHIFT_M,
    YAW_RAD,
    furnished_floor,
    furnished_room,
)


def nearest_offset(xyz: np.ndarray, surfaces, rows: np.ndarray) -> np.ndarray:
    """Return each point's distance from the nearest of some unbounded surfaces."""
    away = xyz.astype(float) @ surfaces.normals[rows].T - surfaces.offsets[rows]
    return np.abs(away).min(axis=1)


def test_all_points_but_the_clutter_lie_on_a_surface():
    xyz, surfaces = furnished_room(20_000, seed=3, noise_m=0.0)
    near = nearest_offset(xyz, surfaces, np.arange(len(surfaces))) < 1e-5
    assert xyz.shape == (20_000, 3) and xyz.dtype == np.float32
    assert surfaces.points.sum() == 20_000 * (1 - CLUTTER_SHARE)
    assert surfaces.points.sum() <= near.sum() <= 20_000


def test_the_noise_has_the_stated_spread_along_the_normal():
    xyz, surfaces = furnished_room(200_000, seed=1, noise_m=0.01)
    walls = [i for i, role in enumerate(surfaces.roles) if role == "wall"]
    inside = (xyz @ surfaces.normals[walls].T - surfaces.offsets[walls] > 0.1).all(axis=1)
    ceiling = surfaces.roles.index("ceiling")
    off = xyz[inside, 2].astype(float) - surfaces.centres[ceiling, 2]
    assert off[np.abs(off) < 0.05].std() == pytest.approx(0.01, rel=0.03)


def test_the_room_measures_six_by_five_by_three():
    _, surfaces = furnished_room(1000, seed=0)
    walls = [i for i, role in enumerate(surfaces.roles) if role == "wall"]
    south, north, west, east = walls
    gap = lambda a, b: -(surfaces.offsets[a] + surfaces.offsets[b])  # noqa: E731
    assert gap(south, north) == pytest.approx(5.0)
    assert gap(west, east) == pytest.approx(6.0)
    assert gap(surfaces.roles.index("floor"), surfaces.roles.index("ceiling")) == pytest.approx(3)
    assert np.arctan2(*surfaces.normals[west][1::-1]) == pytest.approx(YAW_RAD)
    assert [surfaces.roles.count(r) for r in ("table", "seat", "back")] == [2, 5, 5]


def test_nothing_fills_the_door_opening():
    xyz, _ = furnished_room(100_000, seed=2, noise_m=0.0)
    cosine, sine = np.cos(YAW_RAD), np.sin(YAW_RAD)
    local = (xyz - SHIFT_M) @ np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
    x, y, z = local.T
    in_wall = np.abs(y) < 1e-4
    in_door = in_wall & (x > 4.21) & (x < 5.09) & (z > 0.01) & (z < 2.04)
    assert in_wall.sum() > 5000 and in_door.sum() <= 1


def test_the_storey_has_twenty_rooms_about_a_corridor_and_measures_47_by_13():
    xyz, surfaces = furnished_floor(100_000, seed=5, noise_m=0.0)
    assert set(surfaces.rooms) == set(range(21))
    cosine, sine = np.cos(YAW_RAD), np.sin(YAW_RAD)
    local = (xyz - SHIFT_M) @ np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
    assert np.ptp(local, axis=0) == pytest.approx([46.6, 12.8, 2.8], abs=1e-2)
    assert surfaces.roles.count("ceiling") == 21 and surfaces.roles.count("wall") == 84


@pytest.mark.parametrize("make", [furnished_room, furnished_floor])
def test_the_same_seed_gives_the_same_bytes_and_another_seed_others(make):
    assert make(5000, 7)[0].tobytes() == make(5000, 7)[0].tobytes()
    assert make(5000, 7)[0].tobytes() != make(5000, 8)[0].tobytes()


def test_all_surfaces_lie_inside_their_rooms_walls():
    _, surfaces = furnished_floor(1000, seed=4)
    roles = np.array(surfaces.roles)
    for room in range(21):
        walls = (surfaces.rooms == room) & (roles == "wall")
        inside = surfaces.centres[surfaces.rooms == room] @ surfaces.normals[walls].T
        assert (inside - surfaces.offsets[walls] > -1e-9).all()
