"""Mapped against true rooms: hand-worked pairs, and brute force over all ways to pair them."""

from hashlib import sha256
from itertools import permutations

import numpy as np
import pytest
import shapely
from shapely import box
from shapely.affinity import rotate

from storage.errors import MapSenseError
from storage.plan import Plan, PlanRoom
from storage.plan_geojson import write_plan
from storage.rooms import Rooms
from storage.sources import Source
from tasks.evaluation.rooms import EvaluateParams, ious, match, room_errors

ALL = EvaluateParams()


def mapped(*polygons):
    n = len(polygons)
    column = np.empty(n, object)
    column[:] = polygons
    unknown = np.full(n, np.nan)
    return Rooms(column, unknown, unknown, np.ones(n), np.ones(n), ((),) * n)


@pytest.fixture
def truth(tmp_path):
    """Return what writes true rooms as a plan and returns it as a stage's input."""

    def write(**rooms):
        path = tmp_path / "truth.geojson"
        classed = {"a": "office"}
        write_plan(
            Plan("b", "0", tuple(PlanRoom(i, p, classed.get(i)) for i, p in rooms.items())), path
        )
        data = path.read_bytes()
        digest = sha256(data).hexdigest()
        return Source(name="truth", path=str(path), sha256=digest, size_bytes=len(data))

    return write


def test_each_true_room_has_the_error_of_the_room_found_for_it(truth):
    true = truth(a=box(0, 0, 4, 5), b=box(4, 0, 8, 5), c=box(20, 0, 24, 5))
    errors = room_errors(mapped(box(4, 0, 8, 5.5), box(0, 0, 3, 5)), true, ALL)
    assert list(errors.rooms) == ["a", "b", "c"]
    assert list(errors.classes) == ["office", "", ""]
    assert errors.true_m2 == pytest.approx([20, 20, 20])
    assert errors.found_m2 == pytest.approx([15, 22, np.nan], nan_ok=True)
    assert errors.error_m2 == pytest.approx([5, 2, np.nan], nan_ok=True)
    assert errors.iou == pytest.approx([15 / 20, 20 / 22, 0])


def test_the_sum_over_all_rooms_counts_not_the_best_pair(truth):
    # a's best is the wide room, 30 of 70 m2; only if it takes the other one has b a room at all
    true = truth(a=box(0, 0, 10, 5), b=box(-4, 0, 0, 5))
    errors = room_errors(mapped(box(-4, 0, 6, 5), box(6, 0, 10, 5)), true, ALL)
    assert errors.found_m2 == pytest.approx([20, 50])
    assert errors.iou == pytest.approx([0.4, 0.4])


def test_a_room_found_once_is_the_room_of_one_true_room_only(truth):
    errors = room_errors(mapped(box(0, 0, 6, 5)), truth(a=box(0, 0, 4, 5), b=box(4, 0, 6, 5)), ALL)
    assert errors.iou == pytest.approx([20 / 30, 0])
    assert np.isnan(errors.error_m2[1])


def test_nothing_mapped_misses_every_room(truth):
    errors = room_errors(mapped(), truth(a=box(0, 0, 4, 5), b=box(4, 0, 6, 5)), ALL)
    assert errors.true_m2 == pytest.approx([20, 10])
    assert np.isnan(errors.found_m2).all() and np.isnan(errors.error_m2).all()
    assert list(errors.iou) == [0, 0]


def test_a_truth_without_rooms_has_no_errors(truth):
    assert len(room_errors(mapped(box(0, 0, 1, 1)), truth(), ALL)) == 0
    assert len(room_errors(mapped(), truth(), ALL)) == 0


def test_only_the_rooms_asked_for_are_compared_in_the_order_asked(truth):
    true = truth(a=box(0, 0, 4, 5), b=box(4, 0, 8, 5))
    found = mapped(box(0, 0, 4, 5), box(4, 0, 8, 5))
    errors = room_errors(found, true, EvaluateParams(rooms=("b", "a")))
    assert list(errors.rooms) == ["b", "a"]
    # b alone may take what a would have had
    (alone,) = room_errors(mapped(box(2, 0, 6, 5)), true, EvaluateParams(rooms=("b",))).iou
    assert alone == pytest.approx(10 / 30)


def test_an_unknown_room_is_an_error_that_names_the_file_the_room_and_those_there_are(truth):
    true = truth(a=box(0, 0, 4, 5), b=box(4, 0, 8, 5))
    with pytest.raises(MapSenseError, match=r"truth\.geojson: has no room 'z'; it has a, b"):
        room_errors(mapped(), true, EvaluateParams(rooms=("a", "z")))


@pytest.mark.parametrize("shape", [(1, 1), (2, 4), (4, 2), (4, 4), (5, 3), (3, 5)])
def test_no_other_pairing_has_a_greater_sum(shape):
    rng = np.random.default_rng(shape)
    for _ in range(20):
        overlap = rng.random(shape) * (rng.random(shape) < 0.5)
        wide = overlap if shape[0] <= shape[1] else overlap.T
        best = max(
            sum(wide[i, j] for i, j in enumerate(chosen))
            for chosen in permutations(range(wide.shape[1]), len(wide))
        )
        partner = match(overlap)
        matched = np.flatnonzero(partner >= 0)
        assert len(set(partner[matched])) == len(matched)
        assert (overlap[partner[matched], matched] > 0).all()
        assert overlap[partner[matched], matched].sum() == pytest.approx(best)


@pytest.mark.parametrize("shape", [(0, 3), (3, 0), (0, 0)])
def test_none_of_nothing_is_matched(shape):
    assert list(match(np.zeros(shape))) == [-1] * shape[1]


def test_rooms_that_do_not_touch_are_no_pair():
    assert list(match(np.zeros((2, 2)))) == [-1, -1]


def test_the_iou_of_upright_rectangles_is_that_of_their_sides():
    rng = np.random.default_rng(1)
    low = rng.uniform(0, 5, (30, 2))
    high = low + rng.uniform(0.5, 5, (30, 2))
    rooms = [box(*a, *b) for a, b in zip(low, high, strict=True)]
    found = ious(rooms[:10], rooms[10:])
    sides = np.minimum(high[:10, None], high[None, 10:]) - np.maximum(
        low[:10, None], low[None, 10:]
    )
    both = sides.clip(0).prod(axis=-1)
    area = (high - low).prod(axis=-1)
    assert found == pytest.approx(both / (area[:10, None] + area[None, 10:] - both))
    assert (found == 0).any() and (found > 0.2).any()


def test_the_iou_of_turned_rectangles_is_that_of_shapely_one_by_one():
    rng = np.random.default_rng(2)
    rooms = [
        rotate(box(x, y, x + w, y + h), angle)
        for x, y, w, h, angle in rng.uniform((0, 0, 1, 1, 0), (4, 4, 5, 5, 180), (24, 5))
    ]
    found = ious(rooms[:8], rooms[8:])
    for i, a in enumerate(rooms[:8]):
        for j, b in enumerate(rooms[8:]):
            union = shapely.union(a, b).area
            assert found[i, j] == pytest.approx(a.intersection(b).area / union, abs=1e-9)
    assert np.diag(ious(rooms, rooms)) == pytest.approx(np.ones(len(rooms)))
