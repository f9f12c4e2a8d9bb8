"""Faces of walls, how they move together, and what makes a plan invalid."""

import numpy as np
import pytest
from shapely import box

from storage.walls import Walls
from tasks.layout.placement.facing import facing_edges
from tasks.layout.placement.moves import Moves, WallKey, agreed, without
from tasks.layout.placement.outline import edges_of
from tasks.layout.placement.seen import face_sigma, seen_share
from tasks.layout.placement.validity import overlap_m2, overlaps, walls_at_fault

ROW = [box(0, 0, 3, 5), box(3.1, 0, 7, 5), box(7.1, 0, 9, 5)]
BEHIND = box(0, 5.2, 9, 8)
SIDE, BACK = WallKey("side", 0, 1), WallKey("back", 0, 0)


def edge(polygons, shape, normal):
    edges = edges_of(polygons)
    on = (edges.shape == shape) & (edges.outward @ np.array(normal) > 0.9)
    return int(np.flatnonzero(on)[0])


def wish(edge, by_m, wall=SIDE, sigma_m=0.1):
    return Moves(np.array([edge]), np.array([[by_m, by_m]]), np.array([sigma_m]), (wall,))


def moves_of(*parts):
    return Moves(
        *(np.concatenate([getattr(p, f) for p in parts]) for f in ("edge", "by_m", "sigma_m")),
        sum((p.wall for p in parts), ()),
    )


def test_faces_of_one_wall_are_found_with_what_lies_between():
    edges = edges_of([*ROW, BEHIND])
    facing = facing_edges(edges, 0.5)
    found = {
        (int(edges.shape[a]), int(edges.shape[b])): (round(gap, 6), round(to - low, 6))
        for a, b, gap, (low, to) in zip(
            facing.a, facing.b, facing.gap_m, facing.common_m, strict=True
        )
    }
    assert found == {
        (0, 1): (0.1, 5), (1, 2): (0.1, 5), (0, 3): (0.2, 3), (1, 3): (0.2, 3.9), (2, 3): (0.2, 1.9)
    }  # fmt: skip


@pytest.mark.parametrize(
    ("by_m", "valid"),
    [((0.05, -0.05), True), ((0.09, 0.0), False), ((-0.3, -0.05), True), ((-0.3, -0.2), False),
     ((0.04, 0.04), True), ((0.05, 0.05), False)],
)  # fmt: skip
def test_between_neighbours_there_is_a_wall_neither_too_thin_nor_too_thick(by_m, valid):
    edges = edges_of(ROW[:2])
    facing = facing_edges(edges, 0.5)
    moves = np.zeros((len(edges), 2))
    moves[[edge(ROW, 0, (1, 0)), edge(ROW, 1, (-1, 0))]] = np.array(by_m)[:, None]
    assert walls_at_fault(facing, moves, 0.02, 0.5).any() != valid


def test_a_wall_too_thin_already_may_stay_as_it_is():
    rooms = [box(0, 0, 3, 5), box(3.01, 0, 7, 5)]
    edges = edges_of(rooms)
    assert not walls_at_fault(facing_edges(edges, 0.5), np.zeros((len(edges), 2)), 0.02, 0.5).any()


def test_overlaps_count_beyond_those_of_the_initial_model():
    rooms = [box(0, 0, 3, 5), box(2.9, 0, 7, 5), box(6.5, 0, 9, 5)]
    before = overlap_m2(rooms)
    assert before[0, 1] == before[1, 0] == pytest.approx(0.5)
    assert np.diag(before).tolist() == [0, 0, 0]
    owner = np.arange(3)
    assert overlaps(rooms, owner, before) == []
    ((a, b, where),) = overlaps([rooms[0], box(2.8, 0, 7, 5), rooms[2]], owner, before)
    assert {a, b} == {0, 1}
    assert where.bounds == pytest.approx((2.8, 0, 3, 5))


