"""Walls across a reference line from faces made by hand, and what scans say of one wall."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import box

from storage.faces import NOT_SEEN, SEEN_WALL, Faces
from storage.rooms import Rooms
from storage.segments import Raster, Segments
from tasks.layout.extraction.branches import Branches, BranchParams, join_faces, without_slivers
from tasks.layout.extraction.fusion import fuse
from tasks.layout.extraction.model import LineFrame, lay_out
from tasks.layout.extraction.presence import PresenceParams, presence
from tasks.layout.extraction.sheets import find_sheets

PARTITION = 0.125, 0.02
LINE = LineFrame(np.zeros(2), np.array([1.0, 0.0]), 20.0)
"""Along x; rooms lie above it, their faces 0.2 m off, 5 m deep."""
FRONT, DEPTH = 0.2, 5.0
UP, DOWN = 1, -1
"""What a face looks towards: along the line, or back."""


def rooms(*polygons):
    n = len(polygons)
    made = np.empty(n, object)
    made[:] = [shapely.orient_polygons(p) for p in polygons]
    whole = np.ones(n)
    return Rooms(made, np.zeros(n), np.full(n, 2.8), whole, whole, ((0,),) * n)


def faces(*given):
    """Return faces from (x, facing) or (x, facing, low y, high y, lean): 0 looks nowhere."""
    lines, normals = [], []
    for x, facing, *rest in given:
        y0, y1, lean = rest or (FRONT, DEPTH, 0.0)
        lines.append([(x, y0), (x + lean * (y1 - y0), y1)])
        normals.append((facing or 1, 0, 0))
    k = len(given)
    lines = np.array(lines, float).reshape(-1, 2, 2)
    spans = np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1)
    return Faces(
        normals=np.array(normals, float).reshape(-1, 3),
        offsets=np.zeros(k),
        sides=np.array([int(g[1] != 0) for g in given], np.int8),
        lines=lines,
        heights=np.tile([0.0, 2.8], (k, 1)),
        weights=spans * 2.8,
        scans=np.ones(k, np.int64),
        profiles=tuple(np.full(int(np.ceil(s / 0.1 - 1e-9)), SEEN_WALL, np.uint8) for s in spans),
        bin_m=0.1,
    )


def branches(found, of_rooms=None, segments=(), params=None):
    params = params or BranchParams()
    model = lay_out(of_rooms or rooms(), found, segments)
    sheets = find_sheets(LINE, (0.0, 20.0), FRONT, np.empty(0, np.int64), model, params)
    return join_faces(sheets, LINE, FRONT, DEPTH, model, PARTITION, params)


@pytest.mark.parametrize("thickness", [0.1, 0.125, 0.24, 0.4])
def test_two_faces_that_look_apart_are_one_wall_cut_in_its_middle(thickness):
    found = branches(faces((7.0, DOWN), (7.0 + thickness, UP)))
    assert found.at == pytest.approx([7.0 + thickness / 2])
    assert found.faces == pytest.approx(np.array([[7.0, 7.0 + thickness]]))


def test_two_faces_that_look_at_each_other_are_two_walls_of_a_narrow_room():
    found = branches(faces((7.0, UP), (7.4, DOWN)))
    assert found.at == pytest.approx([7.0 - PARTITION[0] / 2, 7.4 + PARTITION[0] / 2])
    assert np.isnan(found.faces).tolist() == [[True, False], [False, True]]


def test_faces_further_apart_than_tau_are_two_walls():
    assert len(branches(faces((7.0, DOWN), (7.49, UP))).at) == 1
    assert len(branches(faces((7.0, DOWN), (7.51, UP))).at) == 2


def test_a_single_face_is_half_a_partition_off_the_cut_on_its_far_side():
    found = branches(faces((5.0, DOWN), (9.0, UP), (13.0, 0)))
    half = PARTITION[0] / 2
    assert found.at == pytest.approx([5 + half, 9 - half, 13])
    expected = [[5, np.nan], [np.nan, 9], [np.nan, np.nan]]
    np.testing.assert_allclose(found.faces, expected)
    one = np.hypot(0.02, PARTITION[1] / 2)
    assert found.sigma == pytest.approx([one, one, np.hypot(0.02, half)])


def test_the_nearest_to_a_partition_are_paired_first():
    found = branches(faces((7.0, DOWN), (7.13, UP), (7.45, UP)))
    assert found.at == pytest.approx([7.065, 7.45 - PARTITION[0] / 2])


def test_faces_registered_across_each_other_are_still_one_wall():
    found = branches(faces((7.05, DOWN), (7.0, UP)))
    assert found.at == pytest.approx([7.025])


def test_a_face_of_unknown_side_within_a_wall_is_that_walls():
    assert len(branches(faces((7.0, DOWN), (7.2, UP), (7.1, 0))).at) == 1
    # a distance more like a partition's counts less than what the faces look towards
    assert branches(faces((7.0, DOWN), (7.4, UP), (7.15, 0))).at == pytest.approx([7.2])
    paired = branches(faces((7.0, DOWN), (7.2, 0)))
    assert paired.at == pytest.approx([7.1])


@pytest.mark.parametrize(
    ("face", "counts"),
    [
        ((8.0, UP, FRONT + 0.39, DEPTH, 0.0), True),
        ((8.0, UP, FRONT + 0.41, DEPTH, 0.0), False),
        ((8.0, UP, -3.0, 2.0, 0.0), True),
        ((8.0, UP, -3.0, 0.0, 0.0), False),
        ((8.0, UP, FRONT, FRONT + 0.45, 0.0), False),
        ((8.0, UP, FRONT, DEPTH, 0.19), True),
        ((8.0, UP, FRONT, DEPTH, 0.25), False),
        ((20.5, UP, FRONT, DEPTH, 0.0), False),
    ],
    ids=["near", "off", "crosses", "right", "short", "leans", "oblique", "beyond"],
)
def test_a_branch_is_square_on_the_line_and_ends_near_it_on_its_left(face, counts):
    assert len(branches(faces(face)).at) == counts


def test_outlines_alone_make_cuts_less_sure_than_seen_walls():
    two = rooms(box(0, FRONT, 6.9, DEPTH), box(7.1, FRONT, 14, DEPTH))
    drawn = branches(faces(), two)
    seen = branches(faces((6.9, DOWN), (7.1, UP)), two)
    inner = np.abs(drawn.at - 7) < 1e-9
    assert inner.sum() == 1
    assert drawn.sigma[inner] == pytest.approx(BranchParams().sigma_unseen_m / np.sqrt(2))
    both = np.abs(seen.at - 7) < 1e-9
    assert seen.sigma[both] == pytest.approx(0.02 / np.sqrt(2))
    assert drawn.presence[inner] < seen.presence[both]
    assert np.isnan(drawn.faces).all()
    assert seen.beside[both].tolist() == [[0, 1]]


@pytest.mark.parametrize("seen", [(6.9, DOWN), (6.9, 0), (7.14, UP), (7.14, 0)])
def test_an_outline_that_nobody_saw_has_no_say_beside_a_face_that_was_seen(seen):
    # a room that was not entered reaches to the far face of its neighbour's wall, or near it
    unseen = 7.14 if seen[0] < 7 else 6.9
    edges = rooms(box(0, FRONT, min(seen[0], unseen), DEPTH),
                  box(max(seen[0], unseen), FRONT, 14, DEPTH))  # fmt: skip
    found = branches(faces(seen), edges)
    wall = np.abs(found.at - 7) < 0.2
    side = 1 if seen[0] < 7 else -1
    assert found.at[wall] == pytest.approx([seen[0] + side * PARTITION[0] / 2])
    assert found.sigma[wall] == pytest.approx([np.hypot(0.02, PARTITION[1] / 2)])
    expected = (seen[0], np.nan) if side == 1 else (np.nan, seen[0])
    np.testing.assert_allclose(found.faces[wall], [expected])


def test_a_wall_between_two_rooms_is_more_probable_than_one_within_a_room():
    wall = faces((6.9, DOWN), (7.1, UP))
    apart = branches(wall, rooms(box(0, FRONT, 6.9, DEPTH), box(7.1, FRONT, 14, DEPTH)))
    within = branches(wall, rooms(box(0, FRONT, 14, DEPTH)))
    cabinet = branches(faces((6.9, DOWN, FRONT, 1.2, 0.0)), rooms(box(0, FRONT, 14, DEPTH)))
    at = [np.abs(b.at - 7).argmin() for b in (apart, within, cabinet)]
    p = [b.presence[i] for b, i in zip((apart, within, cabinet), at, strict=True)]
    assert p[0] > 0.95 > p[1] > 0.3 > p[2]


def test_faces_in_line_but_behind_the_rooms_have_no_say():
    near = faces((7.0, DOWN), (7.2, UP))
    behind = faces((7.0, DOWN), (7.2, UP), (7.05, DOWN, 6.0, 12.0, 0.0))
    assert branches(behind).at == pytest.approx(branches(near).at)


def test_of_two_walls_nearer_than_a_sliver_the_more_probable_stays():
    found = Branches(
        at=np.array([2.0, 2.5, 3.1, 6.0, 9.0]),
        faces=np.full((5, 2), np.nan),
        sigma=np.full(5, 0.02),
        scans=np.ones(5, np.int64),
        presence=np.array([0.5, 0.9, 0.6, 0.99, 0.01]),
        beside=np.full((5, 2), -1),
        outliers=((),) * 5,
    )
    assert without_slivers(found, BranchParams()).at.tolist() == [2.5, 6.0]


def scan_of(x, facing, area=10.0):
    return Segments(
        cell_m=0.1,
        kinds=np.zeros(1, np.int8),
        normals=np.array([[facing, 0.0, 0.0]]),
        offsets=np.array([x * facing]),
        side_known=np.ones(1, bool),
        lines=np.array([[(x, FRONT), (x, DEPTH)]]),
        heights=np.array([[0.0, 2.6]]),
        areas=np.array([area]),
        inliers=np.array([1000]),
        rms=np.array([0.01]),
        hulls=(b"",),
        rasters=(Raster((0.0, 0.0), np.ones((1, 1), bool)),),
    )


def test_a_scan_that_is_off_is_named_and_left_out():
    scans = [scan_of(x, DOWN) for x in (7.0, 7.01, 6.99, 7.2, 7.0)]
    found = branches(faces((7.02, DOWN)), segments=scans)
    assert found.outliers == ((3,),)
    assert found.at == pytest.approx([7.0 + PARTITION[0] / 2])
    assert found.scans.tolist() == [4]
    assert found.sigma == pytest.approx([np.hypot(0.02 / 2, PARTITION[1] / 2)])


def test_scans_of_either_face_count_once_each():
    scans = [scan_of(7.0, DOWN), scan_of(7.0, DOWN), scan_of(7.2, UP)]
    found = branches(faces((7.0, DOWN), (7.2, UP)), segments=scans)
    assert found.scans.tolist() == [3]
    assert found.at == pytest.approx([7.1])


def test_a_face_that_no_scan_shows_by_itself_yields_to_one_that_an_outline_lies_on():
    scans = [scan_of(6.85, DOWN), scan_of(7.07, UP)]
    found = faces((6.85, DOWN), (7.02, DOWN), (7.07, UP))
    walls = branches(found, rooms(box(0, FRONT, 6.85, DEPTH)), scans)
    assert np.isclose(walls.faces, [6.85, 7.07]).all(axis=1).any()
    # ...but furniture yields to what is as thick as a partition
    hidden = faces((6.6, DOWN), (6.95, DOWN), (7.07, UP))
    walls = branches(hidden, rooms(box(0, FRONT, 6.6, DEPTH)), [scan_of(6.6, DOWN), scans[1]])
    assert np.isclose(walls.faces, [6.95, 7.07]).all(axis=1).any()


def test_a_face_too_small_for_any_scan_leaves_a_wall_where_its_room_ends():
    scrap = faces((7.08, DOWN, 1.0, 1.6, 0.0))
    ends = rooms(box(0, FRONT, 7.0, DEPTH))
    elsewhere = [scan_of(15.0, UP)]
    found = branches(scrap, ends, elsewhere)
    face = found.faces[np.abs(found.at - 7) < 0.2]
    assert face == pytest.approx(np.array([[7.0, np.nan]]), nan_ok=True)
    # as uncertain as the two are apart, and the thickness of a wall seen from one side
    sigma = np.sqrt(0.02**2 + 0.08**2 + (PARTITION[1] / 2) ** 2)
    assert found.sigma[np.abs(found.at - 7) < 0.2] == pytest.approx([sigma])


def test_fusion_is_the_inverse_variance_mean():
    at, sigma = np.array([1.0, 1.02, 0.99]), np.array([0.01, 0.02, 0.04])
    found = fuse(at, sigma, np.arange(3))
    weights = [10_000, 2_500, 625]
    assert found.position_m == pytest.approx(np.dot(weights, at) / 13_125)
    assert found.sigma_m == pytest.approx(1 / np.sqrt(13_125))
    assert found.outliers == ()


def test_measurements_of_one_scan_count_as_one():
    once = fuse(np.array([1.0, 1.1]), np.array([0.05, 0.05]), np.array([0, 1]))
    often = fuse(np.array([1.0, 1.0, 1.0, 1.1]), np.full(4, 0.05), np.array([0, 0, 0, 1]))
    assert (once.position_m, once.sigma_m) == pytest.approx((often.position_m, often.sigma_m))


def test_of_two_scans_that_differ_neither_is_an_outlier_but_neither_is_trusted():
    apart = fuse(np.array([1.0, 2.0]), np.array([0.02, 0.02]), np.array([4, 9]))
    assert apart.outliers == ()
    # two values scatter by half their distance about the mean: its error is that
    assert (apart.position_m, apart.sigma_m) == pytest.approx((1.5, 0.5))


def test_nothing_measured_is_nowhere():
    none = fuse(np.empty(0), np.empty(0), np.empty(0, np.int64))
    assert np.isnan(none.position_m) and none.sigma_m == np.inf and none.outliers == ()


@settings(max_examples=60, deadline=None)
@given(st.lists(st.integers(-20, 20), min_size=3, max_size=9), st.randoms(use_true_random=False))
def test_fusion_heeds_neither_order_nor_where_zero_is(millimetres, random):
    at = np.array(millimetres) / 1000
    scans = np.arange(len(at))
    sigma = np.full(len(at), 0.02)
    first = fuse(at, sigma, scans)
    order = np.array(random.sample(range(len(at)), len(at)))
    second = fuse(at[order] + 5.0, sigma, scans[order])
    assert second.position_m - 5.0 == pytest.approx(first.position_m, abs=1e-9)
    assert second.sigma_m == pytest.approx(first.sigma_m)
    assert second.outliers == first.outliers
    far = fuse(np.append(at, 3.0), np.append(sigma, 0.02), np.append(scans, 77))
    assert far.outliers == (77,)
    assert far.position_m == pytest.approx(first.position_m, abs=1e-9)


def test_fused_sigma_is_what_fused_positions_scatter_by():
    rng = np.random.default_rng(3)
    sigma = np.array([0.01, 0.02, 0.03, 0.02])
    draws = rng.normal(scale=sigma, size=(1500, 4))
    found = [fuse(d, sigma, np.arange(4)) for d in draws]
    clean = np.array([f.position_m for f in found if not f.outliers])
    assert len(clean) > 1450
    assert np.std(clean) == pytest.approx(1 / np.sqrt((sigma**-2.0).sum()), rel=0.05)


def test_each_piece_of_evidence_makes_a_wall_more_probable():
    little = {
        "divides": np.zeros(1),
        "covered": np.zeros(1),
        "both": np.zeros(1, bool),
        "height": np.zeros(1),
        "scans": np.ones(1, np.int64),
    }
    base = presence(**little, params=PresenceParams())
    assert base == pytest.approx(1 / (1 + np.exp(4)))
    much = {"both": np.ones(1, bool), "scans": np.full(1, 4)}
    for name in little:
        more = little | {name: much.get(name, np.ones(1))}
        assert presence(**more, params=PresenceParams()) > base
    known = PresenceParams(base=0, divides=0, covered=0, both=0, height=0, scans=0)
    assert presence(**little, params=known) == pytest.approx(0.5)


def test_unseen_stretches_of_a_face_do_not_cover():
    whole = faces((7.0, DOWN))
    half = np.full(48, SEEN_WALL, np.uint8)
    half[24:] = NOT_SEEN
    gaps = replace(whole, profiles=(half,))
    assert branches(gaps).presence < branches(whole).presence
