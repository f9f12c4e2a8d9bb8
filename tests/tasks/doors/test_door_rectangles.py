"""Rectangles of lines and of standard sizes, against all pairs and against brute force."""

from itertools import product

import numpy as np
import pytest

from tasks.doors.lines import Lines
from tasks.doors.rectangles import SizeParams, door_rectangles, window_rectangles
from tasks.doors.templates import TemplateParams, template_rectangles
from tasks.doors.windows import like_usual, usual_window

PIXEL_M = 0.04
SIZES = SizeParams()


def lines(*rows):
    """Return lines of (place, begin, end)."""
    places, begins, ends = np.array(sorted(rows), float).reshape(-1, 3).T
    return Lines(places, begins, ends, ends - begins)


def rounded(rectangles):
    return {tuple(np.round(row, 6)) for row in rectangles}


def test_two_sides_and_a_head_are_a_door_and_so_are_standard_sizes_from_either_side():
    uprights = lines((1.0, 0.0, 2.0), (1.95, 0.1, 2.0))
    levels = lines((2.05, 0.9, 2.1))
    found = rounded(door_rectangles(uprights, levels, 5.0, SIZES))
    sides = {(1.0, 1.95)}
    for width in SIZES.door_widths_m:
        sides |= {(1.0, 1.0 + width), (1.95, 1.95 + width), (1.95 - width, 1.95)}
        if width <= 1:
            sides.add((1.0 - width, 1.0))
    assert {row[:2] for row in found} == rounded(np.array(sorted(sides)))
    assert {row[2] for row in found} == {0.0}
    # the level line bounds what it runs across, the standard height everything
    assert {row[:2] for row in found if row[3] == 1.97} == {row[:2] for row in found}
    assert (1.0, 1.95, 0.0, 2.05) in found
    assert not any(row[3] == 2.05 and row[0] > 1.9 for row in found)


@pytest.mark.parametrize(
    "side",
    [(1.0, 1.3, 2.0), (1.0, 0.0, 1.2)],
    ids=["begins above a door's foot", "ends below a door's head"],
)
def test_a_line_that_bounds_no_door_makes_none(side):
    assert len(door_rectangles(lines(side), lines(), 5.0, SIZES)) == 0


def test_uprights_meet_those_within_a_doors_width_and_no_others():
    rng = np.random.default_rng(5)
    places = np.unique(np.round(rng.uniform(0, 20, 60), 3))
    uprights = lines(*((place, 0.0, 2.0) for place in places))
    sizes = SizeParams(door_widths_m=(), door_heads_m=(1.97,))
    found = rounded(door_rectangles(uprights, lines(), 20.0, sizes))
    least, most = sizes.door_width_m
    every = {
        (a, b, 0.0, 1.97)
        for a, b in product(places, places)
        if least - 1e-9 <= b - a <= most + 1e-9
    }
    assert found == {tuple(np.round(row, 6)) for row in every}


def test_there_are_as_many_rectangles_as_lines_times_what_sizes_allow():
    def count(length):
        places = np.arange(0, length, 0.1)
        return len(door_rectangles(lines(*((p, 0, 2) for p in places)), lines(), length, SIZES))

    short, long = count(20.0), count(80.0)
    assert long < 4.5 * short  # all pairs would be sixteen times as many


def test_a_window_lies_between_its_sill_and_its_head():
    uprights = lines((1.0, 0.9, 2.2), (2.5, 0.95, 2.15))
    levels = lines((0.9, 1.0, 2.5), (2.2, 0.9, 2.6))
    found = rounded(window_rectangles(uprights, levels, 2.8, SIZES))
    assert (1.0, 2.5, 0.9, 2.2) in found
    # where level lines are missing the uprights' common extent stands in
    alone = rounded(window_rectangles(uprights, lines(), 2.8, SIZES))
    assert alone == {(1.0, 2.5, 0.95, 2.15)}


