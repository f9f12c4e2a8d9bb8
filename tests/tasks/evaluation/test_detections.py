"""A mapped plan against a true one: cases worked by hand, and what must not change a score."""

from dataclasses import replace
from hashlib import sha256

import numpy as np
import pytest
import shapely
from shapely import LineString, box
from shapely.affinity import affine_transform, rotate, translate

from storage.detections import Detections
from storage.plan import Plan, PlanFurniture, PlanOpening, PlanRoom, PlanWall
from storage.plan_geojson import write_plan
from storage.sources import Source
from tasks.evaluation.detections import EvaluationParams, detect, evaluate_plans
from tasks.evaluation.scores import scores

DEFAULT = EvaluationParams()
NOTHING = Plan("b", "0")


def plan(rooms=(), walls=(), doors=(), windows=(), furniture=()):
    return Plan(
        "b", "0", tuple(rooms), tuple(walls), tuple(doors), tuple(windows), tuple(furniture)
    )


def door(name, x0, x1, y=0.0, sill=0.0, head=2.0, rooms=()):
    return PlanOpening(name, LineString([(x0, y), (x1, y)]), sill, head, rooms=tuple(rooms))


def wall(name, *coordinates):
    return PlanWall(name, LineString(coordinates))


def score(found, truth, class_, metric, threshold, params=DEFAULT):
    (found_score,) = [
        s
        for s in scores(detect(found, truth, params))
        if (s.class_, s.metric, s.threshold) == (class_, metric, threshold)
    ]
    return found_score


def counts(*args):
    s = score(*args)
    return s.n_true, s.n_found, s.n_matched


def keys(detections):
    return {(s.class_, s.metric, s.threshold) for s in scores(detections)}


HOUSE = plan(
    rooms=[
        PlanRoom("a", box(0, 0, 4, 5), "office"),
        PlanRoom("b", box(4.2, 0, 9, 5), "office"),
        PlanRoom("c", box(0, 5.2, 9, 8), "corridor"),
    ],
    walls=[
        wall("w1", (4.1, 0), (4.1, 5)),
        wall("w2", (0, 5.1), (4.1, 5.1)),
        wall("w3", (4.1, 5.1), (9, 5.1)),
    ],
    doors=[
        door("da", 1, 2, 5.1, rooms=("a", "c")),
        door("db", 6, 7, 5.1, rooms=("b", "c")),
        door("out", 3, 4, 8.1, rooms=("c",)),
    ],
    windows=[door("wa", 1, 3, -0.1, 0.9, 2.1)],
    furniture=[
        PlanFurniture("t", box(1, 1, 2, 3), "table", 0.0, 0.75),
        PlanFurniture("s", box(2.2, 1, 2.7, 1.5), "chair", 0.0, 0.9),
    ],
)


def test_a_plan_finds_all_of_itself():
    found = scores(detect(HOUSE, HOUSE, DEFAULT))
    assert {(s.precision, s.recall, s.f1) for s in found} == {(1.0, 1.0, 1.0)}
    assert all(
        s.value == pytest.approx(0 if s.metric in ("distance_m", "links") else 1) for s in found
    )
    assert {s.class_accuracy for s in found} == {None, 1.0}


def test_nothing_found_misses_all_and_has_no_precision():
    found = scores(detect(NOTHING, HOUSE, DEFAULT))
    assert {(s.n_found, s.precision, s.recall, s.f1, s.value) for s in found} == {
        (0, None, 0.0, 0.0, None)
    }
    assert keys(detect(NOTHING, HOUSE, DEFAULT)) == keys(detect(HOUSE, HOUSE, DEFAULT))


def test_of_nothing_true_all_found_is_false_and_there_is_no_recall():
    found = scores(detect(HOUSE, NOTHING, DEFAULT))
    assert {(s.n_true, s.precision, s.recall, s.f1, s.value) for s in found} == {
        (0, 0.0, None, 0.0, None)
    }
    assert keys(detect(HOUSE, NOTHING, DEFAULT)) == keys(detect(HOUSE, HOUSE, DEFAULT))


def test_nothing_against_nothing_has_no_rows():
    detections = detect(NOTHING, NOTHING, DEFAULT)
    assert len(detections) == 0 and scores(detections) == []


