"""Reference lines: the corridors' own, the grammar's, and the grammar's laid onto the corridors."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import shapely
from shapely import Polygon, box

from grammars.model import Grammar, Part, ReferenceLine, Rule
from storage.errors import MapSenseError
from storage.faces import Faces
from storage.rooms import Rooms
from tasks.layout.extraction.alignment import AlignParams, Rigid, align
from tasks.layout.extraction.corridors import (
    CorridorParams,
    find_corridors,
    mean_width,
    straight_runs,
)
from tasks.layout.extraction.model import lay_out
from tasks.layout.extraction.reference_lines import LineParams, place_lines
from tasks.simulation.layouts.ring import closed_loop
from tasks.simulation.layouts.rows import offset_ring

PUBLISHED = np.array([4.77, 19.46, 4.91, 21.86, 4.91, 19.46, 4.88, 21.86])
"""Reference lines around the corridor of the storey the authors' group published, metres."""
GRAMMAR = Grammar(
    name="comb",
    building_type="office",
    about="",
    learnt_from=(),
    simulated=True,
    classes=("office",),
    rules=(Rule("r1", (Part("office", 4.8, 0.3),), 1.0),),
    p_relation=np.ones((1, 1)),
    partition_m=0.125,
    partition_spread_m=0.02,
)
NO_FACES = Faces(
    np.empty((0, 3)),
    np.empty(0),
    np.empty(0, np.int8),
    np.empty((0, 2, 2)),
    np.empty((0, 2)),
    np.empty(0),
    np.empty(0, np.int64),
    (),
    0.1,
)


def model(polygons):
    n = len(polygons)
    made = np.empty(n, object)
    made[:] = [shapely.orient_polygons(p) for p in polygons]
    whole = np.ones(n)
    rooms = Rooms(made, np.zeros(n), np.full(n, 2.8), whole, whole, ((0,),) * n)
    return lay_out(rooms, NO_FACES, [])


def runs_of(*polygons, params=None):
    made = np.empty(len(polygons), object)
    made[:] = polygons
    return straight_runs(made, params or CorridorParams())


def lengths(lines):
    return np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1)


def row(x0, x1, y0, y1, n=5):
    at = np.linspace(x0, x1, n + 1)
    return [box(a + 0.06, y0, b - 0.06, y1) for a, b in pairwise(at)]


def ring():
    """Return the published ring: its corridor, and one room behind each of its lines."""
    loop = closed_loop(PUBLISHED)
    corridor = Polygon(loop, [offset_ring(loop, -1.9)])
    near, far = offset_ring(loop, 0.24), offset_ring(loop, 5.0)
    rooms = [
        Polygon([near[i], near[(i + 1) % 8], far[(i + 1) % 8], far[i]]).buffer(-0.05)
        for i in range(8)
    ]
    return loop, corridor, rooms


def test_the_published_ring_corridor_has_the_published_lines_with_rooms_to_their_left():
    loop, corridor, rooms = ring()
    runs = runs_of(corridor)
    outer = [
        run for run in runs if corridor.exterior.dwithin(shapely.Point(run.mean(axis=0)), 1e-6)
    ]
    assert len(outer) == 8
    for run in outer:
        side = int(np.linalg.norm(loop - run[1], axis=1).argmin())  # walked against the loop
        assert run[1] == pytest.approx(loop[side], abs=1e-6)
        assert np.linalg.norm(run[1] - run[0]) == pytest.approx(PUBLISHED[side], abs=1e-6)
        step = (run[1] - run[0]) / np.linalg.norm(run[1] - run[0])
        aside = run.mean(axis=0) + 1.0 * np.array([-step[1], step[0]])
        assert rooms[side].covers(shapely.Point(aside))
    assert find_corridors(model([corridor, *rooms]), CorridorParams()).tolist() == [0]


def test_an_end_of_a_corridor_is_no_line():
    runs = runs_of(box(0, 0, 30, 2.1))
    assert lengths(runs) == pytest.approx([30, 30])