@pytest.mark.parametrize(
    ("uprights", "levels"),
    [
        (lines((1.0, 0.9, 2.2), (1.3, 0.9, 2.2)), lines()),
        (lines((1.0, 0.9, 2.2), (5.0, 0.9, 2.2)), lines()),
        (lines((1.0, 0.9, 1.2), (2.5, 1.6, 2.2)), lines()),
        (lines((1.0, 0.9, 1.6), (2.5, 1.3, 2.2)), lines()),
        (lines((1.0, 0.9, 2.2)), lines((0.9, 0, 4), (2.2, 0, 4))),
    ],
    ids=["narrow", "wide", "not side by side", "low", "one upright"],
)
def test_what_has_no_windows_size_is_none(uprights, levels):
    assert len(window_rectangles(uprights, levels, 2.8, SIZES)) == 0


def test_a_window_with_a_hidden_side_is_found_by_what_the_others_look_like():
    whole = (
        lines((1.0, 0.9, 2.2), (2.5, 0.9, 2.2), (4.0, 0.9, 2.2), (5.5, 0.9, 2.2)),
        lines((0.9, 1.0, 2.5), (0.92, 4.0, 5.5), (2.2, 1.0, 5.5)),
    )
    usual = usual_window([whole, whole], SIZES)
    assert (usual.width_m, usual.sill_m, usual.head_m) == pytest.approx((1.5, 0.91, 2.2), abs=0.01)
    found = rounded(like_usual(usual, lines((1.0, 1.5, 2.1)), 4.0, 2.8, SIZES))
    assert len(found) == 1
    assert min(found) == pytest.approx((1.0, 2.5, 0.91, 2.2), abs=0.01)


def test_without_windows_there_is_no_usual_one_and_nothing_like_it():
    door = lines((1.0, 0.0, 2.0), (1.9, 0.0, 2.0)), lines((2.0, 1.0, 1.9))
    assert usual_window([door], SIZES) is None
    assert usual_window([], SIZES) is None
    assert len(like_usual(None, lines((1.0, 0.9, 2.2)), 4.0, 2.8, SIZES)) == 0


def steps_by_hand(depth, start, wide, high, strip):
    """Return by how much a box lies behind the least deep of the three strips around it."""

    def mean(i0, i1, j0, j1):
        part = depth[max(i0, 0) : max(i1, 0), j0:j1]
        enough = np.isfinite(part).sum() >= max(0.3 * part.size, 1)
        return np.nanmean(part) if part.size and enough else np.nan

    stop = start + wide
    around = [
        mean(start - strip, start, 1, high),
        mean(stop, stop + strip, 1, high),
        mean(start, stop, high, high + strip),
    ]
    return mean(start, stop, 1, high) - np.nanmax(around)


def test_a_leaf_a_centimetre_back_is_found_under_noise_that_hides_its_edges(scenes):
    depth = scenes.Face(5.0, noise_m=0.012, seed=2).moved((1.4, 2.36, 0, 1.96), 0.012).depths
    found = template_rectangles(depth, PIXEL_M, (0.96,), (1.96,), TemplateParams())
    assert len(found) == 1
    assert found[0] == pytest.approx((1.4, 2.36, 0.0, 1.96), abs=0.09)
    start = round(found[0, 0] / PIXEL_M)
    every = [steps_by_hand(depth, i, 24, 49, 5) for i in range(len(depth) - 24 + 1)]
    assert start == int(np.argmax(every))


@pytest.mark.parametrize(
    "draw",
    [
        lambda face: face,
        lambda face: face.moved((2.0, 5.0, 0, 2.8), 0.02),
        lambda face: face.moved((1.4, 2.36, 0, 1.96), -0.02),
        lambda face: face.hidden((0, 5, 0, 2.8)),
    ],
    ids=["flat", "a step in the wall", "a board on the wall", "nothing seen"],
)
def test_what_is_no_recess_gives_no_box(scenes, draw):
    depth = draw(scenes.Face(5.0, noise_m=0.004, seed=3)).depths
    assert len(template_rectangles(depth, PIXEL_M, (0.96,), (1.96,), TemplateParams())) == 0


def test_a_face_smaller_than_a_door_has_none(scenes):
    depth = scenes.Face(0.6, noise_m=0.01).depths
    assert len(template_rectangles(depth, PIXEL_M, (0.96,), (1.96,), TemplateParams())) == 0
