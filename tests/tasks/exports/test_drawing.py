"""The drawing: what stands in it, where it stands, and that it is the same each time."""

import re
import xml.etree.ElementTree as ET
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
import shapely
from shapely import LineString, Point, Polygon, box

from storage.errors import StoreError
from storage.plan import Plan, PlanFurniture, PlanOpening, PlanRoom, PlanWall
from tasks.exports.coverage import Coverage, seen_area, unseen_area
from tasks.exports.drawing import draw_plan
from tasks.exports.labels import place_label
from tasks.exports.openings import door_lines, window_lines
from tasks.exports.poche import assumed_walls, known_walls
from tasks.exports.sheet import MARGIN_IN, WIDTH_IN, new_sheet, text_width

PNG_WIDTH = 1600


def flat() -> Plan:
    """Two rooms with a door between them, a window, a table; all walls 0.2 m thick."""
    rooms = (
        PlanRoom("r1", box(0, 0, 4, 3), "office", "Office $1"),
        PlanRoom("r2", box(4.2, 0, 6.2, 3), "storage"),
    )
    ring = [(-0.1, -0.1), (6.3, -0.1), (6.3, 3.1), (-0.1, 3.1), (-0.1, -0.1)]
    walls = [PlanWall(f"w{i}", LineString(ring[i : i + 2]), 0.2) for i in range(4)]
    walls.append(PlanWall("w4", LineString([(4.1, -0.1), (4.1, 3.1)]), 0.2, rooms=("r1", "r2")))
    door = PlanOpening("d", LineString([(4.1, 0.3), (4.1, 1.2)]), 0.0, 2.05, "w4", None, "open")
    return Plan(
        "ifp",
        "4",
        rooms,
        tuple(walls),
        doors=(replace(door, rooms=("r1", "r2")),),
        windows=(PlanOpening("n", LineString([(1, -0.1), (2, -0.1)]), 0.9, 2.2, "w0"),),
        furniture=(PlanFurniture("f", box(1, 1, 2.6, 1.8), "table", 0.0, 0.74, "r1"),),
        simulated=True,
    )


def squares() -> Coverage:
    x, y = np.meshgrid(np.arange(0.25, 4, 0.5), np.arange(0.25, 3, 0.5))
    cells = np.column_stack((x.ravel(), y.ravel()))
    return Coverage(cells, 0.5, 1 + (cells[:, 0] > 2).astype(np.int64))


CASES = {
    "flat": (flat(), squares()),
    "empty": (Plan("ifp", "5"), None),
    "empty but scanned": (Plan("ifp", "5"), squares()),
    "walls alone": (replace(flat(), rooms=(), doors=(), furniture=()), None),
    "closet": (Plan("ifp", "0", (PlanRoom("r", box(0, 0, 1, 1.5)),)), None),
    "tower": (Plan("ifp", "0", (PlanRoom("r", box(0, 0, 1, 80)),)), None),
    "corridor": (Plan("ifp", "0", (PlanRoom("r", box(0, 0, 90, 2)),)), None),
}


@pytest.mark.parametrize("case", CASES)
def test_every_plan_is_drawn_alike_each_time_and_at_full_width(case, tmp_path):
    plan, coverage = CASES[case]
    for name in ("a", "b"):
        draw_plan(plan, coverage, tmp_path / f"{name}.svg", tmp_path / f"{name}.png")
    for suffix in ("svg", "png"):
        first, second = (tmp_path / f"{name}.{suffix}" for name in ("a", "b"))
        assert first.read_bytes() == second.read_bytes()
    assert len(list(tmp_path.iterdir())) == 4
    png = (tmp_path / "a.png").read_bytes()
    width, height = (int.from_bytes(png[i : i + 4], "big") for i in (16, 20))
    assert width == PNG_WIDTH and 600 < height < 2400
    svg = (tmp_path / "a.svg").read_text()
    assert ET.fromstring(svg).tag.endswith("svg")
    assert not re.search(r"dc:date|matplotlib v", svg)


def test_plans_drawn_at_once_are_those_drawn_one_by_one(tmp_path):
    def draw(name: str) -> tuple[bytes, bytes]:
        files = tmp_path / f"{name}.svg", tmp_path / f"{name}.png"
        draw_plan(flat(), squares(), *files)
        return files[0].read_bytes(), files[1].read_bytes()

    alone = draw("alone")
    with ThreadPoolExecutor(3) as threads:
        assert set(threads.map(draw, "abc")) == {alone}