def test_each_object_is_in_one_row_of_each_metric_and_threshold():
    moved = replace(HOUSE, rooms=HOUSE.rooms[:2], doors=HOUSE.doors[1:], furniture=())
    detections = detect(moved, HOUSE, DEFAULT)
    for ids in (detections.true_ids, detections.found_ids):
        columns = (detections.classes, detections.metrics, detections.thresholds, ids)
        named = [row for row in zip(*columns, strict=True) if row[-1]]
        assert len(set(named)) == len(named)
    assert ((detections.true_ids != "") | (detections.found_ids != "")).all()
    matched = (detections.true_ids != "") & (detections.found_ids != "")
    assert (np.isnan(detections.values) == ~matched).all()


def test_rooms_count_when_more_than_half_is_shared():
    truth = plan(rooms=[PlanRoom("a", box(0, 0, 4, 5)), PlanRoom("b", box(10, 0, 14, 5))])
    found = plan(
        rooms=[
            PlanRoom("x", box(0, 0, 3, 5)),  # 15 / 20
            PlanRoom("y", box(10, 0, 12, 5)),  # 10 / 20 is not more than half
            PlanRoom("z", box(30, 0, 34, 5)),
        ]
    )
    half = score(found, truth, "room", "iou", 0.5)
    assert (half.n_true, half.n_found, half.n_matched) == (2, 3, 1)
    assert (half.precision, half.recall) == (pytest.approx(1 / 3), 0.5)
    assert half.f1 == pytest.approx(2 * (1 / 3) * 0.5 / (1 / 3 + 0.5))
    assert half.value == pytest.approx(0.75)
    assert counts(found, truth, "room", "iou", 0.0) == (2, 3, 2)


def test_areas_stand_in_the_rows_of_rooms_only():
    found = replace(HOUSE, rooms=(PlanRoom("x", box(0, 0, 3, 5)),))
    d = detect(found, HOUSE, DEFAULT)
    at = (d.classes == "room") & (d.metrics == "iou") & (d.thresholds == 0)
    assert d.true_m2[at] == pytest.approx([20, 24, 25.2])
    assert d.found_m2[at] == pytest.approx([15, np.nan, np.nan], nan_ok=True)
    assert np.isnan(d.true_m2[d.classes != "room"]).all()


def test_a_room_of_another_class_is_found_but_not_as_what_it_is():
    rooms = (replace(HOUSE.rooms[0], class_="corridor"), *HOUSE.rooms[1:])
    found = replace(HOUSE, rooms=rooms)
    assert score(found, HOUSE, "room", "iou", 0.5).class_accuracy == pytest.approx(2 / 3)
    assert counts(found, HOUSE, "room", "iou", 0.5) == (3, 3, 3)
    assert counts(found, HOUSE, "room", "iou_class", 0.5) == (3, 3, 2)


def test_a_truth_without_classes_says_nothing_about_classes():
    bare = replace(HOUSE, rooms=tuple(replace(room, class_=None) for room in HOUSE.rooms))
    detections = detect(HOUSE, bare, DEFAULT)
    assert "iou_class" not in detections.metrics
    assert score(HOUSE, bare, "room", "iou", 0.5).class_accuracy is None
    # but a plan that does not name the class of a room has it wrong
    assert score(bare, HOUSE, "room", "iou", 0.5).class_accuracy == 0


def test_corners_are_found_within_ten_or_twenty_centimetres():
    truth = plan(rooms=[PlanRoom("a", box(0, 0, 4, 5))])
    # corners move by 0, 0.15 (two), and 0.15 both ways: 0.21
    found = plan(rooms=[PlanRoom("x", box(0, 0, 4.15, 5.15))])
    assert counts(found, truth, "corner", "distance_m", 0.1) == (4, 4, 1)
    assert counts(found, truth, "corner", "distance_m", 0.2) == (4, 4, 3)
    assert score(found, truth, "corner", "distance_m", 0.2).value == pytest.approx(0.1)


