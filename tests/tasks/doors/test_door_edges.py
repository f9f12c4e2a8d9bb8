"""Straightened depths, edges and lines of drawn faces."""

import numpy as np
import pytest

from storage.wall_images import OCCUPIED
from tasks.doors.edges import EdgeParams, find_edges
from tasks.doors.lines import LineParams, level_lines, upright_lines
from tasks.doors.straightening import StraightParams, straightened

LEAF = (1.2, 2.16, 0.0, 1.96)
PIXEL_M = 0.04


def edges_of(face):
    straight = straightened(face.labels, face.depths, PIXEL_M, StraightParams())
    edges = find_edges(face.labels, straight, StraightParams(), EdgeParams())
    return edges.upright, edges.level


def lines_of(face):
    upright, level = edges_of(face)
    return (
        upright_lines(upright, PIXEL_M, LineParams()),
        level_lines(level, PIXEL_M, LineParams()),
    )


def test_a_wall_that_leans_and_drifts_is_straight_and_a_leaf_keeps_its_recess(scenes):
    face = scenes.Face(6.0)
    drift = np.linspace(-0.05, 0.07, len(face.depths))[:, None]
    face.depths += drift.astype(np.float32)
    face.moved(LEAF, 0.075)
    straight = straightened(face.labels, face.depths, PIXEL_M, StraightParams())
    inside = np.zeros(face.depths.shape, bool)
    inside[30:54, 0:49] = True
    assert np.median(straight.depth[inside]) == pytest.approx(0.075, abs=0.01)
    assert np.abs(straight.depth[~inside]).max() < 0.03
    assert straight.noise_m < 0.01


def test_depths_are_taken_from_the_wall_even_where_a_door_fills_most_of_it(scenes):
    face = scenes.Face(1.6).moved((0.2, 1.4, 0.0, 1.96), 0.075)
    straight = straightened(face.labels, face.depths, PIXEL_M, StraightParams())
    assert straight.depth[20, 20] == pytest.approx(0.075, abs=1e-6)
    assert straight.depth[20, 60] == pytest.approx(0, abs=1e-6)


def test_a_pixel_nothing_was_seen_through_is_unknown(scenes):
    face = scenes.Face().emptied((1, 2, 1, 2), np.nan)
    straight = straightened(face.labels, face.depths, PIXEL_M, StraightParams())
    assert np.isnan(straight.depth[30, 30])
    assert np.isnan(straight.depth).sum() == 25 * 25


def test_a_face_nobody_saw_has_no_depth_no_edge_and_no_line(scenes):
    face = scenes.Face().hidden((0, 5, 0, 2.8))
    straight = straightened(face.labels, face.depths, PIXEL_M, StraightParams())
    assert np.isnan(straight.depth).all() and np.isnan(straight.noise_m)
    assert not any(edges.any() for edges in edges_of(face))
    assert [len(lines) for lines in lines_of(face)] == [0, 0]


@pytest.mark.parametrize("by_m", [0.075, -0.06, 0.15], ids=["leaf", "cupboard", "deep"])
def test_the_outline_of_a_box_set_back_or_forth_is_edges_and_nothing_else(scenes, by_m):
    upright, level = edges_of(scenes.Face().moved((1.2, 2.16, 0.4, 1.96), by_m))
    i, j = np.nonzero(upright)
    assert {min(abs(x - 30), abs(x - 54)) <= 1 for x in i} == {True}
    # both sides along nearly all of their height
    assert all(len(set(j[abs(i - side) <= 1])) >= 36 for side in (30, 54))
    i, j = np.nonzero(level)
    assert {min(abs(y - 10), abs(y - 49)) <= 1 for y in j} == {True}
    assert all(len(set(i[abs(j - side) <= 1])) >= 20 for side in (10, 49))


def test_steps_smaller_than_noise_allows_are_no_edges(scenes):
    face = scenes.Face(noise_m=0.002, seed=4).moved(LEAF, 0.008)
    assert not any(edges.any() for edges in edges_of(face))


def test_an_opening_gives_two_uprights_and_a_head_at_their_places(scenes):
    uprights, levels = lines_of(scenes.Face(noise_m=0.004, seed=1).emptied(LEAF))
    assert uprights.places == pytest.approx([1.2, 2.16], abs=0.05)
    assert (uprights.begins <= 0.1).all()
    assert uprights.ends == pytest.approx([1.96, 1.96], abs=0.1)
    head = levels.places[levels.places > 0.2]
    assert head == pytest.approx([1.96], abs=0.05)
    assert (levels.begins[-1], levels.ends[-1]) == pytest.approx((1.2, 2.16), abs=0.1)


def test_a_line_goes_on_behind_what_hides_a_part_of_it():
    edges = np.zeros((100, 70), np.uint8)
    edges[40, 2:20] = 255
    edges[40, 25:50] = 255
    lines = upright_lines(edges, PIXEL_M, LineParams())
    assert lines.places == pytest.approx([40.5 * PIXEL_M])
    assert lines.lengths == pytest.approx([43 * PIXEL_M], abs=PIXEL_M)
    assert lines.ends[0] == pytest.approx(50 * PIXEL_M, abs=PIXEL_M)


def test_lines_are_at_most_as_many_as_asked_for_and_ascend():
    edges = np.zeros((100, 70), np.uint8)
    edges[::4, 5:60] = 255
    lines = upright_lines(edges, PIXEL_M, LineParams(most=10))
    assert len(lines) == 4  # ten per ten metres, of a face of four
    assert (np.diff(lines.places) > 0).all()


def test_the_same_edges_give_the_same_lines_twice():
    rng = np.random.default_rng(7)
    edges = np.where(rng.random((150, 70)) < 0.3, 255, 0).astype(np.uint8)
    first, second = (upright_lines(edges, PIXEL_M, LineParams()) for _ in range(2))
    assert (first.places == second.places).all() and (first.ends == second.ends).all()


def test_upright_and_level_are_told_apart_by_turning_the_picture():
    edges = np.zeros((70, 70), np.uint8)
    edges[30, 10:60] = 255
    params = LineParams()
    upright, level = upright_lines(edges, PIXEL_M, params), level_lines(edges.T, PIXEL_M, params)
    assert len(upright) == len(level) == 1
    assert upright.places == level.places
    assert len(level_lines(edges, PIXEL_M, params)) == 0


def test_all_of_a_drawn_face_is_occupied_before_it_is_changed(scenes):
    assert (scenes.Face().labels == OCCUPIED).all()
