"""Initial models spoilt on purpose: a row of rooms worked by hand, and what holds of any storey."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from shapely import box
from shapely.affinity import rotate

from storage.faces import SEEN_WALL, Faces
from storage.rooms import Rooms
from storage.walls import Walls
from tasks.evaluation.disturbance import DisturbParams, disturb
from tasks.simulation.presets import preset

BIN, TURN = 0.1, 20.0
MISSING, SPURIOUS = DisturbParams(missing=0.5), DisturbParams(spurious=0.5)


def model(polygons, lines=(), thickness=0.2):
    """Return rooms, a wall of given ends per pair of rooms, and its two faces, all of it seen."""
    n = len(polygons)
    column = np.empty(n, object)
    column[:] = polygons
    rooms = Rooms(
        column, np.zeros(n), np.full(n, 2.5), np.ones(n), np.ones(n), tuple((i,) for i in range(n))
    )
    ends = np.array([line for line, _ in lines], float).reshape(-1, 2, 2)
    of = np.array([pair for _, pair in lines], np.int32).reshape(-1, 2)
    w = len(lines)
    walls = Walls(ends, np.full(w, thickness), np.zeros(w), np.full(w, 2.5), of, np.ones(w))
    steps = ends[:, 1] - ends[:, 0]
    lengths = np.linalg.norm(steps, axis=1)
    left = np.column_stack([-steps[:, 1], steps[:, 0]]) / lengths[:, None]
    both, sign = np.repeat(np.arange(w), 2), np.tile([-1.0, 1.0], w)
    towards = left[both] * sign[:, None]
    at = ends[both] + (towards * thickness / 2)[:, None]
    faces = Faces(
        normals=np.column_stack([towards, np.zeros(2 * w)]),
        offsets=(at[:, 0] * towards).sum(axis=1),
        sides=np.ones(2 * w, np.int8),
        lines=at,
        heights=np.tile([0.0, 2.5], (2 * w, 1)),
        weights=lengths[both] * 2.5,
        scans=np.ones(2 * w, np.int64),
        profiles=tuple(
            np.full(int(np.ceil(x / BIN - 1e-9)), SEEN_WALL, np.uint8) for x in lengths[both]
        ),
        bin_m=BIN,
    )
    return rooms, walls, faces


def row():
    """Three rooms of 4 x 5 m above a corridor, walls of 0.2 m between all of them."""
    rooms = [box(0, 0, 12.4, 2)] + [box(4.2 * i, 2.2, 4.2 * i + 4, 7.2) for i in range(3)]
    front = [(((4.2 * i, 2.1), (4.2 * i + 4, 2.1)), (0, i + 1)) for i in range(3)]
    between = [(((4.2 * i - 0.1, 2.2), (4.2 * i - 0.1, 7.2)), (i, i + 1)) for i in (1, 2)]
    rear = [(((0, 7.3), (12.4, 7.3)), (1, -1))]
    return model(rooms, [*front, *between, *rear])


def storey(name):
    """Return a preset's true rooms as an initial model, walls and faces left out."""
    return model([room.polygon for room in preset(name).rooms])


def area(rooms):
    return shapely.area(rooms.polygons)


def test_nothing_asked_for_is_the_input_itself():
    given = row()
    assert all(a is b for a, b in zip(disturb(*given, DisturbParams()), given, strict=True))


def test_a_missing_wall_joins_two_rooms_and_takes_what_was_seen_of_it_along():
    rooms, walls, faces = disturb(*row(), MISSING)
    given_rooms, given_walls, given_faces = row()
    assert sorted(area(rooms)) == pytest.approx(sorted([24.8, 20.0, 8.2 * 5]), abs=1e-2)
    assert len(walls) == len(given_walls) - 1
    assert len(faces) == len(given_faces) - 2
    assert rooms.polygons[0].equals(given_rooms.polygons[0])
    joined = int(area(rooms)[1:].argmax()) + 1
    assert len(rooms.scans[joined]) == 2
    # the corridor's three walls lead to the joined room twice
    assert sorted(b for a, b in walls.rooms.tolist() if a == 0) == sorted(
        [joined, joined, 3 - joined]
    )


