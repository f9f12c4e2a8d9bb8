"""A simulated depth sensor: rays of a pinhole cast into the mesh of a storey.

Modelled on the Tango tablet of Sec. 7.1, a structured-light sensor: an infrared projector beside
the camera, so that nearer things throw a shadow in which nothing is measured.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PositiveFloat, PositiveInt

from tasks.params import Params
from tasks.simulation.materials import GLASS, MATT
from tasks.simulation.mesh import Mesh
from tasks.simulation.noise import Depths, NoiseParams, measured, mixed, returned
from tasks.simulation.rotations import Quaternions, matrices, turned

RAYS = 300_000
"""Rays cast together: some 100 MB with all that is computed of them, and work for all cores."""
SKIN = 0.01
"""Share of the way to the projector in which a point's own surface throws no shadow on it."""


class SensorParams(Params):
    """A depth sensor like a Tango tablet's, held upright."""

    columns: PositiveInt = 180
    """Pixels across the device, along its x (Tango tablet: 320 x 180 depth images)."""
    rows: PositiveInt = 320
    """Pixels along its long edge, its y."""
    focal_px: PositiveFloat = 260.0
    """Focal length, pixels: a view of 63 by 38 degrees. Assumption, of a Kinect's width (58)."""
    rays: PositiveInt = 20_000
    """Pixels a snapshot keeps, drawn at random: the point limit of a frame. Assumption; 105 scans
    of 3 GB (Sec. 7.1) are 2.4 million points a scan, and `alpha_p` (Sec. 3.2) is 5000."""
    depth_min_m: PositiveFloat = 0.5
    """Least depth seen, metres (Sec. 3.2.1: "between half a meter to four meters")."""
    depth_max_m: PositiveFloat = 4.0
    """Greatest depth seen, metres (Sec. 3.2.1)."""
    baseline_m: float = Field(default=0.075, ge=0)
    """From the camera to the projector, metres along the device's x: 7.5 cm in a Kinect
    (Khoshelham and Oude Elberink 2012). Assumed for Tango."""
    glass_return: float = Field(default=0.05, ge=0, le=1)
    """Share of rays that a pane itself returns. Assumption: "hardly", says Sec. 3.2.1."""
    glass_through: float = Field(default=0.25, ge=0, le=1)
    """Share of the other rays that come back from behind the pane. Assumption."""
    noise: NoiseParams = NoiseParams()
    """What becomes of a depth."""


@dataclass(frozen=True, eq=False)
class Views:
    """k true poses of the device and how fast it turned at each."""

    positions: NDArray[np.float64]
    """(k, 3), metres, building frame"""
    rotations: Quaternions
    """(k, 4), device frame -> building frame; the camera looks along the device's -z"""
    rates: NDArray[np.float64]
    """(k,), radians a second"""

    def __len__(self) -> int:
        return len(self.positions)

    def __getitem__(self, part: slice) -> "Views":
        return Views(self.positions[part], self.rotations[part], self.rates[part])


@dataclass(frozen=True, eq=False)
class Returns:
    """n points that k snapshots saw, in the order of the snapshots."""

    points: NDArray[np.float32]
    """(n, 3), metres, device frame of the point's snapshot"""
    snapshot: NDArray[np.int32]
    """(n,), index of the snapshot"""


@dataclass(frozen=True, eq=False)
class Hits:
    """What n rays met first."""

    depths: Depths
    """(n,), lengths of the ray's direction; inf where nothing is hit"""
    incidence: NDArray[np.float64]
    """(n,), angle between ray and surface normal, radians"""
    materials: NDArray[np.uint8]
    """(n,), indices of `MATERIALS`"""


