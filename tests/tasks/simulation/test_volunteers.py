"""The walks of volunteers: where they are, how the device is held, and what skill changes."""

import numpy as np
import pytest
import shapely
from shapely import box

from tasks.simulation.rotations import matrices
from tasks.simulation.volunteers import VolunteerParams, habits_of, looking, walk

ROOM = box(0, 0, 6, 5)
DESK = box(0.5, 0.2, 2.1, 1.0)


def walked(skill, seed=0, **params):
    params = VolunteerParams(**params)
    return walk(ROOM, (DESK,), 0.5, skill, params, np.random.default_rng(seed))


def forward(views):
    return -matrices(views.rotations)[:, :, 2]


def test_a_level_upright_device_has_a_roll_of_ninety_degrees_whatever_its_heading():
    heading = np.linspace(-3, 3, 7)
    pitch = np.deg2rad([-35, 0, 35, 0, 10, -10, 0])
    tilt = np.deg2rad([0, 0, 0, 40, -20, 30, 0])
    a, b, c, d = looking(heading, pitch, tilt).T
    roll = np.arctan2(2 * (a * b + c * d), 1 - 2 * (b * b + c * c))  # Eq. 1
    assert roll == pytest.approx(np.arctan2(np.cos(pitch) * np.cos(tilt), -np.sin(pitch)))
    assert roll[[0, 1, 2, 3]] == pytest.approx(np.pi / 2 + pitch[[0, 1, 2, 3]])


def test_a_device_looks_along_its_heading_with_its_long_edge_up():
    (R,) = matrices(looking(np.array([np.pi / 2]), np.zeros(1), np.zeros(1)))
    assert pytest.approx([-1, 0, 0], abs=1e-12) == R @ (0, 0, -1)
    assert pytest.approx([0, 0, 1], abs=1e-12) == R @ (0, 1, 0)


@pytest.mark.parametrize("skill", [0.0, 0.5, 1.0])
def test_snapshots_are_taken_inside_the_room_at_hand_height_one_after_the_other(skill):
    walk_ = walked(skill)
    positions = walk_.views.positions
    assert shapely.contains_xy(ROOM, positions[:, :2]).all()
    assert np.ptp(positions[:, 2]) == 0 and 1.8 <= positions[0, 2] <= 2.1
    assert (np.diff(walk_.times) > 0).all()
    assert np.linalg.norm(walk_.views.rotations, axis=1) == pytest.approx(1.0)


def test_nobody_walks_or_turns_faster_than_they_do():
    params = {"sway_rad": (0.0, 0.0), "arm_m": 0.0, "dropped": (0.0, 0.0)}
    for skill in (0.0, 1.0):
        habits, scan = habits_of(skill, VolunteerParams()), walked(skill, **params)
        steps = np.linalg.norm(np.diff(scan.views.positions, axis=0), axis=1)
        assert steps.sum() > 1
        assert (steps / np.diff(scan.times)).max() <= habits.speed_m_s + 1e-9
        assert scan.views.rates.max() <= habits.turn_rad_s + 1e-9
        assert scan.path_m >= steps.sum() - 1e-9


def test_a_skilled_volunteer_sees_all_directions_level_up_and_down():
    ahead = forward(walked(1.0).views)
    heading = np.degrees(np.arctan2(ahead[:, 1], ahead[:, 0]))
    pitch = np.degrees(np.arcsin(ahead[:, 2]))
    for low, high in ((-45, -25), (-10, 10), (25, 45)):
        of = heading[(pitch > low) & (pitch < high)]
        assert np.histogram(of, 12, (-180, 180))[0].min() > 0


def test_without_skill_the_scan_is_hasty_skewed_and_skips_parts():
    good, bad = ([walked(skill, seed) for seed in range(12)] for skill in (1.0, 0.0))

    def means(scans, what):
        return np.mean([what(scan) for scan in scans])

    def skew(scan):
        a, b, c, d = scan.views.rotations.T
        roll = np.arctan2(2 * (a * b + c * d), 1 - 2 * (b * b + c * c))
        return np.abs(roll - np.pi / 2).mean()

    assert means(good, len) > 4 * means(bad, len)
    assert means(good, lambda s: np.median(s.views.rates)) < 0.8
    assert means(bad, lambda s: np.median(s.views.rates)) > 1.2
    assert means(bad, skew) > 1.5 * means(good, skew)
    gaps = [np.diff(scan.times).max() / 0.4 for scan in bad]
    assert np.rint(gaps).max() > 1


def test_volunteers_of_little_skill_skip_the_ceiling_now_and_then():
    droop = {"droop_rad": (0.0, 0.0), "coverage": (0.25, 0.25)}
    up = np.array([forward(walked(0.3, seed, **droop).views)[:, 2].max() for seed in range(30)])
    habits = habits_of(0.3, VolunteerParams())
    assert np.mean(up > 0.4) == pytest.approx(habits.look_up, abs=3 * np.sqrt(0.25 / 30))


def test_the_device_is_held_an_arm_ahead_of_the_body():
    held, body = walked(1.0), walked(1.0, arm_m=0.0)
    offset = held.views.positions - body.views.positions
    ahead = forward(held.views)[:, :2]
    assert np.linalg.norm(offset, axis=1) == pytest.approx(0.25)
    along = np.einsum("ki,ki->k", offset[:, :2], ahead) / np.linalg.norm(ahead, axis=1)
    assert along == pytest.approx(0.25)
