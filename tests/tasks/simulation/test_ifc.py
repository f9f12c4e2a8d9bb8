"""Rays in the mesh of an IFC storey: known distances, holes, glass, and closed rooms."""

import json
from pathlib import Path

import ifcopenshell
import ifcopenshell.api.aggregate
import ifcopenshell.api.context
import ifcopenshell.api.feature
import ifcopenshell.api.geometry
import ifcopenshell.api.project
import ifcopenshell.api.root
import ifcopenshell.api.spatial
import ifcopenshell.api.style
import ifcopenshell.api.unit
import numpy as np
import pytest
import shapely
from shapely import Polygon, box

from storage.errors import InputError
from storage.plan_ifc import read_ifc_storey
from tasks.simulation.ifc import IfcMeshParams, ifc_mesh
from tasks.simulation.materials import DARK, GLASS, MATT

api = ifcopenshell.api
DATA = Path(__file__).parents[3].parent / "shared" / "data" / "ifc_buildings"
EYE = (2.0, 1.5, 4.0)
"""Where rays start: in the middle of the first room, a metre above its floor."""


class House:
    """An IFC4 file in millimetres in the making; arguments are metres."""

    def __init__(self, shift=(0, 0, 0)):
        self.file = api.project.create_file()
        self.shift = np.array(shift)
        project = self.make("IfcProject")
        api.unit.assign_unit(self.file, length={"is_metric": True, "raw": "MILLIMETERS"})
        model = api.context.add_context(self.file, "Model")
        self.body = api.context.add_context(self.file, "Model", "Body", "MODEL_VIEW", parent=model)
        self.building = self.make("IfcBuilding", "b")
        api.aggregate.assign_object(self.file, [self.building], project)

    def make(self, class_, name=None):
        return api.root.create_entity(self.file, ifc_class=class_, name=name)

    def place(self, product, *origin):
        matrix = np.eye(4)
        matrix[:3, 3] = self.shift + origin
        api.geometry.edit_object_placement(self.file, product=product, matrix=matrix)

    def storey(self, name, z):
        storey = self.make("IfcBuildingStorey", name)
        api.aggregate.assign_object(self.file, [storey], self.building)
        self.place(storey, 0, 0, z)
        return storey

    def prism(self, class_, storey, outline, low, high, style=None):
        element = self.make(class_)
        if class_ == "IfcSpace":
            api.aggregate.assign_object(self.file, [element], storey)
        elif storey is not None:
            api.spatial.assign_container(self.file, products=[element], relating_structure=storey)
        self.place(element, 0, 0, low)
        f = self.file
        xy = shapely.get_coordinates(outline.exterior) * 1000
        line = f.createIfcPolyline([f.createIfcCartesianPoint(tuple(map(float, p))) for p in xy])
        profile = f.createIfcArbitraryClosedProfileDef("AREA", None, line)
        up = f.createIfcDirection((0.0, 0.0, 1.0))
        solid = f.createIfcExtrudedAreaSolid(profile, None, up, (high - low) * 1000.0)
        shape = f.createIfcShapeRepresentation(self.body, "Body", "SweptSolid", [solid])
        element.Representation = f.createIfcProductDefinitionShape(None, None, [shape])
        if style is not None:
            api.style.assign_representation_styles(f, shape_representation=shape, styles=[style])
        return element

    def style(self, name, grey, transparency):
        style = api.style.add_style(self.file, name=name)
        colour = {"Name": None, "Red": grey, "Green": grey, "Blue": grey}
        api.style.add_surface_style(
            self.file,
            style=style,
            ifc_class="IfcSurfaceStyleShading",
            attributes={"SurfaceColour": colour, "Transparency": transparency},
        )
        return style

    def cut(self, wall, outline, low, high):
        hole = self.prism("IfcOpeningElement", None, outline, low, high)
        api.feature.add_feature(self.file, feature=hole, element=wall)

    def write(self, folder):
        self.file.write(str(folder / "house.ifc"))
        return folder / "house.ifc"