class Scene:
    """A mesh made ready for ray casting, with its glass and without."""

    def __init__(self, mesh: Mesh, threads: int = 0) -> None:
        """Take a mesh; `threads` cast rays, 0 = as many as there are cores."""
        open3d = load_open3d()
        self._threads = threads
        self._tensor = open3d.core.Tensor
        self._scenes = []
        self._materials = []
        for kept in (np.ones(len(mesh.triangles), bool), mesh.materials != GLASS):
            scene = open3d.t.geometry.RaycastingScene()
            if kept.any():
                triangles = np.ascontiguousarray(mesh.triangles[kept])
                scene.add_triangles(self._tensor(mesh.vertices), self._tensor(triangles))
            self._scenes.append(scene)
            self._materials.append(np.append(mesh.materials[kept], np.uint8(MATT)))

    def cast(
        self,
        origins: NDArray[np.float64],
        directions: NDArray[np.float64],
        through_glass: bool = False,
    ) -> Hits:
        """Return what n rays meet; glass is none of it for rays that go through."""
        rays = self._rays(origins, directions)
        if not len(rays):
            return Hits(np.empty(0), np.empty(0), np.empty(0, np.uint8))
        found = self._scenes[through_glass].cast_rays(self._tensor(rays), nthreads=self._threads)
        normals = found["primitive_normals"].numpy().astype(np.float64)
        along = np.abs(np.einsum("ni,ni->n", normals, directions))
        lengths = np.sqrt(np.einsum("ni,ni->n", directions, directions))
        ids = found["primitive_ids"].numpy()
        materials = self._materials[through_glass]
        return Hits(
            found["t_hit"].numpy().astype(np.float64),
            np.arccos(np.clip(along / lengths, 0, 1)),
            # rays that hit nothing have an id past every triangle: the last code, matt
            materials[np.minimum(ids, len(materials) - 1)],
        )

    def distances(
        self, origins: NDArray[np.float64], directions: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the (n,) distances at which n rays of unit direction hit, inf where none does."""
        return self.cast(origins, directions).depths

    def lit(self, points: NDArray[np.float64], lamps: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which of n points nothing but glass hides from their lamp, both (n, 3)."""
        rays = self._rays(points, lamps - points)
        if not len(rays):
            return np.empty(0, bool)
        hidden = self._scenes[1].test_occlusions(
            self._tensor(rays), tnear=SKIN, tfar=1.0, nthreads=self._threads
        )
        seen: NDArray[np.bool_] = ~hidden.numpy()
        return seen

    def _rays(
        self, origins: NDArray[np.float64], directions: NDArray[np.float64]
    ) -> NDArray[np.float32]:
        return np.concatenate((origins, directions), axis=1, dtype=np.float32)


def capture(scene: Scene, views: Views, params: SensorParams, rng: np.random.Generator) -> Returns:
    """Return what the sensor sees from k poses."""
    step = max(1, RAYS // _rays_a_snapshot(params))
    parts = [
        _batch(scene, views[start : start + step], start, params, rng)
        for start in range(0, len(views), step)
    ]
    return Returns(
        np.concatenate([np.empty((0, 3), np.float32)] + [part.points for part in parts]),
        np.concatenate([np.empty(0, np.int32)] + [part.snapshot for part in parts]),
    )


def _batch(
    scene: Scene, views: Views, first: int, params: SensorParams, rng: np.random.Generator
) -> Returns:
    """Return what the sensor sees from a few poses, numbered from `first`."""
    of, pixels = _drawn_pixels(len(views), params, rng)
    turns = matrices(views.rotations)
    hits = _hits(scene, views.positions, turns, of, pixels, params, rng)
    seen = (hits.depths >= params.depth_min_m) & (hits.depths <= params.depth_max_m)
    luck = _luck_of_windows(of, pixels, params, rng)
    seen &= returned(hits.incidence, hits.materials, views.rates[of], luck, params.noise)
    depths, of, rays = hits.depths[seen], of[seen], _rays_of(pixels[seen], params)
    there = views.positions[of] + turned(turns, of, depths[:, None] * rays)
    lamps = views.positions + params.baseline_m * turns[:, :, 0]
    lit = scene.lit(there, lamps[of])
    depths = measured(depths[lit], params.noise, rng)
    points = (depths[:, None] * rays[lit]).astype(np.float32)
    return Returns(points, of[lit] + np.int32(first))


def _hits(
    scene: Scene,
    positions: NDArray[np.float64],
    turns: NDArray[np.float64],
    of: NDArray[np.int32],
    pixels: NDArray[np.float64],
    params: SensorParams,
    rng: np.random.Generator,
) -> Hits:
    """Return what the pixels of the snapshots `of` see."""

    def looked(rows: NDArray[np.int64], offsets: NDArray[np.float64]) -> Hits:
        rays = turned(turns, of[rows], _rays_of(pixels[rows] + offsets, params))
        return _behind_glass(scene, positions[of[rows]], rays, params, rng)

    noise = params.noise
    # a depth is measured a little beside the pixel it is reported for
    offsets = rng.normal(0, noise.jitter_px, pixels.shape)
    mixing = np.flatnonzero(rng.random(len(of)) < noise.mixing)
    apart = rng.uniform(-noise.window_px, noise.window_px, (len(mixing), 2))
    weights = rng.random(len(mixing))
    # two places whose mean by these weights is the pixel's
    offsets[mixing] -= weights[:, None] * apart
    hits = looked(np.arange(len(of)), offsets)
    other = looked(mixing, offsets[mixing] + apart).depths
    both = np.isfinite(hits.depths[mixing]) & np.isfinite(other)
    mixing = mixing[both]
    hits.depths[mixing] = mixed(hits.depths[mixing], other[both], weights[both])
    return hits


def _behind_glass(
    scene: Scene,
    origins: NDArray[np.float64],
    directions: NDArray[np.float64],
    params: SensorParams,
    rng: np.random.Generator,
) -> Hits:
    """Return what n rays meet; at glass most meet nothing, some what lies behind."""
    hits = scene.cast(origins, directions)
    panes = np.flatnonzero(hits.materials == GLASS)
    panes = panes[rng.random(len(panes)) >= params.glass_return]
    hits.depths[panes] = np.inf
    through = panes[rng.random(len(panes)) < params.glass_through]
    behind = scene.cast(origins[through], directions[through], through_glass=True)
    hits.depths[through] = behind.depths
    hits.incidence[through] = behind.incidence
    hits.materials[through] = behind.materials
    return hits


def _drawn_pixels(
    k: int, params: SensorParams, rng: np.random.Generator
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Return the snapshot and the (m, 2) column and row of the pixels that k snapshots keep."""
    n, total = _rays_a_snapshot(params), params.columns * params.rows
    drawn = [np.sort(rng.choice(total, n, replace=False)) for _ in range(k)]
    row, column = np.divmod(np.concatenate([np.empty(0, np.int64), *drawn]), params.columns)
    return np.repeat(np.arange(k, dtype=np.int32), n), np.column_stack((column, row)).astype(float)


def _luck_of_windows(
    of: NDArray[np.int32],
    pixels: NDArray[np.float64],
    params: SensorParams,
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    """Return (n,) numbers even over 0 to 1, the same for all pixels of a window of a snapshot."""
    side = 2 * params.noise.window_px + 1
    column, row = (pixels // side).astype(np.int64).T
    width, height = int(params.columns // side) + 1, int(params.rows // side) + 1
    drawn = rng.random((int(of.max(initial=-1)) + 1, height, width))
    return drawn[of, row, column]


def _rays_a_snapshot(params: SensorParams) -> int:
    return min(params.rays, params.columns * params.rows)


def _rays_of(pixels: NDArray[np.float64], params: SensorParams) -> NDArray[np.float64]:
    """Return the (m, 3) directions of pixels in the device frame, of depth 1; row 0 is on top."""
    x = (pixels[:, 0] + 0.5 - params.columns / 2) / params.focal_px
    y = (params.rows / 2 - pixels[:, 1] - 0.5) / params.focal_px
    return np.column_stack((x, y, np.full(len(pixels), -1.0)))


def load_open3d() -> Any:
    """Return the module open3d, with libusb from its package where the system has none."""
    try:
        import open3d
    except ImportError:
        import ctypes

        import libusb_package

        ctypes.CDLL(str(libusb_package.get_library_path()), mode=ctypes.RTLD_GLOBAL)
        import open3d
    return open3d
