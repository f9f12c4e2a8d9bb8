"""A simulated depth sensor: rays of a frustum cast into the mesh of a storey."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PositiveFloat, PositiveInt

from tasks.params import Params
from tasks.simulation.mesh import Mesh
from tasks.simulation.rotations import Quaternions, matrices


class SensorParams(Params):
    """A depth sensor like that of a Tango device, held upright. Assumptions unless sourced."""

    fov_along_rad: float = Field(default=np.deg2rad(60), gt=0, lt=np.pi)
    """Opening angle along the device's long edge (its y), radians."""
    fov_across_rad: float = Field(default=np.deg2rad(45), gt=0, lt=np.pi)
    """Opening angle across it (its x), radians."""
    pixels_along: PositiveInt = 320
    """Pixels along the long edge."""
    pixels_across: PositiveInt = 180
    """Pixels across it."""
    rays: PositiveInt = 7500
    """Pixels a snapshot keeps, drawn at random; `alpha_p` (Sec. 3.2) asks for over 5000 points."""
    range_min_m: PositiveFloat = 0.5
    """Nearest distance seen, metres (Sec. 2: "between half a meter to four meters")."""
    range_max_m: PositiveFloat = 4.0
    """Farthest distance seen, metres (Sec. 2)."""
    noise_m: float = Field(default=0.0022, ge=0)
    """Noise at no distance, metres (standard deviation along the ray)."""
    noise_per_m: float = Field(default=0.0008, ge=0)
    """Growth of the noise with the squared distance, 1/m: 3 mm at 1 m, 15 mm at 4 m."""

    def sigma(self, distance_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the noise's standard deviation at (...) distances, metres."""
        return self.noise_m + self.noise_per_m * distance_m**2


@dataclass(frozen=True, eq=False)
class Returns:
    """n points that k snapshots saw, in the order of the snapshots."""

    points: NDArray[np.float64]
    """(n, 3), metres, building frame"""
    snapshot: NDArray[np.int32]
    """(n,), index of the snapshot"""


class Scene:
    """A mesh made ready for ray casting."""

    def __init__(self, mesh: Mesh) -> None:
        open3d = load_open3d()
        self._tensor = open3d.core.Tensor
        self._scene = open3d.t.geometry.RaycastingScene()
        if len(mesh.triangles):
            self._scene.add_triangles(self._tensor(mesh.vertices), self._tensor(mesh.triangles))

    def distances(
        self, origins: NDArray[np.float64], directions: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the (n,) distances at which n rays of unit direction hit, inf where none does."""
        rays = np.concatenate((origins, directions), axis=1, dtype=np.float32)
        if not len(rays):
            return np.empty(0)
        return self._scene.cast_rays(self._tensor(rays))["t_hit"].numpy().astype(np.float64)


def capture(
    scene: Scene,
    positions: NDArray[np.float64],
    rotations: Quaternions,
    params: SensorParams,
    rng: np.random.Generator,
) -> Returns:
    """Return what the sensor sees from k poses.

    Parameters
    ----------
    positions : (k, 3) float
        Where the sensor is, metres, building frame.
    rotations : (k, 4) float
        Unit quaternions, device frame -> building frame; the camera looks along -z.
    """
    k, n = len(positions), min(params.rays, params.pixels_along * params.pixels_across)
    device_rays = _pixel_rays(params)
    pixels = [np.sort(rng.choice(len(device_rays), n, replace=False)) for _ in range(k)]
    turned = [device_rays[p] @ R.T for p, R in zip(pixels, matrices(rotations), strict=True)]
    directions = np.concatenate([np.empty((0, 3)), *turned])
    snapshot = np.repeat(np.arange(k, dtype=np.int32), n)
    distances = scene.distances(positions[snapshot], directions)
    seen = (distances >= params.range_min_m) & (distances <= params.range_max_m)
    directions, snapshot, distances = directions[seen], snapshot[seen], distances[seen]
    measured = distances + rng.normal(size=len(distances)) * params.sigma(distances)
    return Returns(positions[snapshot] + measured[:, None] * directions, snapshot)


def _pixel_rays(params: SensorParams) -> NDArray[np.float64]:
    """Return the (pixels, 3) unit directions of all pixels in the device frame."""
    y = _centres(params.pixels_along) * np.tan(params.fov_along_rad / 2)
    x = _centres(params.pixels_across) * np.tan(params.fov_across_rad / 2)
    grid_y, grid_x = np.meshgrid(y, x, indexing="ij")
    rays = np.column_stack((grid_x.ravel(), grid_y.ravel(), np.full(grid_x.size, -1.0)))
    return rays / np.linalg.norm(rays, axis=1, keepdims=True)


def _centres(n: int) -> NDArray[np.float64]:
    """Return the centres of n pixels over (-1, 1)."""
    return (np.arange(n) + 0.5) * 2 / n - 1


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
