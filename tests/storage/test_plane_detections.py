"""Plane detections and point quality as tables: what is unknown is null, and SQL can count it."""

from dataclasses import fields

import numpy as np
import pytest

from storage.artifacts import Place, kind_of, read, write
from storage.catalog import Catalog
from storage.plane_detections import PLANE_DETECTIONS, PlaneDetections, from_table, to_table
from storage.point_quality import PointQuality

NAN = np.nan
FOUND = PlaneDetections(
    simulated=np.array([True] * 4),
    classes=np.array(["wall", "ceiling", "horizontal", "vertical"]),
    true_ids=np.array(["r/wall-0", "r/ceiling", "", ""]),
    found=np.array([0, -1, 3, 2]),
    part_of=np.array(["", "", "", "r/wall-0"]),
    angle_rad=np.array([0.01, NAN, NAN, NAN]),
    offset_m=np.array([-0.02, NAN, NAN, NAN]),
    iou=np.array([0.9, NAN, NAN, NAN]),
    true_m2=np.array([12.5, 20.0, NAN, NAN]),
    seen=np.array([1.0, 0.5, NAN, NAN]),
    found_m2=np.array([12.0, NAN, 1.0, 2.0]),
)
POINTS = PointQuality(
    simulated=np.array([False, False]),
    classes=np.array(["wall", "door"]),
    buffer_m=np.array([0.05, 0.05]),
    true_points=np.array([100, 0]),
    near_points=np.array([80, 0]),
    found_points=np.array([90, 0]),
    matched_points=np.array([60, 0]),
    completeness=np.array([0.8, NAN]),
    iou=np.array([60 / 130, NAN]),
)


@pytest.mark.parametrize("value", [FOUND, POINTS], ids=["planes", "points"])
def test_rows_come_back_from_the_store_and_their_columns_say_what_they_hold(tmp_path, value):
    kind = kind_of(type(value))
    place = Place(store=str(tmp_path), run="r", building="b", storey="0")
    again = read(kind, write(kind, value, place), str(tmp_path))
    for field in fields(value):
        np.testing.assert_array_equal(getattr(value, field.name), getattr(again, field.name))
    for column in kind.schema:
        assert column.metadata[b"about"]


def test_what_a_row_does_not_have_is_null():
    table = to_table(FOUND)
    assert table["true_id"].to_pylist() == ["r/wall-0", "r/ceiling", None, None]
    assert table["part_of"].to_pylist() == [None, None, None, "r/wall-0"]
    assert table["found_segment"].to_pylist() == [0, None, 3, 2]
    assert table["offset_m"].to_pylist() == [-0.02, None, None, None]
    nothing = from_table(table.slice(0, 0))
    assert len(nothing) == 0
    assert nothing.true_ids.dtype.kind == "U"


def test_recall_and_precision_of_planes_are_counts_of_rows(tmp_path):
    place = Place(store=str(tmp_path), run="r", building="b", storey="0", scan="s")
    write(PLANE_DETECTIONS, FOUND, place)
    (row,) = (
        Catalog(tmp_path)
        .query(
            "select count(iou) / count(true_id) as recall,"
            " count(iou) / count(found_segment) as precision from plane_detections_all"
        )
        .to_pylist()
    )
    assert row == {"recall": 1 / 2, "precision": pytest.approx(1 / 3)}