def test_the_sheet_says_what_a_reader_must_know(tmp_path, monkeypatch):
    assert "simulated data" in texts_of(flat(), tmp_path, monkeypatch)
    assert "simulated data" not in texts_of(Plan("b", "0"), tmp_path, monkeypatch)
    assert "no rooms found" in texts_of(Plan("b", "0"), tmp_path, monkeypatch)
    assert {"ifp  ·  storey 4", "2 rooms, 18.0 m²"} <= texts_of(flat(), tmp_path, monkeypatch)
    assert {"Office $1", "12.0 m²", "r2"} <= texts_of(flat(), tmp_path, monkeypatch)
    noted = Plan("b", "0", notes=("one scan was skipped",))
    assert "one scan was skipped" in texts_of(noted, tmp_path, monkeypatch)


def texts_of(plan: Plan, folder, monkeypatch) -> set[str]:
    sheets = []
    monkeypatch.setattr("tasks.exports.drawing.save", lambda sheet, _: sheets.append(sheet))
    draw_plan(plan, None, folder / "p.svg", folder / "p.png")
    figure = sheets[0].figure
    return {text.get_text() for text in (*figure.texts, *figure.axes[0].texts)}


def test_walls_of_one_thickness_join_in_clean_corners():
    area = known_walls(replace(flat(), doors=(), windows=()))
    expected = box(-0.2, -0.2, 6.4, 3.2) - box(0, 0, 4, 3) - box(4.2, 0, 6.2, 3)
    assert area.symmetric_difference(expected).area < 1e-9


def test_walls_at_any_angle_fill_the_band_about_their_room():
    outline = Polygon([(0, 0), (9, -1.5), (10.5, 3), (5, 4.6), (5.8, 10), (0.5, 9.2)])
    ring = list(outline.exterior.coords)
    walls = tuple(PlanWall(f"w{i}", LineString(ring[i : i + 2]), 0.2) for i in range(len(ring) - 1))
    band = outline.buffer(0.1, join_style="mitre") - outline.buffer(-0.1, join_style="mitre")
    assert known_walls(Plan("b", "0", walls=walls)).symmetric_difference(band).area < 1e-6


def test_walls_of_two_thicknesses_close_their_corner():
    walls = (
        PlanWall("a", LineString([(0, 0), (5, 0)]), 0.3),
        PlanWall("b", LineString([(5, 0), (5, 4)]), 0.1),
    )
    area = known_walls(Plan("b", "0", walls=walls))
    assert area.contains(Point(5.04, -0.14)) and area.geom_type == "Polygon"


def test_a_wall_that_ends_on_another_does_not_stick_out_behind_it():
    walls = (
        PlanWall("a", LineString([(0, 0), (6, 0)]), 0.1),
        PlanWall("b", LineString([(3, 0), (5, 4)]), 0.4),
    )
    area = known_walls(Plan("b", "0", walls=walls))
    assert area.intersection(box(0, -1, 6, -0.11)).area < 0.02


def test_openings_are_cut_out_of_their_walls():
    area = known_walls(flat())
    assert area.distance(Point(4.1, 0.7)) > 0.09 and area.distance(Point(1.5, -0.1)) > 0.09


def test_a_wall_of_unknown_thickness_is_not_drawn_as_known():
    plan = Plan("b", "0", walls=(PlanWall("w", LineString([(0, 0), (3, 0)])),))
    assert known_walls(plan).is_empty
    assert assumed_walls(plan).contains(Point(1.5, 0.03))


def test_a_leaf_opens_into_the_smaller_room_from_the_hinge_at_its_corner():
    plan = flat()
    lines = door_lines(plan, plan.doors[0])
    assert lines.leaf == pytest.approx(np.array([(4.2, 0.3), (5.1, 0.3)]))
    assert lines.swing[0] == pytest.approx([4.2, 1.2])
    assert np.linalg.norm(lines.swing - lines.leaf[0], axis=1) == pytest.approx(0.9)
    assert lines.certain


@pytest.mark.parametrize(
    ("state", "degrees", "certain"),
    [("open", 90, True), ("ajar", 30, True), ("unknown", 90, False), (None, 90, False)],
)
def test_a_leaf_stands_as_the_doors_state_says(state, degrees, certain):
    plan = flat()
    lines = door_lines(plan, replace(plan.doors[0], state=state))
    leaf, shut = lines.leaf[1] - lines.leaf[0], lines.swing[0] - lines.leaf[0]
    cosine = leaf @ shut / 0.81
    assert np.rad2deg(np.arccos(np.clip(cosine, -1, 1))) == pytest.approx(degrees)
    assert lines.certain is certain