def test_a_vertex_on_a_straight_edge_is_no_corner_and_those_of_a_hole_are():
    square = box(0, 0, 4, 5)
    dense = shapely.segmentize(square, 0.5)
    ring = square.difference(box(1, 1, 2, 2))
    truth = plan(rooms=[PlanRoom("a", square)])
    assert len(dense.exterior.coords) > 30
    assert counts(plan(rooms=[PlanRoom("x", dense)]), truth, "corner", "distance_m", 0.1) == (
        4,
        4,
        4,
    )
    assert counts(plan(rooms=[PlanRoom("x", ring)]), truth, "corner", "distance_m", 0.1) == (
        4,
        8,
        4,
    )


@pytest.mark.parametrize(("away", "limits"), [(0.04, 3), (0.09, 2), (0.19, 1), (0.21, 0)])
def test_walls_are_found_by_both_their_ends_in_either_order(away, limits):
    truth = plan(walls=[wall("w", (0, 0), (0, 5))])
    found = plan(walls=[wall("v", (away, 5), (0, 0))])
    matched = [counts(found, truth, "wall", "distance_m", t)[2] for t in (0.2, 0.1, 0.05)]
    assert matched == [1] * limits + [0] * (3 - limits)
    ends = [counts(found, truth, "wall_end", "distance_m", t)[2] for t in (0.2, 0.1, 0.05)]
    assert ends == [2] * limits + [1] * (3 - limits)


def test_a_wall_that_is_near_along_x_only_is_not_found():
    # what |dx| alone, as the public evaluator of CV4AEC has it, would call exact
    truth = plan(walls=[wall("w", (0, 0), (0, 5))])
    found = plan(walls=[wall("v", (0, 2), (0, 9))])
    assert counts(found, truth, "wall_end", "distance_m", 0.2) == (2, 2, 0)
    assert counts(found, truth, "wall", "distance_m", 0.2) == (1, 1, 0)


def test_openings_share_width_and_height_on_the_wall_plane():
    truth = plan(doors=[door("d", 0, 1)])
    found = plan(doors=[door("e", 0.2, 1.2, y=0.1, head=1.8)])
    # 0.8 of 1.2 along the wall; 0.8 x 1.8 of 2 + 1.8 - 1.44 on its plane
    assert score(found, truth, "door", "iou_width", 0.5).value == pytest.approx(0.8 / 1.2)
    assert score(found, truth, "door", "iou", 0.5).value == pytest.approx(1.44 / 2.36)
    low = plan(doors=[door("e", 0.2, 1.2, head=1.2)])
    assert counts(low, truth, "door", "iou_width", 0.5) == (1, 1, 1)
    assert counts(low, truth, "door", "iou", 0.5) == (1, 1, 0)


def test_the_width_error_of_a_matched_opening_is_found_less_true():
    truth = plan(windows=[door("w", 0, 1), door("x", 4, 6)])
    found = plan(windows=[door("v", 0.1, 0.9)])
    d = detect(found, truth, DEFAULT)
    assert d.width_error_m == pytest.approx([-0.2, np.nan] * 2, nan_ok=True)


@pytest.mark.parametrize(
    "other",
    [door("e", 0, 1, y=0.35), door("e", 1.1, 2.1), PlanOpening("e", LineString([(0, 0), (1, 1)]))],
    ids=["another wall", "beside", "askew"],
)
def test_an_opening_elsewhere_is_another(other):
    truth = plan(doors=[door("d", 0, 1)])
    assert counts(plan(doors=[other]), truth, "door", "iou_width", 0.5) == (1, 1, 0)


def test_heights_that_nobody_knows_are_not_invented():
    known, unknown = door("d", 0, 1), door("e", 3, 4, sill=None, head=None)
    # nothing true says its height: no score
    d = detect(plan(doors=[known]), plan(doors=[unknown]), DEFAULT)
    assert keys(d) == {("door", "iou_width", 0.5)}
    # a true door that does not say it is left out, with the one in its place and no other
    truth = plan(doors=[known, unknown])
    false = door("f", 7, 8)
    assert counts(plan(doors=[known, door("e", 3, 4), false]), truth, "door", "iou", 0.5) == (
        1,
        2,
        1,
    )
    # a found door that does not say it is not found
    blind = plan(doors=[door("d", 0, 1, sill=None, head=None)])
    assert counts(blind, truth, "door", "iou", 0.5) == (1, 1, 0)


