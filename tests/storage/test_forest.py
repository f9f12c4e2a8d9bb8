"""A forest in its file: nothing lost, nothing believed that a prediction could not walk."""

import json
import os
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from storage.artifacts import column, schema
from storage.errors import InputError
from storage.forest import (
    HEADER,
    Forest,
    open_forest,
    read_forest,
    to_table,
    write_forest,
)
from storage.forest_provenance import ClassScore, Provenance, TrainedStorey

FEATURES, CLASSES = ("width_m", "height_m"), ("door", "window", "other")


@pytest.fixture
def forest():
    """Two trees: one asks twice, the other never."""
    return Forest(
        features=FEATURES,
        classes=CLASSES,
        roots=np.array([0, 5]),
        asked=np.array([0, -1, 1, -1, -1, -1], np.int32),
        thresholds=np.array([0.9, 0.0, np.inf, 0.0, 0.0, 0.0]),
        nan_left=np.array([True, False, False, False, False, False]),
        left=np.array([1, -1, 3, -1, -1, -1]),
        right=np.array([2, -1, 4, -1, -1, -1]),
        shares=np.array(
            [[0, 0, 0], [1, 0, 0], [0, 0, 0], [0.25, 0.75, 0], [0, 0, 1], [1 / 3, 1 / 3, 1 / 3]]
        ),
        provenance=Provenance(
            parameters={"trees": 2, "depth": None},
            versions={"scikit-learn": "1.9"},
            examples={"a/1": 7},
            storeys=(TrainedStorey(building="a", storey="1", digest="0" * 64),),
            training={"seeds": [3000]},
            simulated=True,
            scores={"forest": (ClassScore(class_="door", examples=4, predicted=2, right=1),)},
        ),
    )


@pytest.fixture
def file(tmp_path, forest):
    path = tmp_path / "forest.parquet"
    write_forest(forest, path)
    return path


def test_a_forest_comes_back_from_its_file(file, forest):
    found = read_forest(file, FEATURES, CLASSES)
    assert (found.features, found.classes) == (FEATURES, CLASSES)
    assert found.provenance == forest.provenance
    for name in ("roots", "asked", "thresholds", "nan_left", "left", "right", "shares"):
        np.testing.assert_array_equal(getattr(found, name), getattr(forest, name))
        assert getattr(found, name).dtype == getattr(forest, name).dtype


def test_equal_forests_are_equal_bytes(file, forest, tmp_path):
    write_forest(forest, tmp_path / "again.parquet")
    assert (tmp_path / "again.parquet").read_bytes() == file.read_bytes()


def test_any_tool_reads_the_nodes_and_the_provenance(file):
    table = pq.read_table(file)
    assert table["tree"].to_pylist() == [0, 0, 0, 0, 0, 1]
    assert table["shares"].to_pylist()[:2] == [[], [1.0, 0.0, 0.0]]
    header = json.loads(table.schema.metadata[HEADER])
    assert header["provenance"]["storeys"][0]["building"] == "a"


def test_precision_and_recall_are_none_where_nothing_is_counted():
    score = ClassScore(class_="door", examples=4, predicted=2, right=1)
    assert (score.precision, score.recall) == (0.5, 0.25)
    nothing = ClassScore(class_="door", examples=0, predicted=0, right=0)
    assert (nothing.precision, nothing.recall) == (None, None)


@pytest.mark.parametrize(
    ("features", "classes", "said"),
    [
        (("height_m", "width_m"), CLASSES, "features are width_m, height_m, expected height_m"),
        (FEATURES, ("table", "chair", "other"), "classes are door, window, other, expected table"),
    ],
)
def test_a_forest_of_something_else_is_refused(file, features, classes, said):
    with pytest.raises(InputError, match=said) as caught:
        read_forest(file, features, classes)
    assert "mapsense train" in str(caught.value) and str(file) in str(caught.value)


def harmed(file, name, row, value):
    """Write the file again with one value of a column changed."""
    table = pq.read_table(file)
    values = table[name].to_pylist()
    values[row] = value
    place = table.schema.get_field_index(name)
    changed = table.set_column(place, table.schema.field(name), pa.array(values, table[name].type))
    pq.write_table(changed, file)


