"""What is measured of candidates, against plain numpy, and what both faces of a wall say."""

from dataclasses import replace

import numpy as np
import pytest

from storage.candidates import FEATURES, FIG_10, THERE
from storage.wall_images import EMPTY, OCCLUDED, OCCUPIED
from tasks.doors.candidates import CandidateParams, face_view, find_candidates
from tasks.doors.features import FeatureParams, apart_m, features_of, on_opposite

PIXEL_M = 0.04
LEAF = (1.2, 2.16, 0.0, 1.96)
PARAMS = CandidateParams()


def measured(images, face, box):
    views = [face_view(images, f, PARAMS) for f in range(len(images))]
    row = features_of(images, views, face, np.array([box]), FeatureParams())
    return dict(zip(FEATURES, row[0], strict=True))


def test_fig_10s_eight_are_sizes_and_distances_to_the_walls_ends(scenes):
    found = measured(scenes.alone(scenes.Face(5.0)), 0, (1.2, 2.16, 0.0, 1.96))
    expected = (0.96, 1.96, 5.0, 2.8, 1.2, 2.84, 0.0, 0.84)
    assert [found[name] for name in FIG_10] == pytest.approx(expected)


def test_shares_are_those_of_the_pixels(scenes):
    rng = np.random.default_rng(8)
    face = scenes.Face(5.0, noise_m=0.02, seed=8)
    face.labels[:] = rng.integers(0, 4, face.labels.shape)
    face.depths[:] = np.where(rng.random(face.depths.shape) < 0.3, np.nan, face.depths)
    images = scenes.alone(face)
    found = measured(images, 0, LEAF)
    view = face_view(images, 0, PARAMS)
    labels, depth = view.labels[30:54, 0:49], view.depth[30:54, 0:49]
    for name, label in (("occupied", OCCUPIED), ("empty", EMPTY), ("occluded", OCCLUDED)):
        assert found[f"{name}_share"] == pytest.approx((labels == label).mean())
    seen = np.isfinite(depth)
    hits = depth[seen & (labels != EMPTY)]
    assert found["back_share"] == pytest.approx((depth[seen] > 0.03).mean())
    assert found["through_share"] == pytest.approx((seen & (labels == EMPTY)).mean())
    assert found["recess_m"] == pytest.approx(np.median(hits), abs=1e-4)
    low, high = np.percentile(hits, (10, 90))
    assert found["spread_m"] == pytest.approx((high - low) / 2, rel=0.05)
    columns = np.broadcast_to(np.arange(24)[:, None] * PIXEL_M, depth.shape)
    slope = np.polyfit(columns[seen & (labels != EMPTY)], hits, 1)[0]
    assert found["slant"] == pytest.approx(abs(slope), abs=1e-6)
    outside = view.depth[24:30, 0:49]
    left = (outside[np.isfinite(outside)] > 0.03).mean()
    assert found["left_back_share"] == pytest.approx(left)


def test_a_leaf_set_back_has_edges_all_around_and_steps_of_its_recess(scenes):
    found = measured(scenes.alone(scenes.Face().moved(LEAF, 0.075)), 0, LEAF)
    assert min(found["left_edge"], found["right_edge"], found["head_edge"]) > 0.9
    steps = [found[name] for name in ("left_step_m", "right_step_m", "over_step_m", "recess_m")]
    assert steps == pytest.approx([0.075] * 4, abs=0.005)
    assert found["back_share"] == 1 and found["slant"] < 0.01
    beside = measured(scenes.alone(scenes.Face().moved(LEAF, 0.075)), 0, (3.0, 3.96, 0.0, 1.96))
    assert max(beside["left_edge"], beside["right_edge"], beside["head_edge"]) == 0


def test_rims_are_what_lies_just_within_a_side_behind_what_lies_beyond_its_frame(scenes):
    face = scenes.Face(5.0, noise_m=0.02, seed=4).moved(LEAF, 0.03)
    images = scenes.alone(face)
    found, depth = measured(images, 0, LEAF), face_view(images, 0, PARAMS).depth.clip(-0.1, 0.1)
    sides = {
        "left_rim_m": (depth[30:34, 0:49], depth[24:28, 0:49]),
        "right_rim_m": (depth[50:54, 0:49], depth[56:60, 0:49]),
        "head_rim_m": (depth[30:54, 45:49], depth[30:54, 51:55]),
    }
    for name, (within, beyond) in sides.items():
        assert found[name] == pytest.approx(np.nanmean(within) - np.nanmean(beyond), abs=1e-6)
        assert found[name] == pytest.approx(0.03, abs=0.01)


