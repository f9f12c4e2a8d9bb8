"""Furniture and what may become it survive being stored."""

import numpy as np
import pyarrow.parquet as pq
import pytest
import shapely

from storage import furniture, furniture_segments
from storage.furniture import FURNITURE, Furniture
from storage.furniture_segments import FURNITURE_SEGMENTS, FurnitureSegments

SHAPES = np.array([shapely.box(0, 0, 1.6, 0.8), shapely.Polygon([(3, 0), (4, 1), (3, 2)])], object)


def stored(kind, value, folder):
    path = folder / "a.parquet"
    pq.write_table(kind.to_table(value), path)
    return kind.from_table(pq.read_table(path))


@pytest.mark.parametrize("n", [0, 2])
def test_furniture_comes_back_as_it_was(tmp_path, n):
    value = Furniture(
        SHAPES[:n],
        np.array(["table", "other"])[:n],
        np.array([0.0, 1.2])[:n],
        np.array([0.74, 1.5])[:n],
        np.array([3, 0], np.int32)[:n],
        np.array([0.9, 0.5])[:n],
    )
    found = stored(FURNITURE, value, tmp_path)
    assert len(found) == n
    assert found.classes.tolist() == value.classes.tolist()
    assert found.rooms.tolist() == value.rooms.tolist() and found.rooms.dtype == np.int32
    for name in ("base_m", "top_m", "confidences"):
        assert getattr(found, name).tolist() == getattr(value, name).tolist()
    assert shapely.equals(found.footprints, value.footprints).all()


def test_no_furniture_is_a_table_without_rows():
    assert furniture.to_table(furniture.none()).num_rows == 0


@pytest.mark.parametrize("n", [0, 2])
def test_segments_come_back_with_their_features_and_names(tmp_path, n):
    value = FurnitureSegments(
        ("area_m2", "distance_m"),
        np.array([(1.2, np.nan), (0.2, 0.45)])[:n],
        SHAPES[:n],
        SHAPES[::-1][:n],
        np.array([0.74, 0.45])[:n],
        np.array([0.74, 0.86])[:n],
        np.array([0.0, 0.01])[:n],
        np.array([1, 1], np.int32)[:n],
    )
    found = stored(FURNITURE_SEGMENTS, value, tmp_path)
    assert found.names == value.names
    assert found.features.shape == (n, 2)
    assert np.array_equal(found.features, value.features, equal_nan=True)
    for name in ("surface_m", "top_m", "base_m", "rooms"):
        assert getattr(found, name).tolist() == getattr(value, name).tolist()
    for name in ("footprints", "hulls"):
        assert shapely.equals(getattr(found, name), getattr(value, name)).all()


def test_columns_say_their_units():
    for module in (furniture, furniture_segments):
        assert {f.name for f in module.SCHEMA if f.name.endswith("_m")} >= {"top_m"}
