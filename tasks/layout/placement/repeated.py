"""Rows with their walls where all scans that count put them, not only those told apart before."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from storage.layout import Layout
from storage.sightings import Sightings
from tasks.layout.placement.decoded_rows import DecodedRow


def with_sightings(
    rows: Sequence[DecodedRow],
    layout: Layout,
    sightings: Sightings,
    partition: tuple[float, float],
) -> list[DecodedRow]:
    """Return the rows with the walls that scans were held against each other at.

    Parameters
    ----------
    layout : the rows' rooms
    partition : usual thickness of a wall between rooms, and its spread, metres

    Notes
    -----
    A wall stands in the middle between its two faces, with a quarter of their variances' sum; of
    one face only, as far behind it as it was observed to, or else half a partition, with a quarter
    of the variance of a partition's thickness more.
    """
    return [
        _with(
            row,
            np.flatnonzero(sightings.line_ids == layout.line_ids[row.decoded[0]]),
            sightings,
            partition,
        )
        for row in rows
    ]


def _with(
    row: DecodedRow,
    own: np.ndarray,
    sightings: Sightings,
    partition: tuple[float, float],
) -> DecodedRow:
    faces, at, sigma = row.faces_m.copy(), row.chain.observed_m.copy(), row.chain.sigma_m.copy()
    for k in np.unique(sightings.walls[own[sightings.drift_m[own] != 0]]).tolist():
        of_wall = own[sightings.walls[own] == k]
        spread = np.full(2, np.nan)
        for side in np.unique(sightings.sides[of_wall]).tolist():
            first = of_wall[sightings.sides[of_wall] == side][0]
            faces[k, side] = sightings.fused_m[first]
            spread[side] = sightings.fused_sigma_m[first]
        known = ~np.isnan(faces[k])
        if known.all():
            spread = np.where(np.isnan(spread), sigma[k], spread)
            at[k], sigma[k] = faces[k].mean(), np.hypot(*spread) / 2
        else:
            side = int(known.argmax())
            before = row.faces_m[k, side]
            half = (0.5 - side) * partition[0] if np.isnan(before) else at[k] - before
            at[k] = faces[k, side] + half
            sigma[k] = np.hypot(spread[side], partition[1] / 2)
    return replace(row, faces_m=faces, chain=replace(row.chain, observed_m=at, sigma_m=sigma))