def test_a_shut_door_has_no_swing_and_a_door_of_no_room_is_still_drawn():
    plan = flat()
    assert len(door_lines(plan, replace(plan.doors[0], state="shut")).swing) == 0
    lost = door_lines(plan, replace(plan.doors[0], rooms=(), wall=None))
    assert np.isfinite(lost.leaf).all()


def test_a_window_has_its_faces_and_two_panes():
    plan = flat()
    heights = [line[0, 1] for line in window_lines(plan, plan.windows[0])]
    assert heights == pytest.approx([-0.2, -0.12, -0.08, 0.0])


ROOMS = {
    "square": box(0, 0, 4, 4),
    "L": Polygon([(0, 0), (8, 0), (8, 2), (2, 2), (2, 8), (0, 8)]),
    "courtyard": box(0, 0, 9, 9).difference(box(2, 2, 7, 7)),
    "oblique": Polygon([(0, 0), (5, 1), (4, 5), (-1, 4)]),
    "narrow": box(0, 0, 1, 9),
}


@pytest.mark.parametrize("shape", ROOMS)
@pytest.mark.parametrize("points_per_m", [20, 60, 110])
def test_a_label_lies_inside_its_room(shape, points_per_m):
    room = PlanRoom("r1", ROOMS[shape], name="Meeting room 4.01")
    label = place_label(room, box(0, 0, 0.5, 0.5), points_per_m, text_width)
    if label is None:
        assert points_per_m == 20
        return
    wide = max(text_width(line, label.size_pt) for line in label.lines)
    sides = (wide, 1.2 * label.size_pt * len(label.lines))
    w, h = (side / points_per_m / 2 for side in (sides[::-1] if label.upright else sides))
    text = box(label.x_m - w, label.y_m - h, label.x_m + w, label.y_m + h)
    assert room.polygon.contains(text)


def test_a_label_gets_shorter_before_it_is_dropped():
    def lines(side: float) -> tuple[str, ...] | None:
        room = PlanRoom("r1", box(0, 0, side, side), name="Archive of the library")
        label = place_label(room, shapely.Point(), 60, text_width)
        return label and label.lines

    assert lines(5.0) == ("Archive of the library", "25.0 m²")
    assert lines(1.3)[0] == "Archive of"
    assert lines(0.4) == ("r1",)
    assert lines(0.1) is None


def test_a_label_keeps_clear_of_furniture_where_it_can():
    room, table = PlanRoom("r1", box(0, 0, 5, 4)), box(1.5, 1, 3.5, 3)
    label = place_label(room, table, 80, text_width)
    assert not table.contains(Point(label.x_m, label.y_m)) and label.size_pt > 10


def test_the_scale_fits_the_sheet_and_is_the_same_both_ways():
    sheet = new_sheet((0, 0, 40, 10))
    assert sheet.scale_in_per_m == pytest.approx((WIDTH_IN - 2 * MARGIN_IN) / 40)
    (left, right), (bottom, top) = sheet.axes.get_xlim(), sheet.axes.get_ylim()
    place = sheet.axes.get_position()
    across = place.width * WIDTH_IN / (right - left)
    upwards = place.height * sheet.height_in / (top - bottom)
    assert across == pytest.approx(sheet.scale_in_per_m) == upwards


def test_coverage_splits_the_floor_into_seen_and_unseen():
    coverage = squares()
    assert seen_area(coverage, 1).area == pytest.approx(12.0)
    assert seen_area(coverage, 2).area == pytest.approx(6.0)
    assert seen_area(coverage, 3).is_empty
    assert unseen_area(coverage, box(0, 0, 6, 3)).area == pytest.approx(6.0)
    none = Coverage(np.empty((0, 2)), 0.5, np.empty(0, np.int64))
    assert unseen_area(none, box(0, 0, 6, 3)).area == pytest.approx(18.0)


def test_a_folder_that_cannot_be_made_is_a_store_error_failure(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreError, match="cannot write the drawing"):
        draw_plan(flat(), None, tmp_path / "file" / "p.svg", tmp_path / "p.png")
