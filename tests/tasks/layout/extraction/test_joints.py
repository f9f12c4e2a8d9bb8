"""Walls that nobody saw, found by the gaps they leave in the walls they join."""

import numpy as np
import pytest
from shapely import box
from shapely.affinity import rotate

from storage.faces import NOT_SEEN, SEEN_WALL, Faces
from storage.rooms import Rooms
from tasks.layout.extraction.joints import GapParams, find_joints
from tasks.layout.extraction.model import LineFrame, lay_out
from tasks.layout.extraction.presence import JointParams, joint_presence

PARAMS = GapParams()
ROOM = box(0, 0.2, 12, 5.2)
"""Two rooms of 4.8 and 7.08 m and the partition between them, 0.12 m thick, taken for one."""
AT_M = 4.86
WALL = (4.8, 4.92)


def model(pieces, angle=0.0):
    """Return a model of one room and of faces (from, to, ordinate, side of the line it looks to).

    Faces were seen all along, but for what lies between the stretches of one face.
    """
    lines, normals, profiles = [], [], []
    for stretches, y, side in pieces:
        low, high = stretches[0][0], stretches[-1][1]
        middles = low + 0.1 * (np.arange(int(np.ceil((high - low) / 0.1 - 1e-9))) + 0.5)
        seen = [any(a - 0.05 < x < b + 0.05 for a, b in stretches) for x in middles]
        lines.append([(low, y), (high, y)])
        normals.append((0.0, side, 0.0))
        profiles.append(np.where(seen, SEEN_WALL, NOT_SEEN).astype(np.uint8))
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    turn = np.array([(c, -s), (s, c)])
    lines, normals = np.array(lines, float) @ turn.T, np.array(normals)
    normals[:, :2] = normals[:, :2] @ turn.T
    k = len(lines)
    faces = Faces(
        normals=normals,
        offsets=np.einsum("kx,kx->k", normals[:, :2], lines[:, 0]),
        sides=np.ones(k, np.int8),
        lines=lines,
        heights=np.tile([0.0, 2.8], (k, 1)),
        weights=np.ones(k),
        scans=np.ones(k, np.int64),
        profiles=tuple(profiles),
        bin_m=0.1,
    )
    polygons = np.array([rotate(ROOM, angle, origin=(0, 0))], object)
    one = np.ones(1)
    rooms = Rooms(polygons, 0 * one, 2.8 * one, one, one, ((0,),))
    frame = LineFrame.between(np.zeros(2), 12 * np.array([c, s]))
    return frame, lay_out(rooms, faces, [])


def joints(pieces, angle=0.0):
    frame, made = model(pieces, angle)
    return find_joints(frame, [0], 0.8, made, PARAMS)


def face(y, side, *gaps):
    """Return the faces in one plane along the room, none before the gaps."""
    ends = [0.0, *(x for gap in gaps for x in gap), 12.0]
    return [([(a, b)], y, side) for a, b in zip(ends[::2], ends[1::2], strict=True)]


FRONT, REAR = (0.2, 1.0), (5.2, -1.0)


@pytest.mark.parametrize("angle", [0, 33, 180, 247])
def test_a_wall_is_found_where_it_joins_front_and_rear(angle):
    found = joints([*face(*FRONT, WALL), *face(*REAR, WALL)], angle)
    assert found.at == pytest.approx([AT_M], abs=0.02)
    assert np.isnan(found.faces).all() and found.scans.tolist() == [0]
    assert found.presence[0] == pytest.approx(joint_presence([1, 1], JointParams()))


def test_one_face_through_both_rooms_shows_the_gap_in_its_profile():
    found = joints([([(0.0, 4.75), (4.95, 12.0)], *FRONT)])
    assert found.at == pytest.approx([4.85], abs=0.06)


def test_a_gap_on_one_side_tells_less_and_a_wall_that_runs_through_speaks_against_it():
    both = joints([*face(*FRONT, WALL), *face(*REAR, WALL)]).presence[0]
    alone = joints(face(*FRONT, WALL)).presence[0]
    against = joints([*face(*FRONT, WALL), *face(*REAR)]).presence[0]
    assert both > 0.95 > alone > 0.5 > against > 0.1


@pytest.mark.parametrize(
    "faces",
    [
        face(*FRONT),
        face(*FRONT, (4.5, 5.4)),
        face(*FRONT, (0.3, 0.42)),
        face(*FRONT, (4.8, 4.92), (4.98, 5.4)),
        [*face(*FRONT, WALL), ([(4.0, 6.0)], 1.5, 1.0)],
    ],
    ids=["no gap", "a door", "at the side", "hardly seen beside", "furniture before it"],
)
def test_what_is_no_gap_of_a_wall_within_the_room_tells_nothing(faces):
    assert len(joints(faces).at) == 0


def test_another_face_that_covers_a_gap_closes_it():
    assert len(joints([*face(*FRONT, WALL), ([(4.0, 6.0)], 0.25, 1.0)]).at) == 0


def test_evidence_adds_up_in_log_odds():
    params = JointParams(base=-2.0, gap=3.0, solid=-1.0)
    odds = [joint_presence(s, params) for s in ([], [0, 0], [1, 0], [1, 1], [1, -1])]
    assert np.log(np.array(odds) / (1 - np.array(odds))) == pytest.approx([-2, -2, 1, 4, 0])
