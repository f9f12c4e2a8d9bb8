"""Plans from IFC: small models with known numbers, damaged files, and real buildings with truth."""

import json
import math
from pathlib import Path

import ifcopenshell
import ifcopenshell.api.aggregate
import ifcopenshell.api.context
import ifcopenshell.api.feature
import ifcopenshell.api.geometry
import ifcopenshell.api.project
import ifcopenshell.api.root
import ifcopenshell.api.spatial
import ifcopenshell.api.unit
import numpy as np
import pytest
import shapely
from shapely import LineString, Polygon, box
from shapely.affinity import rotate, translate

from storage.errors import InputError
from storage.ifc.furniture import FIRST_WORD
from storage.plan_geojson import from_geojson, read_plan, to_geojson, write_plan
from storage.plan_ifc import ifc_storeys, read_ifc, read_ifc_storey

api = ifcopenshell.api
DATA = Path(__file__).parents[2].parent / "shared" / "data" / "ifc_buildings"
UNITS = {
    "mm": (0.001, {"is_metric": True, "raw": "MILLIMETERS"}),
    "m": (1.0, {"is_metric": True, "raw": "METERS"}),
    "foot": (0.3048, {"is_metric": False, "raw": "FEET"}),
}
YAW = math.radians(30)
DESK = rotate(box(1, 1, 2.6, 1.8), 25)


