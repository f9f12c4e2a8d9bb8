"""Plane detection in a whole storey at once."""

from typing import Any

import numpy as np
from harness import Case, Prepared, measure
from planes import warm_up
from report import TIMES, Column, Report, Table, Target
from scipy.spatial import cKDTree
from scoring import FURNITURE, ROOM, errors, score

from storage.planes import PlaneLabels, Planes
from storage.points import PointCloud
from tasks.simulation.clouds import Surfaces, furnished_floor
from tasks.surfaces.hough import HoughParams, detect_planes

POINTS = 5_000_000
ROUNDS = 3
NEAR_M = 1.0
"""A surface counts as found in place if a matching patch has a point this near to its centre."""
STRIDE = 10
"""Every tenth point is enough to see where a patch lies: 40 to a square metre and more."""

COLUMNS = (
    Column("case", "method"), *TIMES,
    Column("planes", "planes"), Column("recall", "surfaces of 126"),
    Column("in_place", "by a patch of their own place"),
    Column("furniture", "furniture"), Column("furniture_in_place", "in place"),
    Column("pieces", "of"),
    Column("angle_deg", "angle deg", "{:.4f}"), Column("angle_worst_deg", "worst", "{:.3f}"),
    Column("offset_mm", "offset mm", "{:.3f}"), Column("offset_worst_mm", "worst", "{:.2f}"),
    Column("above_mb", "peak MB above cloud", "{:.0f}"),
    Column("peak_mb", "MB in all", "{:.0f}"),
)  # fmt: skip


def storey(quick: bool) -> Report:
    """Measure ours; what others need for a storey is not comparable."""
    (ours,) = measure(Case("ours", prepare_storey), rounds=1 if quick else ROUNDS).values()
    return Report(
        f"Storey: 20 furnished rooms and a corridor, 47 x 13 m, {POINTS / 1e6:.0f} million points",
        [Table("whole storey at once", COLUMNS, [ours.row()])],
        [
            Target("surfaces found", ours.figures["recall"], 120, at_least=True),
            Target("surfaces found in place", ours.figures["in_place"], 120, at_least=True),
            Target("peak of the whole process", ours.peak_mb, 1000, " MB"),
        ],
        [f"In place: a matching patch has a point within {NEAR_M:g} m of the surface's centre."],
    )


def prepare_storey() -> Prepared:
    """Return our detection, compiled, and the storey."""
    warm_up()
    xyz, surfaces = furnished_floor(POINTS, seed=0)
    cloud = PointCloud(xyz, np.zeros(3))

    def judge(found: tuple[Planes, PlaneLabels]) -> dict[str, Any]:
        planes, labels = found
        figures = score(planes.normals, planes.offsets, surfaces)
        return figures | _in_place(cloud, planes, labels, surfaces)

    return Prepared(lambda: detect_planes(cloud, HoughParams()), judge)


def _in_place(
    cloud: PointCloud, planes: Planes, labels: PlaneLabels, surfaces: Surfaces
) -> dict[str, Any]:
    """Count the surfaces near whose centre a matching patch has points.

    Planes end nowhere, so that one room's floor would stand for those of all rooms.
    """
    close = errors(planes.normals, planes.offsets, surfaces).close
    near = cKDTree(cloud.xyz[::STRIDE]).query_ball_point(surfaces.centres, NEAR_M)
    some = labels.labels[::STRIDE]
    found = np.array(
        [
            any(label >= 0 and row[label] for label in np.unique(some[points]))
            for row, points in zip(close, near, strict=True)
        ]
    )
    return {
        "in_place": int(found[np.isin(surfaces.roles, ROOM)].sum()),
        "furniture_in_place": int(found[np.isin(surfaces.roles, FURNITURE)].sum()),
    }
