"""The mesh of a plan against closed forms: where rays hit, what solids measure."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from shapely import LineString, Point, box
from shapely.affinity import rotate

from storage.errors import MapSenseError
from storage.plan import Plan, PlanFurniture, PlanOpening, PlanRoom, PlanWall
from tasks.simulation.defaults import SimulationDefaults, complete_plan
from tasks.simulation.furniture_solids import furniture_solids, seat_height_m
from tasks.simulation.junctions import end_extensions, solid_area
from tasks.simulation.materials import DARK, GLASS, MATERIALS, MATT
from tasks.simulation.mesh import Mesh, storey_mesh
from tasks.simulation.plan import StoreyParams, make_storey
from tasks.simulation.wall_solids import leaf_angle, wall_solids


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


def door(state: str | None, rooms: tuple[str, ...] = ("r",)) -> PlanOpening:
    line = LineString([(1, -0.1), (1.9, -0.1)])
    return PlanOpening("d", line, 0.0, 2.05, "w0", state=state, rooms=rooms)


def cast(mesh: Mesh, origins, directions) -> tuple[np.ndarray, np.ndarray]:
    """Return distances and materials where rays of unit direction hit, by Moeller and Trumbore."""
    a, b, c = (mesh.vertices[mesh.triangles[:, i]].astype(float) for i in range(3))
    found, materials = [], []
    for origin, direction in zip(np.atleast_2d(origins), np.atleast_2d(directions), strict=True):
        p = np.cross(direction, c - a)
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = 1 / np.einsum("ij,ij->i", b - a, p)
            s = origin - a
            u = np.einsum("ij,ij->i", s, p) * inverse
            q = np.cross(s, b - a)
            v = q @ direction * inverse
            t = np.einsum("ij,ij->i", c - a, q) * inverse
            u, v = (np.where(np.isfinite(w), w, 2.0) for w in (u, v))
        hit = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9) & (t > 1e-9)
        t = np.where(hit, t, np.inf)
        found.append(t.min())
        materials.append(mesh.materials[t.argmin()] if hit.any() else -1)
    return np.array(found), np.array(materials)


def distance(plan: Plan, origin, direction) -> float:
    return float(cast(storey_mesh(plan), origin, direction)[0][0])


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
        ((2.0, 1.0, 1.2), (0, 1, 0), 2.1),  # the window's pane
        ((1.03, 1.0, 1.2), (0, 1, 0), 2.065),  # its frame
        ((2.0, 1.0, 0.8), (0, 1, 0), 2.0),  # under its sill
        ((2.0, 1.0, 2.3), (0, 1, 0), 2.0),  # over its head
        ((1.5, -0.1, 1.2), (1, 0, 0), 0.4),  # the door's reveal
        ((1.5, -0.1, 1.2), (0, 0, -1), 1.2),  # its threshold
    ],
)
def test_a_ray_hits_where_the_plan_says(origin, direction, expected):
    assert distance(cell(), origin, direction) == pytest.approx(expected, abs=1e-5)


def test_only_a_pane_is_glass():
    mesh = storey_mesh(cell())
    ahead = cast(mesh, [(2.0, 1.0, 1.2), (1.03, 1.0, 1.2)], [(0, 1, 0)] * 2)[1]
    assert ahead.tolist() == [GLASS, MATT]
    assert len(mesh.materials) == len(mesh.triangles)
    a, b, c = (mesh.vertices[mesh.triangles[mesh.materials == GLASS, i]] for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    assert area == pytest.approx((2 - 0.12) * (1.3 - 0.12), abs=1e-5)


def test_a_shut_leaf_lies_behind_both_faces_and_its_frame_before_them():
    plan = cell(doors=(door("shut"),))
    inside = distance(plan, (1.5, 1.0, 1.2), (0, -1, 0))
    outside = distance(plan, (1.5, -1.2, 1.2), (0, 1, 0))
    # opens into the room: a rebate of 1 cm on this side, the wall less rebate and leaf on that
    assert inside == pytest.approx(1.0 + 0.01, abs=1e-5)
    assert outside == pytest.approx(1.0 + 0.2 - 0.01 - 0.04, abs=1e-5)
    assert distance(plan, (0.97, 1.0, 1.2), (0, -1, 0)) == pytest.approx(1.0 - 0.012, abs=1e-5)
    assert distance(plan, (1.93, -1.2, 1.2), (0, 1, 0)) == pytest.approx(1.0 - 0.012, abs=1e-5)
    assert distance(plan, (1.5, 1.0, 2.08), (0, -1, 0)) == pytest.approx(1.0 - 0.012, abs=1e-5)


@pytest.mark.parametrize(("state", "low", "high"), [("open", 80, 100), ("ajar", 10, 35)])
def test_a_leaf_is_turned_about_its_hinge_into_the_room(state, low, high):
    for id_ in ("d1", "d2", "d17"):
        leaf = replace(door(state), id=id_)
        angle = leaf_angle(leaf)
        assert low <= np.rad2deg(angle) <= high
        # hinged at the end nearer to a corner, x = 1; a ray along x meets the front of the leaf
        hinge = np.array((1.004, -0.01))
        reach = 0.5 * np.array((np.cos(angle), np.sin(angle)))
        x, y = hinge + reach
        mesh = storey_mesh(cell(doors=(leaf,)))
        normal = np.array((-np.sin(angle), np.cos(angle)))
        start = (x, y) + 0.3 * normal
        found = cast(mesh, (*start, 1.2), (*-normal, 0.0))[0][0]
        assert found == pytest.approx(0.3, abs=1e-5)


def test_a_leaf_stops_at_a_side_wall():
    narrow = PlanRoom("r", box(0.99, 0, 4, 3), floor_m=0.0, ceiling_m=2.5)
    plan = cell(rooms=(narrow,), doors=(replace(door("open"), id="d17"),))
    assert np.rad2deg(leaf_angle(plan.doors[0])) > 92
    mesh = storey_mesh(replace(plan, walls=plan.walls[:1], windows=()))
    away = mesh.vertices[(mesh.vertices[:, 1] > 0.2) & (mesh.vertices[:, 2] == np.float32(2.046))]
    assert len(away) == 2
    assert away[:, 0].min() > 0.98


def test_a_ray_passes_an_open_door_and_no_shut_one():
    mesh = {s: storey_mesh(cell(doors=(door(s),))) for s in ("open", "shut", "unknown", None)}
    away = {s: cast(m, (1.6, 1.0, 1.2), (0, -1, 0))[0][0] for s, m in mesh.items()}
    assert away["open"] == away["unknown"] == away[None] == np.inf
    assert np.isfinite(away["shut"])
    assert len(mesh["unknown"].triangles) == len(mesh[None].triangles) < len(mesh["open"].triangles)


def test_an_opening_that_names_no_wall_is_cut_into_the_wall_it_lies_on():
    plan = cell()
    loose = cell(doors=tuple(replace(d, wall=None) for d in plan.doors))
    assert storey_mesh(loose).vertices.tobytes() == storey_mesh(plan).vertices.tobytes()


def test_a_wall_may_bend():
    ends = [(-0.1, -0.1), (4.1, -0.1), (4.1, 3.1), (-0.1, 3.1), (-0.1, -0.1)]
    bent = PlanWall("w", LineString(ends), 0.2, 0.0, 2.5)
    openings = {k: tuple(replace(o, wall="w") for o in getattr(cell(), k)) for k in KINDS}
    mesh, straight = storey_mesh(cell(walls=(bent,), **openings)), storey_mesh(cell())
    assert mesh.triangles.shape == straight.triangles.shape
    assert np.sort(mesh.vertices, axis=0) == pytest.approx(np.sort(straight.vertices, axis=0))


KINDS = ("doors", "windows")


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


def test_the_seat_of_a_chair_pushed_in_is_under_the_table_and_its_back_before_it():
    table = PlanFurniture("t", box(0.5, 1, 2.1, 1.8), "table", 0.0, 0.74, "r")
    chair = PlanFurniture("c", box(1, 1.5, 1.46, 1.96), "chair", 0.0, 0.9, "r")
    mesh = storey_mesh(cell(furniture=(table, chair)))
    down = (0, 0, -1)
    heights = 2 - cast(mesh, [(1.2, y, 2.0) for y in (1.6, 1.85, 1.95)], [down] * 3)[0]
    assert heights == pytest.approx([0.74, 0.48, 0.9], abs=1e-5)
    assert cast(mesh, (1.2, 1.6, 0.6), down)[0] == pytest.approx(0.6 - 0.48, abs=1e-5)


def test_a_chair_away_from_tables_has_its_back_to_the_wall():
    chair = PlanFurniture("c", box(0.05, 1, 0.5, 1.45), "chair", 0.0, 0.84, "r")
    mesh = storey_mesh(cell(furniture=(chair,)))
    heights = 2 - cast(mesh, [(0.06, 1.2, 2.0), (0.49, 1.2, 2.0)], [(0, 0, -1)] * 2)[0]
    assert heights == pytest.approx([0.84, 0.45], abs=1e-5)


@pytest.mark.parametrize(
    ("top", "seat"), [(0.45, 0.45), (0.7, 0.4), (0.84, 0.45), (0.87, 0.48), (1.1, 0.48)]
)
def test_seats_are_between_40_and_48_cm_high(top, seat):
    assert seat_height_m(0.0, top) == pytest.approx(seat)
    assert seat_height_m(3.0, 3.0 + top) == pytest.approx(seat)


def test_a_shelf_is_open_and_a_cabinet_is_not():
    shelf, cabinet = (
        PlanFurniture(f"{kind}-1", box(1, 1, 2, 1.35), "other", 0.0, 1.9, "r")
        for kind in ("shelf", "cabinet")
    )
    rays = [(x, -1.0, z) for z in np.linspace(0.05, 1.85, 37) for x in (1.06, 1.94)]
    hits = [
        np.isfinite(cast(storey_mesh(Plan("b", "0", furniture=(p,))), rays, [(0, 1, 0)] * 74)[0])
        for p in (shelf, cabinet)
    ]
    assert hits[1].all()
    # files leave at least a tenth of each board free, at one end of it
    assert 0 < hits[0].sum() < 74


def test_screens_are_dark():
    screen = PlanFurniture("screen-1", box(1, 1, 1.6, 1.2), "other", 0.74, 1.2)
    assert set(storey_mesh(Plan("b", "0", furniture=(screen,))).materials) == {DARK}


@pytest.mark.parametrize("layout", ["small", "open_plan", "irregular"])
def test_every_solid_is_closed_and_faces_outwards(layout):
    plan = make_storey(StoreyParams(layout=layout, seed=1, yaw_rad=0.3), "demo", "1")
    for solid in (*wall_solids(plan), *furniture_solids(plan.furniture, plan.rooms)):
        if solid.material == GLASS:
            continue
        edges = Counter((t[i], t[(i + 1) % 3]) for t in solid.triangles.tolist() for i in range(3))
        # each edge once in either direction: watertight and consistently oriented
        assert set(edges.values()) == {1}
        assert all(edge[::-1] in edges for edge in edges)
        a, b, c = (solid.vertices[solid.triangles[:, i]] - solid.vertices[0] for i in range(3))
        volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6
        assert volume >= -1e-9
        flat = np.ptp(solid.vertices[:, 2]) == 0  # a threshold
        assert flat or volume > 0


def test_floors_and_ceilings_have_the_area_of_the_rooms():
    plan = make_storey(StoreyParams(layout="irregular", seed=2), "demo", "1")
    bare = storey_mesh(replace(plan, walls=(), doors=(), windows=(), furniture=()))
    a, b, c = (bare.vertices[bare.triangles[:, i]].astype(float) for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    assert area == pytest.approx(2 * sum(room.polygon.area for room in plan.rooms), rel=1e-5)


@pytest.mark.parametrize("layout", ["small", "irregular", "ring"])
def test_from_a_rooms_middle_the_walls_are_as_far_as_its_outline(layout):
    plan = make_storey(StoreyParams(layout=layout, seed=4, yaw_rad=0.3), "demo", "1")
    mesh = storey_mesh(replace(plan, furniture=()))
    angles = np.linspace(0, 2 * np.pi, 7, endpoint=False)
    directions = np.column_stack((np.cos(angles), np.sin(angles), np.zeros(7)))
    for room in plan.rooms[:20]:
        middle = room.polygon.representative_point()
        # over every lintel and frame, so that no opening lets a ray through
        origins = np.tile((middle.x, middle.y, 2.6), (7, 1))
        for found, (x, y, _) in zip(cast(mesh, origins, directions)[0], directions, strict=True):
            ray = LineString([middle, (middle.x + 60 * x, middle.y + 60 * y)])
            outline = room.polygon.boundary.intersection(ray)
            assert found == pytest.approx(Point(middle).distance(outline), abs=2e-3)


@pytest.mark.parametrize("angle", [90, 60, 135, 160])
@pytest.mark.parametrize("thin", [0.2, 0.1])
def test_two_walls_close_their_corner_and_no_more(angle, thin):
    turn = np.deg2rad(angle)
    lines = np.array([[(3, 0), (0, 0)], [(0, 0), (3 * np.cos(turn), 3 * np.sin(turn))]])
    solid = solid_area(lines, np.array((0.2, thin)))
    # the area between the outer and the inner pair of half planes
    below = lambda y: box(-9, y, 9, 9)  # noqa: E731
    beside = lambda y: rotate(box(-9, -9, 9, y), angle, origin=(0, 0))  # noqa: E731
    expected = (below(-0.1) & beside(thin / 2)) - (below(0.1) & beside(-thin / 2))
    near = Point(0, 0).buffer(1.5)
    # square ends: unequal walls at a blunt corner leave a step, sharp corners stick out
    step = 1e-6 if thin == 0.2 or angle <= 90 else 0.1**2 / 2
    assert ((expected - solid) & near).area < step
    assert ((solid - expected) & near).area < (step if angle >= 90 else 0.03)


def test_a_wall_ends_where_it_meets_others_and_runs_on_where_it_meets_none():
    lines = np.array([[(0, 0), (4, 0)], [(4, 0), (8, 0)], [(2, 0), (2, 3)]], float)
    found = end_extensions(lines, np.array((0.2, 0.2, 0.1)))
    assert found == pytest.approx(np.array([(0.1, 0.0), (0.0, 0.1), (0.0, 0.05)]))


def test_an_empty_plan_has_an_empty_mesh():
    mesh = storey_mesh(Plan("b", "0"))
    assert mesh.vertices.shape == mesh.triangles.shape == (0, 3) and mesh.materials.shape == (0,)
    assert MATERIALS == ("matt", "dark", "glass")


def test_the_same_plan_gives_the_same_bytes():
    plans = [make_storey(StoreyParams(seed=5), "demo", "1") for _ in range(2)]
    a, b = (storey_mesh(plan) for plan in plans)
    assert a.vertices.tobytes() == b.vertices.tobytes()
    assert a.triangles.tobytes() == b.triangles.tobytes()
    assert a.materials.tobytes() == b.materials.tobytes()


UNKNOWN = [
    ("'w1': 'thickness_m'", lambda p: {"walls": _changed(p.walls, 1, thickness_m=None)}),
    ("'r': 'ceiling_m'", lambda p: {"rooms": _changed(p.rooms, 0, ceiling_m=None)}),
    ("door 'd': 'head_m'", lambda p: {"doors": _changed(p.doors, 0, head_m=None)}),
    ("window 'n': 'sill_m'", lambda p: {"windows": _changed(p.windows, 0, sill_m=None)}),
    ("'t': 'top_m'", lambda p: {"furniture": (replace(TABLE, top_m=None),)}),
]
TABLE = PlanFurniture("t", box(0.5, 1, 2.1, 1.8), "table", 0.0, 0.74, "r")


@pytest.mark.parametrize(("name", "change"), UNKNOWN)
def test_what_a_simulation_needs_and_does_not_know_is_named_failure(name, change):
    plan = cell()
    with pytest.raises(MapSenseError, match=name):
        storey_mesh(replace(plan, **change(plan)))


@pytest.mark.parametrize(("name", "change"), UNKNOWN)
def test_a_plan_is_completed_only_where_it_says_nothing(name, change):
    plan = cell(furniture=(TABLE,))
    completed = complete_plan(replace(plan, **change(plan)), SimulationDefaults(thickness_m=0.2))
    assert len(storey_mesh(completed).triangles) == len(storey_mesh(plan).triangles)
    assert complete_plan(plan, SimulationDefaults()).walls[0].thickness_m == 0.2
    assert "assumed" in completed.notes[-1]


def test_an_opening_on_no_wall_is_named_failure():
    stray = PlanOpening("d", LineString([(1, 1.4), (1.9, 1.4)]), 0.0, 2.05)
    with pytest.raises(MapSenseError, match="door 'd': lies on no wall"):
        storey_mesh(cell(doors=(stray,)))


def _changed(items: tuple, index: int, **values) -> tuple:
    return (*items[:index], replace(items[index], **values), *items[index + 1 :])
