"""Rooms of flats to learn from: what is told of them is what stands in them."""

import numpy as np
import pytest
import shapely

from tasks.furniture.homes import HomeParams, _hits, homes

FEW = HomeParams(rooms=8, views=3, rays=8000, noise_m=0.001)


def test_the_same_seed_makes_the_same_rooms_and_points_and_another_others():
    first, again, other = (
        next(iter(homes(FEW.model_copy(update={"seed": seed})))) for seed in (0, 0, 1)
    )
    assert np.array_equal(first[1][0].xyz, again[1][0].xyz)
    assert not np.array_equal(first[1][0].xyz, other[1][0].xyz)


def test_rays_end_where_shapely_says_they_meet_walls_and_boxes():
    rng = np.random.default_rng(3)
    blocks = np.array([(1.0, 2.0, 1.0, 1.5, 0.0, 2.0), (3.0, 3.4, 0.5, 2.5, 0.0, 2.0)])
    start, room = np.array((0.5, 2.2, 1.0)), (4.0, 3.0, 2.0)
    angles = rng.uniform(0, 2 * np.pi, 300)
    ways = np.column_stack((np.cos(angles), np.sin(angles), np.zeros(300)))
    solid = [shapely.box(b[0], b[2], b[1], b[3]) for b in blocks]
    edges = shapely.union_all([shapely.box(0, 0, *room[:2]).exterior, *solid])
    for way, reach in zip(ways, _hits(start, ways, blocks, room), strict=True):
        ray = shapely.LineString((start[:2], start[:2] + 9 * way[:2]))
        hit = shapely.distance(shapely.Point(start[:2]), shapely.intersection(ray, edges))
        assert reach == pytest.approx(hit)


def test_every_kind_of_piece_stands_within_its_room():
    seen = set()
    for rooms, _, truth in homes(FEW):
        outline = shapely.buffer(rooms.polygons[0], 1e-6)
        for piece in truth.furniture:
            assert outline.covers(piece.footprint)
            seen.add(piece.class_)
    assert seen == {"table", "chair", "other"}


def test_what_is_seen_at_the_height_of_a_top_lies_on_a_piece():
    for rooms, (cloud,), truth in homes(FEW):
        xyz = cloud.xyz
        inner = shapely.buffer(rooms.polygons[0], -0.1)
        amid = shapely.contains_xy(inner, xyz[:, 0], xyz[:, 1])
        xyz = xyz[amid & (xyz[:, 2] > 0.3) & (xyz[:, 2] < 1.3)]
        shapes = shapely.buffer(shapely.union_all([p.footprint for p in truth.furniture]), 0.02)
        held = shapely.contains_xy(shapes, xyz[:, 0], xyz[:, 1])
        # a headboard is told of with no piece of its own
        assert held.mean() > 0.97
