"""What is told of scans that contradict the others."""

from dataclasses import replace

import numpy as np

from flows.correction import told
from storage.sightings import DRIFTS, NO_SIGHTINGS, Sightings

SEEN = Sightings(
    line_ids=np.array(["c0-1"] * 4),
    walls=np.array([0, 0, 1, 1]),
    sides=np.array([1, 1, 0, 0]),
    scans=np.array([0, 2, 0, 2]),
    at_m=np.zeros(4),
    sigma_m=np.full(4, 0.02),
    drift_m=np.array([0.0, -0.314, 0.0, -0.314]),
    left_out=np.array(["", DRIFTS, "", DRIFTS]),
    fused_m=np.zeros(4),
    fused_sigma_m=np.full(4, 0.02),
)


def test_a_drifting_scan_is_named_with_how_far_it_is_off():
    said = told(SEEN, ["hall", "lab", "lab-again"])
    assert said == (
        "scan lab-again is off by 0.31 m from the others: left out at 2 of 2 wall faces"
    )


def test_nothing_is_told_of_scans_that_agree():
    assert told(NO_SIGHTINGS, []) == ""
    assert told(replace(SEEN, drift_m=np.zeros(4)), ["hall", "lab", "lab-again"]) == ""
