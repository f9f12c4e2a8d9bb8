"""The voxel grid against Open3D's."""

from functools import partial
from typing import Any

import numpy as np
from harness import BenchmarkError, Case, Prepared, measure
from numpy.typing import NDArray
from report import TIMES, Column, Report, Table, Target

from storage.points import PointCloud
from tasks.device.voxels import VoxelParams, centroids, voxel_grid
from tasks.simulation.clouds import furnished_floor, furnished_room
from tasks.simulation.sensor import load_open3d

CLOUDS = {
    "room": (partial(furnished_room, 2_000_000, 0), 0.02),
    "storey": (partial(furnished_floor, 5_000_000, 0), 0.05),
}
"""Cloud and edge of the voxels, metres."""
ROUNDS = 5
BOUND = 0.2
"""Target: our time as a share of Open3D's."""

OURS, LEGACY, TENSOR = "ours", "Open3D", "Open3D tensor"
COLUMNS = (
    Column("case", "method"), *TIMES, Column("ratio", "ours / theirs", "{:.3f}"),
    Column("points", "voxels", "{:,}"), Column("above_mb", "peak MB above cloud", "{:.0f}"),
)  # fmt: skip
NOTES = [
    "Open3D's grids begin elsewhere than ours, which changes the number of voxels a little; on the",
    "grid of its point cloud ours has as many voxels as it (checked here), and the same centroids",
    "(tests).",
]


def voxels(quick: bool) -> Report:
    """Measure time and memory of a room and of a storey."""
    report = Report("Voxel grid: the centroid of each occupied voxel", notes=list(NOTES))
    for name, (_, edge) in CLOUDS.items():
        found = measure(
            Case(OURS, partial(prepare_ours, name)),
            [
                Case(LEGACY, partial(prepare_legacy, name), rival=True),
                Case(TENSOR, partial(prepare_tensor, name), rival=True),
            ],
            1 if quick else ROUNDS,
        )
        if found[OURS].figures["same_grid"] != found[LEGACY].figures["points"]:
            raise BenchmarkError(f"{name}: {found[OURS].figures}, {found[LEGACY].figures}")
        rows = [m.row() for m in found.values()]
        for row in rows[1:]:
            row["ratio"] = found[OURS].ratio(found[row["case"]])
        title = f"{name}, {len(_cloud(name)):,} points, {100 * edge:g} cm"
        report.tables.append(Table(title, COLUMNS, rows))
        ratio = found[OURS].ratio(found[LEGACY])
        report.targets.append(Target(f"{name}: time / {LEGACY}", ratio, BOUND, "x", of_time=True))
    return report


def _cloud(name: str) -> PointCloud:
    return PointCloud(CLOUDS[name][0]()[0], np.zeros(3))


def prepare_ours(name: str) -> Prepared:
    """Return our voxel grid, compiled."""
    cloud, params = _cloud(name), VoxelParams(edge_m=CLOUDS[name][1])
    voxel_grid(PointCloud(cloud.xyz[:1000], cloud.origin), params)

    def judge(found: PointCloud) -> dict[str, Any]:
        corner = cloud.xyz.min(axis=0).astype(np.float64) - params.edge_m / 2
        same = centroids(cloud, params.edge_m, corner)  # on Open3D's grid
        return {"points": len(found), "same_grid": len(same)}

    return Prepared(lambda: voxel_grid(cloud, params), judge)


def prepare_legacy(name: str) -> Prepared:
    """Return Open3D's voxel_down_sample; its cloud, of doubles, is made beforehand."""
    open3d = load_open3d()
    points = open3d.utility.Vector3dVector(_cloud(name).xyz.astype(np.float64))
    cloud, edge = open3d.geometry.PointCloud(points), CLOUDS[name][1]
    return Prepared(
        lambda: np.asarray(cloud.voxel_down_sample(edge).points), lambda xyz: {"points": len(xyz)}
    )


def prepare_tensor(name: str) -> Prepared:
    """Return the voxel_down_sample of Open3D's tensor cloud of float32, on all cores."""
    open3d = load_open3d()
    cloud = open3d.t.geometry.PointCloud(open3d.core.Tensor(_cloud(name).xyz))
    edge = CLOUDS[name][1]

    def run() -> NDArray[np.float32]:
        return cloud.voxel_down_sample(edge).point.positions.numpy()

    return Prepared(run, lambda xyz: {"points": len(xyz)})