def two_rooms(**options):
    """Return two rooms at z = 3 without floor and ceiling, joined by a passage and a door."""
    house = House(**options)
    house.eg = house.storey("EG", 3.0)
    house.og = house.storey("OG", 6.0)
    white = house.style("paint", 0.9, 0.0)
    for room in (box(0, 0, 4, 3), box(4.2, 0, 8, 3)):
        house.prism("IfcSpace", house.eg, room, 3.0, 5.7)
    between = house.prism("IfcWall", house.eg, box(4, 0, 4.2, 3), 3, 6, white)
    house.cut(between, box(3.9, 1, 4.3, 1.9), 3, 5.05)
    house.cut(between, box(3.9, 2.2, 4.3, 2.8), 3, 5.1)
    south = house.prism("IfcWall", house.eg, box(-0.3, -0.3, 8.3, 0), 3, 6, white)
    house.cut(south, box(1, -0.4, 3, 0.1), 3.9, 5.2)
    for wall in (box(-0.3, 3, 8.3, 3.3), box(-0.3, 0, 0, 3), box(8, 0, 8.3, 3)):
        house.prism("IfcWall", house.eg, wall, 3, 6, white)
    house.door = house.prism("IfcDoor", house.eg, box(4.05, 1, 4.1, 1.9), 3, 5.05, white)
    pane = house.style("clear", 0.5, 0.8)
    house.prism("IfcWindow", house.eg, box(1, -0.2, 3, -0.18), 3.9, 5.2, pane)
    return house


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return two_rooms().write(tmp_path_factory.mktemp("ifc"))


def look(mesh, directions, start=EYE):
    """Return distances and materials of what rays meet."""
    open3d = pytest.importorskip("open3d")
    scene = open3d.t.geometry.RaycastingScene()
    scene.add_triangles(open3d.core.Tensor(mesh.vertices), open3d.core.Tensor(mesh.triangles))
    directions = np.atleast_2d(np.asarray(directions, np.float32))
    starts = np.broadcast_to(np.asarray(start, np.float32), directions.shape)
    hits = scene.cast_rays(open3d.core.Tensor(np.hstack((starts, directions))))
    distances, ids = hits["t_hit"].numpy(), hits["primitive_ids"].numpy()
    met = np.where(np.isfinite(distances), ids, 0).astype(int)
    return distances, mesh.materials[met]


def toward(x, y, z=EYE[2]):
    """Return a direction that reaches a point after a path of one."""
    return np.array((x, y, z)) - EYE


def test_a_ray_ends_at_the_wall_and_passes_an_open_opening(path):
    mesh = ifc_mesh(path, "EG", IfcMeshParams())
    hits, materials = look(mesh, [(1, 0, 0), (-1, 0, 0), (0, 1, 0)])
    # the shut door's leaf, the west and the north wall
    assert hits == pytest.approx([2.05, 2.0, 1.5], abs=1e-5)
    assert (materials == MATT).all()
    # through the passage to the east wall; past its edge to the wall between the rooms
    assert look(mesh, (1, 0, 0), (2.0, 2.5, 4.0))[0] == pytest.approx(6.0, abs=1e-5)
    assert look(mesh, toward(4.0, 2.1))[0] == pytest.approx(1.0, abs=1e-5)
    assert look(mesh, toward(4.0, 2.5, 5.2))[0] == pytest.approx(1.0, abs=1e-5)  # its lintel


def test_an_open_door_is_a_hole(path):
    (door,) = (d for d in read_ifc_storey(path, "EG").doors if d.state == "unknown")
    mesh = ifc_mesh(path, "EG", IfcMeshParams(), open_doors=[door.id])
    assert look(mesh, (1, 0, 0))[0] == pytest.approx(6.0, abs=1e-5)
    with pytest.raises(InputError, match="no IfcDoor 'front'"):
        ifc_mesh(path, "EG", IfcMeshParams(), open_doors=["front"])


