"""Rays at a wall face against Embree, on the same voxels and on the exact scene."""

import os
from concurrent.futures import ThreadPoolExecutor
from functools import cache, partial
from typing import Any

import numpy as np
from harness import Case, Prepared, measure
from numpy.typing import NDArray
from report import TIMES, Column, Report, Table, Target
from scipy.spatial.transform import Rotation

from storage.points import PointCloud
from tasks.doors.rays import ASIDE, HIT, PASSED, STOPPED, Canvas, Eyes, Limits, cast_rays
from tasks.doors.voxels import DistanceField, distance_field
from tasks.simulation.clouds import DOOR_M, SHIFT_M, YAW_RAD, furnished_room
from tasks.simulation.patches import Box, furnished_patches
from tasks.simulation.sensor import load_open3d

POINTS, POSES = 500_000, 60
VOXELS_M = (0.05, 0.025)
PIXEL_M, WALL_M = 0.02, (6.0, 3.0)
D_M, D_0_M = 0.1, 0.1
LEAST_POINTS = 2
ROUNDS = 5
PARTS = 12
"""Pieces the wall is cut into, as a storey has many faces for its threads."""
OUTCOME = np.array([0, 1, 1, 2])
"""STOPPED, HIT, ASIDE and PASSED as occluded, occupied, empty."""

OURS, ONE = "ours", "ours, one thread"
BOXES, BOXES_ONE = "Embree, voxel boxes", "Embree, voxel boxes, one thread"
EXACT = "Embree, exact mesh"
COLUMNS = (
    Column("case", "method"), *TIMES,
    Column("rays", "M rays/s", "{:.1f}"), Column("ratio", "ours / theirs", "{:.2f}"),
    Column("agreement", "labels as exact", "{:.3f}"),
    Column("empty", "of empty rays", "{:.3f}"), Column("triangles", "triangles", "{:,}"),
)  # fmt: skip
NOTES = [
    f"A wall of {WALL_M[0]:g} x {WALL_M[1]:g} m with a door, pixels of {100 * PIXEL_M:g} cm, rays "
    f"from {POSES} places in a furnished room of {POINTS:,} points.",
    "Labels compare the depth along the wall's normal with d and d + d_0, of every ray, however",
    "sharp its angle. Embree (Open3D's RaycastingScene) returns distances only; its labels are",
    "made outside the time.",
]


def rays(quick: bool) -> Report:
    """Measure both sizes of voxels; quick the coarse one, each once."""
    report = Report("Rays: label image of a wall", notes=list(NOTES))
    for edge in VOXELS_M[: 1 if quick else None]:
        found = measure(
            Case(OURS, partial(prepare_ours, edge, os.cpu_count() or 1)),
            [
                Case(BOXES, partial(prepare_embree, edge, 0), rival=True),
                Case(ONE, partial(prepare_ours, edge, 1)),
                Case(BOXES_ONE, partial(prepare_embree, edge, 1), rival=True),
                Case(EXACT, partial(prepare_embree, None, 0), rival=True),
            ],
            1 if quick else ROUNDS,
        )
        rows = [m.row() for m in found.values()]
        for row in rows:
            row["rays"] = POSES * len(_pixels()) / row["seconds"] / 1e6
            ours = rows[2] if "one thread" in row["case"] else rows[0]
            if row["case"] not in (OURS, ONE):
                row["ratio"] = row["seconds"] / ours["seconds"]
        report.tables.append(Table(f"voxels of {100 * edge:g} cm", COLUMNS, rows))
        if edge == VOXELS_M[0]:
            report.targets += [
                Target("rate / Embree on the same voxels", rows[1]["ratio"], 1.2, "x",
                       at_least=True, of_time=True),
                Target("labels as the exact mesh's", 100 * rows[0]["agreement"], 92, " %",
                       at_least=True),
            ]  # fmt: skip
    return report


def prepare_ours(edge: float, threads: int) -> Prepared:
    """Return our rays at all pieces of the wall, compiled."""
    field, eyes = _field(edge), _eyes()
    limits = Limits(D_M, D_M + D_0_M, D_M, D_M + 2 * D_0_M, 0.0, POSES + 1, False)
    pieces = _pieces()
    pool = ThreadPoolExecutor(threads)
    cast_rays(field, pieces[0], [(eyes, limits)])

    def run() -> list[Any]:
        return list(pool.map(lambda piece: cast_rays(field, piece, [(eyes, limits)]), pieces))

    @cache
    def figures() -> dict[str, Any]:
        labels = []
        for pose in range(POSES):
            eye = [(eyes.take(np.array([pose])), limits)]
            counts = [cast_rays(field, piece, eye).counts for piece in pieces]
            ends = np.concatenate([c.reshape(4, -1) for c in counts], axis=1)
            labels.append(OUTCOME[ends[[STOPPED, HIT, ASIDE, PASSED]].argmax(axis=0)])
        return _compared(np.array(labels))

    return Prepared(run, lambda _: figures())


