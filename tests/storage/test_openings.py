"""Candidates, doors and windows become tables and come back as they were, whole and empty."""

import json

import numpy as np
import pytest
import shapely

from storage import artifacts
from storage.artifacts import Place, kind_of
from storage.candidates import ABOUT, FEATURES, FIG_10, SHARES, Candidates
from storage.openings import Openings

RNG = np.random.default_rng(3)


def candidates(n):
    features = RNG.normal(size=(n, len(FEATURES)))
    features[::2, 5] = np.nan
    return Candidates(np.arange(n, dtype=np.int32) // 2, *RNG.random((4, n)), features)


def openings(n):
    kinds = np.array(["door", "window", "door"], np.str_)
    states = np.array(["unknown", "", "shut"], np.str_)
    return Openings(
        kinds=np.resize(kinds, n),
        lines=RNG.normal(size=(n, 2, 2)),
        sill_m=RNG.random(n),
        head_m=RNG.random(n),
        walls=np.arange(n, dtype=np.int32),
        rooms=np.resize(np.array([(0, 1), (4, -1), (-1, -1)], np.int32), (n, 2)),
        states=np.resize(states, n),
        confidences=RNG.random(n),
    )


VALUES = {
    "candidates": candidates(5),
    "no candidates": candidates(0),
    "openings": openings(6),
    "no openings": openings(0),
}


@pytest.mark.parametrize("value", VALUES.values(), ids=VALUES)
def test_a_value_comes_back_from_its_file(value, tmp_path):
    kind = kind_of(type(value))
    place = Place(store=str(tmp_path), run="r", building="b", storey="0")
    ref = artifacts.write(kind, value, place)
    found = artifacts.read(kind, ref, tmp_path)
    assert ref.rows == len(value) == len(found)
    for name in value.__dataclass_fields__:
        one, other = getattr(found, name), getattr(value, name)
        assert one.dtype.kind == other.dtype.kind and one.shape == other.shape
        np.testing.assert_array_equal(one, other)


def test_a_table_says_what_every_feature_holds_and_its_unit():
    schema = kind_of(Candidates).schema
    for name in FEATURES:
        assert schema.field(name).metadata[b"about"].decode() == ABOUT[name]
    assert len(FIG_10) == 8 and len(SHARES) == 3
    assert FEATURES[:11] == FIG_10 + SHARES
    assert len(set(FEATURES)) == len(FEATURES)


def test_a_feature_is_found_by_its_name_and_some_candidates_keep_theirs():
    some = candidates(4)
    kept = some.take(np.array([2, 0]))
    assert (kept.feature("head_edge") == some.features[[2, 0], FEATURES.index("head_edge")]).all()
    assert (kept.from_m == some.from_m[[2, 0]]).all()


def test_the_line_of_an_opening_is_its_geometry_and_a_room_that_is_none_is_null():
    value = openings(3)
    table = kind_of(Openings).to_table(value)
    lines = shapely.from_wkb(table["geometry"].to_pylist())
    assert shapely.length(lines) == pytest.approx(table["width_m"].to_numpy())
    assert table["room_b"].to_pylist() == [1, None, None]
    geo = json.loads(table.schema.metadata[b"geo"])
    assert geo["columns"]["geometry"]["geometry_types"] == ["LineString"]


def test_doors_and_windows_are_told_apart():
    value = openings(3)
    assert value.of_kind("door").tolist() == [0, 2]
    assert value.of_kind("window").tolist() == [1]