def test_a_transparent_style_is_glass_and_a_black_one_dark(tmp_path):
    house = two_rooms()
    house.prism("IfcFurniture", house.eg, box(1, 2, 1.5, 2.5), 3, 5, house.style("", 0.05, 0.0))
    house.prism("IfcFurniture", house.eg, box(2.5, 2, 3, 2.5), 3, 5, house.style("Glas ESG", 1, 0))
    mesh = ifc_mesh(house.write(tmp_path), "EG", IfcMeshParams())
    rays = [(0, -1, 0), toward(1.2, 2.0), toward(2.8, 2.0), toward(0.5, 0.0)]
    hits, materials = look(mesh, rays)
    assert hits == pytest.approx([1.68, 1, 1, 1], abs=1e-5)
    assert materials.tolist() == [GLASS, DARK, GLASS, MATT]


def test_the_panel_of_a_curtain_wall_without_a_style_is_glass_and_its_post_is_not(tmp_path):
    house = two_rooms()
    front = house.make("IfcCurtainWall")
    api.spatial.assign_container(house.file, products=[front], relating_structure=house.eg)
    parts = [
        house.prism("IfcPlate", None, box(2, 2, 3, 2.1), 3, 5),
        house.prism("IfcMember", None, box(1, 2, 1.2, 2.1), 3, 5),
    ]
    api.aggregate.assign_object(house.file, parts, front)
    steel = house.prism("IfcPlate", house.eg, box(1, 1, 1.2, 1.1), 3, 5)
    assert steel.Representation is not None
    mesh = ifc_mesh(house.write(tmp_path), "EG", IfcMeshParams())
    hits, materials = look(mesh, [toward(2.5, 2), toward(1.1, 2), toward(1.1, 1.1)])
    assert hits == pytest.approx([1, 1, 1], abs=1e-5)
    assert materials.tolist() == [GLASS, MATT, MATT]


def test_a_room_without_floor_and_ceiling_is_closed_by_its_space(path):
    mesh = ifc_mesh(path, "EG", IfcMeshParams())
    assert look(mesh, [(0, 0, 1), (0, 0, -1)])[0] == pytest.approx([1.7, 1.0], abs=1e-5)
    x, y, z = np.random.default_rng(0).uniform((0, 0, 0), (4, 3, 1), (500, 3)).T
    z = np.where(z < 0.5, 3.0, 5.7)
    rays = np.column_stack((x, y, z)) - EYE
    assert look(mesh, rays)[0] == pytest.approx(np.ones(500), abs=1e-5)


def test_a_modelled_ceiling_is_seen_instead_of_the_space(tmp_path):
    house = two_rooms()
    # a slab of the storey above, over the first room only; the storey below lends its floor
    house.prism("IfcSlab", house.og, box(-0.3, -0.3, 4.1, 3.3), 6.0, 6.3)
    house.prism("IfcSlab", house.eg, box(-0.3, -0.3, 8.3, 3.3), 2.7, 2.95)
    mesh = ifc_mesh(house.write(tmp_path), "EG", IfcMeshParams())
    vertical = [(0, 0, 1), (0, 0, -1)]
    assert look(mesh, vertical)[0] == pytest.approx([2.0, 1.05], abs=1e-5)
    assert look(mesh, vertical, (6, 1.5, 4))[0] == pytest.approx([1.7, 1.05], abs=1e-5)
    # where the slab covers too little, the space closes the room after all
    strict = IfcMeshParams(covered_min=1.0, reach_m=0.1)
    assert look(ifc_mesh(tmp_path / "house.ifc", "EG", strict), (0, 0, 1))[0] == pytest.approx(1.7)


