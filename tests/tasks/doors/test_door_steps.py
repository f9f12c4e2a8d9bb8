"""The steps of door detection on a drawn wall: each panel's content against what was drawn."""

import numpy as np
import pytest

from storage.openings import Openings
from storage.snapshots import none
from tasks.doors.candidates import CandidateParams, find_candidates
from tasks.doors.crosscheck import on_walls
from tasks.doors.examples import CLASSES
from tasks.doors.openings import OpeningsParams
from tasks.doors.steps import face_steps, on_face
from tasks.forest import Examples, ForestParams, fit

DOOR = (1.2, 2.16, 0.0, 1.96)


@pytest.fixture(scope="module")
def scene(scenes):
    width = 5.0
    back = (width - DOOR[1], width - DOOR[0], *DOOR[2:])
    faces = (scenes.Face(width).emptied(DOOR), scenes.Face(width).emptied(back))
    images, walls, _ = scenes.two_rooms(*faces)
    return images, walls, find_candidates(images, CandidateParams())


def by_emptiness(candidates):
    """Return a forest that takes what is empty for an open door."""
    empty = candidates.feature("empty_share") > 0.8
    labels = np.where(empty, CLASSES.index("open"), CLASSES.index("other"))
    examples = Examples(
        candidates.feature("empty_share")[:, None], labels, np.full(len(labels), "drawn")
    )
    return fit(examples, ["empty_share"], CLASSES, ForestParams(trees=8))


def found(images):
    middle = [[(DOOR[0], 0.0), (DOOR[1], 0.0)], [(4.0, 0.0), (4.9, 0.0)]]
    return Openings(
        kinds=np.array(["door", "window"]),
        lines=np.array(middle),
        sill_m=np.zeros(2),
        head_m=np.array([DOOR[3], 2.2]),
        walls=np.zeros(2, np.int32),
        rooms=np.array([(0, 1), (0, -1)], np.int32),
        states=np.array(["open", ""]),
        confidences=np.ones(2),
    )


@pytest.fixture(scope="module", params=[0, 1], ids=["north", "south"])
def steps(request, scene):
    images, walls, candidates = scene
    params = CandidateParams(), OpeningsParams()
    forest, openings = by_emptiness(candidates), found(images)
    at = request.param
    return at, face_steps(at, images, walls, candidates, openings, [none()], forest, params)


def drawn_on(face, width=5.0):
    """Return where the door lies on a face: the south one runs the other way."""
    along = DOOR[:2] if face == 0 else (width - DOOR[1], width - DOOR[0])
    return np.array([*along, *DOOR[2:]])


def test_edges_and_lines_lie_along_the_door(steps):
    face, made = steps
    begin, end, _, head = drawn_on(face)
    assert made.edges.canny.any() and made.edges.sobel.any()
    both = (made.edges.upright > 0) | (made.edges.level > 0)
    np.testing.assert_array_equal(both, made.edges.canny | made.edges.sobel)
    np.testing.assert_allclose(made.uprights.places, [begin, end], atol=0.06)
    assert np.abs(made.levels.places - head).min() < 0.06


def test_what_is_told_and_clustered_are_candidates_at_the_door(steps):
    face, made = steps
    door = drawn_on(face)
    assert 0 < len(made.likely) < len(made.candidates)
    at = np.abs(made.likely[:, :2] - door[:2]).max(axis=1) < 0.5
    assert at.all() and len(made.clustered) == len(made.clusters) > 0
    own = {tuple(box) for box in np.round(made.candidates, 6)}
    assert {tuple(box) for box in np.round(made.likely, 6)} <= own


def test_doors_found_lie_on_the_face_and_windows_do_not(steps):
    face, made = steps
    np.testing.assert_allclose(made.doors, drawn_on(face)[None], atol=1e-9)


def test_boxes_on_walls_lie_on_their_face_where_they_were(scene):
    images, walls, candidates = scene
    boxes = on_walls(candidates, images, walls)
    for face in (0, 1):
        mine = candidates.take(candidates.faces == face)
        back = on_face(boxes[candidates.faces == face], face, images, walls)
        expected = [mine.from_m, mine.to_m, mine.sill_m, mine.head_m]
        np.testing.assert_allclose(back, np.column_stack(expected), atol=1e-9)
