"""Rays in a scene of boxes against where they meet the boxes in closed form."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from storage.points import PointCloud
from tasks.doors.rays import ASIDE, HIT, PASSED, STOPPED, Canvas, Eyes, Limits, cast_rays
from tasks.doors.voxels import distance_field

EDGE = 0.05
LOW, HIGH = np.zeros(3), np.array([5.0, 4.0, 3.0])
FACE_Y = 3.0
"""The wall's face; the room lies before it, at smaller y."""
BOXES = np.array(
    [
        # wall with a doorway from x = 2 to 3, 2 m high
        [[0.0, 3.0, 0.0], [2.0, 3.2, 3.0]],
        [[3.0, 3.0, 0.0], [5.0, 3.2, 3.0]],
        [[2.0, 3.0, 2.0], [3.0, 3.2, 3.0]],
        # cupboard before it, table, something standing in the next room
        [[0.2, 2.4, 0.0], [1.2, 2.85, 1.8]],
        [[3.4, 1.0, 0.6], [4.8, 2.0, 0.8]],
        [[2.2, 3.6, 0.0], [2.6, 3.8, 1.2]],
    ]
)
CANVAS = Canvas(np.array([5.0, FACE_Y, 0.0]), np.array([-1.0, 0.0]), (125, 75), 0.04)
"""Seen from the room, columns run to the left: the room lies to the left of the axis."""
LIMITS = Limits(
    before_m=0.1, through_m=0.3, aside_m=0.1, behind_m=0.9,
    least_cosine=0.0, enough=10**6, need_background=False,
)  # fmt: skip
POSITIONS = np.array([[2.5, 0.5, 1.5], [0.7, 1.2, 1.3], [4.4, 0.4, 1.7], [2.45, 2.2, 0.4]])


def eyes(positions=POSITIONS, **other):
    positions = np.atleast_2d(positions)
    frames = np.tile(np.eye(3), (len(positions), 1, 1))
    return replace(Eyes(positions, frames, True, (1.0, 1.0), 100.0), **other)


@pytest.fixture(scope="module")
def field():
    shape = np.rint((HIGH - LOW) / EDGE).astype(int)
    middles = LOW + (np.argwhere(np.ones(shape, bool)) + 0.5) * EDGE
    within = np.zeros(len(middles), bool)
    for low, high in BOXES:
        within |= ((middles > low) & (middles < high)).all(axis=1)
    cloud = PointCloud(middles[within].astype(np.float32), np.zeros(3))
    return distance_field([cloud], EDGE, 1, LOW, HIGH)


def middles_of(canvas):
    i, j = np.meshgrid(*(np.arange(n) + 0.5 for n in canvas.shape), indexing="ij")
    along = i[..., None] * canvas.pixel_m * np.append(canvas.axis, 0.0)
    return canvas.origin + along + j[..., None] * canvas.pixel_m * np.array([0.0, 0.0, 1.0])


def ends_exactly(position, canvas, boxes):
    """Return how each pixel's ray ends and at which depth, by intersecting it with the boxes."""
    d = middles_of(canvas) - position
    away = FACE_Y - position[1]
    with np.errstate(divide="ignore"):
        sides = (boxes[:, None, None] - position) / d[None, :, :, None]  # (n, a, b, 2, 3)
    enter, leave = sides.min(axis=3).max(axis=-1), sides.max(axis=3).min(axis=-1)
    t = np.where((enter <= leave) & (leave >= 0), enter, np.inf).min(axis=0)
    depth = (t - 1) * away
    beside = (t - 1) * np.hypot(d[..., 0], d[..., 2])
    within = np.where((depth > LIMITS.aside_m) & (beside > LIMITS.aside_m), ASIDE, HIT)
    end = np.where(depth < -LIMITS.before_m, STOPPED, within)
    return np.where(depth > LIMITS.through_m, PASSED, end), np.minimum(depth, LIMITS.behind_m)


