"""Rows with their walls where the scans that agree have them."""

from dataclasses import replace

import numpy as np
import pytest

from storage.sightings import DRIFTS, NO_SIGHTINGS, Sightings
from tasks.layout.placement.decoded_rows import decoded_rows
from tasks.layout.placement.repeated import with_sightings
from tests.tasks.layout.crowd.three_rooms import DECODED, OBSERVED, PARTITION_M, WALLS, faces

SPREAD_M = 0.02
PARTITION = PARTITION_M, SPREAD_M


def sighting(wall, side, fused_m, fused_sigma_m=0.01):
    """Return what one scan that drifts saw of a face that others put elsewhere."""
    return Sightings(
        line_ids=np.array(["a"]),
        walls=np.array([wall]),
        sides=np.array([side]),
        scans=np.array([1]),
        at_m=np.array([fused_m + 0.3]),
        sigma_m=np.array([0.02]),
        drift_m=np.array([0.3]),
        left_out=np.array([DRIFTS]),
        fused_m=np.array([fused_m]),
        fused_sigma_m=np.array([fused_sigma_m]),
    )


def both(a, b):
    """Return two sightings as one."""
    columns = zip(vars(a).values(), vars(b).values(), strict=True)
    return Sightings(*(np.append(x, y) for x, y in columns))


def row_with(sightings, observed=OBSERVED):
    """Return the row of three rooms, its walls where scans have them."""
    (row,) = with_sightings(decoded_rows(observed, DECODED, 0.05), DECODED, sightings, PARTITION)
    return row


def test_a_wall_stands_in_the_middle_of_its_fused_faces():
    seen = both(sighting(1, 0, 3.9, 0.01), sighting(1, 1, 4.04, 0.03))
    row = row_with(seen)
    assert row.faces_m[1] == pytest.approx([3.9, 4.04])
    assert row.chain.observed_m == pytest.approx([WALLS[0], 3.97, *WALLS[2:]])
    assert row.chain.sigma_m[1] == pytest.approx(np.hypot(0.01, 0.03) / 2)


def test_a_wall_with_one_face_moves_with_it():
    one = OBSERVED.faces_m.copy()
    one[1, 0] = np.nan
    observed = replace(OBSERVED, faces_m=one)
    row = row_with(sighting(2, 1, faces(2)[1] + 0.05), observed)
    assert row.chain.observed_m[2] == pytest.approx(WALLS[2] + 0.05)
    assert row.chain.sigma_m[2] == pytest.approx(np.hypot(0.01, SPREAD_M / 2))
    assert np.isnan(row.faces_m[2, 0])


def test_a_wall_of_which_nothing_was_observed_stands_half_a_partition_off_its_face():
    observed = replace(OBSERVED, faces_m=np.full((2, 2), np.nan))
    row = row_with(sighting(1, 0, 3.9), observed)
    assert row.chain.observed_m[1] == pytest.approx(3.9 + PARTITION_M / 2)


def test_walls_that_no_drifting_scan_saw_stay_as_observed():
    (plain,) = decoded_rows(OBSERVED, DECODED, 0.05)
    agreed = replace(sighting(1, 0, 3.9), drift_m=np.zeros(1), left_out=np.array([""]))
    for sightings in (NO_SIGHTINGS, agreed, replace(agreed, line_ids=np.array(["b"]))):
        row = row_with(sightings)
        assert row.chain.observed_m.tolist() == plain.chain.observed_m.tolist()
        assert row.chain.sigma_m.tolist() == plain.chain.sigma_m.tolist()
        np.testing.assert_array_equal(row.faces_m, plain.faces_m)
