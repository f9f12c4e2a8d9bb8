"""Furniture of a storey against its planes, the stage it must not cost more than (Sec. 7.3)."""

from typing import Any

import numpy as np
import shapely
from harness import Case, Prepared, measure
from planes import warm_up
from report import TIMES, Column, Report, Table, Target

from storage.furniture_segments import FurnitureSegments
from storage.points import PointCloud
from storage.rooms import Rooms
from tasks.furniture.segments import FurnitureSegmentParams, find_furniture_segments
from tasks.simulation.clouds import furnished_floor
from tasks.surfaces.hough import HoughParams, detect_planes

POINTS = 5_000_000
ROUNDS = 3
STRIDE = 500
"""Every so many points are enough to see how far the storey reaches."""

COLUMNS = (
    Column("case", "method"), *TIMES,
    Column("ratio", "ours / theirs", "{:.2f}"), Column("segments", "segments"),
)  # fmt: skip


def furniture(quick: bool) -> Report:
    """Measure both stages on one cloud; quick each once."""
    found = measure(
        Case("furniture segments", prepare_furniture),
        [Case("planes", prepare_planes)],
        1 if quick else ROUNDS,
    )
    rows = [m.row() for m in found.values()]
    for row in rows[1:]:
        row["ratio"] = rows[0]["cpu_seconds"] / row["cpu_seconds"]
    return Report(
        f"Furniture: a storey of 20 furnished rooms, {POINTS / 1e6:.0f} million points",
        [Table("both stages of one storey", COLUMNS, rows)],
        [Target("time / plane stage", rows[1]["ratio"], 1.0, "x", of_time=True)],
        ["The storey is one room here: its walls stand within it, which costs more, not less."],
    )


def prepare_furniture() -> Prepared:
    """Return the search for segments, compiled, and the storey."""
    xyz, _ = furnished_floor(POINTS, seed=0)
    rooms, cloud = _rooms(xyz), PointCloud(xyz, np.zeros(3))
    params = FurnitureSegmentParams()
    find_furniture_segments(rooms, [PointCloud(xyz[:: 10 * STRIDE], np.zeros(3))], params)

    def judge(segments: FurnitureSegments) -> dict[str, Any]:
        return {"segments": len(segments)}

    return Prepared(lambda: find_furniture_segments(rooms, [cloud], params), judge)


def prepare_planes() -> Prepared:
    """Return plane detection, compiled, and the storey."""
    warm_up()
    xyz, _ = furnished_floor(POINTS, seed=0)
    cloud = PointCloud(xyz, np.zeros(3))
    return Prepared(lambda: detect_planes(cloud, HoughParams()))


def _rooms(xyz: np.ndarray) -> Rooms:
    outline = shapely.minimum_rotated_rectangle(shapely.MultiPoint(xyz[::STRIDE, :2]))
    floor = np.quantile(xyz[::STRIDE, 2], 0.01)
    one = np.ones(1)
    return Rooms(np.array([outline], object), floor * one, (floor + 2.7) * one, one, one, ((0,),))