def test_lines_go_on_over_jogs_and_keep_to_most_of_the_wall():
    jogged = Polygon([(0, 0), (30, 0), (30, 2), (12, 2), (12, 2.2), (10, 2.2), (10, 2), (0, 2)])
    runs = runs_of(jogged)
    assert lengths(runs) == pytest.approx([30, 30])
    assert {round(float(run[0, 1]), 6) for run in runs} == {0, 2}
    deeper = [(0, 0), (30, 0), (30, 2), (12, 2), (12, 2.6), (6, 2.6), (6, 2), (0, 2)]
    assert sorted(lengths(runs_of(Polygon(deeper)))) == pytest.approx([6, 30, 30])


def test_a_line_goes_on_over_an_open_room_and_ends_at_another_corridor():
    with_room = shapely.union(box(0, 0, 30, 2), box(10, 1, 14, 6))
    assert sorted(lengths(runs_of(with_room)))[-2:] == pytest.approx([30, 30])
    with_branch = shapely.union(box(0, 0, 30, 2), box(10, 1, 12, 14))
    assert sorted(lengths(runs_of(with_branch))) == pytest.approx([10, 12, 12, 18, 30])


def test_corridors_in_line_with_rooms_between_them_have_lines_of_their_own():
    assert sorted(lengths(runs_of(box(0, 0, 10, 2), box(16, 0, 30, 2)))) == pytest.approx(
        [10, 10, 14, 14]
    )
    # a door's wall between two parts of one corridor is none
    assert lengths(runs_of(box(0, 0, 10, 2), box(10.2, 0, 30, 2))) == pytest.approx([30, 30])


def test_runs_that_were_cut_short_meet_in_the_corner():
    clipped = Polygon([(0, 0), (20, 0), (20, 15), (18, 15), (18, 2), (0.0, 2)])
    rounded = clipped.difference(Polygon([(19.7, -1), (21, -1), (21, 0.3), (19.9, 0.2)]))
    runs = runs_of(rounded)
    ends = runs.reshape(-1, 2)
    assert np.linalg.norm(ends - (20, 0), axis=1).min() < 1e-6


def test_a_corridor_is_told_from_rooms_that_are_narrow_too():
    corridor = box(0, 0, 24, 2)
    around = box(0, -5, 24, -0.1).difference(box(5, -3.5, 19, -0.1))  # a U about another room
    beside = [box(5.1, -3.4, 18.9, -0.1), box(24.2, -5, 30, -0.2), box(-6, -5, -0.2, -0.2)]
    rooms = [*row(0, 24, 2.2, 7), around, *beside]
    assert find_corridors(model([*rooms, corridor]), CorridorParams()).tolist() == [len(rooms)]
    hall = box(0, 0, 24, 6)
    assert not len(find_corridors(model([hall, *row(0, 24, 6.2, 11)]), CorridorParams()))
    cellar = [box(0, 0, 24, 2), box(0, 2.2, 12, 7), box(12.1, 2.2, 24, 7)]
    assert not len(find_corridors(model(cellar), CorridorParams()))


@pytest.mark.parametrize(("width", "length"), [(2.0, 30.0), (1.5, 5.0), (3.0, 3.0)])
def test_mean_width_of_a_strip_is_its_width(width, length):
    assert mean_width(box(0, 0, length, width)) == pytest.approx(width)


def test_mean_width_of_a_closed_ring_is_its_width():
    assert mean_width(box(0, 0, 20, 30).difference(box(2, 2, 18, 28))) == pytest.approx(2)


def comb():
    """Return a storey about a straight corridor and a grammar with both of its lines."""
    rooms = [box(0, 0, 24, 2), *row(0, 24, 2.2, 7), *row(0, 24, -5, -0.2, 4)]
    lines = (
        ReferenceLine("north", "1", (0.0, 2.0), (24.0, 2.0)),
        ReferenceLine("south", "1", (24.0, 0.0), (0.0, 0.0)),
    )
    return rooms, replace(GRAMMAR, lines=lines)


