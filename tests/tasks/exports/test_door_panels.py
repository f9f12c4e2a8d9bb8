"""Panels of a wall face: their pictures' colours, and the sheet they are drawn on."""

import matplotlib.image
import numpy as np
import pytest

from storage.wall_images import EMPTY, NOT_SEEN, OCCLUDED, OCCUPIED, WallImages
from tasks.exports.door_panels import (
    DEEP,
    NEAR,
    Panel,
    depth_image,
    draw_panels,
    edge_image,
    label_image,
    mask_image,
    traced_panels,
)


def images():
    label = np.full((100, 60), OCCUPIED, np.uint8)
    label[40:62, :48] = EMPTY
    label[80:] = OCCLUDED
    label[:5] = NOT_SEEN
    depth = np.where(label == EMPTY, 2.0, 0.0).astype(np.float32)
    depth[:5] = np.nan
    empty = np.where(label == EMPTY, 255, 0).astype(np.uint8)
    one = np.zeros(1, np.int32)
    return WallImages(
        0.04, one, one, one - 1, np.zeros((1, 2)), np.array([[1.0, 0.0]]), np.zeros(1),
        (label,), (depth,), (empty,), np.ones(1, np.int64),
    )  # fmt: skip


def test_each_label_has_a_colour_of_its_own_and_empty_is_white():
    colours = label_image(np.array([[NOT_SEEN, OCCUPIED, EMPTY, OCCLUDED]], np.uint8))[0]
    assert len({tuple(c) for c in colours}) == 4
    assert (colours[2] == 1).all()


def test_depths_darken_away_from_the_room_and_unknown_ones_are_white():
    picture = depth_image(np.array([[-1, -0.1, 0.1, 0.3, 9, np.nan]], np.float32))[0]
    np.testing.assert_allclose(picture[[0, 1]], [NEAR, NEAR])
    np.testing.assert_allclose(picture[2], (NEAR + DEEP) / 2, atol=1e-6)
    np.testing.assert_allclose(picture[[3, 4]], [DEEP, DEEP], atol=1e-6)
    assert (picture[5] == 1).all()


@pytest.mark.parametrize("suffix", [".png", ".svg"])
def test_eight_panels_make_a_sheet_that_is_the_same_each_time(tmp_path, suffix):
    some = images()
    edges = Panel("edges", mask_image(some.labels[0] == EMPTY))
    box = Panel("doors", label_image(some.labels[0]), rectangles=np.array([[1.6, 0, 2.5, 1.9]]))
    line = Panel("lines", edges.image, lines=np.array([[[1.6, 0], [1.6, 2.0]]]))
    panels = [*traced_panels(some, 0), edges, line, edges, box, box]
    written = []
    for name in ("a", "b"):
        path = tmp_path / f"{name}{suffix}"
        draw_panels(panels, some.pixel_m, "wall 0 from room 0", "pixels of 4 cm", path)
        written.append(path.read_bytes())
    assert written[0] == written[1] and len(written[0]) > 5000


def test_a_rectangle_is_drawn_around_its_place_on_the_wall(tmp_path):
    white = np.ones((100, 60, 3))
    found = []
    for rectangles in (np.empty((0, 4)), np.array([[1.0, 0.5, 3.0, 2.0]])):
        path = tmp_path / f"{len(rectangles)}.png"
        draw_panels([Panel("", white, rectangles=rectangles)], 0.04, "", "", path)
        found.append(matplotlib.image.imread(path)[..., :3])
    changed = np.argwhere((found[0] != found[1]).any(axis=2))
    (top, left), (bottom, right) = changed.min(axis=0), changed.max(axis=0)
    assert (right - left) / (bottom - top) == pytest.approx(2.0 / 1.5, rel=0.03)
    middle = found[1][(top + bottom) // 2, (left + right) // 2]
    np.testing.assert_allclose(middle, 1)  # outlined, not filled


def test_panels_of_different_shapes_or_none_are_refused(tmp_path):
    two = [Panel("", np.ones((4, 5, 3))), Panel("", np.ones((5, 4, 3)))]
    for panels in (two, []):
        with pytest.raises(ValueError, match="one shape"):
            draw_panels(panels, 0.04, "", "", tmp_path / "a.png")


def test_edges_of_one_detector_alone_are_coloured_and_those_of_both_are_ink():
    canny = np.array([[True, True, False, False]])
    picture = edge_image(canny, np.array([[True, False, True, False]]))[0]
    assert len({tuple(colour) for colour in picture}) == 4
    assert picture[0].max() < 0.3 and (picture[3] == 1).all()
    assert picture[1].argmax() == 2 and picture[2].argmax() == 0  # Canny's blue, Sobel's red


def test_groups_of_rectangles_are_told_apart_by_colour(tmp_path):
    white, boxes = np.ones((100, 60, 3)), np.array([[0.2, 0.2, 1.2, 2.0], [2.0, 0.2, 3.0, 2.0]])
    found = []
    for groups in ((0, 0), (0, 1), (0, -1)):
        path = tmp_path / f"{groups}.png"
        panel = Panel("", white, rectangles=boxes, groups=np.array(groups))
        draw_panels([panel], 0.04, "", "", path)
        found.append(matplotlib.image.imread(path)[..., :3])
    alike, apart, of_none = found
    for other in (apart, of_none):
        changed = np.argwhere((alike != other).any(axis=2))
        high, wide = np.ptp(changed, axis=0)
        assert wide / high == pytest.approx(1.0 / 1.8, rel=0.05)  # the right one alone
    assert (apart != of_none).any()