def test_a_door_is_that_of_the_two_rooms_it_links_wherever_it_is():
    rooms = tuple(replace(room, id=f"found {room.id}") for room in HOUSE.rooms)
    doors = (
        door("1", 3, 3.5, 5.1, rooms=("found c", "found a")),
        door("2", 1, 1.5, 5.1, rooms=("found c", "found a")),
        door("3", 4, 4.2, 2, rooms=("found a", "found b")),
        door("4", 0, 1, 8.1, rooms=("found c",)),
        door("5", 6, 7, 5.1),
    )
    d = detect(replace(HOUSE, rooms=rooms, doors=doors), HOUSE, DEFAULT)
    at = d.metrics == "links"
    rows = set(zip(d.true_ids[at], d.found_ids[at], strict=True))
    # of two between the same rooms the nearer one counts
    assert rows == {("da", "2"), ("db", ""), ("out", "4"), ("", "1"), ("", "3"), ("", "5")}


def test_what_is_found_in_place_of_a_true_object_that_does_not_say_is_not_false():
    a, b, c = HOUSE.rooms
    truth = replace(
        HOUSE,
        rooms=(a, replace(b, class_=None), c),
        doors=(HOUSE.doors[0], replace(HOUSE.doors[1], rooms=()), HOUSE.doors[2]),
        furniture=(replace(HOUSE.furniture[0], top_m=None), HOUSE.furniture[1]),
    )
    assert counts(HOUSE, truth, "room", "iou_class", 0.5) == (2, 2, 2)
    assert counts(HOUSE, truth, "door", "links", 0.5) == (2, 2, 2)
    assert counts(HOUSE, truth, "furniture", "iou_3d", 0.5) == (1, 1, 1)
    more = PlanFurniture("x", box(7, 7, 8, 8), "chair", 0.0, 0.9)
    found = replace(HOUSE, furniture=(*HOUSE.furniture, more))
    assert counts(found, truth, "furniture", "iou_3d", 0.5) == (1, 2, 1)


def test_a_door_of_a_room_that_is_none_leads_nowhere_and_not_outside():
    rooms = (*HOUSE.rooms, PlanRoom("ghost", box(50, 50, 54, 54)))
    doors = (door("1", 3, 4, 8.1, rooms=("c", "ghost")),)
    assert counts(replace(HOUSE, rooms=rooms, doors=doors), HOUSE, "door", "links", 0.5) == (
        3,
        1,
        0,
    )


def test_furniture_is_scored_per_class_and_in_all_by_footprint_and_by_box():
    rotated = rotate(HOUSE.furniture[0].footprint, 90)
    found = plan(
        furniture=[
            PlanFurniture("1", rotated, "table", 0.0, 0.75),  # 1 of 3 m2
            PlanFurniture(
                "2", box(2.2, 1, 2.7, 1.5), "table", 0.0, 0.45
            ),  # the chair, half as high
        ]
    )
    assert counts(found, HOUSE, "table", "iou", 0.25) == (1, 2, 1)
    assert counts(found, HOUSE, "table", "iou", 0.5) == (1, 2, 0)
    assert counts(found, HOUSE, "table", "iou_3d", 0.3) == (1, 2, 1)
    assert counts(found, HOUSE, "chair", "iou", 0.25) == (1, 0, 0)
    assert counts(found, HOUSE, "furniture", "iou", 0.5) == (2, 2, 1)
    every = score(found, HOUSE, "furniture", "iou_3d", 0.3)
    assert every.n_matched == 2
    assert every.value == pytest.approx((1 / 3 + 1 / 2) / 2)
    assert every.class_accuracy == 0.5


def test_boxes_that_stand_on_one_another_share_nothing():
    table = HOUSE.furniture[0]
    above = plan(furniture=[replace(table, base_m=0.75, top_m=1.5)])
    assert counts(above, plan(furniture=[table]), "table", "iou_3d", 0.25) == (1, 1, 0)
    flat = plan(furniture=[replace(table, base_m=None)])
    assert "iou_3d" not in detect(above, flat, DEFAULT).metrics


