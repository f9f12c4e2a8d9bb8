"""Stored things become tables and come back as they were, whole and empty, and byte for byte."""

import json
from dataclasses import fields, replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from shapely import Polygon, box

from storage import artifacts
from storage.artifacts import Place, kind_of
from storage.corners import Corners
from storage.coverage import Coverage
from storage.errors import DamagedArtifact
from storage.faces import Faces
from storage.occupancy import Occupancy
from storage.planes import PlaneLabels, Planes
from storage.points import PointCloud
from storage.rooms import Rooms
from storage.scans import Scan
from storage.segments import Raster, Segments
from storage.snapshots import Snapshots, none
from storage.walls import Walls

RNG = np.random.default_rng(1)
NO = np.empty(0)
SOME = np.array([0.25, np.nan, 1 / 3])


def unit(n):
    normals = RNG.normal(size=(n, 3))
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def segments(m):
    return Segments(
        cell_m=0.1,
        kinds=np.arange(m, dtype=np.int8) % 3,
        normals=unit(m),
        offsets=RNG.normal(size=m),
        side_known=np.arange(m) % 2 == 0,
        lines=np.where((np.arange(m) % 3 == 0)[:, None, None], RNG.normal(size=(m, 2, 2)), np.nan),
        heights=RNG.normal(size=(m, 2)),
        areas=RNG.random(m),
        inliers=np.arange(m, dtype=np.int64) + 2**40,
        rms=RNG.random(m),
        hulls=tuple(shapely.to_wkb(box(0, 0, i + 1, 2)) for i in range(m)),
        rasters=tuple(Raster((0.1 * i, -1.3), RNG.random((i + 1, 9)) > 0.5) for i in range(m)),
    )


def faces(k):
    return Faces(
        normals=unit(k),
        offsets=RNG.normal(size=k),
        sides=np.arange(k, dtype=np.int8) % 2,
        lines=RNG.normal(size=(k, 2, 2)),
        heights=RNG.normal(size=(k, 2)),
        weights=RNG.random(k),
        scans=np.arange(k, dtype=np.int64),
        profiles=tuple(RNG.integers(0, 4, 5 * i).astype(np.uint8) for i in range(k)),
        bin_m=0.1,
    )


def polygons(*some):
    made = np.empty(len(some), object)
    made[:] = some
    return made


TURNED = shapely.affinity.rotate(box(1e6, 5e6, 1e6 + 4, 5e6 + 3), 20)
VALUES = {
    "points": PointCloud(
        np.array([[0.0, 1.234, -5.001], [1, 2, 3]], np.float32), np.array([3.5e6, 5.4e6, 0.1])
    ),
    "points of snapshots": PointCloud(
        np.ones((3, 3), np.float32), np.zeros(3), np.array([0, 2, 1], np.int32)
    ),
    "no points": PointCloud(np.empty((0, 3), np.float32), np.array([1.0, 2.0, 3.0])),
    "snapshots": Snapshots(
        np.array([0.0, 0.1]), RNG.normal(size=(2, 3)), np.eye(4)[:2], np.array([3, 2**33])
    ),
    "no snapshots": none(),
    "scan": Scan("s1", "ply", 10, 8, 1, 1, 0, "-y", True, 0.01, False, True, "Höhe: geschätzt"),
    "planes": Planes(
        unit(4), RNG.normal(size=4), np.arange(4) + 2**33, RNG.random(4), np.array([1e6, -2e6, 0.3])
    ),
    "no planes": Planes(np.empty((0, 3)), NO, np.empty(0, np.int64), NO, np.zeros(3)),
    "labels": PlaneLabels(np.array([-1, 0, 2, 1, -1], np.int32)),
    "no labels": PlaneLabels(np.empty(0, np.int32)),
    "segments": segments(7),
    "no segments": segments(0),
    "faces": faces(5),
    "no faces": faces(0),
    "coverage": Coverage(
        cells=np.array([[0, 0], [-3, 50_000_000], [7, 1]], np.int32),
        floor_m=np.array([0.01, np.nan, -1.5]),
        ceiling_m=np.array([np.nan, 2.8, 1 / 3]),
        scans=np.array([2, 1, 3]),
        seen_by=np.array([0, 1, 4, 0, 1, 2], np.int32),
        cell_m=0.1,
        floor_level_m=0.0,
        ceiling_level_m=2.8,
    ),
    "coverage without a floor": Coverage(
        np.array([[0, 0]], np.int32),
        np.array([np.nan]),
        np.array([2.5]),
        np.array([1]),
        np.array([0], np.int32),
        0.05,
        None,
        2.5,
    ),
    "no coverage": Coverage(
        np.empty((0, 2), np.int32),
        NO,
        NO,
        np.empty(0, np.int64),
        np.empty(0, np.int32),
        0.1,
        None,
        None,
    ),
    "occupancy": Occupancy(np.array([[-7, 0, 3], [5, 1, -2]], np.int32), 1 / 3),
    "no occupancy": Occupancy(np.empty((0, 3), np.int32), 0.1),
    "rooms": Rooms(
        polygons(
            box(0, 0, 1, 2), TURNED, Polygon([(0, 0), (3, 0), (3, 1), (1, 1), (1, 4), (0, 4)])
        ),
        SOME,
        SOME + 2.5,
        np.array([1.0, 0.2, 0.0]),
        np.array([0.9, 1.0, 0.3]),
        ((0, 1), (), (2,)),
    ),
    "no rooms": Rooms(np.empty(0, object), NO, NO, NO, NO, ()),
    "walls": Walls(
        RNG.normal(size=(3, 2, 2)),
        SOME,
        SOME,
        SOME + 2,
        np.array([[0, 1], [0, -1], [2, -1]], np.int32),
        np.array([1.0, 0.5, 0.0]),
    ),
    "no walls": Walls(np.empty((0, 2, 2)), NO, NO, NO, np.empty((0, 2), np.int32), NO),
    "corners": Corners(
        np.array([0, 0, 1], np.int32),
        np.column_stack([SOME, SOME, SOME]),
        RNG.normal(size=(3, 3)),
    ),
    "no corners": Corners(np.empty(0, np.int32), np.empty((0, 3)), np.empty((0, 3))),
}
every_value = pytest.mark.parametrize("value", VALUES.values(), ids=VALUES)


