"""Plane detection in a furnished room, against Open3D."""

from functools import partial
from typing import Any

import numpy as np
from harness import Case, Measured, Prepared, measure
from numpy.typing import NDArray
from report import TIMES, Column, Report, Table, Target
from scoring import score

from storage.planes import Planes
from storage.points import PointCloud
from tasks.simulation.clouds import Surfaces, furnished_room
from tasks.simulation.sensor import load_open3d
from tasks.surfaces.hough import HoughParams, detect_planes

SIZES = {100_000: 5, 500_000: 3, 2_000_000: 1}
"""Points of the cloud -> runs of each rival, which take half a minute at two millions."""
OURS_FIRST = 3
SEEDS = 10
DISTANCE_M, ITERATIONS, LEFT_SHARE, LEAST_SHARE = 0.03, 1000, 0.01, 0.002
"""segment_plane: its tolerance and iterations, when to stop, the smallest plane."""
NEIGHBOURS = 30
WARM_POINTS, WARM_MANY = 20_000, 1_000_000
"""Clouds to warm up with: large ones may take other compiled paths than small ones."""

OURS, SEGMENT, PATCHES = "ours", "segment_plane", "detect_planar_patches"
COLUMNS = (
    Column("case", "method"), *TIMES,
    Column("ratio", "/ segment_plane", "{:.3f}"),
    Column("planes", "planes"),
    Column("recall", "room of 6"), Column("furniture", "furniture of 12"),
    Column("angle_deg", "angle deg", "{:.4f}"), Column("angle_worst_deg", "worst", "{:.3f}"),
    Column("offset_mm", "offset mm", "{:.3f}"), Column("offset_worst_mm", "worst", "{:.2f}"),
    Column("above_mb", "peak MB above cloud", "{:.0f}"),
)  # fmt: skip
SEED_COLUMNS = (
    Column("case", "points"), Column("rooms", "rooms"),
    Column("complete", "with 6 of 6"), Column("furniture", "furniture of 12, least"),
    Column("furniture_median", "median", "{:.0f}"),
    Column("angle_worst_deg", "worst angle deg", "{:.3f}"),
    Column("offset_worst_mm", "worst offset mm", "{:.2f}"),
)  # fmt: skip
NOTES = [
    f"segment_plane: repeated, {DISTANCE_M} m, {ITERATIONS} iterations, default probability, "
    f"until {LEFT_SHARE:.0%} is left or a plane holds under {LEAST_SHARE:.1%} of the points.",
    f"detect_planar_patches: its time includes the normals it needs (k = {NEIGHBOURS}).",
    "Ours runs with one thread, Open3D with all cores. Medians; runs interleaved.",
]


def planes(quick: bool) -> Report:
    """Measure all sizes; quick leaves out the rivals at two million points."""
    report = Report("Planes: furnished room of 6 x 5 x 3 m, 1 cm noise", notes=list(NOTES))
    seeds = []
    for n, rounds in SIZES.items():
        slow = n > 1_000_000
        rivals = [
            Case(SEGMENT, partial(prepare_segment_plane, n), rival=True),
            Case(PATCHES, partial(prepare_patches, n), rival=True),
        ]
        found = measure(
            Case(OURS, partial(prepare_ours, n)),
            () if quick and slow else rivals,
            1 if quick else rounds,
            OURS_FIRST,
        )
        report.tables.append(Table(f"{n:,} points", COLUMNS, _rows(found)))
        (seed,) = measure(Case(f"{n:,}", partial(prepare_seeds, n)), rounds=1).values()
        seeds.append(seed.row())
        report.targets += _targets(n, found, seed)
    title = f"Ours in {SEEDS} rooms, each furnished, sampled and drawn with its own seed"
    report.tables.append(Table(title, SEED_COLUMNS, seeds))
    return report


def _rows(found: dict[str, Measured]) -> list[dict[str, Any]]:
    return [m.row() | {"ratio": m.ratio(found.get(SEGMENT))} for m in found.values()]


def _targets(n: int, found: dict[str, Measured], seeds: Measured) -> list[Target]:
    ours, points = found[OURS].figures, f"{n:,} points"
    worst = seeds.figures["angle_worst_deg"], seeds.figures["offset_worst_mm"]
    bound = {500_000: 0.05, 2_000_000: 0.01}.get(n)
    ratio = found[OURS].ratio(found.get(SEGMENT))
    time = (
        []
        if bound is None
        else [Target(f"{points}: time / segment_plane", ratio, bound, "x", of_time=True)]
    )
    return [
        *time,
        Target(f"{points}: median angle error", ours.get("angle_deg"), 0.02, " deg"),
        Target(f"{points}: median offset error", ours.get("offset_mm"), 0.5, " mm"),
        Target(f"{points}: worst angle error in {SEEDS} rooms", worst[0], 0.1, " deg"),
        Target(f"{points}: worst offset error in {SEEDS} rooms", worst[1], 2, " mm"),
        Target(f"{points}: peak above the cloud", found[OURS].above_mb, 30, " MB"),
        Target(
            f"{points}: rooms with 6 of 6 surfaces, of {SEEDS}",
            seeds.figures["complete"],
            SEEDS,
            at_least=True,
        ),
        Target(
            f"{points}: furniture found of 12, median of {SEEDS} rooms",
            seeds.figures["furniture_median"],
            7,
            at_least=True,
        ),
    ]


