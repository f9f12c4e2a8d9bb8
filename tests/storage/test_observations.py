"""Observations come back from their table as they were, whole and empty."""

from dataclasses import fields, replace

import numpy as np
import pyarrow as pa
import pytest

from storage import artifacts
from storage.artifacts import Place, kind_of
from storage.observations import SCHEMA, Observations, from_table, to_table

THREE_LINES = Observations(
    line_ids=np.array(["c0-1", "c0-3", "east"]),
    starts=np.array([[0.0, 0.0], [9.0, 2.0], [1.0, 5.0]]),
    ends=np.array([[9.0, 0.0], [0.0, 2.0], [1.0, 8.0]]),
    end_sigma_m=np.array([[0.01, np.nan], [np.nan, np.nan], [0.02, 0.03]]),
    end_faces_m=np.array(
        [[[-0.1, np.nan], [np.nan, np.nan]], np.full((2, 2), np.nan), [[-0.1, 0.1], [np.nan, 3.1]]]
    ),
    lines=np.array([0, 0, 2]),
    cut_m=np.array([2.4, 1 / 3 + 6, 1.5]),
    sigma_m=np.array([0.01, 0.02, 0.3]),
    faces_m=np.array([[2.3, 2.5], [np.nan, 6.4], [1.4, np.nan]]),
    scans=np.array([2, 1, 5]),
    presence=np.array([0.99, 0.5, 0.1]),
    interval_lines=np.array([0, 0, 0, 1, 2, 2]),
    from_m=np.array([0.0, 2.4, 1 / 3 + 6, 0.0, 0.0, 1.5]),
    to_m=np.array([2.4, 1 / 3 + 6, 9.0, 9.0, 1.5, 3.0]),
    rooms=np.array([3, -1, 0, 2, 7, 7]),
    depth_m=np.array([4.8, np.nan, 5.0, 4.9, 3.0, 3.0]),
    outliers=((), (4, 9), (0,)),
)
NO, NO_INT, NO_POINT = np.empty(0), np.empty(0, np.int64), np.empty((0, 2))
NONE = Observations(
    line_ids=np.empty(0, np.str_),
    starts=NO_POINT,
    ends=NO_POINT,
    end_sigma_m=NO_POINT,
    end_faces_m=np.empty((0, 2, 2)),
    lines=NO_INT,
    cut_m=NO,
    sigma_m=NO,
    faces_m=NO_POINT,
    scans=NO_INT,
    presence=NO,
    interval_lines=NO_INT,
    from_m=NO,
    to_m=NO,
    rooms=NO_INT,
    depth_m=NO,
)


def assert_same(found, expected):
    for field in fields(Observations):
        a, b = getattr(found, field.name), getattr(expected, field.name)
        if isinstance(b, tuple):
            assert a == b, field.name
        else:
            np.testing.assert_array_equal(a, b, err_msg=field.name)
            assert a.dtype.kind == b.dtype.kind, field.name


@pytest.mark.parametrize(
    "observations",
    [THREE_LINES, replace(THREE_LINES, outliers=()), NONE],
    ids=["compared", "not compared", "none"],
)
def test_observations_come_back_as_they_were(observations):
    table = to_table(observations)
    assert table.schema.equals(SCHEMA)
    assert_same(from_table(table), observations)


def test_a_row_is_an_interval_and_holds_the_wall_at_its_end():
    rows = to_table(THREE_LINES).to_pylist()
    assert [row["line"] for row in rows] == ["c0-1", "c0-1", "c0-1", "c0-3", "east", "east"]
    assert [row["cut_m"] for row in rows] == [2.4, 1 / 3 + 6, None, None, 1.5, None]
    assert all(row["cut_m"] in (None, row["to_m"]) for row in rows)
    assert rows[1]["room"] is None and rows[1]["depth_m"] is None
    assert rows[1]["outliers"] == [4, 9]
    assert rows[3]["outliers"] is None
    assert (rows[3]["end_x_m"], rows[3]["end_y_m"]) == (0.0, 2.0)


def test_they_are_stored_by_their_type_and_twice_as_the_same_bytes(tmp_path):
    place = Place(store=str(tmp_path), run="r", building="b", storey="1")
    kind = kind_of(Observations)
    first = artifacts.write(kind, THREE_LINES, place)
    assert artifacts.write(kind, THREE_LINES, place).sha256 == first.sha256
    assert_same(artifacts.read(kind, first, str(tmp_path)), THREE_LINES)


def test_lengths_are_those_between_starts_and_ends():
    assert THREE_LINES.lengths_m == pytest.approx([9.0, 9.0, 3.0])
    assert len(THREE_LINES) == 3


def test_a_column_for_every_number_says_its_unit():
    floats = [field.name for field in SCHEMA if pa.types.is_float64(field.type)]
    assert [name for name in floats if not name.endswith("_m")] == ["presence"]