@pytest.mark.parametrize("position", POSITIONS)
def test_every_pixel_is_labelled_as_the_boxes_say(field, position):
    found = cast_rays(field, CANVAS, [(eyes(position), LIMITS)])
    assert found.cast == 125 * 75 and (found.counts.sum(axis=0) == 1).all()
    label, depth = found.counts.argmax(axis=0), found.depth_m.sum(axis=0)
    exact, exact_depth = ends_exactly(position, CANVAS, BOXES)
    # a ray is looked at once per layer of voxels: it may miss what it merely clips, and lie up to
    # a layer further in a box than where it entered, but meets what is a voxel smaller all around
    clipped = BOXES + np.array([EDGE, -EDGE])[:, None]
    late, _ = ends_exactly(position, CANVAS, clipped)
    sure = exact == late
    assert sure.mean() > 0.75
    assert (label == exact)[sure].all()
    assert ((label == exact) | (label == late) | (label == ASIDE) | (label == HIT)).all()
    assert (label == exact).mean() > 0.95
    same = sure & (label == exact) & (label != PASSED)
    assert np.abs(depth - exact_depth)[same & (label == HIT)].max() <= EDGE + 1e-6
    assert np.median(np.abs(depth - exact_depth)[same]) < EDGE


def test_what_is_seen_through_an_opening_is_as_deep_as_it_stands(field):
    found = cast_rays(field, CANVAS, [(eyes(POSITIONS[0]), LIMITS)])
    depth = found.depth_m[PASSED]
    _, exact = ends_exactly(POSITIONS[0], CANVAS, BOXES)
    for x, z, stands in ((2.42, 1.0, 0.6), (2.8, 1.0, LIMITS.behind_m)):
        at = int((5.0 - x) / 0.04), int(z / 0.04)
        assert exact[at] == pytest.approx(stands)
        assert depth[at] == pytest.approx(stands, abs=EDGE)


def test_rays_are_cast_only_at_what_the_device_has_in_view(field):
    turn = Rotation.from_euler("xz", [80, 20], degrees=True)  # looks level, a little to its left
    frames = turn.as_matrix().T[None]
    across, up = 0.35, 0.6
    looking = eyes(
        POSITIONS[:1], frames=np.ascontiguousarray(frames), all_round=False,
        half_view=(across, up), reach_m=3.0,
    )  # fmt: skip
    limits = replace(LIMITS, least_cosine=0.8)
    found = cast_rays(field, CANVAS, [(looking, limits)])
    d = middles_of(CANVAS) - POSITIONS[0]
    x, y, z = np.moveaxis(turn.inv().apply(d.reshape(-1, 3)).reshape(d.shape), 2, 0)
    length = np.linalg.norm(d, axis=2)
    expected = (z < 0) & (np.abs(x / z) <= across) & (np.abs(y / z) <= up)
    expected &= (length <= 3.0) & (d[..., 1] / length >= 0.8)
    np.testing.assert_array_equal(found.counts.sum(axis=0) > 0, expected)
    assert found.cast == expected.sum() > 1000


def test_places_behind_the_face_see_nothing_of_it(field):
    assert cast_rays(field, CANVAS, [(eyes([2.5, 3.5, 1.0]), LIMITS)]).cast == 0


def test_no_more_rays_are_cast_at_a_pixel_once_enough_have_reached_it(field):
    places = np.repeat(POSITIONS[:1], 6, axis=0)
    found = cast_rays(field, CANVAS, [(eyes(places), replace(LIMITS, enough=2))])
    reached = found.counts[[HIT, ASIDE, PASSED]].sum(axis=0)
    stopped = found.counts[STOPPED] > 0
    assert (reached[~stopped] == 2).all() and (found.counts[STOPPED][stopped] == 6).all()
    # a later round goes on where the one before left off
    twice = cast_rays(field, CANVAS, [(eyes(places), replace(LIMITS, enough=n)) for n in (2, 3)])
    assert (twice.counts[[HIT, ASIDE, PASSED]].sum(axis=0)[~stopped] == 3).all()


def test_a_ray_that_meets_nothing_says_nothing_if_a_background_is_asked_for(field):
    found, asked = (
        cast_rays(field, CANVAS, [(eyes(POSITIONS[:1]), replace(LIMITS, need_background=need))])
        for need in (False, True)
    )
    open_end = found.depth_m[PASSED] > LIMITS.behind_m - 1e-6
    assert open_end.any()
    assert (asked.counts.sum(axis=0) == ~open_end).all()


def test_places_outside_the_storeys_voxels_see_it_too(field):
    far = np.array([2.5, -4.0, 1.5])
    found = cast_rays(field, CANVAS, [(eyes(far), LIMITS)])
    exact, _ = ends_exactly(far, CANVAS, BOXES)
    assert (found.counts.argmax(axis=0) == exact).mean() > 0.96
