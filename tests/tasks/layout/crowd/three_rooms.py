"""Three rooms along a line, observed and decoded, and scans of their walls."""

import numpy as np

from storage.layout import LINE_END, Layout
from storage.observations import Observations
from storage.segments import Raster, Segments

PARTITION_M, DEPTH_M = 0.12, 5.0
WALLS = (0.0, 4.0, 8.0, 12.0)
"""Centres of the walls of three rooms along a line on the x axis."""


def faces(wall):
    """Return the lower and the upper face of a wall."""
    return WALLS[wall] - PARTITION_M / 2, WALLS[wall] + PARTITION_M / 2


OBSERVED = Observations(
    line_ids=np.array(["a"]),
    starts=np.array([[0.0, 0.0]]),
    ends=np.array([[12.0, 0.0]]),
    end_sigma_m=np.full((1, 2), 0.03),
    end_faces_m=np.array([[(np.nan, faces(0)[1]), (faces(3)[0], np.nan)]]),
    lines=np.zeros(2, int),
    cut_m=np.array(WALLS[1:3]),
    sigma_m=np.full(2, 0.02),
    faces_m=np.array([faces(1), faces(2)]),
    scans=np.ones(2, int),
    presence=np.full(2, 0.99),
    interval_lines=np.zeros(3, int),
    from_m=np.array(WALLS[:3]),
    to_m=np.array(WALLS[1:]),
    rooms=np.arange(3),
    depth_m=np.full(3, DEPTH_M),
)
NO = np.full(3, np.nan)
DECODED = Layout(
    line_ids=np.array(["a"] * 3),
    hypotheses=np.zeros(3, int),
    orders=np.arange(3),
    from_m=np.array(WALLS[:3]),
    to_m=np.array(WALLS[1:]),
    from_cuts=np.array([LINE_END, 0, 1]),
    to_cuts=np.array([0, 1, LINE_END]),
    classes=np.array(["office"] * 3),
    rules=np.array(["o"] * 3),
    parts=np.zeros(3, int),
    widths_m=NO,
    spreads_m=NO,
    posteriors=np.ones(3),
    from_posteriors=np.ones(3),
    to_posteriors=np.ones(3),
    undivided=np.ones(3),
    gains=np.full(3, 5.0),
    log_p=np.zeros(3),
)


def scan(*strips):
    """Return a scan of strips of wall (x, facing): 1 seen from further along the x axis."""
    m = len(strips)
    x, facing = np.array(strips, float).reshape(-1, 2).T
    return Segments(
        cell_m=0.1,
        kinds=np.zeros(m, np.int8),
        normals=np.column_stack([facing, np.zeros(m), np.zeros(m)]),
        offsets=x * facing,
        side_known=np.ones(m, bool),
        lines=np.array([[(at, 0.2), (at, DEPTH_M - 0.1)] for at in x]).reshape(-1, 2, 2),
        heights=np.tile([0.0, 2.6], (m, 1)),
        areas=np.full(m, 10.0),
        inliers=np.full(m, 1000),
        rms=np.full(m, 0.01),
        hulls=(b"",) * m,
        rasters=(Raster((0.0, 0.0), np.ones((1, 1), bool)),) * m,
    )


def of_room(room, shift=0.0, wider=0.0):
    """Return a scan of one room's two side walls, shifted along the line, one side further off."""
    return scan((faces(room)[1] + shift, 1), (faces(room + 1)[0] + shift + wider, -1))
