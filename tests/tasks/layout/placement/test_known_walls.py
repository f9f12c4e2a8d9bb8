"""Rooms of a building whose walls are known go onto these, and only these."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from shapely import Polygon, box

from grammars.model import Grammar, Part, ReferenceLine, Rule
from storage.layout import LINE_END
from tasks.layout.extraction.model import LineFrame
from tasks.layout.placement.decoded_rows import DecodedRow
from tasks.layout.placement.facing import facing_edges
from tasks.layout.placement.known_moves import known_moves
from tasks.layout.placement.known_walls import known_walls
from tasks.layout.placement.outline import edges_of, moved
from tasks.layout.placement.redrawn import Face, redrawn
from tasks.layout.placement.widths import Chain

LINE = ReferenceLine("n", "1", (0, 0), (20, 0), ((0, 0.2), (20, 0.2), (20, 5), (0, 5)))
OTHER = ReferenceLine("s", "1", (20, -2), (0, -2))
GRAMMAR = Grammar(
    name="g",
    building_type="t",
    about="a",
    learnt_from=(),
    simulated=False,
    classes=("a",),
    rules=(Rule("r", (Part("a", 5.0, 0.03),), 1.0),),
    p_relation=np.ones((1, 1)),
    partition_m=0.1,
    partition_spread_m=0.01,
    lines=(LINE, OTHER),
)
REACH, SIGMA, LIMIT = (0.6, 0.35), (0.01, 0.03, 0.05), 3.0


def row_on(start, end):
    none = np.zeros(0)
    chain = Chain(np.zeros(2), np.ones(2), np.full(1, np.nan), np.full(1, np.nan))
    ends = np.array([LINE_END, LINE_END])
    return DecodedRow(
        frame=LineFrame.between(np.array(start, float), np.array(end, float)),
        decoded=np.array([0]),
        chain=chain,
        faces_m=np.full((2, 2), np.nan),
        presence=np.zeros(2),
        cuts=ends,
        interval_m=np.zeros((0, 2)),
        standing=none.astype(int),
        line_faces_m=np.zeros((0, 2)),
        line_presence=none,
        depth_m=np.inf,
    )


def walls_of(grammar=GRAMMAR):
    # a row reaches from its first room to its last, not from end to end of its line
    return known_walls(grammar, [row_on((1, 0), (19, 0)), row_on((18, -2), (3, -2))], ["n", "s"])


def wishes(polygons, seen=1.0, sigma=SIGMA):
    edges = edges_of(polygons)
    shares = np.broadcast_to(np.asarray(seen, float), (len(edges),))
    first = list(range(len(polygons)))
    facing = facing_edges(edges, 0.5)
    return edges, known_moves(walls_of(), edges, first, facing, shares, REACH, sigma, LIMIT)


def applied(polygons, **kwargs):
    edges, moves = wishes(polygons, **kwargs)
    by = np.zeros((len(edges), 2))
    by[moves.edge] = moves.by_m
    return [moved(p, by[edges.shape == i]) for i, p in enumerate(polygons)]


def test_lines_that_the_observations_do_not_name_tell_of_no_wall():
    assert len(known_walls(GRAMMAR, [row_on((1, 0), (19, 0))], ["run-1"])) == 0


def test_a_line_without_a_space_tells_of_the_corridor_s_wall_alone():
    walls = walls_of()
    assert walls.kind == ("corridor", "near", "end", "far", "end", "corridor")
    assert walls.ends[0] == pytest.approx(np.array([(20, 0), (0, 0)]))  # the corridor to the left


def test_walls_turn_and_shift_as_the_lines_were_laid():
    angle, shift = 0.1, np.array([3.0, -2.0])
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    rows = [
        row_on(*(turn @ np.array([p, q], float).T).T + shift)
        for p, q in (((0, 0), (20, 0)), ((20, -2), (0, -2)))
    ]
    laid = known_walls(GRAMMAR, rows, ["n", "s"])
    assert laid.ends == pytest.approx(walls_of().ends @ turn.T + shift, abs=1e-9)


def test_a_face_goes_onto_its_wall_by_the_precisions_of_both():
    room = box(4, 0.25, 8, 4.9)
    (final,) = applied([room])
    measured = 0.03**2 + 0.05**2
    share = measured / (measured + 0.01**2)
    assert shapely.bounds(final) == pytest.approx(
        [4, 0.25 - 0.05 * share, 8, 4.9 + 0.1 * share], abs=1e-9
    )


def test_furniture_that_hides_a_wall_has_no_say_and_other_walls_are_out_of_reach():
    hidden, other = box(4, 0.2, 8, 4.5), box(8.1, 0.2, 12, 4.3)
    final = applied([hidden, other])
    assert shapely.bounds(final[0])[3] == pytest.approx(5.0)
    assert shapely.bounds(final[1])[3] == pytest.approx(4.3)


def test_a_wall_seen_elsewhere_from_both_sides_stays():
    corridor, room = box(0, -2, 20, 0.25), box(4, 0.45, 8, 5)
    edges, moves = wishes([corridor, room])
    faces = np.flatnonzero(
        np.isclose(edges.middle[:, 1], 0.25) | np.isclose(edges.middle[:, 1], 0.45)
    )
    assert len(faces) == 2 and not np.isin(faces, moves.edge).any()
    # seen badly, it is moved
    _, moves = wishes([corridor, room], seen=0.2)
    assert np.isin(faces, moves.edge).any()


def test_a_short_edge_alone_is_no_face_of_a_wall():
    jog = Polygon([(4, 0.2), (6, 0.2), (6, 0.1), (6.2, 0.1), (6.2, 0.2), (8, 0.2), (8, 5), (4, 5)])
    only = Polygon([(4, 1.5), (7.8, 1.5), (7.8, 0.3), (8, 0.3), (8, 5), (4, 5)])
    assert shapely.bounds(applied([jog])[0])[1] == pytest.approx(0.2, abs=0.01)
    edges, moves = wishes([only])
    assert not np.isin(np.flatnonzero(np.isclose(edges.middle[:, 1], 0.3)), moves.edge).any()


def test_a_corridor_loses_doorways_dents_and_what_hangs_on_by_a_thread():
    doors = box(3, -0.1, 4, 0.4).union(box(12, -0.1, 13, 0.4))
    measured = box(0, -2, 20, 0.1).union(doors).difference(box(6, -0.3, 9, 0.2))
    top = np.array([(20.0, 0.0), (0.0, 0.0)])
    edges = edges_of([measured]).ends
    upper = edges[(edges[..., 1] > -0.5).all(axis=1)]
    found = redrawn(measured, [Face(top, upper, 0.6, 0.6, whole=True)])
    assert found.symmetric_difference(box(0, -2, 20, 0)).area < 1e-2


def test_what_is_drawn_anew_keeps_holes_and_refuses_to_lose_one():
    ring = box(0, 0, 10, 10).difference(box(4, 4, 6, 6))
    edges = edges_of([ring]).ends
    low = edges[np.isclose(edges[..., 1], 0).all(axis=1)]
    face = Face(np.array([(0.0, 0.1), (10.0, 0.1)]), low, 0.2, 0.2)
    assert redrawn(ring, [face]).area == pytest.approx(95.0, abs=0.01)
    assert redrawn(ring, [face._replace(before_m=8.0)]) is None


def test_a_corner_that_moves_outwards_is_filled_up_to_the_next_wall_and_no_further():
    ell = Polygon([(0, 0), (6, 0), (6, 3), (4, 3), (4, 5), (0, 5)])
    edges = edges_of([ell]).ends
    places = {"low": (1, 0), "right": (0, 6), "step": (1, 3), "inner": (0, 4), "left": (0, 0)}
    of = {
        name: edges[np.isclose(edges[..., axis], at).all(axis=1)]
        for name, (axis, at) in places.items()
    }
    low, right = np.array([(0.0, -0.2), (6.0, -0.2)]), np.array([(6.3, 0.0), (6.3, 3.0)])
    moves = [Face(low, of["low"], 0.35, 0.15), Face(right, of["right"], 0.45, 0.15)]
    stay = [Face(of[name][0], of[name], 0.0, 0.0) for name in ("step", "inner", "left")]
    found = redrawn(ell, [face._replace(around_m=0.4) for face in (*moves, *stay)])
    expected = Polygon([(0, -0.2), (6.3, -0.2), (6.3, 3), (4, 3), (4, 5), (0, 5)])
    assert found.symmetric_difference(expected).area < 0.02


def test_a_grammar_of_another_building_moves_nothing():
    plain = replace(GRAMMAR, lines=())
    assert len(known_walls(plain, [row_on((1, 0), (19, 0))], ["n"])) == 0