def test_what_faces_a_moved_wall_moves_along_by_the_share_it_covers():
    polygons = [*ROW, BEHIND]
    edges = edges_of(polygons)
    facing = facing_edges(edges, 0.5)
    back, face = edge(polygons, 1, (0, 1)), edge(polygons, 3, (0, -1))
    by_m, walls = agreed(wish(back, 0.06, BACK), facing, edges.length_m)
    assert by_m[back] == pytest.approx(0.06)
    assert by_m[face] == pytest.approx(-0.06 * 3.9 / 9)
    assert walls == {back: {BACK}, face: {BACK}}


@pytest.mark.parametrize(
    ("gap_m", "by_m", "left_m"),
    # beside no wall as it is built the other face stays; where none would be left it makes way
    [(0.5, 0.3, 0.2), (0.0, -0.2, 0.2), (0.02, -0.02, 0.06), (0.2, 0.1, 0.2), (0.2, -0.1, 0.2)],
)
def test_a_face_that_was_no_wall_with_the_moved_one_stays(gap_m, by_m, left_m):
    polygons = [box(0, 0, 3, 5), box(3 + gap_m, 0, 7, 5)]
    edges = edges_of(polygons)
    side, other = edge(polygons, 0, (1, 0)), edge(polygons, 1, (-1, 0))
    moves, _ = agreed(wish(side, by_m), facing_edges(edges, 0.5), edges.length_m)
    left = gap_m - moves[side].mean() - moves[other].mean()
    assert moves[side] == pytest.approx(by_m)
    assert left == pytest.approx(left_m)


def test_fronts_take_nobody_along():
    polygons = [*ROW, BEHIND]
    edges = edges_of(polygons)
    front = WallKey("front", 0, 0)
    back = edge(polygons, 1, (0, 1))
    by_m, _ = agreed(wish(back, 0.06, front), facing_edges(edges, 0.5), edges.length_m)
    assert np.flatnonzero(by_m.any(axis=1)).tolist() == [back]


def test_wishes_for_one_edge_count_by_their_precision_and_frozen_walls_not_at_all():
    edges = edges_of(ROW)
    facing = facing_edges(edges, 0.5)
    side = edge(ROW, 0, (1, 0))
    both = moves_of(wish(side, 0.1, SIDE, 0.1), wish(side, 0.2, BACK, 0.2))
    by_m, _ = agreed(both, facing, edges.length_m)
    assert by_m[side] == pytest.approx((0.1 * 4 + 0.2) / 5)
    by_m, walls = agreed(without(both, {SIDE}), facing, edges.length_m)
    assert by_m[side] == pytest.approx(0.2)
    assert walls[side] == {BACK}
    assert not agreed(without(both, {SIDE, BACK}), facing, edges.length_m)[0].any()


def walls(lines, rooms, seen, thickness=np.nan):
    n = len(lines)
    return Walls(
        np.array(lines, float), np.full(n, thickness), np.zeros(n), np.full(n, 2.8),
        np.array(rooms, np.int32), np.array(seen, float),
    )  # fmt: skip


def test_an_edge_is_seen_as_far_as_its_rooms_walls_were():
    edges = edges_of(ROW[:1])
    known = walls(
        [[(3.05, 0), (3.05, 2)], [(3.05, 2), (3.05, 5)], [(0, 5), (3, 5)]],
        [(0, 1), (0, -1), (7, 8)],
        [1.0, 0.5, 1.0],
        thickness=0.1,
    )
    share = seen_share(edges, [(0,)], known)
    right = edge(ROW, 0, (1, 0))
    assert share[right] == pytest.approx((2 + 1.5) / 5)
    assert np.delete(share, right).tolist() == [0, 0, 0]  # the last wall is another room's


def test_a_face_seen_in_part_is_less_sure():
    sigma = face_sigma(np.array([1.0, 0.25, 0.0]), 0.03)
    assert sigma == pytest.approx([0.03, 0.06, 0.3])