def test_all_walls_missing_leave_one_room_beside_the_corridor():
    rooms, walls, _ = disturb(*row(), DisturbParams(missing=1.0))
    assert area(rooms) == pytest.approx([24.8, 12.4 * 5], abs=1e-2)
    assert walls.rooms.tolist() == [[0, 1], [0, 1], [0, 1], [1, -1]]


def test_of_a_face_that_runs_on_past_the_missing_wall_the_rest_stays():
    rooms, walls, faces = row()
    long = faces.lines.copy()
    upright = int(np.flatnonzero(np.isclose(long[:, 0, 0], long[:, 1, 0]))[0])
    long[upright, :, 1] = [-3.0, 7.2]  # of a wall on the corridor's other side, in line
    profile = np.zeros(102, np.uint8)
    profile[:20] = profile[52:] = SEEN_WALL
    profiles = tuple(profile if i == upright else p for i, p in enumerate(faces.profiles))
    faces = replace(faces, lines=long, profiles=profiles)
    _, _, left = disturb(rooms, walls, faces, DisturbParams(missing=1.0))
    uprights = np.flatnonzero(np.isclose(left.lines[:, 0, 0], left.lines[:, 1, 0]))
    assert len(uprights) == 1
    (i,) = uprights
    low, high = sorted(left.lines[i, :, 1])
    assert low == pytest.approx(-3.0)
    assert 2.0 <= high <= 2.2
    assert left.profiles[i][:20].all() and not left.profiles[i][20:].any()
    assert left.weights[i] == pytest.approx(faces.weights[upright] * 20 / 70)


def test_a_false_partition_makes_two_rooms_with_a_wall_and_two_faces_between():
    rooms, walls, faces = disturb(*row(), SPURIOUS)
    given_rooms, given_walls, given_faces = row()
    assert area(rooms).sum() == pytest.approx(area(given_rooms).sum() - 0.1 * 4)
    assert (len(rooms), len(faces)) == (5, len(given_faces) + 2)
    pair = walls.rooms[-1]
    assert pair[1] == pair[0] + 1
    assert [sorted(given_rooms.scans).index(rooms.scans[i]) for i in pair] == [pair[0]] * 2
    a, b = rooms.polygons[pair]
    assert a.distance(b) == pytest.approx(0.1)
    # square to the longest side, which is upright: both faces lie and look at their own half
    (low, high), axis = faces.lines[-2:, :, 1], walls.lines[-1, 0, 1]
    assert low == pytest.approx([axis - 0.05] * 2) or low == pytest.approx([axis + 0.05] * 2)
    assert high.mean() == pytest.approx(2 * axis - low.mean())
    for line, normal, offset in zip(
        faces.lines[-2:], faces.normals[-2:, :2], faces.offsets[-2:], strict=True
    ):
        assert line @ normal == pytest.approx([offset] * 2)
        seen_from = shapely.Point(line.mean(axis=0) + 0.1 * normal)
        assert a.contains(seen_from) or b.contains(seen_from)
    assert all((p == SEEN_WALL).all() and len(p) == 40 for p in faces.profiles[-2:])
    # a wall beside both halves is two walls now; the corridor's side walls each have one room
    lengths = np.linalg.norm(walls.lines[:, 1] - walls.lines[:, 0], axis=1)
    given = np.linalg.norm(given_walls.lines[:, 1] - given_walls.lines[:, 0], axis=1)
    assert lengths.sum() == pytest.approx(given.sum() + 4)


