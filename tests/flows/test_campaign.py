"""Campaigns into a folder: what lies there, the same from the same seed, from plans and IFC."""

from hashlib import sha256
from pathlib import Path

import ifcopenshell
import ifcopenshell.api.aggregate
import ifcopenshell.api.context
import ifcopenshell.api.geometry
import ifcopenshell.api.project
import ifcopenshell.api.root
import ifcopenshell.api.spatial
import ifcopenshell.api.unit
import numpy as np
import pyarrow.parquet as pq
import pytest
import shapely
from shapely import LineString, box

from flows.campaign import SimulationParams, Site, plan_sites, preset_sites, simulate
from storage.campaign import read_campaign
from storage.errors import InputError, MapSenseError
from storage.plan import Plan, PlanRoom, PlanWall
from storage.plan_geojson import read_plan, write_plan
from tasks.scans.read import ReadParams, read_scan
from tasks.scans.sources import find_sources
from tasks.simulation.campaign import CampaignParams
from tasks.simulation.sensor import SensorParams
from tasks.simulation.volunteers import VolunteerParams

api = ifcopenshell.api
FEW = CampaignParams(
    seed=5, sensor=SensorParams(rays=200), volunteer=VolunteerParams(interval_s=2.0)
)
DEFAULTS = SimulationParams()


def plan(storey="0", rooms=2, **heights):
    """Return rooms of 4 x 3 m side by side; without heights unless they are given."""
    spaces = [PlanRoom(f"r{i}", box(4.2 * i, 0, 4.2 * i + 4, 3), **heights) for i in range(rooms)]
    end = 4.2 * rooms - 0.1
    lines = [((-0.1, y), (end, y)) for y in (-0.1, 3.1)]
    lines += [((x, -0.1), (x, 3.1)) for x in np.arange(rooms + 1) * 4.2 - 0.1]
    walls = [PlanWall(f"w{i}", LineString(line)) for i, line in enumerate(lines)]
    return Plan("b", storey, tuple(spaces), tuple(walls))


