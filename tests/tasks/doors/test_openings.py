"""Doors and windows of drawn storeys, told apart by a forest grown on other drawn walls."""

import numpy as np
import pytest
from shapely import LineString

from storage.candidates import FEATURES
from storage.errors import InputError
from storage.forest import write_forest
from storage.plan import Plan, PlanOpening
from storage.snapshots import Snapshots
from storage.sources import Source
from tasks.doors.candidates import CandidateParams, find_candidates
from tasks.doors.examples import CLASSES, ExampleParams, examples
from tasks.doors.openings import PAPER, OpeningsParams, find_openings
from tasks.doors.stages import openings
from tasks.forest import Examples, ForestParams, fit, joined

SHAPES = {"open": 0.96, "shut": 0.96, "window": 1.52}


def drawn(scenes, what, seed):
    """Return a wall with openings at places along it, both faces, and its plan."""
    north, south = (scenes.Face(9.0, noise_m=0.006, seed=2 * seed + k) for k in range(2))
    doors, windows = [], []
    for kind, at in what:
        line = LineString([(at, 0), (at + SHAPES[kind], 0)])
        low, high = (0.92, 2.2) if kind == "window" else (0.0, 1.96)
        there = (at, at + SHAPES[kind], low, high)
        back = (9 - there[1], 9 - there[0], low, high)
        if kind == "open":
            north.emptied(there)
            south.emptied(back)
            doors.append(PlanOpening(f"d{at}", line, low, high, state="open"))
        elif kind == "shut":
            north.moved(there, 0.075)
            south.moved(back, 0.012)
            doors.append(PlanOpening(f"d{at}", line, low, high, state="shut"))
        else:
            north.moved(there, 0.12)
            south.moved(back, 0.12)
            windows.append(PlanOpening(f"n{at}", line, low, high))
    images, walls, rooms = scenes.two_rooms(north, south)
    return (
        images,
        walls,
        rooms,
        Plan("drawn", str(seed), doors=tuple(doors), windows=tuple(windows)),
    )


@pytest.fixture(scope="module")
def taught(scenes):
    rng = np.random.default_rng(0)
    made = []
    for seed in range(5):
        kinds = rng.permutation(["open", "shut", "window"])
        starts = np.array([0.8, 3.6, 6.4]) + rng.uniform(0, 0.6, 3)
        images, _, _, plan = drawn(scenes, list(zip(kinds, starts, strict=True)), seed)
        found = find_candidates(images, CandidateParams())
        made.append(examples(found, images, plan, ExampleParams()))
    return joined(made)


@pytest.fixture(scope="module")
def forest(taught):
    return fit(taught, FEATURES, CLASSES, ForestParams(trees=30))


def found_in(drawn_wall, forest, params=None, snapshots=()):
    images, walls, rooms, _ = drawn_wall
    candidates = find_candidates(images, CandidateParams())
    params = params or OpeningsParams()
    return find_openings(candidates, images, walls, rooms, list(snapshots), forest, params)


def test_doors_and_windows_are_found_once_each_where_they_are(scenes, forest):
    wall = drawn(scenes, [("shut", 0.6), ("open", 3.0), ("window", 6.0)], seed=50)
    found = found_in(wall, forest)
    assert found.kinds.tolist() == ["door", "door", "window"]
    begins = found.lines[:, :, 0].min(axis=1)
    widths = np.ptp(found.lines[:, :, 0], axis=1)
    order = np.argsort(begins)
    assert begins[order] == pytest.approx([0.6, 3.0, 6.0], abs=0.1)
    assert widths[order] == pytest.approx([0.96, 0.96, 1.52], abs=0.12)
    assert found.states[order].tolist() == ["shut", "open", ""]
    assert found.rooms[found.of_kind("door")].tolist() == [[0, 1], [0, 1]]
    assert np.abs(found.lines[:, :, 1]).max() < 1e-9  # on the centre line
    assert found.head_m[order] == pytest.approx([1.96, 1.96, 2.2], abs=0.1)
    assert ((found.confidences > 0.5) & (found.confidences <= 1)).all()


def test_a_bare_wall_has_no_openings(scenes, forest):
    assert len(found_in(drawn(scenes, [], seed=60), forest)) == 0


def test_the_papers_way_finds_no_more_than_one_door_per_wall_face(scenes, forest):
    wall = drawn(scenes, [("open", 0.6), ("open", 3.0), ("open", 6.0)], seed=70)
    assert len(found_in(wall, forest).of_kind("door")) == 3
    assert 1 <= len(found_in(wall, forest, PAPER).of_kind("door")) <= 2


def test_a_walk_through_a_candidate_multiplies_its_odds_of_being_a_door(scenes, taught):
    unsure = fit(taught, FEATURES, CLASSES, ForestParams(trees=5, depth=2, leaf=40))
    wall = drawn(scenes, [("shut", 0.6)], seed=80)
    positions = np.array([(1.08, -1, 1.5), (1.08, 0.6, 1.5)])
    walk = Snapshots(np.arange(2.0), positions, np.eye(2, 4), np.ones(2, np.int64))
    lax = OpeningsParams(door_p=0.0, window_p=1.0, least_p=0.0, door_agree=1)

    def surest(snapshots, params=lax):
        found = found_in(wall, unsure, params, snapshots)
        return found.confidences[found.of_kind("door")].max()

    p, q = surest([]), surest([walk])
    assert 0 < p < 0.99
    assert q / (1 - q) == pytest.approx(p / (1 - p) * np.exp(lax.crossing_weight), rel=1e-6)
    assert surest([walk], lax.model_copy(update={"crossing_weight": 0.0})) == p


def test_a_door_is_as_probable_as_its_best_rectangles_are_on_average(scenes, taught):
    unsure = fit(taught, FEATURES, CLASSES, ForestParams(trees=5, depth=2, leaf=40))
    wall = drawn(scenes, [("shut", 0.6)], seed=80)
    lax = OpeningsParams(door_p=0.0, window_p=1.0, least_p=0.0, door_agree=1)
    every = lax.model_copy(update={"door_agree": 10**6})
    surest, mean = (found_in(wall, unsure, params).confidences.max() for params in (lax, every))
    assert 0 < mean < surest


def test_openings_are_the_same_twice(scenes, forest):
    wall = drawn(scenes, [("shut", 0.6), ("open", 3.0), ("window", 6.0)], seed=90)
    first, second = (found_in(wall, forest) for _ in range(2))
    assert first.lines.tobytes() == second.lines.tobytes()


def test_a_forest_of_something_else_is_refused(scenes, forest, tmp_path):
    images, walls, rooms, _ = drawn(scenes, [], seed=1)
    candidates = find_candidates(images, CandidateParams())

    def run(name, kept):
        write_forest(kept, tmp_path / name)
        source = Source(name=name, path=str(tmp_path / name), sha256="", size_bytes=0)
        return openings(candidates, images, walls, rooms, [], source, OpeningsParams())

    assert len(run("ours", forest)) == 0
    with pytest.raises(InputError, match=r"asks for colour.*train it anew"):
        run("colours", fit_on(("width_m", "colour"), CLASSES))
    with pytest.raises(InputError, match="tells table, chair apart"):
        run("furniture", fit_on(("width_m", "height_m"), ("table", "chair")))


def fit_on(features, classes):
    rng = np.random.default_rng(2)
    some = Examples(rng.random((20, 2)), np.arange(20) % 2, np.full(20, "b/1"))
    return fit(some, features, classes, ForestParams(trees=2))