def test_the_storey_above_is_not_in_the_mesh_but_its_tall_walls_are(tmp_path):
    house = two_rooms()
    house.prism("IfcFurniture", house.og, box(1, 1, 2, 2), 6.0, 7.0)
    house.prism("IfcWall", house.og, box(10, 0, 10.2, 3), 6, 9)
    house.prism("IfcWall", house.og, box(20, 0, 20.2, 3), 3, 9)
    mesh = ifc_mesh(house.write(tmp_path), "EG", IfcMeshParams())
    assert mesh.vertices[:, 0].max() == pytest.approx(20.2)
    assert not ((mesh.vertices[:, 0] > 9) & (mesh.vertices[:, 0] < 11)).any()
    upper = ifc_mesh(tmp_path / "house.ifc", "OG", IfcMeshParams())
    assert upper.vertices[:, 2].min() == pytest.approx(3.0)  # the tall wall's foot
    assert len(upper.triangles) == 3 * 12


def test_the_mesh_is_whole_and_the_same_every_time(path):
    a, b = (ifc_mesh(path, "EG", IfcMeshParams()) for _ in range(2))
    for name in ("vertices", "triangles", "materials"):
        assert getattr(a, name).tobytes() == getattr(b, name).tobytes()
    assert (a.vertices.dtype, a.triangles.dtype, a.materials.dtype) == (
        np.float32,
        np.uint32,
        np.uint8,
    )
    assert a.triangles.max() < len(a.vertices) and len(a.materials) == len(a.triangles)


def test_an_empty_storey_has_an_empty_mesh(tmp_path):
    house = House()
    house.storey("EG", 0.0)
    mesh = ifc_mesh(house.write(tmp_path), "EG", IfcMeshParams())
    assert mesh.vertices.shape == mesh.triangles.shape == (0, 3) and mesh.materials.shape == (0,)


def test_a_building_too_far_for_single_precision_is_refused(tmp_path):
    file = two_rooms(shift=(3_500_000.0, 0.0, 0.0)).write(tmp_path)
    with pytest.raises(InputError, match=r"3500 km from its origin.*IfcSite"):
        ifc_mesh(file, "EG", IfcMeshParams())
    with pytest.raises(InputError, match="no storey 'UG'"):
        ifc_mesh(file, "UG", IfcMeshParams())


@pytest.mark.skipif(not DATA.is_dir(), reason="the shared data is not there")
@pytest.mark.parametrize(
    ("name", "storey"), [("office_a_level2", "Level 2"), ("duplex", "Level 1")]
)
def test_rays_in_a_real_building_end_where_another_conversion_of_it_says(name, storey):
    """Compare with the triangles that were converted from the same model beforehand."""
    mesh = ifc_mesh(DATA / f"{name}.ifc", storey, IfcMeshParams())
    rooms = json.loads((DATA / f"{name}_truth.json").read_text())["rooms"]
    truth = np.load(DATA / f"{name}_mesh.npz")
    skipped = list(truth["class_names"]).index("other")  # the terrain, and parts of spaces
    faces = truth["faces"][truth["face_class"] != skipped]
    reference = type(mesh)(
        truth["vertices"].astype(np.float32),
        faces.astype(np.uint32),
        np.zeros(len(faces), np.uint8),
    )
    angles = np.linspace(0, 2 * np.pi, 90, endpoint=False)
    rays = np.column_stack((np.cos(angles), np.sin(angles), np.full(90, 0.05)))
    centres = [(Polygon(r["polygon"]).representative_point(), r) for r in rooms]
    eyes = np.array([(p.x, p.y, r["z_floor"] + 1.31) for p, r in centres if r["storey"] == storey])
    starts, directions = np.repeat(eyes, 90, axis=0), np.tile(rays, (len(eyes), 1))
    ours, theirs = look(mesh, directions, starts)[0], look(reference, directions, starts)[0]
    near = theirs < 8.0
    assert near.mean() > 0.8
    assert (np.abs(ours[near] - theirs[near]) < 2e-3).mean() > 0.99
    for vertical in ((0, 0, 1), (0, 0, -1)):
        assert np.isfinite(look(mesh, np.tile(vertical, (len(eyes), 1)), eyes)[0]).all()