def assert_same(found, value):
    """Assert that two values hold the same in the same types: points to half a millimetre, all
    else to the last bit."""
    assert type(found) is type(value)
    if isinstance(value, np.ndarray) and value.dtype == object:
        assert found.shape == value.shape
        assert all(a.equals_exact(b, 0) for a, b in zip(found, value, strict=True))
    elif isinstance(value, np.ndarray):
        assert found.dtype == value.dtype
        if value.dtype == np.float32:
            found = np.where(np.abs(found - value) <= 0.0005, value, found)
        np.testing.assert_array_equal(found, value, strict=True)
    elif hasattr(value, "__dataclass_fields__"):
        for field in fields(value):
            assert_same(getattr(found, field.name), getattr(value, field.name))
    elif isinstance(value, tuple):
        assert len(found) == len(value)
        for one, other in zip(found, value, strict=True):
            assert_same(one, other)
    else:
        assert found == value


@every_value
def test_a_value_comes_back_from_its_table(value):
    kind = kind_of(type(value))
    assert_same(kind.from_table(kind.to_table(value)), value)


@every_value
def test_a_value_comes_back_from_its_file(value, tmp_path):
    kind = kind_of(type(value))
    place = Place(store=str(tmp_path), run="r", building="b", storey="0", scan="s")
    ref = artifacts.write(kind, value, place)
    assert_same(artifacts.read(kind, ref, tmp_path), value)
    assert ref.table == kind.table and ref.rows == kind.to_table(value).num_rows


@every_value
def test_a_value_written_twice_gives_the_same_bytes(value, tmp_path):
    kind = kind_of(type(value))
    refs = []
    for run in ("first", "second"):
        place = Place(store=str(tmp_path / run), run=run, building="b", storey="0")
        refs.append(artifacts.write(kind, value, place))
    assert refs[0] == refs[1]
    first, second = (
        (tmp_path / run / ref.uri).read_bytes()
        for run, ref in zip(("first", "second"), refs, strict=True)
    )
    assert first == second


@every_value
def test_a_table_names_itself_and_every_column_says_what_it_holds(value):
    kind = kind_of(type(value))
    table = kind.to_table(value)
    assert table.schema.equals(kind.schema)
    assert table.schema.metadata[b"mapsense.table"].decode() == kind.table
    assert table.schema.metadata[b"mapsense.schema_version"].decode() == artifacts.SCHEMA_VERSION
    for field in table.schema:
        assert field.metadata[b"about"], field.name
        assert field.nullable or table[field.name].null_count == 0, field.name


@pytest.mark.parametrize("name", ["rooms", "walls"])
def test_geometry_is_marked_as_geoparquet_in_a_metric_frame(name):
    schema = kind_of(type(VALUES[name])).schema
    geo = json.loads(schema.metadata[b"geo"])
    column = geo["columns"][geo["primary_column"]]
    assert column["encoding"] == "WKB"
    assert {axis["unit"] for axis in column["crs"]["coordinate_system"]["axis"]} == {"metre"}
    assert geo["primary_column"] in schema.names


coordinates = arrays(
    np.float32,
    st.tuples(st.integers(0, 30), st.just(3)),
    elements=st.floats(-2000, 2000, width=32),
)


@settings(max_examples=100, deadline=None)
@given(coordinates)
def test_points_come_back_to_half_a_millimetre(xyz):
    kind = kind_of(PointCloud)
    cloud = PointCloud(xyz, np.array([1e6, 2e6, 3.0]))
    found = kind.from_table(kind.to_table(cloud))
    # what a 32-bit number can say so far out comes on top
    rounding = np.spacing(np.abs(xyz).max(initial=1.0))
    away = np.abs(found.xyz.astype(float) - xyz.astype(float))
    assert away.max(initial=0) <= 0.0005 + rounding
    assert found.xyz.dtype == np.float32
    assert (found.origin == cloud.origin).all()
    assert found.snapshot is None


def test_another_value_has_another_name(tmp_path):
    place = Place(store=str(tmp_path), run="r", building="b", storey="0")
    kind = kind_of(Planes)
    first = artifacts.write(kind, VALUES["planes"], place)
    moved = replace(VALUES["planes"], origin=np.array([1e6, -2e6, 0.4]))
    second = artifacts.write(kind, moved, place)
    assert first.sha256 != second.sha256 and first.uri != second.uri


def test_a_changed_file_is_not_read_failure(tmp_path):
    place = Place(store=str(tmp_path), run="r", building="b", storey="0")
    kind = kind_of(Planes)
    ref = artifacts.write(kind, VALUES["planes"], place)
    path = tmp_path / ref.uri
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(DamagedArtifact, match="changed or cut"):
        artifacts.read(kind, ref, tmp_path)
    path.unlink()
    with pytest.raises(DamagedArtifact, match="cannot be read"):
        artifacts.read(kind, ref, tmp_path)
