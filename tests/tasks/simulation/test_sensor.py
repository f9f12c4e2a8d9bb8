"""Mesh and sensor against the plan and against closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from shapely import LineString, Point, box

from storage.errors import MapSenseError
from storage.plan import Plan, PlanFurniture, PlanOpening, PlanRoom, PlanWall
from tasks.simulation.mesh import Mesh, storey_mesh
from tasks.simulation.plan import StoreyParams, make_storey
from tasks.simulation.rotations import about, matrices, product
from tasks.simulation.sensor import Scene, SensorParams, capture
from tasks.simulation.volunteers import looking

LEVEL = looking(np.zeros(1), np.zeros(1), np.zeros(1))


def cell(**changes) -> Plan:
    """A room of 4 x 3 x 2.5 m with walls 0.2 m thick, a door south and a window north."""
    ends = [((-0.1, -0.1), (4.1, -0.1)), ((4.1, -0.1), (4.1, 3.1))]
    ends += [((4.1, 3.1), (-0.1, 3.1)), ((-0.1, 3.1), (-0.1, -0.1))]
    walls = [PlanWall(f"w{i}", LineString(e), 0.2, 0.0, 2.5, ("r",)) for i, e in enumerate(ends)]
    return replace(
        Plan(
            "b",
            "0",
            rooms=(PlanRoom("r", box(0, 0, 4, 3), floor_m=0.0, ceiling_m=2.5),),
            walls=tuple(walls),
            doors=(PlanOpening("d", LineString([(1, -0.1), (1.9, -0.1)]), 0.0, 2.05, "w0"),),
            windows=(PlanOpening("n", LineString([(3, 3.1), (1, 3.1)]), 0.9, 2.2, "w2"),),
        ),
        **changes,
    )


def distance(plan: Plan, origin: tuple, direction: tuple) -> float:
    scene = Scene(storey_mesh(plan))
    return float(scene.distances(np.array([origin], float), np.array([direction], float))[0])


@pytest.mark.parametrize(
    ("origin", "direction", "expected"),
    [
        ((1.0, 1.0, 1.2), (1, 0, 0), 3.0),  # a wall's inner face
        ((1.0, 1.0, 1.2), (-1, 0, 0), 1.0),
        ((1.0, 1.0, 1.2), (0, 0, 1), 1.3),  # ceiling
        ((1.0, 1.0, 1.2), (0, 0, -1), 1.2),  # floor
        ((3.0, 1.0, 1.2), (0, -1, 0), 1.0),  # beside the door
        ((1.5, 1.0, 1.2), (0, -1, 0), np.inf),  # through it
        ((1.5, 1.0, 2.2), (0, -1, 0), 1.0),  # its lintel
        ((2.0, 1.0, 1.2), (0, 1, 0), np.inf),  # through the window
        ((2.0, 1.0, 0.8), (0, 1, 0), 2.0),  # under its sill
        ((2.0, 1.0, 2.3), (0, 1, 0), 2.0),  # over its head
        ((1.5, -0.1, 1.2), (1, 0, 0), 0.4),  # the door's reveal
        ((1.5, -0.1, 1.2), (0, 0, -1), 1.2),  # its threshold
    ],
)
def test_a_ray_hits_where_the_plan_says(origin, direction, expected):
    assert distance(cell(), origin, direction) == pytest.approx(expected, abs=1e-5)


def test_a_ray_hits_tables_and_chairs_at_their_heights():
    table = PlanFurniture("t", box(0.5, 1, 2.1, 1.8), "table", 0.0, 0.74, "r")
    chair = PlanFurniture("c", box(1, 2, 1.46, 2.46), "chair", 0.0, 0.84, "r")
    cabinet = PlanFurniture("o", box(3, 0, 4, 0.4), "other", 0.0, 1.9, "r")
    plan = cell(furniture=(table, chair, cabinet))
    down, up = (0, 0, -1), (0, 0, 1)
    assert distance(plan, (1.3, 1.4, 2.0), down) == pytest.approx(2 - 0.74, abs=1e-5)
    assert distance(plan, (1.3, 1.4, 0.1), up) == pytest.approx(0.74 - 0.03 - 0.1, abs=1e-5)
    assert distance(plan, (1.2, 2.2, 2.0), down) == pytest.approx(2 - 0.45, abs=1e-5)
    # the back is on the side away from the table
    assert distance(plan, (1.2, 2.45, 2.0), down) == pytest.approx(2 - 0.84, abs=1e-5)
    assert distance(plan, (3.5, 0.2, 2.4), down) == pytest.approx(0.5, abs=1e-5)


@pytest.mark.parametrize("seed", [0, 4])
def test_from_a_simulated_rooms_middle_the_walls_are_as_far_as_its_outline(seed):
    plan = make_storey(StoreyParams(seed=seed, yaw_rad=0.3), "demo", "1")
    scene = Scene(storey_mesh(replace(plan, furniture=())))
    angles = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    directions = np.column_stack((np.cos(angles), np.sin(angles), np.zeros(60)))
    for room in plan.rooms:
        middle = room.polygon.representative_point()
        # over every lintel, so that no opening lets a ray through
        origins = np.tile((middle.x, middle.y, 2.5), (60, 1))
        for found, (x, y, _) in zip(scene.distances(origins, directions), directions, strict=True):
            ray = LineString([middle, (middle.x + 60 * x, middle.y + 60 * y)])
            outline = room.polygon.exterior.intersection(ray)
            assert found == pytest.approx(Point(middle).distance(outline), abs=2e-3)


def test_the_noise_grows_with_the_distance_as_stated():
    params = SensorParams()
    assert params.sigma(np.array([1.0, 4.0])) == pytest.approx([0.003, 0.015])
    for away in (1.0, 3.5):
        wall = Mesh(
            np.array([(-9, away, -9), (9, away, -9), (9, away, 9), (-9, away, 9)], np.float32),
            np.array([(0, 1, 2), (0, 2, 3)], np.uint32),
        )
        narrow = params.model_copy(update={"fov_along_rad": 0.02, "fov_across_rad": 0.02})
        returns = capture(Scene(wall), np.zeros((1, 3)), LEVEL, narrow, np.random.default_rng(0))
        error = returns.points[:, 1] - away
        expected = float(params.sigma(np.array([away]))[0])
        assert len(error) == params.rays
        assert error.std() == pytest.approx(expected, rel=0.05)
        assert abs(error.mean()) < 4 * expected / np.sqrt(len(error))


def test_nothing_is_seen_nearer_or_farther_than_the_range():
    params = SensorParams(noise_m=0.0, noise_per_m=0.0)
    plan = make_storey(StoreyParams(), "demo", "1")
    corridor = np.array([(0.6, 1.1, 1.5)])
    east = looking(np.array([-np.pi / 2]), np.zeros(1), np.zeros(1))
    rng = np.random.default_rng(0)
    returns = capture(Scene(storey_mesh(plan)), corridor, east, params, rng)
    away = np.linalg.norm(returns.points - corridor, axis=1)
    assert 0 < len(away) < params.rays
    assert away.min() >= params.range_min_m and away.max() <= params.range_max_m


def test_an_empty_plan_returns_nothing():
    scene = Scene(storey_mesh(Plan("b", "0")))
    rng = np.random.default_rng(0)
    assert len(capture(scene, np.zeros((1, 3)), LEVEL, SensorParams(), rng).points) == 0
    assert len(capture(scene, np.zeros((0, 3)), LEVEL[:0], SensorParams(), rng).points) == 0


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("'w1': 'thickness_m'", lambda p: {"walls": _changed(p.walls, 1, thickness_m=None)}),
        ("'r': 'ceiling_m'", lambda p: {"rooms": _changed(p.rooms, 0, ceiling_m=None)}),
        ("'d': 'head_m'", lambda p: {"doors": _changed(p.doors, 0, head_m=None)}),
        (
            "'w0': is not straight",
            lambda p: {"walls": _changed(p.walls, 0, line=LineString([(0, 0), (1, 0), (1, 1)]))},
        ),
    ],
)
def test_what_a_simulation_needs_and_does_not_know_is_named_failure(name, change):
    plan = cell()
    with pytest.raises(MapSenseError, match=name):
        storey_mesh(replace(plan, **change(plan)))


def _changed(items: tuple, index: int, **values) -> tuple:
    return (*items[:index], replace(items[index], **values), *items[index + 1 :])


def test_a_level_upright_device_has_a_roll_of_ninety_degrees_whatever_its_heading():
    heading = np.linspace(-3, 3, 7)
    pitch = np.deg2rad([-35, 0, 35, 0, 10, -10, 0])
    a, b, c, d = looking(heading, pitch, np.zeros(7)).T
    roll = np.arctan2(2 * (a * b + c * d), 1 - 2 * (b * b + c * c))  # Eq. 1
    assert roll == pytest.approx(np.pi / 2 + pitch)


def test_a_device_looks_along_its_heading_with_its_long_edge_up():
    (R,) = matrices(looking(np.array([np.pi / 2]), np.zeros(1), np.zeros(1)))
    assert pytest.approx([-1, 0, 0], abs=1e-12) == R @ (0, 0, -1)
    assert pytest.approx([0, 0, 1], abs=1e-12) == R @ (0, 1, 0)


def test_a_product_of_rotations_is_the_product_of_their_matrices():
    p, q = product(about("x", 0.3), about("y", -1.1)), about("z", 2.0)
    assert matrices(product(p, q)) == pytest.approx(matrices(p) @ matrices(q))
