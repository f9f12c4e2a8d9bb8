"""Candidates named by a true plan."""

import numpy as np
import pytest
from shapely import LineString

from storage.candidates import FEATURES, Candidates
from storage.plan import Plan, PlanOpening
from tasks.doors.examples import AMBIGUOUS, CLASSES, ExampleParams, examples, label, mirrored


def candidates(*boxes, faces=None):
    begin, end, sill, head = np.array(boxes, float).reshape(-1, 4).T
    n = len(boxes)
    rows = np.zeros(n, np.int32) if faces is None else np.array(faces, np.int32)
    features = np.random.default_rng(1).normal(size=(n, len(FEATURES)))
    return Candidates(rows, begin, end, sill, head, features)


def plan(doors=(), windows=()):
    return Plan("b", "1", doors=tuple(doors), windows=tuple(windows))


def door(begin, end, y=-0.06, state="shut", head=2.0):
    return PlanOpening("d", LineString([(begin, y), (end, y)]), 0.0, head, state=state)


WINDOW = PlanOpening("n", LineString([(3, -0.1), (4.5, -0.1)]), 0.9, 2.2)


def names(found):
    return ["ambiguous" if i == AMBIGUOUS else CLASSES[i] for i in found]


@pytest.fixture
def images(scenes):
    return scenes.two_rooms(scenes.Face(6.0), scenes.Face(6.0))[0]


def test_a_candidate_is_what_it_covers(images):
    # IoU 1, 0.7/1.3, 0.5/1.5, and of the window
    found = candidates((1, 2, 0, 2), (1.3, 2.3, 0, 2), (1.5, 2.5, 0, 2), (3.1, 4.5, 0.9, 2.2))
    truth = plan([door(1, 2)], [WINDOW])
    labels = names(label(found, images, truth, ExampleParams()))
    assert labels == ["shut", "ambiguous", "other", "window"]


def test_heights_count(images):
    found = candidates((1, 2, 0, 2), (1, 2, 0, 0.7))
    assert names(label(found, images, plan([door(1, 2)]), ExampleParams())) == ["shut", "other"]
    # where nobody knows the head of a door, its width decides
    unknown = plan([door(1, 2, head=None)])
    assert names(label(found, images, unknown, ExampleParams())) == ["shut", "shut"]


def test_both_faces_of_the_wall_see_the_door_and_other_walls_do_not(images):
    mirrored_box = (6 - 2, 6 - 1, 0, 2)
    found = candidates((1, 2, 0, 2), mirrored_box, faces=[0, 1])
    on_the_wall = plan([door(1, 2, y=0.0, state="open")])
    assert names(label(found, images, on_the_wall, ExampleParams())) == ["open", "open"]
    elsewhere = plan([door(1, 2, y=1.0)])
    assert names(label(found, images, elsewhere, ExampleParams())) == ["other", "other"]


def test_a_door_of_a_wall_across_is_none_of_this_wall(images):
    across = PlanOpening("d", LineString([(1.5, -0.5), (1.5, 0.5)]), 0.0, 2.0, state="open")
    found = label(candidates((1, 2, 0, 2)), images, plan([across]), ExampleParams())
    assert names(found) == ["other"]


@pytest.mark.parametrize("state", [None, "unknown"])
def test_a_door_whose_leaf_nobody_knows_teaches_nothing(images, state):
    truth = plan([door(1, 2, state=state)])
    found = candidates((1, 2, 0, 2), (4, 5, 0, 2))
    assert names(label(found, images, truth, ExampleParams())) == ["ambiguous", "other"]
    assert len(examples(found, images, truth, ExampleParams())) == 2  # the other, and its mirror


def test_examples_stand_beside_their_mirror_images_in_the_group_of_their_storey(images):
    found = candidates((1, 2, 0, 2), (4, 5, 0, 2))
    made = examples(found, images, plan([door(1, 2)]), ExampleParams())
    assert names(made.labels) == ["shut", "other"] * 2
    assert set(made.groups) == {"b/1"}
    left, right = FEATURES.index("left_m"), FEATURES.index("right_m")
    assert (made.features[2:, left] == found.features[:, right]).all()
    assert (mirrored(made.features[2:]) == found.features).all()
    same = FEATURES.index("width_m")
    assert (made.features[2:, same] == found.features[:, same]).all()
