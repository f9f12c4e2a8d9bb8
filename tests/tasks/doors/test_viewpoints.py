"""Which snapshots are asked about a face."""

import numpy as np
import pytest
import shapely
from scipy.spatial.transform import Rotation

from storage.snapshots import Snapshots, none
from tasks.doors.rays import Canvas
from tasks.doors.viewpoints import (
    ViewParams,
    chosen,
    interior_eyes,
    of_room,
    sees,
    snapshot_eyes,
)

ROOM = shapely.Polygon([(0, 0), (6, 0), (6, 2), (2, 2), (2, 5), (0, 5)])
FACE = Canvas(np.zeros(3), np.array([1.0, 0.0]), (150, 70), 0.04)
"""The room's wall along y = 0."""


def towards(azimuth):
    """Return the turn of a device held upright that looks this way, degrees from x."""
    return Rotation.from_euler("xz", [90, azimuth - 90], degrees=True)


def snapshots(positions, azimuths):
    turns = [towards(a).as_quat(scalar_first=True) for a in azimuths]
    k = len(positions)
    at = np.array(positions, float).reshape(-1, 3)
    return Snapshots(np.arange(k) * 0.1, at, np.array(turns).reshape(-1, 4), np.full(k, 1000))


def test_a_device_sees_ahead_and_not_behind_or_beside():
    eyes = snapshot_eyes([snapshots([[3, 1.5, 1.4]] * 3, [-90, 90, 0]), none()], ViewParams())
    ahead = np.array([[3.0, 0.0, 1.4]])
    assert sees(eyes, ahead, FACE.normal, 0.1)[:, 0].tolist() == [True, False, False]
    # 1.5 m away: 38 degrees across reach 0.52 m to either side, 63 degrees up 0.92 m
    for dx, dz, seen in ((0.5, 0, True), (0.55, 0, False), (0, 0.9, True), (0, 0.95, False)):
        place = ahead + np.array([dx, 0, dz])
        assert sees(eyes, place, FACE.normal, 0.1)[0, 0] == seen


def test_a_panoramic_scanner_sees_all_around_within_its_reach():
    params = ViewParams(view_across_rad=2 * np.pi, reach_m=2.0)
    eyes = snapshot_eyes([snapshots([[3, 1.5, 1.4]], [90])], params)
    places = np.array([[3.0, 0.0, 1.4], [4.3, 0.0, 1.4], [4.4, 0.0, 1.4]])
    assert sees(eyes, places, FACE.normal, 0.1)[0].tolist() == [True, True, False]


def test_the_eyes_of_a_room_are_those_in_it_and_just_outside():
    at = [[1, 4, 1.5], [5, 4, 1.5], [6.2, 1, 1.5], [6.5, 1, 1.5]]
    eyes = snapshot_eyes([snapshots(at, [0] * 4)], ViewParams())
    assert of_room(eyes, ROOM, 0.3).positions[:, 0].tolist() == [1, 6.2]


def test_places_within_a_room_fill_it_at_the_height_of_a_hand():
    eyes = interior_eyes(ROOM, 10.0, ViewParams())
    assert shapely.contains_xy(ROOM, eyes.positions[:, :2]).all()
    assert (eyes.positions[:, 2] == 11.5).all() and eyes.all_round
    assert len(eyes) == pytest.approx(ROOM.area, rel=0.2)
    closet = shapely.affinity.rotate(shapely.box(0, 0, 0.3, 3), 45)
    assert shapely.contains_xy(
        closet, interior_eyes(closet, 0, ViewParams()).positions[:, :2]
    ).all()


def test_chosen_places_see_the_face_and_the_first_of_them_are_spread_along_it():
    rng = np.random.default_rng(2)
    crowd = np.column_stack([rng.uniform(0.4, 0.6, 50), np.full(50, 1.5), np.full(50, 1.4)])
    few = [[2.5, 1.5, 1.4], [4.0, 1.6, 1.4], [5.5, 1.4, 1.4]]
    away = [[3.0, 1.0, 1.4]] * 20
    all_of = snapshots([*crowd, *few, *away], [-90] * 53 + [90] * 20)
    eyes = snapshot_eyes([all_of], ViewParams())
    picked = chosen(eyes, FACE, 0.3, 4)
    assert len(picked) == 4
    assert {tuple(p) for p in few[1:]} < {tuple(p) for p in picked.positions}
    assert len(chosen(eyes, FACE, 0.3, 1000)) == 53  # none of those that look away
    assert len(chosen(eyes.take(np.arange(53, 73)), FACE, 0.3, 4)) == 0