def prepare_ours(n: int) -> Prepared:
    """Return our detection, compiled."""
    warm_up()
    xyz, surfaces = furnished_room(n, seed=0)
    cloud = PointCloud(xyz, np.zeros(3))
    return Prepared(
        lambda: detect_planes(cloud, HoughParams())[0],
        lambda found: _score(found, surfaces),
    )


def warm_up() -> None:
    """Compile all that a cloud of any size needs."""
    for n in (WARM_POINTS, WARM_MANY):
        detect_planes(PointCloud(furnished_room(n, seed=1)[0], np.zeros(3)), HoughParams())


def prepare_seeds(n: int) -> Prepared:
    """Return our detection in ten rooms."""

    def run() -> list[dict[str, Any]]:
        scores = []
        for seed in range(SEEDS):
            xyz, surfaces = furnished_room(n, seed)
            found, _ = detect_planes(PointCloud(xyz, np.zeros(3)), HoughParams(seed=seed))
            scores.append(_score(found, surfaces))
        return scores

    return Prepared(run, _summary)


def _summary(scores: list[dict[str, Any]]) -> dict[str, Any]:
    return {
        "rooms": len(scores),
        "complete": sum(s["recall"] == s["surfaces"] for s in scores),
        "furniture": min(s["furniture"] for s in scores),
        "furniture_median": float(np.median([s["furniture"] for s in scores])),
        "angle_worst_deg": max(s.get("angle_worst_deg", np.inf) for s in scores),
        "offset_worst_mm": max(s.get("offset_worst_mm", np.inf) for s in scores),
    }


def _score(found: Planes, surfaces: Surfaces) -> dict[str, Any]:
    return score(found.normals, found.offsets, surfaces)


def prepare_segment_plane(n: int) -> Prepared:
    """Return Open3D's RANSAC, repeated on what is left."""
    cloud, surfaces = _open3d_room(n)
    _segment_planes(_open3d_room(WARM_POINTS)[0])

    def judge(equations: NDArray[np.float64]) -> dict[str, Any]:
        return score(equations[:, :3], -equations[:, 3], surfaces)

    return Prepared(lambda: _segment_planes(cloud), judge)


def _segment_planes(cloud: Any) -> NDArray[np.float64]:
    """Return (m, 4): a, b, c, d of the planes in the order found."""
    n, left, found = len(cloud.points), cloud, []
    while len(left.points) > LEFT_SHARE * n:
        equation, inliers = left.segment_plane(DISTANCE_M, 3, ITERATIONS)
        if len(inliers) < LEAST_SHARE * n:
            break
        found.append(equation)
        left = left.select_by_index(inliers, invert=True)
    return np.array(found).reshape(-1, 4)


def prepare_patches(n: int) -> Prepared:
    """Return Open3D's region growing on normals, the normals included."""
    cloud, surfaces = _open3d_room(n)
    _planar_patches(_open3d_room(WARM_POINTS)[0])

    def judge(boxes: list[Any]) -> dict[str, Any]:
        normals = np.array([box.R[:, 2] for box in boxes]).reshape(-1, 3)
        centres = np.array([box.center for box in boxes]).reshape(-1, 3)
        return score(normals, np.einsum("ij,ij->i", normals, centres), surfaces)

    return Prepared(lambda: _planar_patches(cloud), judge)


def _planar_patches(cloud: Any) -> list[Any]:
    open3d = load_open3d()
    cloud.estimate_normals(open3d.geometry.KDTreeSearchParamKNN(NEIGHBOURS))
    boxes = cloud.detect_planar_patches()
    cloud.normals = open3d.utility.Vector3dVector()
    return list(boxes)


def _open3d_room(n: int) -> tuple[Any, Surfaces]:
    open3d = load_open3d()
    open3d.utility.random.seed(0)
    xyz, surfaces = furnished_room(n, seed=0)
    points = open3d.utility.Vector3dVector(xyz.astype(np.float64))
    return open3d.geometry.PointCloud(points), surfaces
