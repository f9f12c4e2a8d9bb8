"""How far from the truth a device believes to be: drift, and jumps back where it knows the place.

Motion tracking drifts with the way walked; area learning (Sec. 3.1) recognises the place now and
then and takes most of the drift back at once. What remains all scan long is the error of the
place's own registration, as when the light differs from that of the area description.
"""

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PositiveFloat

from tasks.params import Params
from tasks.simulation.rotations import about, matrices, product
from tasks.simulation.sensor import Views


class DriftParams(Params):
    """Errors of the poses a device reports. Gravity is measured, so only the heading turns."""

    place_m: float = Field(default=0.01, ge=0)
    """Error of a scan's place in the building frame, metres (standard deviation per axis): one to
    two centimetres in all. Assumption."""
    place_rad: float = Field(default=np.deg2rad(0.3), ge=0)
    """Error of a scan's heading, radians (standard deviation). Assumption."""
    walk_m: float = Field(default=0.01, ge=0)
    """Drift of the position over the first metre of way, metres (standard deviation per axis);
    grows with the root of the way. 1.7 % of 1 m, 0.5 % of 10 m: the order of visual-inertial
    odometry. Assumption."""
    walk_rad: float = Field(default=np.deg2rad(0.1), ge=0)
    """Drift of the heading over the first metre of way, radians (standard deviation).
    Assumption."""
    turn_rad: float = Field(default=np.deg2rad(0.05), ge=0)
    """Drift of the heading over the first radian turned, radians (standard deviation).
    Assumption."""
    relocalised_s: PositiveFloat = 15.0
    """Mean time between two recognitions of the place, seconds. Assumption."""
    left: float = Field(default=0.1, ge=0, le=1)
    """Share of the drift that a recognition leaves. Assumption."""


def believed(
    times: NDArray[np.float64], true: Views, params: DriftParams, rng: np.random.Generator
) -> Views:
    """Return the k poses a device reports of its true ones.

    Parameters
    ----------
    times : (k,) float
        Seconds, ascending.
    true : Views
    """
    k = len(true)
    jumps = _jumps(times, params, rng)
    steps = np.linalg.norm(np.diff(true.positions, axis=0, prepend=true.positions[:1]), axis=1)
    turns = true.rates * np.diff(times, prepend=times[:1])
    shift = params.walk_m * np.sqrt(steps)[:, None] * rng.normal(size=(k, 3))
    spread = np.hypot(params.walk_rad * np.sqrt(steps), params.turn_rad * np.sqrt(turns))
    drift = _walked(np.column_stack((shift, spread * rng.normal(size=k))), jumps, params.left)
    place, heading = rng.normal(0, params.place_m, 3), rng.normal(0, params.place_rad)
    start = true.positions[:1]
    turn = matrices(about("z", heading))
    moved = np.einsum("ij,kj->ki", turn, true.positions - start)
    return Views(
        positions=start + moved + place + drift[:, :3],
        rotations=product(about("z", heading + drift[:, 3]), true.rotations),
        rates=true.rates,
    )


def _jumps(
    times: NDArray[np.float64], params: DriftParams, rng: np.random.Generator
) -> NDArray[np.bool_]:
    """Return at which of k times the place is recognised: at any with the same chance a second."""
    waited = np.diff(times, prepend=times[:1])
    jumps: NDArray[np.bool_] = rng.random(len(times)) < -np.expm1(-waited / params.relocalised_s)
    return jumps


def _walked(
    steps: NDArray[np.float64], jumps: NDArray[np.bool_], left: float
) -> NDArray[np.float64]:
    """Return the (k, m) sums of steps, cut to a share at every jump."""
    total = np.zeros(steps.shape[1])
    walked = np.empty_like(steps)
    for i, (step, jump) in enumerate(zip(steps, jumps, strict=True)):
        total = (left * total if jump else total) + step
        walked[i] = total
    return walked