def prepare_embree(edge: float | None, threads: int) -> Prepared:
    """Return Embree's rays at the boxes of the full voxels; edge None: at the exact mesh."""
    vertices, triangles = _exact_mesh() if edge is None else _boxes_mesh(_field(edge))
    scene = _scene(vertices, triangles)
    cast = load_open3d().core.Tensor(_rays())
    scene.cast_rays(cast, nthreads=threads)

    def judge(found: Any) -> dict[str, Any]:
        return _compared(_labels(found["t_hit"].numpy())) | {"triangles": len(triangles)}

    return Prepared(lambda: scene.cast_rays(cast, nthreads=threads), judge)


def _compared(labels: NDArray[np.int64]) -> dict[str, Any]:
    exact = _exact_labels()
    same = labels == exact
    return {"agreement": float(same.mean()), "empty": float(same[exact == 2].mean())}


@cache
def _exact_labels() -> NDArray[np.int64]:
    found = _scene(*_exact_mesh()).cast_rays(load_open3d().core.Tensor(_rays()))
    return _labels(found["t_hit"].numpy())


def _labels(t: NDArray[np.float32]) -> NDArray[np.int64]:
    """Return 0 occluded, 1 occupied, 2 empty of rays that end at t times the way to the pixel."""
    wall = _pieces()[0]
    away = (_eyes().positions - wall.origin)[:, :2] @ wall.normal
    depth = (t - 1) * away[:, None]
    return np.where(depth < -D_M, 0, np.where(depth <= D_M + D_0_M, 1, 2))


@cache
def _field(edge: float) -> DistanceField:
    xyz, _ = furnished_room(POINTS, seed=0)
    low, high = xyz.min(axis=0).astype(float) - 0.5, xyz.max(axis=0) + 0.5
    return distance_field([PointCloud(xyz, np.zeros(3))], edge, LEAST_POINTS, low, high)


def _placed() -> NDArray[np.float64]:
    return Rotation.from_euler("z", YAW_RAD).as_matrix()


@cache
def _eyes() -> Eyes:
    at = np.random.default_rng(0).uniform((0.5, 0.5, 1.2), (5.5, 4.5, 1.7), (POSES, 3))
    frames = np.tile(np.eye(3), (POSES, 1, 1))
    return Eyes(at @ _placed().T + SHIFT_M, frames, True, (1.0, 1.0), 100.0)


@cache
def _pieces() -> list[Canvas]:
    """Return the pieces of the room's south wall."""
    axis = _placed()[:2, 0].copy()
    columns, rows = (round(length / PIXEL_M) for length in WALL_M)
    step = np.append(axis, 0.0) * WALL_M[0] / PARTS
    return [
        Canvas(SHIFT_M + k * step, axis, (columns // PARTS, rows), PIXEL_M) for k in range(PARTS)
    ]


@cache
def _pixels() -> NDArray[np.float64]:
    parts = []
    for piece in _pieces():
        i, j = (v.reshape(-1, 1) + 0.5 for v in np.mgrid[: piece.shape[0], : piece.shape[1]])
        along = i * PIXEL_M * np.append(piece.axis, 0.0)
        parts.append(piece.origin + along + j * PIXEL_M * np.array([0.0, 0.0, 1.0]))
    return np.concatenate(parts)


def _rays() -> NDArray[np.float32]:
    """Return (POSES, pixels, 6): origins, and the ways to the pixels."""
    start = _eyes().positions[:, None] + np.zeros_like(_pixels())
    return np.concatenate([start, _pixels() - start], axis=2).astype(np.float32)


def _exact_mesh() -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """Return the surfaces that `furnished_room` samples, as triangles."""
    room = Box(0.0, 0.0, 6.0, 5.0, 3.0, doors={"S": ((4.2, 4.2 + DOOR_M),)})
    patches = furnished_patches(room, 0, 2, 5, np.random.default_rng(0)).moved(_placed(), SHIFT_M)
    c, u, v = patches.corners, patches.u, patches.v
    return _of_quads(np.stack([c, c + u, c + u + v, c + v], axis=1))


def _boxes_mesh(field: DistanceField) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """Return the sides of the full voxels that an empty one lies at, as triangles."""
    full = np.pad(field.distances == 0, 1)
    quads = []
    for axis in range(3):
        u, v = np.eye(3)[[(axis + 1) % 3, (axis + 2) % 3]]
        sides = np.argwhere(np.diff(full.astype(np.int8), axis=axis) != 0) - 1.0
        corner = sides + np.eye(3)[axis]
        quads.append(np.stack([corner, corner + u, corner + u + v, corner + v], axis=1))
    return _of_quads(np.concatenate(quads) * field.edge_m + field.low)


def _of_quads(quads: NDArray[np.float64]) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    first = 4 * np.arange(len(quads))[:, None]
    triangles = np.concatenate([first + np.array(corners) for corners in ((0, 1, 2), (0, 2, 3))])
    return quads.reshape(-1, 3).astype(np.float32), triangles.astype(np.uint32)


def _scene(vertices: NDArray[np.float32], triangles: NDArray[np.uint32]) -> Any:
    open3d = load_open3d()
    scene = open3d.t.geometry.RaycastingScene()
    scene.add_triangles(open3d.core.Tensor(vertices), open3d.core.Tensor(triangles))
    return scene
