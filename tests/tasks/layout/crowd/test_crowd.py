"""Repeated scans of walls between decoded rooms: combined by hand, outliers named, order aside."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from storage.sightings import DRIFTS, OFF
from tasks.layout.crowd.crowd import CrowdParams, fuse_scans
from tests.tasks.layout.crowd.three_rooms import (
    DECODED,
    OBSERVED,
    PARTITION_M,
    faces,
    of_room,
    scan,
)

PARAMS = CrowdParams()


def fused(*scans, params=PARAMS):
    """Return what scans saw, in the frame of the decoded walls."""
    return fuse_scans(OBSERVED, DECODED, scans, PARTITION_M, params)


def why(found, scan):
    """Return why the sightings of a scan do not count."""
    return found.left_out[found.scans == scan].tolist()


def test_scans_of_a_face_are_combined_by_inverse_variance():
    found = fused(of_room(1), of_room(1, 0.03), of_room(1, -0.006))
    of_face = (found.walls == 1) & (found.sides == 1)
    assert found.scans[of_face].tolist() == [0, 1, 2]
    assert found.at_m[of_face] == pytest.approx(faces(1)[1] + np.array([0, 0.03, -0.006]))
    assert found.fused_m[of_face] == pytest.approx(faces(1)[1] + 0.024 / 3)
    # three of one variance: a third of it is the mean's
    assert found.fused_sigma_m[of_face] == pytest.approx(PARAMS.sigma_scan_m / np.sqrt(3))
    assert not found.left_out.any() and not found.drift_m.any()


def test_a_scan_that_is_off_at_all_its_walls_is_named_and_left_out():
    found = fused(of_room(1), of_room(1, 0.3), of_room(1, 0.01), of_room(0))
    assert why(found, 1) == [DRIFTS, DRIFTS]
    assert {*why(found, 0), *why(found, 2), *why(found, 3)} == {""}
    assert found.drift_m[found.scans == 1] == pytest.approx(0.3, abs=0.02)
    of_face = (found.walls == 1) & (found.sides == 1)
    assert found.fused_m[of_face] == pytest.approx(faces(1)[1] + 0.005)
    assert found.fused_sigma_m[of_face] == pytest.approx(PARAMS.sigma_scan_m / np.sqrt(2))


def test_what_a_rooms_neighbours_saw_of_its_walls_tells_which_of_two_scans_is_off():
    found = fused(of_room(0), of_room(1, -0.4), of_room(1), of_room(2))
    assert why(found, 1) == [DRIFTS, DRIFTS]
    assert not {*why(found, 0), *why(found, 2), *why(found, 3)} - {""}


def test_of_two_scans_that_differ_neither_is_named():
    found = fused(of_room(1), of_room(1, 0.3))
    assert not found.left_out.any() and not found.drift_m.any()
    # they scatter by half their distance about the mean
    of_face = (found.walls == 1) & (found.sides == 1)
    assert found.fused_m[of_face] == pytest.approx(faces(1)[1] + 0.15)
    assert found.fused_sigma_m[of_face] == pytest.approx(0.15)


def test_furniture_before_one_wall_is_no_drift():
    before = scan((faces(1)[1] + 0.4, 1), (faces(2)[0], -1))
    found = fused(of_room(1), before, of_room(1, 0.01), of_room(1, -0.01))
    assert sorted(why(found, 1)) == ["", OFF]
    assert not found.drift_m.any()
    assert found.fused_m[(found.walls == 1) & (found.sides == 1)] == pytest.approx(faces(1)[1])


def test_a_room_that_looks_wider_to_one_scan_is_no_drift():
    wide = scan((faces(1)[1] - 0.2, 1), (faces(2)[0] + 0.2, -1))
    found = fused(of_room(1), wide, of_room(1, 0.01), of_room(1, -0.01))
    assert not (found.left_out == DRIFTS).any()


def test_a_face_that_only_a_drifting_scan_saw_is_moved_back():
    # the scan saw the far wall of the next room as well, which nobody else did
    far = scan((faces(1)[1] + 0.3, 1), (faces(2)[0] + 0.3, -1), (faces(3)[0] + 0.3, -1))
    found = fused(of_room(1), far, of_room(1))
    alone = (found.walls == 3) & (found.scans == 1)
    assert found.left_out[alone].tolist() == [""]
    assert found.drift_m[alone] == pytest.approx([0.3])
    assert found.fused_m[alone] == pytest.approx([faces(3)[0]])
    # its own deviation, that of the two others' mean over two faces, and its own over these
    drift = np.sqrt((0.02**2 + 0.02**2 / 2) / 2)
    assert found.fused_sigma_m[alone] == pytest.approx([np.hypot(0.02, drift)])


@settings(max_examples=25, deadline=None)
@given(st.permutations(range(6)))
def test_the_order_of_scans_does_not_matter(order):
    scans = [of_room(0), of_room(1), of_room(1, 0.25), of_room(1, 0.01), of_room(2), of_room(2)]
    first = fused(*scans)
    second = fused(*(scans[i] for i in order))
    places = [order.index(i) for i in range(6)]

    def told(found, number):
        columns = (found.walls, found.sides, number, found.left_out)
        numbers = np.round([found.at_m, found.drift_m, found.fused_m, found.fused_sigma_m], 9)
        return sorted(zip(*(c.tolist() for c in (*columns, *numbers)), strict=True))

    assert told(first, np.array(places)[first.scans]) == told(second, second.scans)
    assert (first.left_out == DRIFTS).sum() == 2


def test_false_alarms_are_as_rare_as_said():
    rng = np.random.default_rng(4)
    params = CrowdParams(p_outlier=0.01)
    wrong = tested = 0
    for _ in range(80):
        scans = [of_room(1, shift) for shift in rng.normal(0, params.sigma_scan_m, 5)]
        found = fused(*scans, params=params)
        wrong += len(np.unique(found.scans[found.left_out == DRIFTS]))
        tested += 5
    # what a scan's two sides say is one shift here: each is beyond a tenth's limit together
    assert wrong <= 0.1 * tested


def test_what_is_seen_through_a_door_is_not_compared():
    short = scan((faces(1)[1] + 0.3, 1))
    short.lines[0] = [(faces(1)[1] + 0.3, 0.2), (faces(1)[1] + 0.3, 1.5)]
    assert len(fused(of_room(1), short)) == 2


def test_without_scans_there_are_no_sightings():
    assert len(fused()) == 0