def test_the_grammars_lines_are_taken_as_they_are():
    rooms, grammar = comb()
    placed = place_lines(model(rooms), grammar, LineParams(lines="grammar"))
    assert placed.ids == ("north", "south")
    assert placed.ends.tolist() == [[[0, 2], [24, 2]], [[24, 0], [0, 0]]]
    assert placed.given and placed.corridors.tolist() == [0]


def test_the_grammars_lines_are_laid_onto_a_storey_that_lies_elsewhere():
    rooms, grammar = comb()
    moved = Rigid(0.4, np.array([7.0, -3.0]))
    turned = [shapely.transform(p, moved.apply) for p in rooms]
    placed = place_lines(model(turned), grammar, LineParams(lines="aligned"))
    lines = np.array([(line.start, line.end) for line in grammar.lines])
    assert placed.ends == pytest.approx(moved.apply(lines), abs=1e-4)


@pytest.mark.parametrize(
    ("lines", "storey", "expected"),
    [
        ((), "", "has no reference lines"),
        (("1", "2"), "", "several storeys, 1, 2"),
        (("1", "2"), "3", "no reference lines of storey '3', only of 1, 2"),
    ],
)
def test_lines_a_grammar_cannot_give_failure(lines, storey, expected):
    rooms, grammar = comb()
    given = tuple(replace(grammar.lines[0], id=s, storey=s) for s in lines)
    with pytest.raises(MapSenseError, match=expected):
        place_lines(
            model(rooms), replace(grammar, lines=given), LineParams(lines="grammar", storey=storey)
        )


def test_of_several_storeys_the_named_one_gives_its_lines():
    rooms, grammar = comb()
    other = replace(grammar.lines[0], id="up", storey="2")
    several = replace(grammar, lines=(*grammar.lines, other))
    params = LineParams(lines="grammar", storey="2")
    assert place_lines(model(rooms), several, params).ids == ("up",)


@pytest.mark.parametrize("turn", [-1.2, -0.3, 0.0, 0.05, 1.4])
def test_alignment_finds_the_turn_and_shift_of_the_published_ring(turn):
    runs = runs_of(ring()[1])
    goal = Rigid(turn, np.array([12.0, -40.0]))
    found = align(runs, goal.apply(runs), "grammar 'g'", AlignParams())
    assert found.turn_rad == pytest.approx(turn, abs=1e-6)
    assert found.apply(runs) == pytest.approx(goal.apply(runs), abs=1e-5)