def test_the_iou_of_upright_boxes_is_that_of_their_sides():
    rng = np.random.default_rng(3)
    for _ in range(30):
        low, size = rng.uniform(0, 0.4, (2, 3)), rng.uniform(0.8, 1.2, (2, 3))
        high = low + size
        both = (high.min(axis=0) - low.max(axis=0)).prod()
        truth, found = (
            plan(furniture=[PlanFurniture(n, box(*a[:2], *b[:2]), "table", a[2], b[2])])
            for n, a, b in zip("tf", low, high, strict=True)
        )
        params = EvaluationParams(box_iou=(0.01,))
        value = score(found, truth, "table", "iou_3d", 0.01, params).value
        assert value == pytest.approx(both / (size.prod(axis=1).sum() - both))


def moved(some, matrix):
    def turn(objects, field):
        return tuple(
            replace(o, **{field: affine_transform(getattr(o, field), matrix)}) for o in objects
        )

    return replace(
        some,
        rooms=turn(some.rooms, "polygon"),
        walls=turn(some.walls, "line"),
        doors=turn(some.doors, "line"),
        windows=turn(some.windows, "line"),
        furniture=turn(some.furniture, "footprint"),
    )


def jittered(some, rng):
    def shake(objects, field):
        return tuple(
            replace(o, **{field: translate(getattr(o, field), *rng.normal(0, 0.1, 2))})
            for o in objects
        )

    return replace(
        some,
        rooms=shake(some.rooms, "polygon"),
        walls=shake(some.walls, "line"),
        doors=shake(some.doors, "line"),
        windows=shake(some.windows, "line"),
        furniture=shake(some.furniture, "footprint"),
    )


def test_turning_both_plans_changes_nothing_and_turning_one_does():
    found = jittered(HOUSE, np.random.default_rng(4))
    angle = np.radians(37)
    matrix = [np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle), 100, -20]
    straight = detect(found, HOUSE, DEFAULT)
    turned = detect(moved(found, matrix), moved(HOUSE, matrix), DEFAULT)
    assert list(straight.true_ids) == list(turned.true_ids)
    assert list(straight.found_ids) == list(turned.found_ids)
    assert straight.values == pytest.approx(turned.values, nan_ok=True)
    assert straight.width_error_m == pytest.approx(turned.width_error_m, nan_ok=True)
    assert len(set(straight.true_ids[np.isnan(straight.values)])) > 0
    # nothing is aligned
    assert score(moved(found, matrix), HOUSE, "room", "iou", 0.0).n_matched == 0


def test_the_order_of_objects_changes_no_score():
    found = jittered(HOUSE, np.random.default_rng(6))
    backwards = replace(
        found, rooms=found.rooms[::-1], walls=found.walls[::-1], doors=found.doors[::-1]
    )
    first, second = (scores(detect(f, HOUSE, DEFAULT)) for f in (found, backwards))
    for a, b in zip(first, second, strict=True):
        assert (a.class_, a.metric, a.threshold, a.n_matched) == (
            b.class_,
            b.metric,
            b.threshold,
            b.n_matched,
        )
        assert a.value == (None if b.value is None else pytest.approx(b.value))


@pytest.fixture
def source(tmp_path):
    def write(name, some):
        path = tmp_path / f"{name}.geojson"
        write_plan(some, path)
        data = path.read_bytes()
        digest = sha256(data).hexdigest()
        return Source(name=name, path=str(path), sha256=digest, size_bytes=len(data))

    return write


def test_plans_are_read_from_geojson_and_what_is_simulated_says_so(source):
    found = replace(jittered(HOUSE, np.random.default_rng(7)), simulated=True)
    d = evaluate_plans(source("found", found), source("truth", HOUSE), DEFAULT)
    direct = detect(found, HOUSE, DEFAULT)
    assert isinstance(d, Detections)
    assert list(d.true_ids) == list(direct.true_ids)
    assert d.values == pytest.approx(direct.values, abs=1e-3, nan_ok=True)
    assert d.simulated.all()
    assert not detect(HOUSE, HOUSE, DEFAULT).simulated.any()
