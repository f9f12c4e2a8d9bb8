"""Subdivisions of a storey: their walls and rooms."""

import numpy as np
import pytest
from shapely import Polygon, box
from shapely.affinity import rotate

from tasks.simulation.cells import cleaned, inner_faces, wall_lines
from tasks.simulation.layouts.ring import closed_loop
from tasks.simulation.layouts.rows import Band, Space, cut_out, fill_band, offset_path, offset_ring
from tasks.simulation.layouts.units import UNITS, Part, draw_row
from tasks.simulation.presets import RING_SIDES_M

CELLS = [box(0, 0, 8, 2), box(0, 2, 3, 6), box(3, 2, 8, 6)]


@pytest.mark.parametrize("angle", [0, 17, 45, 90])
def test_what_two_cells_share_is_a_wall_and_the_rest_is_outside(angle):
    cells = [rotate(cell, angle, origin=(0, 0)) for cell in CELLS]
    walls = wall_lines(cells, {0}, 0.3, 0.24, 0.1)
    shared = {wall.cells: wall for wall in walls if len(wall.cells) == 2}
    assert set(shared) == {(0, 1), (0, 2), (1, 2)}
    lengths = [shared[pair].line.length for pair in ((0, 1), (0, 2), (1, 2))]
    assert lengths == pytest.approx([3, 5, 4])
    assert [shared[pair].thickness_m for pair in ((0, 1), (0, 2), (1, 2))] == [0.24, 0.24, 0.1]
    outer = [wall for wall in walls if len(wall.cells) == 1]
    assert sum(wall.line.length for wall in outer) == pytest.approx(2 * (8 + 6))
    assert {wall.thickness_m for wall in outer} == {0.3}
    rooms = inner_faces(cells, walls)
    areas = [(8 - 0.3) * (2 - 0.27), (3 - 0.2) * (4 - 0.27), (5 - 0.2) * (4 - 0.27)]
    assert [room.area for room in rooms] == pytest.approx(areas)
    assert all(len(room.exterior.coords) == 5 for room in rooms)


def test_what_runs_straight_on_has_one_thickness():
    # the corridor ends at a room as wide as the storey: its end wall runs on as a partition
    cells = [box(0, 2, 6, 4), box(0, 0, 6, 2), box(0, 4, 6, 6), box(6, 0, 9, 6)]
    walls = wall_lines(cells, {0}, 0.3, 0.24, 0.1)
    assert {w.thickness_m for w in walls if 3 in w.cells and len(w.cells) == 2} == {0.24}
    assert [len(room.exterior.coords) - 1 for room in inner_faces(cells, walls)] == [4] * 4


def test_a_corner_on_a_straight_side_is_none():
    polygon = Polygon([(1, 0), (2, 0), (2, 2), (0, 2), (0, 0)], [[(0.5, 0.5), (1, 0.5), (1, 1)]])
    assert len(cleaned(polygon).exterior.coords) == 5
    assert cleaned(polygon).equals(polygon)


def test_walls_so_thick_that_no_room_is_left_are_refused_failure():
    cells = [box(0, 0, 0.2, 0.2)]
    with pytest.raises(ValueError, match="expected one room"):
        inner_faces(cells, wall_lines(cells, (), 0.3, 0.3, 0.1))


def test_the_published_reference_lines_close_as_a_rectangle_with_cut_corners():
    loop = closed_loop(np.array(RING_SIDES_M))
    steps = np.roll(loop, -1, axis=0) - loop
    assert np.linalg.norm(steps, axis=1) == pytest.approx(RING_SIDES_M, abs=1e-9)
    angles = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    assert np.rad2deg(np.diff(angles)) == pytest.approx(45, abs=1.0)
    # 11 by 12 facade modules
    assert np.ptp(loop, axis=0) == pytest.approx([11 * 2.4, 12 * 2.4], abs=0.1)


def test_a_ring_is_moved_outwards_and_back():
    ring = closed_loop(np.array(RING_SIDES_M))
    grown = offset_ring(ring, 1.5)
    expected = Polygon(ring).buffer(1.5, join_style="mitre")
    assert Polygon(grown).symmetric_difference(expected).area < 1e-6
    assert offset_ring(grown, -1.5) == pytest.approx(ring)


def test_a_path_is_moved_to_its_right():
    path = np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 3.0)])
    assert offset_path(path, 1.0) == pytest.approx(np.array([(0, -1), (5, -1), (5, 3)]))


def test_rooms_fill_a_band_in_proportion_to_their_modules():
    band = Band(np.array([(0.0, 0.0), (6.0, 0.0)]), np.array([(-1.0, -5.0), (7.0, -5.0)]))
    spaces = fill_band(band, [Part("office", 2), Part("lab", 1)])
    # base and facade of the first: 4 and 5 m; of the second: 2 and 3 m
    assert [s.cell.area for s in spaces] == pytest.approx([4.5 * 5, 2.5 * 5])
    assert [s.class_ for s in spaces] == ["office", "lab"]


def test_a_cut_leaves_both_rooms_whole_or_is_refused_failure():
    room = Space(box(0, 0, 6, 4), "seminar")
    rest, cut = cut_out(room, box(-1, 2, 2, 9), "storage")
    assert (rest.cell.area, cut.cell.area) == pytest.approx((24 - 4, 4))
    assert (rest.class_, cut.class_) == ("seminar", "storage")
    for through in (box(2, -1, 3, 5), box(9, 9, 10, 10)):
        with pytest.raises(ValueError, match="does not cut one room"):
            cut_out(room, through, "storage")


@pytest.mark.parametrize("modules", [4, 9, 23])
def test_a_drawn_row_is_full_has_what_it_must_and_wide_ends(modules):
    for seed in range(20):
        parts = draw_row(modules, np.random.default_rng(seed), ("wc",), 2 if modules > 4 else 1)
        assert sum(part.modules for part in parts) == modules
        assert "wc" in {part.class_ for part in parts}
        assert modules == 4 or min(parts[0].modules, parts[-1].modules) >= 2


def test_units_are_drawn_as_often_as_their_a_priori_probability_says():
    rng = np.random.default_rng(0)
    drawn = [draw_row(1000, rng) for _ in range(3)]
    units = sum(1 for parts in drawn for part in parts if part.class_ == "assistant")
    # every executives unit has one assistant; the mean unit measures so many modules
    mean = sum(unit.p_apriori * unit.modules for unit in UNITS.values())
    expected = 3000 / mean * UNITS["executives"].p_apriori
    assert abs(units - expected) < 4 * np.sqrt(expected)


def test_a_row_too_short_for_what_it_must_hold_is_refused_failure():
    with pytest.raises(ValueError, match="do not fit in 3 modules"):
        draw_row(3, np.random.default_rng(0), ("seminar",))
