"""The work of a campaign's scans against the numbers counted, row by row."""

import numpy as np
import pytest
from pydantic import ValidationError

from tasks.device.work import Tally, WorkParams, tally_work


def tally(**changes):
    counted = {
        "storey": "0",
        "room": "r1",
        "scan": "s01v2",
        "volunteer": "v2",
        "duration_s": 30.5,
        "raw_points": 1_000_000,
        "voxel_points": 40_000,
        "snapshots": 60,
        "p_sum": 0.25,
        "bytes_mapsense": 30_000,
        "bytes_gramap": 90_000,
        "iou": 0.9,
    }
    return Tally(**counted | changes)


def test_each_scan_is_a_row_with_what_was_counted():
    rows = (tally(), tally(storey="1", scan="s02v1", volunteer="v1", room="r2", duration_s=0.0))
    work = tally_work(WorkParams(scans=rows))
    assert len(work) == 2
    assert list(work.storeys) == ["0", "1"]
    assert list(work.rooms) == ["r1", "r2"]
    assert list(work.scans) == ["s01v2", "s02v1"]
    assert list(work.volunteers) == ["v2", "v1"]
    assert list(work.duration_s) == [30.5, 0.0]
    for name in ("raw_points", "voxel_points", "snapshots", "bytes_mapsense", "bytes_gramap"):
        assert list(getattr(work, name)) == [getattr(row, name) for row in rows]
        assert getattr(work, name).dtype == np.int64


def test_a_raw_point_takes_three_floats_of_four_bytes():
    work = tally_work(WorkParams(scans=(tally(raw_points=7), tally(raw_points=3 * 10**9))))
    assert list(work.bytes_raw) == [7 * 3 * 4, 36 * 10**9]


def test_a_scan_that_was_not_assessed_has_no_p_sum():
    work = tally_work(WorkParams(scans=(tally(p_sum=None), tally(p_sum=0.0))))
    assert work.p_sum == pytest.approx([np.nan, 0.0], nan_ok=True)


def test_a_scan_is_usable_from_the_least_iou_on():
    rows = tuple(tally(iou=iou) for iou in (0.0, 0.79, 0.8, 1.0))
    assert list(tally_work(WorkParams(scans=rows)).usable) == [False, False, True, True]
    asked = WorkParams(scans=rows, usable_iou=0.79)
    assert list(tally_work(asked).usable) == [False, True, True, True]


def test_no_scans_are_an_empty_table():
    work = tally_work(WorkParams())
    assert len(work) == 0
    assert (work.usable.dtype, work.bytes_raw.dtype) == (bool, np.int64)


@pytest.mark.parametrize("field", ["duration_s", "raw_points", "bytes_mapsense", "snapshots"])
def test_a_negative_count_is_refused(field):
    with pytest.raises(ValidationError, match=field):
        tally(**{field: -1})
