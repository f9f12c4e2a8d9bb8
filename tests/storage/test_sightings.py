"""Sightings come back from their table as they were, whole and empty."""

from dataclasses import fields

import numpy as np
import pytest

from storage.artifacts import Place, read, write
from storage.sightings import (
    DRIFTS,
    NO_SIGHTINGS,
    OFF,
    SCHEMA,
    SIGHTINGS,
    Sightings,
    from_table,
    to_table,
)

THREE = Sightings(
    line_ids=np.array(["c0-1", "c0-1", "east"]),
    walls=np.array([0, 0, 3]),
    sides=np.array([1, 1, 0]),
    scans=np.array([2, 5, 2]),
    at_m=np.array([0.06, 0.36, 1 / 3]),
    sigma_m=np.full(3, 0.02),
    drift_m=np.array([0.0, 0.3, 0.0]),
    left_out=np.array(["", DRIFTS, OFF]),
    fused_m=np.array([0.06, 0.06, 2.5]),
    fused_sigma_m=np.array([0.02, 0.02, 0.01]),
)


@pytest.mark.parametrize("sightings", [THREE, NO_SIGHTINGS])
def test_sightings_come_back_as_they_were(sightings, tmp_path):
    place = Place(store=str(tmp_path), run="r", building="b", storey="1")
    back = read(SIGHTINGS, write(SIGHTINGS, sightings, place), place.store)
    for field in fields(Sightings):
        found, expected = getattr(back, field.name), getattr(sightings, field.name)
        assert found.tolist() == expected.tolist(), field.name
        assert found.dtype.kind == expected.dtype.kind, field.name


def test_what_counts_has_no_reason_in_the_table():
    table = to_table(THREE)
    assert table.schema.equals(SCHEMA)
    assert table["left_out"].to_pylist() == [None, "drifts", "off"]
    assert from_table(table).left_out.tolist() == ["", "drifts", "off"]