class House:
    """An IFC file in the making; all numbers are metres, written in the file's unit."""

    def __init__(self, unit="mm", schema="IFC4", yaw=0.0, shift=(0, 0, 0), buildings=("ifp",)):
        self.metres, length = UNITS[unit]
        self.file = api.project.create_file(schema)
        self.project = self.make("IfcProject", "p")
        api.unit.assign_unit(self.file, length=length)
        model = api.context.add_context(self.file, "Model")
        self.body = api.context.add_context(self.file, "Model", "Body", "MODEL_VIEW", parent=model)
        self.axis = api.context.add_context(self.file, "Model", "Axis", "GRAPH_VIEW", parent=model)
        self.site = self.make("IfcSite", "site")
        api.aggregate.assign_object(self.file, [self.site], self.project)
        self.world = np.eye(4)
        self.world[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
        self.world[:3, 3] = shift
        self.place(self.site, self.world)
        self.buildings = [self.make("IfcBuilding", name) for name in buildings]
        api.aggregate.assign_object(self.file, self.buildings, self.site)
        for building in self.buildings:
            self.place(building, self.world)

    def make(self, class_, name=None):
        return api.root.create_entity(self.file, ifc_class=class_, name=name)

    def place(self, product, matrix):
        api.geometry.edit_object_placement(self.file, product=product, matrix=matrix)

    def storey(self, name, z, building=0):
        storey = self.make("IfcBuildingStorey", name)
        api.aggregate.assign_object(self.file, [storey], self.buildings[building])
        self.place(storey, self.at(0, 0, z))
        return storey

    def at(self, x, y, z):
        local = np.eye(4)
        local[:3, 3] = x, y, z
        return self.world @ local

    def prism(self, class_, storey, outline, low, high, name=None, origin=(0, 0), axis=None):
        """Add an element: an outline (a shapely polygon) drawn up from one height to another."""
        element = self.make(class_, name)
        if class_ == "IfcSpace":
            api.aggregate.assign_object(self.file, [element], storey)
        elif class_ != "IfcOpeningElement":
            api.spatial.assign_container(self.file, products=[element], relating_structure=storey)
        self.place(element, self.at(*origin, low))
        local = shapely.get_coordinates(outline.exterior) - origin
        f = self.file
        profile = f.createIfcArbitraryClosedProfileDef("AREA", None, self.polyline(local))
        up = f.createIfcDirection((0.0, 0.0, 1.0))
        solid = f.createIfcExtrudedAreaSolid(profile, None, up, float((high - low) / self.metres))
        items = [("Body", "SweptSolid", self.body, solid)]
        if axis is not None:
            line = self.polyline(np.asarray(axis, float) - origin)
            items.insert(0, ("Axis", "Curve2D", self.axis, line))
        shapes = [f.createIfcShapeRepresentation(c, i, t, [item]) for i, t, c, item in items]
        element.Representation = f.createIfcProductDefinitionShape(None, None, shapes)
        return element

    def polyline(self, xy):
        points = [self.file.createIfcCartesianPoint(tuple(map(float, p / self.metres))) for p in xy]
        return self.file.createIfcPolyline(points)

    def cut(self, wall, outline, low, high, filling=None):
        hole = self.prism("IfcOpeningElement", None, outline, low, high)
        api.feature.add_feature(self.file, feature=hole, element=wall)
        if filling is not None:
            api.feature.add_filling(self.file, opening=hole, element=filling)
        return hole

    def write(self, path):
        self.file.write(str(path))
        return path


def two_rooms(**options):
    """Return two rooms at z = 3 with a door, a passage, a window, a niche and furniture."""
    house = House(**options)
    storey = house.storey("EG", 3.0)
    for name, area, use in (
        ("1.01", box(0, 0, 4, 3), "Office"),
        ("1.02", box(4.2, 0, 8, 3), "Labor"),
    ):
        house.prism("IfcSpace", storey, area, 3.0, 5.7, name).LongName = use
    # an axis in a face, none, an axis the other way round, and an element of its own origin
    between = house.prism(
        "IfcWall", storey, box(4, 0, 4.2, 3), 3, 6, "between", (4, 0), [(4, 0), (4, 3)]
    )
    south = house.prism("IfcWall", storey, box(-0.3, -0.3, 8.3, 0), 3, 6, "south")
    house.prism(
        "IfcWall", storey, box(-0.3, 3, 8.3, 3.3), 3, 6, "north", axis=[(8.3, 3.1), (-0.3, 3.1)]
    )
    house.prism("IfcWall", storey, box(-0.3, 0, 0, 3), 3, 6, "west", (-0.3, 0))
    house.prism("IfcWall", storey, box(8, 0, 8.3, 3), 3, 6, "east")
    door = house.prism("IfcDoor", storey, box(4.05, 0.9, 4.1, 2.0), 3, 5.15, "door")
    door.OverallWidth, door.OverallHeight = 0.9 / house.metres, 2.05 / house.metres
    house.cut(between, box(3.9, 1, 4.3, 1.9), 3, 5.05, door)
    house.cut(between, box(3.9, 2.2, 4.3, 2.8), 2.9, 5.1)
    window = house.prism("IfcWindow", storey, box(1, -0.2, 2.2, -0.18), 3.9, 5.2, "window")
    house.cut(south, box(1, -0.3, 2.2, 0), 3.9, 5.2, window)
    house.cut(south, box(5, -0.1, 6, 0), 3.0, 5.2)  # a niche
    house.prism("IfcFurniture", storey, DESK, 3.0, 3.74, "Schreibtisch 160x80")
    house.prism("IfcFurniture", storey, box(5, 1, 5.5, 1.5), 3.0, 3.9, "Bürostuhl")
    house.prism("IfcFurniture", storey, box(7, 2.6, 8, 3), 3.0, 4.8, "Regal")
    house.storey("Dach", 6.0)
    return house


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return two_rooms().write(tmp_path_factory.mktemp("ifc") / "house.ifc")


@pytest.fixture(scope="module")
def plan(path):
    return read_ifc_storey(path, "EG")


def near(line, other):
    """Whether two lines have the same ends, in either order."""
    a, b = (shapely.get_coordinates(x) for x in (line, other))
    return np.allclose(a, b, atol=2e-4) or np.allclose(a, b[::-1], atol=2e-4)


def by_line(walls, *ends):
    found = [wall for wall in walls if near(wall.line, LineString(ends))]
    assert len(found) == 1, [wall.line.wkt for wall in walls]
    return found[0]


def test_rooms_are_the_spaces_with_their_heights_and_uses(plan):
    assert [(r.name, r.class_) for r in plan.rooms] == [("1.01", "office"), ("1.02", "labor")]
    for room, area in zip(plan.rooms, (box(0, 0, 4, 3), box(4.2, 0, 8, 3)), strict=True):
        assert room.polygon.symmetric_difference(area).area < 1e-3
        assert (room.floor_m, room.ceiling_m) == (pytest.approx(3.0), pytest.approx(5.7))


def test_a_storey_is_named_and_an_empty_one_is_an_empty_plan(path):
    assert ifc_storeys(path) == {"EG": pytest.approx(3.0), "Dach": pytest.approx(6.0)}
    plans = read_ifc(path)
    assert list(plans) == ["EG", "Dach"]
    assert (plans["Dach"].building, plans["Dach"].rooms, plans["Dach"].walls) == ("ifp", (), ())


def test_centre_lines_lie_midway_between_the_faces_with_and_without_an_axis(plan):
    assert len(plan.walls) == 5
    lines = {
        "between": ((4.1, 0), (4.1, 3)),
        "south": ((-0.3, -0.15), (8.3, -0.15)),
        "north": ((-0.3, 3.15), (8.3, 3.15)),
        "west": ((-0.15, 0), (-0.15, 3)),
        "east": ((8.15, 0), (8.15, 3)),
    }
    rooms = [room.id for room in plan.rooms]
    for name, ends in lines.items():
        wall = by_line(plan.walls, *ends)
        assert wall.thickness_m == pytest.approx(0.2 if name == "between" else 0.3, abs=1e-4)
        assert (wall.base_m, wall.top_m) == (pytest.approx(3), pytest.approx(6))
        beside = {"west": rooms[:1], "east": rooms[1:]}.get(name, rooms)
        assert list(wall.rooms) == beside


def test_a_door_is_its_opening_and_links_the_rooms_on_both_sides(plan):
    door, passage = plan.doors
    assert near(door.line, LineString([(4.1, 1), (4.1, 1.9)]))
    assert (door.sill_m, door.head_m) == (pytest.approx(3), pytest.approx(5.05))
    assert door.wall == passage.wall == by_line(plan.walls, (4.1, 0), (4.1, 3)).id
    assert set(door.rooms) == set(passage.rooms) == {room.id for room in plan.rooms}
    assert (door.state, passage.state) == ("unknown", "open")
    assert near(passage.line, LineString([(4.1, 2.2), (4.1, 2.8)]))
    assert (passage.sill_m, passage.head_m) == (pytest.approx(3), pytest.approx(5.1))


def test_a_window_is_its_opening_and_a_niche_is_none(plan):
    (window,) = plan.windows
    assert near(window.line, LineString([(1, -0.15), (2.2, -0.15)]))
    assert (window.sill_m, window.head_m) == (pytest.approx(3.9), pytest.approx(5.2))
    assert (window.state, window.rooms) == (None, ())
    assert len(plan.doors) == 2


def test_furniture_has_an_oriented_footprint_a_class_and_a_room(plan):
    a, b = (room.id for room in plan.rooms)
    desk, chair, shelf = plan.furniture
    assert [f.class_ for f in plan.furniture] == ["table", "chair", "other"]
    assert [f.room for f in plan.furniture] == [a, b, b]
    assert desk.footprint.symmetric_difference(DESK).area < 1e-3
    assert [f.top_m - f.base_m for f in (desk, chair, shelf)] == pytest.approx([0.74, 0.9, 1.8])


@pytest.mark.parametrize("unit", ["m", "foot"])
@pytest.mark.parametrize("schema", ["IFC4", "IFC4X3"])
def test_the_files_unit_and_schema_change_nothing(plan, tmp_path, unit, schema):
    other = read_ifc_storey(two_rooms(unit=unit, schema=schema).write(tmp_path / "h.ifc"), "EG")
    assert_congruent(other, plan, lambda geometry: geometry, 0.0)


def test_a_turned_and_shifted_site_turns_and_shifts_the_plan(plan, tmp_path):
    house = two_rooms(yaw=YAW, shift=(5000.0, -70.0, 400.0))
    moved = read_ifc_storey(house.write(tmp_path / "h.ifc"), "EG")
    assert_congruent(
        moved,
        plan,
        lambda g: translate(rotate(g, YAW, origin=(0, 0), use_radians=True), 5000, -70),
        400.0,
    )


def assert_congruent(plan, reference, move, up):
    for name in ("rooms", "walls", "doors", "windows", "furniture"):
        ours, theirs = getattr(plan, name), getattr(reference, name)
        assert len(ours) == len(theirs) > 0
        for a, b in zip(ours, theirs, strict=True):
            shape = next(k for k in ("polygon", "line", "footprint") if hasattr(a, k))
            distance = shapely.hausdorff_distance(getattr(a, shape), move(getattr(b, shape)))
            assert distance < 5e-4
            for key in ("floor_m", "ceiling_m", "base_m", "top_m", "sill_m", "head_m"):
                if hasattr(a, key):
                    assert getattr(a, key) == pytest.approx(getattr(b, key) + up, abs=1e-6)


def test_doors_keep_their_openings_when_the_file_has_lost_which_fills_which(plan, tmp_path):
    house = two_rooms()
    for relation in house.file.by_type("IfcRelFillsElement"):
        house.file.remove(relation)
    other = read_ifc_storey(house.write(tmp_path / "h.ifc"), "EG")
    assert_congruent(other, plan, lambda geometry: geometry, 0.0)
    assert [door.state for door in other.doors] == ["unknown", "open"]


def test_a_door_without_an_opening_lies_on_its_wall_as_wide_as_it_says(tmp_path):
    house = two_rooms()
    for opening in house.file.by_type("IfcOpeningElement"):
        api.feature.remove_feature(house.file, feature=opening)
    (door,) = read_ifc_storey(house.write(tmp_path / "h.ifc"), "EG").doors
    assert near(door.line, LineString([(4.1, 1.0), (4.1, 1.9)]))  # the body: 0.9 to 2.0
    assert (door.sill_m, door.head_m) == (pytest.approx(3), pytest.approx(5.05))
    assert len(door.rooms) == 2 and door.wall is not None


def test_a_curved_wall_keeps_its_curve(tmp_path):
    house = House()
    storey = house.storey("0", 0.0)
    angles = np.linspace(0, np.pi / 2, 46)
    arc = np.column_stack((np.cos(angles), np.sin(angles)))
    ring = Polygon([*(4 * arc), *(4.3 * arc[::-1])])
    house.prism("IfcWall", storey, ring, 0, 3, axis=4 * arc)
    (wall,) = read_ifc_storey(house.write(tmp_path / "h.ifc"), "0").walls
    assert wall.thickness_m == pytest.approx(0.3, abs=2e-3)
    assert wall.line.length == pytest.approx(4.15 * np.pi / 2, rel=1e-3)
    radii = np.hypot(*shapely.get_coordinates(wall.line).T)
    assert radii == pytest.approx(np.full(len(radii), 4.15), abs=5e-3)


def test_a_bent_wall_without_an_axis_is_left_out_and_said_so(tmp_path):
    house = House()
    storey = house.storey("0", 0.0)
    corner = box(0, 0, 4, 4).difference(box(0.2, 0.2, 4, 4))
    house.prism("IfcWall", storey, corner, 0, 3)
    plan = read_ifc_storey(house.write(tmp_path / "h.ifc"), "0")
    assert plan.walls == () and "no straight centre line" in plan.notes[0]


def test_a_wall_through_two_storeys_is_a_wall_of_both(tmp_path):
    house = House()
    storeys = [house.storey(str(i), 3.0 * i) for i in range(3)]
    tall = house.prism("IfcWall", storeys[0], box(0, 0, 5, 0.2), 0, 6)
    house.prism("IfcWall", storeys[0], box(0, 2, 5, 2.2), 0, 3.4)  # ends in a parapet
    door = house.prism("IfcDoor", storeys[1], box(1, 0.05, 1.9, 0.1), 3, 5)
    house.cut(tall, box(1, 0, 1.9, 0.2), 3, 5, door)
    plans = read_ifc(house.write(tmp_path / "h.ifc"))
    assert [len(plan.walls) for plan in plans.values()] == [2, 1, 0]
    assert [len(plan.doors) for plan in plans.values()] == [0, 1, 0]
    assert plans["1"].doors[0].wall == tall.GlobalId


def test_a_space_with_a_court_keeps_its_hole(tmp_path):
    house = House()
    storey = house.storey("0", 0.0)
    space = house.prism("IfcSpace", storey, box(0, 0, 5, 5), 0, 3, "hall")
    court = house.prism("IfcSpace", storey, box(2, 2, 3, 4), 0, 3, "court")
    profile = space.Representation.Representations[0].Items[0].SweptArea
    inner = court.Representation.Representations[0].Items[0].SweptArea.OuterCurve
    outline = house.file.createIfcArbitraryProfileDefWithVoids(
        "AREA", None, profile.OuterCurve, [inner]
    )
    space.Representation.Representations[0].Items[0].SweptArea = outline
    hall, yard = read_ifc_storey(house.write(tmp_path / "h.ifc"), "0").rooms
    assert hall.polygon.area == pytest.approx(23, abs=1e-3) and len(hall.polygon.interiors) == 1
    assert yard.polygon.area == pytest.approx(2, abs=1e-3)


@pytest.mark.parametrize(
    ("name", "class_"),
    [
        ("M_Chair-Breuer", "chair"),
        ("Drehstühle", "chair"),
        ("Besucherstuhl 03", "chair"),
        ("Chaise de bureau", "chair"),
        ("M_Table-Dining Round w Chairs", "table"),
        ("Desk1500", "table"),
        ("Couchtisch", "table"),
        ("Mesa redonda", "table"),
        ("Tischlampe", "other"),
        ("table lamp", "other"),
        ("Counter Top", "other"),
        ("Tablet holder", None),
        ("Regal", None),
    ],
)
def test_the_first_word_that_names_a_class_decides(name, class_):
    word = FIRST_WORD.search(name.lower().replace("_", " "))
    assert (word.lastgroup if word else None) == class_


def test_the_predefined_type_comes_before_the_name(tmp_path):
    house = House()
    storey = house.storey("0", 0.0)
    house.prism("IfcFurniture", storey, box(0, 0, 1, 1), 0, 1, "Stuhl").PredefinedType = "TABLE"
    house.prism("IfcFurniture", storey, box(2, 0, 3, 1), 0, 1)
    plan = read_ifc_storey(house.write(tmp_path / "h.ifc"), "0")
    assert [f.class_ for f in plan.furniture] == ["table", None]
    assert [f.room for f in plan.furniture] == [None, None]


def test_a_plan_from_ifc_is_written_and_read_as_geojson(plan, tmp_path):
    write_plan(plan, tmp_path / "plan.geojson")
    again = read_plan(tmp_path / "plan.geojson")
    assert to_geojson(again) == to_geojson(plan)
    assert_congruent(again, plan, lambda geometry: geometry, 0.0)


def test_the_same_file_gives_the_same_plan(path):
    once, again = (json.dumps(to_geojson(read_ifc_storey(path, "EG"))) for _ in range(2))
    assert once == again


def test_bad_files_are_refused_with_their_remedy(path, tmp_path):
    text = path.read_text()
    lines = text.splitlines()
    solid = next(i for i, line in enumerate(lines) if "IFCEXTRUDEDAREASOLID" in line)
    bad = {
        "empty": ("", "no IFC file"),
        "prose": ("Dear reader,\n", "no IFC file"),
        "json": ("{}", "no IFC file"),
        "half": (text[: len(text) // 2], "cut short"),
        "hole": ("\n".join(lines[:solid] + lines[solid + 1 :]), "damaged"),
        "blur": ("\n".join([*lines[:solid], "#9=IFCEXTR)(", *lines[solid + 1 :]]), "damaged"),
        "schema": (text.replace("IFC4", "ABC4"), "Unsupported schema"),
    }
    for name, (content, why) in bad.items():
        file = tmp_path / f"{name}.ifc"
        file.write_text(content)
        with pytest.raises(InputError, match=why) as error:
            read_ifc(file)
        assert str(file) in str(error.value) and error.value.remedy
    with pytest.raises(InputError, match="cannot be read"):
        read_ifc(tmp_path / "missing.ifc")
    with pytest.raises(InputError, match="no storey 'OG'; choose one of 'EG', 'Dach'"):
        read_ifc_storey(path, "OG")


def test_any_lost_line_gives_a_plan_or_an_input_error(path, tmp_path):
    lines = path.read_text().splitlines()
    first = lines.index("DATA;") + 1
    drawn = np.random.default_rng(1).choice(np.arange(first, len(lines) - 2), 30, replace=False)
    refused = 0
    for i in drawn:
        (tmp_path / "h.ifc").write_text("\n".join(lines[:i] + lines[i + 1 :]))
        try:
            read_ifc(tmp_path / "h.ifc")
        except InputError:
            refused += 1
    assert refused > len(drawn) / 2


def test_any_cleared_attribute_gives_a_plan_or_an_input_error(path, tmp_path):
    lines = path.read_text().splitlines()
    uses = [i for i, line in enumerate(lines) if "#" in line[5:] and line.startswith("#")]
    for i in np.random.default_rng(2).choice(uses, 30, replace=False):
        head, _, tail = lines[i][4:].partition("#")
        end = len(tail) - len(tail.lstrip("0123456789"))
        cleared = lines[i][:4] + head + "$" + tail[end:]
        (tmp_path / "h.ifc").write_text("\n".join([*lines[:i], cleared, *lines[i + 1 :]]))
        try:
            read_ifc(tmp_path / "h.ifc")
        except InputError as error:
            assert error.remedy


def test_two_buildings_need_a_name_and_two_storeys_two_names(tmp_path):
    house = House(buildings=("west", "east"))
    for i in range(2):
        storey = house.storey("EG", 0.0, building=i)
        house.prism("IfcSpace", storey, box(9 * i, 0, 9 * i + 4 + i, 3), 0, 3, str(i))
    file = house.write(tmp_path / "h.ifc")
    with pytest.raises(InputError, match="2 buildings: 'west', 'east'; name the building"):
        read_ifc(file)
    (room,) = read_ifc(file, building="east")["EG"].rooms
    assert room.polygon.area == pytest.approx(15, abs=1e-3)
    with pytest.raises(InputError, match="0 buildings named 'north'"):
        read_ifc(file, building="north")
    house.storey("EG", 3.0)
    with pytest.raises(InputError, match="two storeys are named 'EG'"):
        read_ifc(house.write(tmp_path / "h.ifc"), building="west")


def test_a_file_without_a_unit_storey_or_own_ids_is_refused(tmp_path):
    bare = House()
    with pytest.raises(InputError, match="no IfcBuildingStorey"):
        read_ifc(bare.write(tmp_path / "bare.ifc"))
    twins = two_rooms()
    a, b = twins.file.by_type("IfcSpace")
    b.GlobalId = a.GlobalId
    with pytest.raises(InputError, match="is used twice"):
        read_ifc(twins.write(tmp_path / "twins.ifc"))
    unitless = two_rooms()
    unitless.project.UnitsInContext = None
    for assignment in unitless.file.by_type("IfcUnitAssignment"):
        unitless.file.remove(assignment)
    with pytest.raises(InputError, match="no unit of length"):
        read_ifc(unitless.write(tmp_path / "unitless.ifc"))


REAL = pytest.mark.skipif(not DATA.is_dir(), reason="the shared data is not there")


@pytest.fixture(scope="module", params=["office_a_level2", "duplex", "canteen"])
def real(request):
    plans = read_ifc(DATA / f"{request.param}.ifc")
    return request.param, plans, json.loads((DATA / f"{request.param}_truth.json").read_text())


@REAL
def test_a_real_building_has_its_rooms_walls_doors_windows_and_furniture(real):
    name, plans, truth = real
    for storey, plan in plans.items():
        of = {
            kind: {item["id"]: item for item in truth[kind] if item["storey"] == storey}
            for kind in ("rooms", "walls", "doors", "windows", "furniture")
        }
        for kind in ("rooms", "windows", "furniture"):
            assert {item.id for item in getattr(plan, kind)} == of[kind].keys()
        # beyond the truth: walls of other storeys and of glass, passages without a door
        assert {wall.id for wall in plan.walls} >= of["walls"].keys()
        assert {door.id for door in plan.doors if door.state == "unknown"} == of["doors"].keys()
        for room in plan.rooms:
            true = of["rooms"][room.id]
            polygon = Polygon(true["polygon"], true["holes"])
            assert room.polygon.symmetric_difference(polygon).area < 0.002
            assert room.floor_m == pytest.approx(true["z_floor"], abs=1e-3)
            assert room.ceiling_m == pytest.approx(true["z_ceiling"], abs=1e-3)
        for wall in plan.walls:
            true = of["walls"].get(wall.id)
            if true is not None:
                assert wall.line.centroid.distance(LineString(true["axis"])) < 1e-3
                assert wall.line.length == pytest.approx(true["length"], abs=1e-3)
        for door in plan.doors:
            true = of["doors"].get(door.id)
            if true is not None:
                assert door.line.length == pytest.approx(true["overall_width"], abs=1e-3)
                height = door.head_m - door.sill_m
                assert height == pytest.approx(true["overall_height"], abs=1e-3)
                assert door.line.centroid.distance(LineString(true["axis"])) < 0.04
                assert true["host_wall"] in (door.wall, None)
        kinds = {"table": "table", "desk": "table", "chair": "chair"}
        for piece in plan.furniture:
            assert piece.class_ == kinds.get(of["furniture"][piece.id]["kind"], "other")
        again = from_geojson(to_geojson(plan), name)
        assert to_geojson(again) == to_geojson(plan)
