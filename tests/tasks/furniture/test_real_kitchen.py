"""Table and chairs of a real kitchen, labelled by hand."""

import json
from pathlib import Path

import numpy as np
import pytest
import shapely

from storage.points import PointCloud
from storage.rooms import Rooms
from tasks.furniture.candidates import BACK, TOP
from tasks.furniture.features import FEATURES
from tasks.furniture.segments import FurnitureSegmentParams, find_furniture_segments

KITCHEN = Path(__file__).resolve().parents[4] / "shared/data/kinect_kitchen_7scenes"
CLOUD = KITCHEN / "registered_gravity_aligned_2cm.ply"
pytestmark = pytest.mark.skipif(not CLOUD.is_file(), reason="the real scans are not here")


@pytest.fixture(scope="module")
def segments():
    data = CLOUD.read_bytes()
    xyz = np.frombuffer(data[data.index(b"end_header\n") + 11 :], np.float32).reshape(-1, 3)
    low, high = np.quantile(xyz[:, :2], (0.002, 0.998), axis=0)
    one = np.ones(1)
    outline = np.array([shapely.box(*low, *high)], object)
    room = Rooms(outline, 0 * one, 2.5 * one, one, one, ((0,),))
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
