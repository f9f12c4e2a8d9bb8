"""Repeated scans of the walls between decoded rooms, combined (after decoding).

Before decoding, the scans of a face are combined as well, but nothing is known of which faces are
walls of rooms, and of two scans that differ either may be right. The decoded rooms say which walls
there are: now a scan can be held against all others at all walls that it saw.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PositiveFloat

from storage.layout import Layout
from storage.observations import Observations
from storage.segments import Segments
from storage.sightings import DRIFTS, OFF, Sightings
from tasks.layout.crowd.drift import drifting
from tasks.layout.crowd.faces import Seen, faces_of, seen_by_scans
from tasks.layout.extraction.fusion import fuse
from tasks.layout.extraction.model import strips_of
from tasks.layout.placement.decoded_rows import decoded_rows
from tasks.params import Params


class CrowdParams(Params):
    """How scans of the same walls are combined. None is in the paper."""

    sigma_scan_m: PositiveFloat = 0.02
    """Standard deviation of a scan's registration, metres per axis. Assumption, as in extraction.
    """
    thickness_sigma_m: PositiveFloat = 0.08
    """Standard deviation of a wall's thickness where the scans of its two faces are compared,
    metres: some are bearing walls. Assumption."""
    p_outlier: float = Field(default=1e-6, gt=0, lt=1)
    """Probability with which a scan is taken for an outlier that is none. Assumption."""


def fuse_scans(
    observations: Observations,
    layout: Layout,
    segments: Sequence[Segments],
    partition_m: float,
    params: CrowdParams,
) -> Sightings:
    """Return what each scan saw of the decoded walls, and where all that counts puts their faces.

    Parameters
    ----------
    layout : its most probable rooms along each line count
    segments : one table per scan, in the storey's order
    partition_m : usual thickness of a wall between rooms

    Notes
    -----
    Scans that contradict the others are left out first (`drift`). At each face the others are
    combined by inverse variance without those that lie off there alone (`extraction.fusion`). Of a
    face that only drifting scans have seen, what they saw is moved back by their drift, with its
    variance: they tell no longer where the storey is, but still how far apart their walls are.
    """
    rows = decoded_rows(observations, layout, params.sigma_scan_m)
    faces = faces_of(rows, partition_m)
    seen = seen_by_scans(rows, faces, strips_of(segments))
    partition = partition_m, params.thickness_sigma_m
    shift, sigma = np.zeros(len(seen)), np.full(len(seen), params.sigma_scan_m)
    drifts = np.zeros(len(seen), bool)
    for row in range(len(rows)):
        own = np.flatnonzero(faces.rows[seen.faces] == row)
        of_row = drifting(seen.take(own), faces, partition, params.sigma_scan_m, params.p_outlier)
        for scan, drift in of_row.items():
            mine = own[seen.scans[own] == scan]
            drifts[mine], shift[mine] = True, drift.shift_m
            sigma[mine] = np.hypot(params.sigma_scan_m, drift.sigma_m)
    fused, why = _fused(seen, seen.at_m - shift, sigma, drifts)
    ids = np.array([str(layout.line_ids[row.decoded[0]]) for row in rows], np.str_)
    return Sightings(
        line_ids=ids[faces.rows[seen.faces]],
        walls=faces.walls[seen.faces],
        sides=faces.sides[seen.faces],
        scans=seen.scans,
        at_m=seen.at_m,
        sigma_m=np.full(len(seen), params.sigma_scan_m),
        drift_m=shift,
        left_out=why,
        fused_m=fused[:, 0],
        fused_sigma_m=fused[:, 1],
    )


def _fused(
    seen: Seen, at_m: NDArray[np.float64], sigma_m: NDArray[np.float64], drifts: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.str_]]:
    """Return position and deviation of each sighting's face, (n, 2), and why it does not count."""
    fused, why = np.full((len(seen), 2), np.nan), np.where(drifts, DRIFTS, "")
    for face in np.unique(seen.faces):
        mine = np.flatnonzero(seen.faces == face)
        if drifts[mine].all():
            why[mine] = ""
        counts = mine[why[mine] == ""]
        one = fuse(at_m[counts], sigma_m[counts], seen.scans[counts])
        why[counts[np.isin(seen.scans[counts], one.outliers)]] = OFF
        fused[mine] = one.position_m, one.sigma_m
    return fused, why
