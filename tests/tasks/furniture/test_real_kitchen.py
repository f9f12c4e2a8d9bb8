"""Table and chairs of a real kitchen, labelled by hand."""

import json
from pathlib import Path

import numpy as np
import pytest
import shapely

from grammars.workplaces.rules import FILE, read_workplaces
from storage.forest import read_forest
from storage.points import PointCloud
from storage.rooms import Rooms
from tasks.furniture.candidates import BACK, TOP
from tasks.furniture.classification import FurnitureParams, named
from tasks.furniture.examples import CLASS_NAMES
from tasks.furniture.features import FEATURES
from tasks.furniture.segments import FurnitureSegmentParams, find_furniture_segments

KITCHEN = Path(__file__).resolve().parents[4] / "shared/data/kinect_kitchen_7scenes"
CLOUD = KITCHEN / "registered_gravity_aligned_2cm.ply"
pytestmark = pytest.mark.skipif(not CLOUD.is_file(), reason="the real scans are not here")


@pytest.fixture(scope="module")
def xyz():
    data = CLOUD.read_bytes()
    return np.frombuffer(data[data.index(b"end_header\n") + 11 :], np.float32).reshape(-1, 3)


@pytest.fixture(scope="module")
def room(xyz):
    low, high = np.quantile(xyz[:, :2], (0.002, 0.998), axis=0)
    one = np.ones(1)
    outline = np.array([shapely.box(*low, *high)], object)
    return Rooms(outline, 0 * one, 2.5 * one, one, one, ((0,),))


@pytest.fixture(scope="module")
def segments(xyz, room):
    return find_furniture_segments(room, [PointCloud(xyz, np.zeros(3))], FurnitureSegmentParams())


@pytest.fixture(scope="module")
def truth():
    return json.loads((KITCHEN / "truth.json").read_text())


def found_by(segments, kind):
    return np.flatnonzero(segments.features[:, FEATURES.index("found_by")] == kind)


def test_the_table_is_one_box_of_its_size_and_height(segments, truth):
    (table,) = truth["tables"]
    (x, y), (width, depth) = table["center"], table["size"]
    label = shapely.box(x - width / 2, y - depth / 2, x + width / 2, y + depth / 2)
    label = shapely.affinity.rotate(label, 4)
    shapes = segments.footprints[found_by(segments, TOP)]
    shared = shapely.area(shapely.intersection(shapes, label))
    overlaps = shared / (shapely.area(shapes) + label.area - shared)
    best = found_by(segments, TOP)[np.argmax(overlaps)]
    assert overlaps.max() > 0.7
    assert segments.surface_m[best] == pytest.approx(table["z"], abs=0.03)


def test_four_of_five_chairs_are_found_though_three_seats_are_hidden(segments, truth):
    shapes = segments.footprints[found_by(segments, BACK)]
    backs = [shapely.Point(chair["back_center"]) for chair in truth["chairs"]]
    near = [shapely.dwithin(shapes, back, 0.05).any() for back in backs]
    assert sum(near) >= 4


def test_the_worktops_round_the_table_are_no_tables(segments, room, truth):
    package = Path(__file__).resolve().parents[3] / "tasks/furniture"
    forest = read_forest(package / "forest.parquet", segments.names, CLASS_NAMES)
    furniture = named(segments, room, forest, read_workplaces(FILE), FurnitureParams())
    tables = furniture.footprints[furniture.classes == "table"]
    assert len(tables) == 1
    assert tables[0].contains(shapely.Point(truth["tables"][0]["center"]))