@pytest.mark.parametrize("seed", range(5))
def test_every_wall_lies_beside_the_rooms_it_names(seed):
    both = DisturbParams(missing=0.5, spurious=0.5, seed=seed)
    rooms, walls, _ = disturb(*row(), both)
    for line, pair in zip(walls.lines[:-1], walls.rooms[:-1], strict=True):
        for room in pair[pair >= 0]:
            beside = rooms.polygons[room].buffer(0.11, join_style="mitre")
            assert beside.intersection(shapely.LineString(line)).length > 0.5


@pytest.mark.parametrize("name", ["ring", "wing"])
@pytest.mark.parametrize("seed", range(3))
def test_of_any_storey_rooms_stay_simple_apart_and_as_many_as_asked_for(name, seed):
    given = storey(name)
    n = len(given[0])
    few, _, _ = disturb(*given, DisturbParams(missing=0.2, seed=seed))
    many, _, _ = disturb(*given, DisturbParams(spurious=0.2, seed=seed))
    assert n - len(few) == len(many) - n > 0
    both, _, _ = disturb(*given, DisturbParams(missing=0.2, spurious=0.2, seed=seed))
    for rooms in (few, many, both):
        shapes = list(rooms.polygons)
        assert all(p.is_valid and p.geom_type == "Polygon" and p.exterior.is_ccw for p in shapes)
        assert sum(p.area for p in shapes) - shapely.union_all(shapes).area < 1e-2
    assert few.polygons[0].equals(given[0].polygons[0])  # the corridor
    assert area(few).sum() > area(given[0]).sum() > area(many).sum()


def test_false_partitions_keep_clear_of_walls():
    given = storey("wing")
    found, _, _ = disturb(*given, DisturbParams(spurious=1.0, seed=3))
    before = set(shapely.to_wkb(given[0].polygons))
    halves = [p for p in found.polygons if shapely.to_wkb(p) not in before]
    assert len(halves) > 10
    assert all(
        min(shapely.length(shapely.linestrings(np.array(
            p.minimum_rotated_rectangle.exterior.coords)[[i, i + 1]])) for i in (0, 1)) > 0.79
        for p in halves
    )  # fmt: skip


def test_a_turned_storey_is_spoilt_alike():
    def turned(rooms, walls, faces):
        polygons = np.array([rotate(p, TURN, origin=(0, 0)) for p in rooms.polygons], object)
        c, s = np.cos(np.radians(TURN)), np.sin(np.radians(TURN))
        turn = np.array([[c, s], [-s, c]])
        normals = faces.normals.copy()
        normals[:, :2] = normals[:, :2] @ turn
        return (
            replace(rooms, polygons=polygons),
            replace(walls, lines=walls.lines @ turn),
            replace(faces, lines=faces.lines @ turn, normals=normals),
        )

    params = DisturbParams(missing=0.5, spurious=0.5, seed=1)
    expected, got = turned(*disturb(*row(), params)), disturb(*turned(*row()), params)
    assert area(got[0]) == pytest.approx(area(expected[0]), abs=1e-3)
    assert got[1].lines == pytest.approx(expected[1].lines, abs=1e-6)
    assert got[1].rooms.tolist() == expected[1].rooms.tolist()
    assert got[2].lines == pytest.approx(expected[2].lines, abs=1e-6)


def test_same_seed_same_model_another_seed_another():
    a, b, c = (disturb(*storey("ring"), replace_seed(s))[0] for s in (1, 1, 2))
    assert [p.wkb for p in a.polygons] == [p.wkb for p in b.polygons]
    assert [p.wkb for p in a.polygons] != [p.wkb for p in c.polygons]


def replace_seed(seed):
    return DisturbParams(missing=0.1, spurious=0.1, seed=seed)


def test_rooms_without_neighbours_are_left_alone():
    given = model([box(0, 0, 4, 4), box(10, 0, 14, 4)])
    rooms, _, _ = disturb(*given, DisturbParams(missing=1.0, spurious=1.0))
    assert area(rooms).tolist() == [16.0, 16.0]
