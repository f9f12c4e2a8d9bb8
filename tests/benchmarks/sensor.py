"""The simulated depth sensor beside a real one, and what a simulated campaign costs.

    python tests/benchmarks/sensor.py [--data DIR] [--every N]
    python tests/benchmarks/sensor.py --campaign SCANS [--write DIR]

The first form compares the depth images of a real hand-held Kinect sequence (7-Scenes, RedKitchen)
with simulated ones: the same poses, a Kinect's intrinsics, and a room with the table, the chairs
and the cupboards read off the real scan by hand, with made-up things on tables and worktops. It
prints, side by side and with their difference: points and holes a snapshot, the noise on flat
patches by range, and what happens at depth edges. The second form simulates a campaign on two
storeys and prints points, seconds, points a second and the peak of memory.
"""

import argparse
import json
import resource
import shutil
import time
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from report import Column, Table
from shapely import LineString, Polygon, affinity, box

from storage.plan import Plan, PlanFurniture, PlanRoom, PlanWall
from tasks.scans.bundle import write_bundle
from tasks.simulation.campaign import CampaignParams, shares, simulate_scans
from tasks.simulation.mesh import storey_mesh
from tasks.simulation.presets import PRESETS, preset
from tasks.simulation.rotations import about, product
from tasks.simulation.sensor import Scene, SensorParams, Views, capture

DATA = Path(__file__).parents[2].parent / "shared" / "data"
SEQUENCE = "kinect_kitchen_7scenes"
KINECT = SensorParams(columns=640, rows=480, focal_px=585.0, rays=640 * 480)
"""The sequence's intrinsics; everything else as in the simulated campaigns."""
THINGS = 30
"""Made-up things on the table and the worktops."""
PATCH = 9
"""Side of a patch that a plane is fitted to, pixels."""
EDGE_M, EDGE_PX = 0.1, 4
"""A pixel lies at a depth edge if the pixels this far to its left and right differ by so much."""
RANGES = ((0.5, 1.5), (1.5, 2.0), (2.0, 2.5), (2.5, 3.0), (3.0, 4.0))
"""Bins of depth, metres."""

COLUMNS = (
    Column("what", "what"), Column("real", "real", "{:.4g}"),
    Column("simulated", "simulated", "{:.4g}"), Column("difference", "difference", "{:+.0%}"),
)  # fmt: skip


@dataclass
class Figures:
    """What is measured on depth images, a value or an array per image."""

    points: list[int] = field(default_factory=list)
    sigma: list[NDArray[np.float64]] = field(default_factory=list)
    """(2, n): depth and residual of flat patches, metres"""
    edge_pixels: int = 0
    edge_holes: int = 0
    edge_flying: int = 0
    inner_pixels: int = 0
    inner_holes: int = 0

    def add(self, depth_m: NDArray[np.float64]) -> None:
        """Take in one depth image; 0 is a hole."""
        self.points.append(int((depth_m > 0).sum()))
        self.sigma.append(_patches(depth_m))
        left, middle, right = (
            depth_m[:, : -2 * EDGE_PX], depth_m[:, EDGE_PX:-EDGE_PX], depth_m[:, 2 * EDGE_PX :],
        )  # fmt: skip
        known = (left > 0) & (right > 0)
        edge = known & (np.abs(left - right) > EDGE_M)
        near, far = np.minimum(left, right)[edge], np.maximum(left, right)[edge]
        at = (middle[edge] - near) / (far - near)
        self.edge_pixels += int(edge.sum())
        self.edge_holes += int((middle[edge] == 0).sum())
        self.edge_flying += int(((at > 0.25) & (at < 0.75)).sum())
        inner = known & ~edge
        self.inner_pixels += int(inner.sum())
        self.inner_holes += int((middle[inner] == 0).sum())

    def rows(self) -> dict[str, float]:
        """Return the figures by what they say."""
        share = np.array(self.points) / (KINECT.columns * KINECT.rows)
        found = {
            f"points a snapshot, {q:.0%} quantile": float(np.quantile(self.points, q))
            for q in (0.05, 0.25, 0.5, 0.75, 0.95)
        }
        found["pixels without depth, mean, %"] = 100 * float(1 - share.mean())
        found["pixels without depth, standard deviation, %"] = 100 * float(share.std())
        depth, sigma = np.concatenate(self.sigma, axis=1)
        for low, high in RANGES:
            inside = (depth >= low) & (depth < high)
            name = f"noise of flat patches at {low} to {high} m"
            found[f"{name}, median, mm"] = 1000 * float(np.median(sigma[inside]))
        found["noise / depth^2, median, mm/m2"] = 1000 * float(np.median(sigma / depth**2))
        found["pixels at depth edges, %"] = (
            100 * self.edge_pixels / sum((self.edge_pixels, self.inner_pixels))
        )
        found["holes at depth edges, %"] = 100 * self.edge_holes / self.edge_pixels
        found["flying pixels at depth edges, %"] = 100 * self.edge_flying / self.edge_pixels
        found["holes between pixels of one surface, %"] = 100 * self.inner_holes / self.inner_pixels
        return found


