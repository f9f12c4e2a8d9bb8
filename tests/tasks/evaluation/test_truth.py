"""Truth in each form: plans, building models, point labels; and what cannot be read as any."""

import json
from pathlib import Path

import ifcopenshell.api.aggregate
import ifcopenshell.api.project
import ifcopenshell.api.root
import ifcopenshell.api.unit
import numpy as np
import pytest
from shapely import LineString, box

from storage.errors import InputError
from storage.plan import Plan, PlanRoom, PlanWall
from storage.plan_geojson import write_plan
from tasks.evaluation.detections import EvaluationParams, detect
from tasks.evaluation.surfaces import true_surfaces
from tasks.evaluation.truth import read_truth, truth_files
from tasks.evaluation.walls import WallQualityParams, compare_walls

DATA = Path(__file__).resolve().parents[3].parent / "shared" / "data" / "ifc_buildings"
REAL = pytest.mark.skipif(not DATA.is_dir(), reason="the shared data is not there")
PLAN = Plan(
    "b",
    "EG",
    rooms=(PlanRoom("r", box(0, 0, 4, 3), "office", None, 0.0, 2.5),),
    walls=(PlanWall("w", LineString([(0, -0.1), (4, -0.1)]), 0.2, 0.0, 2.5, ("r",)),),
)


@pytest.mark.parametrize("name", ["t.geojson", "t.json"])
def test_a_plan_is_read_whatever_it_is_called(tmp_path, name):
    write_plan(PLAN, tmp_path / name)
    for storey in (None, "EG"):
        (room,) = read_truth(tmp_path / name, storey).rooms
        assert room.polygon.equals(PLAN.rooms[0].polygon)
    with pytest.raises(InputError, match="is storey 'EG', not 'OG'"):
        read_truth(tmp_path / name, "OG")
    assert truth_files(tmp_path / name) == (tmp_path / name,)


def test_labels_become_a_plan_that_says_it_is_derived(tmp_path):
    x, y = (a.ravel() for a in np.meshgrid(np.arange(0, 4.01, 0.1), np.arange(0, 3.01, 0.1)))
    rows = "".join(f"{a:.2f} {b:.2f} 0 1\n" for a, b in zip(x, y, strict=True))
    head = "".join(f"property {t}\n" for t in ("float x", "float y", "float z", "uchar label"))
    (tmp_path / "a.ply").write_text(
        f"ply\nformat ascii 1.0\nelement vertex {len(x)}\n{head}end_header\n{rows}"
    )
    given = {"building": "b", "storey": "1", "points": ["a.ply"], "classes": {"1": "floor"}}
    (tmp_path / "t.json").write_text(json.dumps(given))
    plan = read_truth(tmp_path / "t.json", "1")
    assert plan.rooms[0].polygon.area == pytest.approx(12, rel=1e-3)
    assert "derived from point labels" in plan.notes[0]
    # a plan's own file takes what was derived
    write_plan(plan, tmp_path / "derived.geojson")
    assert truth_files(tmp_path / "t.json") == (tmp_path / "t.json", tmp_path / "a.ply")
    with pytest.raises(InputError, match="is storey '1', not '2'"):
        read_truth(tmp_path / "t.json", "2")


@pytest.mark.parametrize(
    ("name", "text", "wrong"),
    [
        ("gone.ifc", None, "there is no such file"),
        ("t.txt", "1 2 3", "'.txt' is no form of truth"),
        ("t.json", "{", "is no JSON"),
        ("t.json", "{}", "'type' is missing"),
        ("t.toml", "building = 1", "building"),
        ("t.toml", "building", "neither TOML nor JSON"),
        ("t.ifc", "no step", "t.ifc"),
    ],
)
def test_what_is_no_truth_is_refused_by_name(tmp_path, name, text, wrong):
    if text is not None:
        (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=wrong) as caught:
        read_truth(tmp_path / name)
    assert caught.value.remedy