@pytest.fixture(scope="module")
def sites(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plans")
    found = []
    for storey, rooms in (("0", 2), ("1. OG / Süd", 1)):
        write_plan(plan(storey, rooms), folder / "plan.geojson")
        found += plan_sites(folder / "plan.geojson", None, DEFAULTS)
    return found


@pytest.fixture(scope="module")
def made(sites, tmp_path_factory):
    """Three scans of three rooms on two storeys: the folder, the campaign, and what was told."""
    folder, told = tmp_path_factory.mktemp("campaign"), []
    return folder, simulate(sites, folder, "hut", 3, FEW, told.append), told


def contents(folder: Path) -> dict[str, str]:
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {
        path.relative_to(folder).as_posix(): sha256(path.read_bytes()).hexdigest() for path in files
    }


def test_a_campaign_says_what_lies_in_its_folder(made):
    folder, campaign, told = made
    assert read_campaign(folder) == campaign
    assert (campaign.building, campaign.simulated, campaign.seed) == ("hut", True, 5)
    assert [storey.storey for storey in campaign.storeys] == ["0", "1._OG_S_d"]
    assert [len(storey.scans) for storey in campaign.storeys] == [2, 1]
    named = {"campaign.json"}
    for storey in campaign.storeys:
        named.add(storey.truth)
        for scan in storey.scans:
            named |= {f"{scan.path}/points.parquet", f"{scan.path}/snapshots.parquet"}
    assert set(contents(folder)) == named
    assert len(told) == 3


def test_a_campaigns_record_agrees_with_its_scans_and_truth(made):
    folder, campaign, _ = made
    for storey in campaign.storeys:
        rooms = {room.id: room.polygon for room in read_plan(folder / storey.truth).rooms}
        sources, errors = find_sources([folder / scan.path for scan in storey.scans])
        assert ([source.name for source in sources], errors) == (
            [scan.scan for scan in storey.scans],
            [],
        )
        assert sorted(scan.room for scan in storey.scans) == sorted(rooms)
        for source, scan in zip(sources, storey.scans, strict=True):
            times = pq.read_table(folder / scan.path / "snapshots.parquet")["time_s"].to_numpy()
            assert scan.duration_s == times.max()
            assert f"v{scan.volunteer[1:]}" in scan.scan and 0 <= scan.skill <= 1
            cloud, snapshots, _ = read_scan(source, ReadParams())
            assert scan.points == len(cloud) == snapshots.points.sum() > 1000
            # registered by its poses, the scan lies in the room that was asked for
            within = shapely.buffer(rooms[scan.room], 0.3)
            x, y, _ = (cloud.xyz + cloud.origin).T
            assert shapely.contains_xy(within, x, y).mean() > 0.9


def test_the_same_seed_gives_the_same_bytes_and_another_seed_others(made, sites, tmp_path):
    folder, _, _ = made
    again, other = tmp_path / "again", tmp_path / "other"
    simulate(sites, again, "hut", 3, FEW, lambda line: None)
    assert contents(again) == contents(folder)
    simulate(sites, other, "hut", 3, FEW.model_copy(update={"seed": 6}), lambda line: None)
    same = contents(other).items() & contents(folder).items()
    assert {Path(name).name for name, _ in same} == {"truth.geojson"}


def test_without_a_number_each_room_is_scanned_once(sites, tmp_path):
    campaign = simulate(sites[1:], tmp_path, "hut", None, FEW, lambda line: None)
    assert [[scan.room for scan in storey.scans] for storey in campaign.storeys] == [["r0"]]


def test_two_plans_of_one_storey_do_not_overwrite_each_other(sites, tmp_path):
    with pytest.raises(MapSenseError, match="two plans are of storey '0': give each its own name"):
        simulate([*sites, sites[0]], tmp_path, "hut", None, FEW, lambda line: None)
    assert list(tmp_path.iterdir()) == []


def test_a_plan_without_heights_is_given_the_assumed_ones_and_says_so(tmp_path):
    write_plan(plan(floor_m=1.0), tmp_path / "plan.geojson")
    params = SimulationParams.model_validate({"defaults": {"height_m": 2.4}})
    (site,) = plan_sites(tmp_path / "plan.geojson", None, params)
    assert [(room.floor_m, room.ceiling_m) for room in site.plan.rooms] == [(1.0, 3.4)] * 2
    assert any("assumed" in note for note in site.plan.notes)
    assert len(site.mesh.triangles) > 0


def test_a_plan_without_rooms_leaves_nothing_to_scan(tmp_path):
    write_plan(Plan("b", "0"), tmp_path / "plan.geojson")
    with pytest.raises(MapSenseError, match=r"plan\.geojson: the plan has no room"):
        plan_sites(tmp_path / "plan.geojson", None, DEFAULTS)


def test_a_plan_that_cannot_be_read_is_named(tmp_path):
    for name in ("missing.geojson", "missing.ifc"):
        with pytest.raises(InputError, match=name):
            plan_sites(tmp_path / name, None, DEFAULTS)


def test_a_preset_is_named_or_known(tmp_path):
    (ring,), (wing,) = (preset_sites(name, "hut") for name in ("ring", "wing"))
    both = preset_sites("paper", "hut")
    assert [site.plan.storey for site in both] == ["ring", "wing"]
    for site, alone in zip(both, (ring, wing), strict=True):
        assert site.plan.building == "hut"
        assert len(site.plan.rooms) == len(alone.plan.rooms) > 10
    with pytest.raises(MapSenseError, match="preset 'rng': there are paper, ring, wing"):
        preset_sites("rng", "hut")


class House:
    """An IFC file of one room of 4 x 3 x 2.7 m with a door, at a height, metres."""

    def __init__(self, z):
        self.file = api.project.create_file("IFC4")
        project = self.make("IfcProject", "p")
        api.unit.assign_unit(self.file, length={"is_metric": True, "raw": "METERS"})
        model = api.context.add_context(self.file, "Model")
        self.body = api.context.add_context(self.file, "Model", "Body", "MODEL_VIEW", parent=model)
        building = self.make("IfcBuilding", "b")
        api.aggregate.assign_object(self.file, [building], project)
        storeys = {"EG": z, "Dach": z + 3}
        self.storeys = {name: self.make("IfcBuildingStorey", name) for name in storeys}
        api.aggregate.assign_object(self.file, list(self.storeys.values()), building)
        for name, storey in self.storeys.items():
            self.place(storey, storeys[name])
        space = self.prism("IfcSpace", box(0, 0, 4, 3), z, z + 2.7)
        api.aggregate.assign_object(self.file, [space], self.storeys["EG"])
        around = ((-0.3, -0.3, 4.3, 0), (-0.3, 3, 4.3, 3.3), (-0.3, 0, 0, 3), (4, 0, 4.3, 3))
        parts = [self.prism("IfcWall", box(*wall), z, z + 2.7) for wall in around]
        parts += [self.prism("IfcSlab", box(-0.3, -0.3, 4.3, 3.3), z - 0.2, z)]
        parts += [self.prism("IfcSlab", box(-0.3, -0.3, 4.3, 3.3), z + 2.7, z + 2.9)]
        door = self.prism("IfcDoor", box(1, -0.2, 1.9, -0.15), z, z + 2.05)
        door.OverallWidth, door.OverallHeight = 0.9, 2.05
        api.spatial.assign_container(
            self.file, products=[*parts, door], relating_structure=self.storeys["EG"]
        )

    def make(self, class_, name=None):
        return api.root.create_entity(self.file, ifc_class=class_, name=name)

    def place(self, product, z):
        matrix = np.eye(4)
        matrix[2, 3] = z
        api.geometry.edit_object_placement(self.file, product=product, matrix=matrix)

    def prism(self, class_, outline, low, high):
        element, f = self.make(class_), self.file
        self.place(element, low)
        xy = shapely.get_coordinates(outline.exterior)
        line = f.createIfcPolyline([f.createIfcCartesianPoint(tuple(map(float, p))) for p in xy])
        profile = f.createIfcArbitraryClosedProfileDef("AREA", None, line)
        up = f.createIfcDirection((0.0, 0.0, 1.0))
        solid = f.createIfcExtrudedAreaSolid(profile, None, up, float(high - low))
        shape = f.createIfcShapeRepresentation(self.body, "Body", "SweptSolid", [solid])
        element.Representation = f.createIfcProductDefinitionShape(None, None, [shape])
        return element


@pytest.fixture(scope="module")
def ifc(tmp_path_factory):
    path = tmp_path_factory.mktemp("ifc") / "house.ifc"
    House(3.0).file.write(str(path))
    return path


def test_the_storeys_of_an_ifc_building_that_have_rooms_are_scanned(ifc, tmp_path):
    (site,) = plan_sites(ifc, None, DEFAULTS)
    assert site.plan.storey == "EG"
    assert {door.state for door in site.plan.doors} <= {"open", "shut", "ajar"}
    few = FEW.model_copy(update={"skill": 1.0, "skill_spread": 0.0})
    campaign = simulate([site], tmp_path, "house", None, few, lambda line: None)
    (scan,) = campaign.storeys[0].scans
    ((source,), _) = find_sources([tmp_path / scan.path])
    cloud, _, _ = read_scan(source, ReadParams())
    z = cloud.xyz[:, 2] + cloud.origin[2]
    assert np.percentile(z, [2, 98]) == pytest.approx([3.0, 5.7], abs=0.15)


def test_the_storey_named_is_scanned_and_one_without_rooms_is_an_error(ifc):
    (site,) = plan_sites(ifc, "EG", DEFAULTS)
    assert isinstance(site, Site) and len(site.plan.rooms) == 1
    with pytest.raises(MapSenseError, match=r"house\.ifc: no storey of it has a room"):
        plan_sites(ifc, "Dach", DEFAULTS)
    with pytest.raises(InputError, match=r"house\.ifc: .*Keller"):
        plan_sites(ifc, "Keller", DEFAULTS)


def test_the_seed_draws_which_doors_of_an_ifc_building_stand_open(ifc):
    def states(seed):
        params = SimulationParams.model_validate({"campaign": {"seed": seed}})
        (site,) = plan_sites(ifc, "EG", params)
        return [door.state for door in site.plan.doors]

    drawn = [states(seed) for seed in range(8)]
    assert {tuple(each) for each in drawn} == {("open",), ("shut",)}
    assert states(0) == drawn[0]