def _patches(depth_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (2, n) depth and residual of the patches without holes, by planes in 1 / depth."""
    rows, columns = (size // PATCH * PATCH for size in depth_m.shape)
    patches = depth_m[:rows, :columns].reshape(rows // PATCH, PATCH, columns // PATCH, PATCH)
    patches = patches.transpose(0, 2, 1, 3).reshape(-1, PATCH**2)
    patches = patches[(patches > 0).all(axis=1)]
    v, u = np.mgrid[:PATCH, :PATCH] - PATCH // 2
    A = np.column_stack((u.ravel(), v.ravel(), np.ones(PATCH**2)))
    plane = np.linalg.lstsq(A, (1 / patches).T, rcond=None)[0]
    residual = 1 / patches - (A @ plane).T
    depth = 1 / plane[2]
    sigma = np.sqrt((residual**2).sum(axis=1) / (PATCH**2 - 3)) * depth**2
    flat = sigma < 0.01 * depth**2  # else an edge runs through it
    return np.array((depth[flat], sigma[flat]))


def real_images(folder: Path, every: int) -> tuple[list[NDArray[np.float64]], Views]:
    """Return the depth images, metres, and their poses in the frame of gravity."""
    poses = np.loadtxt(folder / "trajectory_gravity_tum.txt")[::every]
    paths = sorted((folder / "frames").glob("*.depth.png"))[::every]
    images = []
    for path in paths:
        image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED).astype(float) / 1000
        # the range of the simulated sensor, for both
        image[(image < KINECT.depth_min_m) | (image > KINECT.depth_max_m)] = 0
        images.append(image)
    camera = poses[:, [7, 4, 5, 6]]
    # camera: y down, z forward; device: y up, z back
    rotations = product(camera, np.broadcast_to(about("x", np.pi), camera.shape))
    rates = np.full(len(poses), 0.0)
    return images, Views(poses[:, 1:4], rotations, rates)


def simulated_images(scene: Scene, views: Views, seed: int) -> list[NDArray[np.float64]]:
    """Return the depth images a simulated Kinect takes from the same poses, metres."""
    rng = np.random.default_rng(seed)
    images = []
    for index in range(len(views)):
        seen = capture(scene, views[index : index + 1], KINECT, rng).points.astype(float)
        depth = -seen[:, 2]
        column = np.rint(seen[:, 0] / depth * KINECT.focal_px + (KINECT.columns - 1) / 2)
        row = np.rint((KINECT.rows - 1) / 2 - seen[:, 1] / depth * KINECT.focal_px)
        image = np.zeros((KINECT.rows, KINECT.columns))
        image[row.astype(int), column.astype(int)] = depth
        images.append(image)
    return images


def kitchen(truth: dict, seed: int) -> Plan:
    """Return the furnished room of the sequence, as far as it was read off, and things on top."""
    rng = np.random.default_rng(seed)
    west, south, east, north, high = -2.6, -1.5, 1.97, 3.45, 2.6
    ring = [(west, south), (east, south), (east, north), (west, north), (west, south)]
    walls = [
        PlanWall(f"w{i}", LineString(ring[i : i + 2]), 0.02, 0.0, high, ("r",)) for i in range(4)
    ]
    (table,) = truth["tables"]
    board = affinity.rotate(_rectangle(table["center"], table["size"]), 4)
    tops = [(board, table["z"]), (box(-2.07, 2.8, -0.2, north), 0.9), (box(west, 1, -2, 2.75), 0.9)]
    pieces = [PlanFurniture("table", board, "table", 0.0, table["z"], "r")]
    pieces += [
        PlanFurniture(f"worktop{i}", shape, "cabinet", 0.0, top, "r")
        for i, (shape, top) in enumerate(tops[1:])
    ]
    for chair in truth["chairs"]:
        x, y = chair["back_center"]
        middle = (x, y + 0.2 * np.sign(table["center"][1] - y))
        seat = _rectangle(middle, (0.45, 0.45))
        pieces.append(PlanFurniture(chair["id"], seat, "chair", 0.0, 0.85, "r"))
    while len(pieces) < THINGS + 8:
        shape, top = tops[rng.integers(len(tops))]
        low, far = np.split(np.array(shape.bounds), 2)
        thing = _rectangle(rng.uniform(low, far), rng.uniform(0.06, 0.25, 2))
        if shape.contains(thing):
            tall = top + rng.uniform(0.05, 0.35)
            pieces.append(PlanFurniture(f"thing{len(pieces)}", thing, "other", top, tall, "r"))
    room = PlanRoom("r", Polygon(ring), floor_m=0.0, ceiling_m=high)
    return Plan("kitchen", "0", (room,), tuple(walls), furniture=tuple(pieces), simulated=True)


def _rectangle(middle: NDArray | list | tuple, size: NDArray | list | tuple) -> Polygon:
    (x, y), (w, d) = middle, size
    return box(x - w / 2, y - d / 2, x + w / 2, y + d / 2)


def compare(folder: Path, every: int) -> Table:
    """Return the figures of both, and by how much the simulated ones differ."""
    images, views = real_images(folder, every)
    scene = Scene(storey_mesh(kitchen(json.loads((folder / "truth.json").read_text()), 0)))
    real, simulated = Figures(), Figures()
    for image in images:
        real.add(image)
    for image in simulated_images(scene, views, 0):
        simulated.add(image)
    ours = simulated.rows()
    rows = [
        {"what": what, "real": value, "simulated": ours[what], "difference": ours[what] / value - 1}
        for what, value in real.rows().items()
    ]
    return Table(f"Depth images: a real Kinect, and simulated ({len(images)} each)", COLUMNS, rows)


def campaign(scans: int, folder: Path | None) -> str:
    """Simulate a campaign on two storeys; return what it cost."""
    plans = tuple(preset(name) for name in PRESETS)
    start, points, snapshots, stored = time.perf_counter(), 0, 0, 0
    for plan, share in zip(plans, shares(scans, plans), strict=True):
        for scan in simulate_scans(plan, CampaignParams(scans=share)):
            points += len(scan.cloud)
            snapshots += len(scan.snapshots)
            if folder is not None:
                bundle = folder / f"{plan.building}-{scan.name}.scan"
                write_bundle(bundle, scan.cloud, scan.snapshots, frame="device")
                stored += sum(path.stat().st_size for path in bundle.iterdir())
                shutil.rmtree(bundle)
    seconds = time.perf_counter() - start
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    kept = f", {stored / 1e9:.2f} GB as bundles" if folder is not None else ""
    return (
        f"{scans} scans, {snapshots:,} snapshots, {points:,} points: {points * 12 / 1e9:.2f} GB at "
        f"12 bytes{kept}; {seconds:.0f} s, {points / seconds / 1e6:.2f} million points a second, "
        f"peak {peak:.2f} GB"
    )


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--data", type=Path, default=DATA, help="folder of the real data")
    parser.add_argument("--every", type=int, default=5, help="take every n-th depth image")
    parser.add_argument("--campaign", type=int, metavar="SCANS", help="time a campaign instead")
    parser.add_argument("--write", type=Path, metavar="DIR", help="write its bundles, one by one")
    given = parser.parse_args()
    if given.campaign is not None:
        print(campaign(given.campaign, given.write))
    elif (folder := given.data / SEQUENCE).is_dir():
        print(compare(folder, given.every).text())
    else:
        print(f"{folder} is not there: nothing to compare with.")


if __name__ == "__main__":
    main()