def model(path, storeys):
    """Write a building of empty storeys."""
    api = ifcopenshell.api
    file = api.project.create_file("IFC4")
    project = api.root.create_entity(file, ifc_class="IfcProject", name="p")
    api.unit.assign_unit(file, length={"is_metric": True, "raw": "METERS"})
    building = api.root.create_entity(file, ifc_class="IfcBuilding", name="b")
    api.aggregate.assign_object(file, [building], project)
    for name in storeys:
        storey = api.root.create_entity(file, ifc_class="IfcBuildingStorey", name=name)
        api.aggregate.assign_object(file, [storey], building)
    file.write(str(path))


def test_a_model_of_one_storey_needs_no_name_and_one_of_two_lists_them(tmp_path):
    model(tmp_path / "one.IFC", ["EG"])
    assert read_truth(tmp_path / "one.IFC").storey == "EG"
    model(tmp_path / "two.ifc", ["EG", "OG"])
    with pytest.raises(InputError, match="2 storeys: 'EG', 'OG'; name the one meant"):
        read_truth(tmp_path / "two.ifc")
    assert read_truth(tmp_path / "two.ifc", "OG").storey == "OG"
    with pytest.raises(InputError, match="choose one of 'EG', 'OG'"):
        read_truth(tmp_path / "two.ifc", "UG")


@REAL
def test_a_building_of_several_storeys_needs_the_name_of_one():
    with pytest.raises(InputError, match=r"4 storeys: 'T/FDN', 'Level 1', 'Level 2', 'Roof'"):
        read_truth(DATA / "duplex.ifc")
    with pytest.raises(InputError, match="has no storey 'Level 3'; choose one of"):
        read_truth(DATA / "duplex.ifc", "Level 3")


REAL_STOREYS = [("duplex", "Level 1"), ("canteen", "Nivel 1")]


@REAL
@pytest.mark.parametrize(("name", "storey"), REAL_STOREYS)
def test_a_real_storey_says_all_that_is_compared_and_finds_itself(name, storey):
    plan = read_truth(DATA / f"{name}.ifc", storey)
    stated = json.loads((DATA / f"{name}_truth.json").read_text())
    of = {
        kind: {item["id"]: item for item in stated[kind] if item["storey"] == plan.storey}
        for kind in ("rooms", "walls", "doors", "windows", "furniture")
    }
    for room in plan.rooms:
        assert room.class_ == of["rooms"][room.id]["long_name"].lower()
        assert room.ceiling_m is not None
        assert room.ceiling_m > room.floor_m
    for wall in plan.walls:
        assert wall.top_m > wall.base_m
        if (true := of["walls"].get(wall.id)) is not None:
            # of a wall that is no rectangle the truth states the box around it
            if true["footprint_area"] > 0.95 * true["length"] * true["thickness"]:
                assert wall.thickness_m == pytest.approx(true["thickness"], abs=2e-3)
            assert wall.base_m == pytest.approx(true["bbox_min"][2], abs=1e-2)
            assert wall.top_m == pytest.approx(true["bbox_max"][2], abs=1e-2)
    walls = {wall.id for wall in plan.walls}
    rooms = {room.id for room in plan.rooms}
    for opening in (*plan.doors, *plan.windows):
        assert opening.wall in walls
        assert opening.head_m > opening.sill_m
        assert set(opening.rooms) <= rooms
    # outer doors link one room, no door links none, where there are rooms at all
    assert all(door.rooms for door in plan.doors) or not rooms
    for piece in plan.furniture:
        true = of["furniture"][piece.id]
        assert piece.base_m == pytest.approx(true["bbox_min"][2], abs=1e-2)
        assert piece.top_m == pytest.approx(true["bbox_max"][2], abs=1e-2)
    rows = detect(plan, plan, EvaluationParams())
    assert len(rows)
    assert np.all(rows.true_ids != "")
    assert np.all(rows.found_ids != "")
    quality = compare_walls(plan, plan, WallQualityParams())
    assert quality.completeness == pytest.approx([1])
    surfaces = true_surfaces(plan, 0.5, 0.3)
    assert sum(s.class_ == "floor" for s in surfaces) >= len(rooms) * 0.9
