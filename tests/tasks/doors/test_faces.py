"""Which side of a wall looks at which room."""

import numpy as np
import pytest
import shapely
from shapely import box

from storage.rooms import Rooms
from storage.walls import Walls
from tasks.doors.faces import wall_faces


def rooms(*polygons):
    n = len(polygons)
    made = np.empty(n, object)
    made[:] = polygons
    return Rooms(made, np.zeros(n), np.full(n, 2.5), np.ones(n), np.ones(n), ((0,),) * n)


def walls(lines, thickness, sides):
    w = len(lines)
    return Walls(
        np.array(lines, float).reshape(-1, 2, 2), np.array(thickness, float),
        np.zeros(w), np.full(w, 2.5), np.array(sides, np.int32).reshape(-1, 2), np.ones(w),
    )  # fmt: skip


TWO = rooms(box(0, 0, 4, 3), box(0, 3.2, 4, 6))
BETWEEN = [[0.5, 3.1], [3.5, 3.1]]


@pytest.mark.parametrize("line", [BETWEEN, BETWEEN[::-1]])
@pytest.mark.parametrize("sides", [(0, 1), (1, 0)])
def test_a_wall_between_rooms_has_a_face_on_each_outline_with_its_room_to_the_left(line, sides):
    faces = wall_faces(TWO, walls([line], [0.2], [sides]))
    assert sorted(faces.rooms) == [0, 1]
    assert faces.walls.tolist() == [0, 0] and faces.opposite.tolist() == [1, 0]
    ends = faces.origins + faces.axes * faces.lengths[:, None]
    for f, room in enumerate(faces.rooms):
        outline = TWO.polygons[room].exterior
        np.testing.assert_allclose(
            shapely.distance(outline, shapely.points([faces.origins[f], ends[f]])), 0, atol=1e-9
        )
        before = (
            faces.origins[f] + faces.axes[f] + 0.1 * np.array([-faces.axes[f, 1], faces.axes[f, 0]])
        )
        assert TWO.polygons[room].contains(shapely.Point(before))
    # each begins where the other ends, across the wall
    np.testing.assert_allclose(np.abs(faces.origins - ends[::-1]), [[0, 0.2], [0, 0.2]], atol=1e-9)


def test_a_wall_known_by_one_face_has_that_face_only():
    faces = wall_faces(TWO, walls([[[4, 0], [4, 3]]], [np.nan], [(0, -1)]))
    assert faces.rooms.tolist() == [0] and faces.opposite.tolist() == [-1]
    np.testing.assert_allclose(faces.origins, [[4, 0]])
    np.testing.assert_allclose(faces.axes, [[0, 1]])
    assert np.isnan(faces.thickness_m).all()


def test_faces_of_several_walls_find_their_opposites():
    lines = [[[4, 0], [4, 3]], BETWEEN, [[0, 0], [4, 0]], BETWEEN]
    sides = [(0, -1), (0, 1), (0, -1), (1, 0)]
    faces = wall_faces(TWO, walls(lines, [np.nan, 0.2, np.nan, 0.2], sides))
    assert faces.walls.tolist() == [0, 1, 1, 2, 3, 3]
    assert faces.opposite.tolist() == [-1, 2, 1, -1, 5, 4]


def test_no_walls_have_no_faces():
    assert len(wall_faces(TWO, walls([], [], []))) == 0