def test_a_windows_foot_is_wall_and_a_leafs_is_not(scenes):
    window = (1.2, 2.16, 1.0, 1.96)
    parapet = measured(scenes.alone(scenes.Face().moved(window, 0.075)), 0, LEAF)
    leaf = measured(scenes.alone(scenes.Face().moved(LEAF, 0.075)), 0, LEAF)
    assert parapet["foot_step_m"] == pytest.approx(0, abs=0.002)
    assert leaf["foot_step_m"] == pytest.approx(0.075, abs=0.002)
    # seen on one side alone
    beside = scenes.Face().moved(LEAF, 0.075)
    beside.depths[:30] = np.nan
    assert measured(scenes.alone(beside), 0, LEAF)["foot_step_m"] == pytest.approx(0.075, abs=0.01)


def test_a_frame_stands_out_of_the_wall_by_what_it_does(scenes):
    face = scenes.Face().moved((1.12, 2.24, 0, 2.04), -0.012).moved(LEAF, 0.012)
    assert measured(scenes.alone(face), 0, LEAF)["frame_m"] == pytest.approx(0.012, abs=0.004)


def test_the_other_face_is_measured_at_the_same_place(scenes):
    north = scenes.Face(5.0)
    south = scenes.Face(5.0).moved((5 - 2.16, 5 - 1.2, 0, 1.96), 0.075)
    images, _, _ = scenes.two_rooms(north, south)
    there = measured(images, 0, LEAF)
    own = measured(images, 1, (5 - 2.16, 5 - 1.2, 0.0, 1.96))
    for name in THERE:
        assert there[f"opposite_{name}"] == pytest.approx(own[name], nan_ok=True), name
    assert there["recess_m"] == pytest.approx(0, abs=1e-6)
    assert there["other_room"] == 1 and there["thickness_m"] == pytest.approx(0.12)


def test_without_another_face_nothing_is_known_of_it(scenes):
    found = measured(scenes.alone(scenes.Face()), 0, LEAF)
    assert found["other_room"] == 0
    assert all(np.isnan(found[f"opposite_{name}"]) for name in THERE)


def test_to_the_other_face_and_back_is_the_same_place(scenes):
    images, _, _ = scenes.two_rooms(scenes.Face(5.0), scenes.Face(5.0))
    images = replace(images, base_m=np.array([0.0, 0.3]))
    boxes = np.array([LEAF, (3.0, 4.5, 0.9, 2.2)])
    there = on_opposite(images, 0, boxes)
    assert there[0] == pytest.approx((5 - 2.16, 5 - 1.2, -0.3, 1.66))
    assert on_opposite(images, 1, there) == pytest.approx(boxes)
    assert apart_m(images, 0) == apart_m(images, 1) == pytest.approx(0.12)


def test_candidates_hold_every_door_and_window_of_a_drawn_wall(scenes):
    face = scenes.Face(8.0, noise_m=0.005, seed=5)
    true = [(1.0, 1.96, 0.0, 1.96), (3.0, 4.52, 0.92, 2.2), (6.0, 6.96, 0.0, 1.96)]
    face.emptied(true[0]).moved(true[1], 0.12).moved(true[2], 0.075)
    found = find_candidates(scenes.alone(face), PARAMS)
    boxes = np.column_stack([found.from_m, found.to_m, found.sill_m, found.head_m])
    for box in true:
        assert np.abs(boxes - box).max(axis=1).min() <= 0.06
    assert found.features.shape == (len(found), len(FEATURES))
    assert not np.isinf(found.features).any()


def test_heights_are_the_buildings_where_a_wall_stands_on_an_upper_floor(scenes):
    images = scenes.alone(scenes.Face(4.0).emptied(LEAF))
    ground, upper = (
        find_candidates(replace(images, base_m=np.array([base])), PARAMS) for base in (0.0, 3.2)
    )
    assert upper.head_m == pytest.approx(ground.head_m + 3.2)
    np.testing.assert_array_equal(upper.features, ground.features)


def test_a_bare_wall_and_a_storey_without_walls_have_no_candidates(scenes):
    assert len(find_candidates(scenes.alone(scenes.Face(5.0)), PARAMS)) == 0
    assert len(find_candidates(scenes.images_of([], [], [], [], [], []), PARAMS)) == 0


def test_the_same_images_give_the_same_candidates_twice(scenes):
    face = scenes.Face(6.0, noise_m=0.03, seed=9).moved(LEAF, 0.075)
    first, second = (find_candidates(scenes.alone(face), PARAMS) for _ in range(2))
    assert first.features.tobytes() == second.features.tobytes()