@pytest.mark.parametrize("seed", range(5))
def test_alignment_bears_missing_runs_and_walls_a_little_off(seed):
    rng = np.random.default_rng(seed)
    lines = runs_of(ring()[1])
    goal = Rigid(rng.uniform(-0.6, 0.6), rng.uniform(-30, 30, 2))
    runs = goal.apply(lines)[rng.permutation(len(lines))[: len(lines) * 3 // 4]]
    runs = runs + rng.normal(scale=0.03, size=(len(runs), 2, 2))
    runs[0, 1] = runs[0].mean(axis=0)  # half of it was seen
    found = align(lines, runs, "grammar 'g'", AlignParams())
    assert found.turn_rad == pytest.approx(goal.turn_rad, abs=0.005)
    assert np.abs(found.apply(lines) - goal.apply(lines)).max() < 0.1


def test_what_two_walls_are_off_is_shared_between_them():
    lines = np.array([[(0.0, 2.0), (24.0, 2.0)], [(24.0, 0.0), (0.0, 0.0)]])
    wider = lines + np.array([(0, 0.05), (0, -0.05)])[:, None]
    found = align(lines, wider, "g", AlignParams())
    assert found.apply(lines) == pytest.approx(lines, abs=1e-3)


def test_of_two_turns_that_fit_alike_the_lesser_is_taken():
    lines = np.array([[(0.0, 2.0), (24.0, 2.0)], [(24.0, 0.0), (0.0, 0.0)]])
    assert align(lines, lines, "g", AlignParams()).turn_rad == pytest.approx(0)
    half = Rigid(np.pi - 0.2, np.zeros(2)).apply(lines)
    assert align(lines, half, "g", AlignParams()).turn_rad == pytest.approx(-0.2)


def test_lines_of_another_building_failure():
    around = runs_of(ring()[1])
    straight = runs_of(box(0, 0, 12, 2))
    with pytest.raises(MapSenseError, match=r"grammar 'ring'.*do not fit.*lines = 'corridors'"):
        align(around, straight, "grammar 'ring'", AlignParams())
    with pytest.raises(MapSenseError, match="0% of their length lies on walls of its 0 corridor"):
        align(around, np.empty((0, 2, 2)), "grammar 'ring'", AlignParams())


def test_the_best_lines_are_the_grammars_as_they_are_where_they_fit():
    rooms, grammar = comb()
    lines = np.array([(line.start, line.end) for line in grammar.lines])
    drifted = [shapely.transform(p, lambda xy: xy + np.array([0.0, 0.1])) for p in rooms]
    placed = place_lines(model(drifted), grammar, LineParams())
    assert placed.given and placed.ends.tolist() == lines.tolist()


def test_the_best_lines_are_the_grammars_aligned_where_the_storey_lies_elsewhere():
    rooms, grammar = comb()
    moved = Rigid(0.4, np.array([7.0, -3.0]))
    turned = [shapely.transform(p, moved.apply) for p in rooms]
    placed = place_lines(model(turned), grammar, LineParams())
    lines = np.array([(line.start, line.end) for line in grammar.lines])
    assert placed.given and placed.ends == pytest.approx(moved.apply(lines), abs=1e-4)


@pytest.mark.parametrize("length", [8.0, 60.0])
def test_the_best_lines_are_the_corridors_where_the_grammar_is_of_another_building(length):
    rooms, grammar = comb()
    # a corridor of the same width, but shorter or longer by far
    lines = tuple(
        replace(line, start=(line.start[0] * length / 24, y), end=(line.end[0] * length / 24, y))
        for line in grammar.lines
        for y in (line.start[1],)
    )
    placed = place_lines(model(rooms), replace(grammar, lines=lines), LineParams())
    assert not placed.given and placed.ids == ("run-1", "run-2")
    without = place_lines(model(rooms), replace(grammar, lines=()), LineParams())
    assert without.ends.tolist() == placed.ends.tolist()


def test_of_several_storeys_the_one_whose_lines_fit_gives_the_best():
    rooms, grammar = comb()
    upper = tuple(
        replace(line, id=f"up-{line.id}", storey="2", start=(y, x), end=(v, u))
        for line in grammar.lines
        for (x, y), (u, v) in ((line.start, line.end),)
    )
    shifted = tuple(
        replace(line, start=(line.start[0] + 9, line.start[1] / 2), end=(line.end[0] + 9, 40))
        for line in upper
    )
    several = replace(grammar, lines=(*shifted, *grammar.lines))
    assert place_lines(model(rooms), several, LineParams()).ids == ("north", "south")


def test_moved_lines_must_fit_better_than_given_ones():
    rooms, grammar = comb()
    longer = tuple(
        replace(line, start=(line.start[0] * 1.5, y), end=(line.end[0] * 1.5, y))
        for line in grammar.lines
        for y in (line.start[1],)
    )
    long = replace(grammar, lines=longer)
    elsewhere = [shapely.transform(p, lambda xy: xy + np.array([90.0, 40.0])) for p in rooms]
    assert place_lines(model(rooms), long, LineParams()).given
    assert not place_lines(model(elsewhere), long, LineParams()).given