@pytest.mark.parametrize(
    ("name", "row", "value", "said"),
    [
        ("left", 2, 0, "'left' of row 2: expected a later node"),
        ("left", 0, 0, "'left' of row 0: expected a later node"),
        ("right", 2, 99, "'right' of row 2: expected a later node"),
        ("right", 0, -1, "'right' of row 0: expected a later node"),
        ("right", 2, 5, "'right' of row 2: its child is of another tree"),
        ("right", 2, 3, "row 3 is the child of none or of several"),
        ("left", 1, 3, "'left' of row 1: it is a leaf and has a child"),
        ("threshold", 0, float("nan"), "'threshold' of row 0: expected a number"),
        ("threshold", 0, float("-inf"), "'threshold' of row 0: expected a number"),
        ("feature", 0, 2, "'feature' of row 0: there are 2 features"),
        ("feature", 2, -2, "'feature' of row 2: there are 2 features"),
        ("feature", 2, -1, "'shares' of row 2: 3 classes are held by leaves alone"),
        ("shares", 1, [1.0, 0.0], "'shares' of row 1: 3 classes"),
        ("shares", 1, [0.5, 0.0, 0.0], "'shares' of row 1: expected shares of 0 to 1"),
        ("shares", 1, [1.5, -0.5, 0.0], "'shares' of row 1: expected shares of 0 to 1"),
        ("shares", 1, [float("nan"), 0.5, 0.5], "'shares' of row 1: expected shares of 0 to 1"),
        ("shares", 1, [1.0, None, 0.0], "'shares' has a share without a value"),
        ("tree", 5, 2, "'tree' does not number trees from 0 on"),
        ("tree", 2, -1, "'tree' does not number trees from 0 on"),
        ("tree", 4, 1, "'right' of row 2: its child is of another tree"),
    ],
)
def test_a_damaged_node_is_named(file, name, row, value, said):
    harmed(file, name, row, value)
    with pytest.raises(InputError, match=said) as caught:
        open_forest(file)
    assert str(file) in str(caught.value) and "mapsense train" in str(caught.value)


def test_a_forest_without_trees_is_refused(file):
    pq.write_table(pq.read_table(file).slice(0, 0), file)
    with pytest.raises(InputError, match="'tree' does not number"):
        open_forest(file)


def test_a_value_that_is_missing_is_refused(file, forest):
    table = to_table(forest)
    loose = pa.schema([field.with_nullable(True) for field in table.schema], table.schema.metadata)
    values = table["threshold"].to_pylist()
    values[0] = None
    place = table.schema.get_field_index("threshold")
    table = table.cast(loose).set_column(place, "threshold", pa.array(values, pa.float64()))
    pq.write_table(table, file)
    with pytest.raises(InputError, match="'threshold' has no value in 1 rows"):
        open_forest(file)


@pytest.mark.parametrize(
    ("header", "said"),
    [
        (b"", "metadata 'mapsense.forest', header: invalid json"),
        (b'{"features": ["a"], "classes": ["b"]}', "provenance: field required"),
        (None, "metadata 'mapsense.forest', header: invalid json"),
    ],
)
def test_a_header_that_is_none_is_refused(file, header, said):
    table = pq.read_table(file)
    metadata = dict(table.schema.metadata)
    del metadata[HEADER]
    if header is not None:
        metadata[HEADER] = header
    pq.write_table(table.replace_schema_metadata(metadata), file)
    with pytest.raises(InputError, match=said):
        open_forest(file)


@pytest.mark.parametrize("names", [(), ("width_m", "width_m")])
def test_names_must_be_there_once(forest, tmp_path, names):
    write_forest(replace(forest, features=names), tmp_path / "forest.parquet")
    with pytest.raises(InputError, match="expected some, each once"):
        open_forest(tmp_path / "forest.parquet")


def test_what_is_no_file_of_ours_is_refused(tmp_path, file):
    with pytest.raises(InputError, match="there is no such file"):
        open_forest(tmp_path / "missing.parquet")
    other = schema("walls", [column("tree", pa.int32(), "no tree")])
    pq.write_table(pa.table([pa.array([1], pa.int32())], schema=other), tmp_path / "walls.parquet")
    with pytest.raises(InputError, match="holds table 'walls', expected 'forest'"):
        open_forest(tmp_path / "walls.parquet")
    pq.write_table(pa.table({"a": [1]}), tmp_path / "stranger.parquet")
    with pytest.raises(InputError, match="was not written by us"):
        open_forest(tmp_path / "stranger.parquet")
    os.truncate(file, 200)
    with pytest.raises(InputError, match="cannot be read as Parquet"):
        open_forest(file)


def test_a_file_cut_within_its_nodes_is_refused(file):
    data = bytearray(file.read_bytes())
    data[4:200] = bytes(196)  # the first pages; the footer is whole
    file.write_bytes(data)
    with pytest.raises(InputError, match="is no sound forest"):
        open_forest(file)
