"""What a structured-light sensor makes of a true depth: noise, quantisation, and no return.

Such a sensor measures disparity, which is linear in 1 / depth: errors that are even in disparity
grow with the squared depth, and two depths it cannot tell apart mix in 1 / depth.
"""

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PositiveFloat

from tasks.params import Params
from tasks.simulation.materials import DARK

Depths = NDArray[np.float64]
"""(n,), metres along the optical axis; inf where nothing is hit"""


class NoiseParams(Params):
    """How far a measured depth is from the true one, and when there is none."""

    disparity_step: float = Field(default=0.00285, ge=0)
    """One step of the measured disparity, as a step of 1 / depth, 1/m: 3 mm at 1 m, 46 mm at 4 m
    (Khoshelham and Oude Elberink 2012: depth resolution 2.85e-5 z^2, centimetres; the values of
    a Kinect's depth images lie just so)."""
    disparity_noise: float = Field(default=1 / 6, ge=0)
    """Random error of the disparity, steps, standard deviation (Barron and Malik 2013, in the noise
    model of the ICL-NUIM benchmark, Handa et al. 2014)."""
    jitter_px: float = Field(default=0.5, ge=0)
    """Error of where in the image a depth is measured, pixels, standard deviation per axis (as
    above; Nguyen et al. 2012 measured 0.8 px at edges)."""
    window_px: float = Field(default=4.0, ge=0)
    """How far the image window a disparity is matched in reaches from its middle, pixels: 9 x 9
    (Bohg et al. 2014, in the same noise model)."""
    mixing: float = Field(default=0.1, ge=0, le=1)
    """Share of pixels that report a mean of two depths of their window: a flying pixel at an edge,
    no change on a plane. Assumption."""
    grazing_rad: float = Field(default=np.deg2rad(70), gt=0, lt=np.pi / 2)
    """Incidence from which returns get fewer, radians: beyond it the noise of Nguyen et al. (2012)
    rises steeply."""
    blind_rad: float = Field(default=np.deg2rad(85), gt=0, lt=np.pi / 2)
    """Incidence from which there is none, radians. Assumption."""
    dark_loss: float = Field(default=0.6, ge=0, le=1)
    """Share of returns lost on dark surfaces. Assumption."""
    blur_rad_s: PositiveFloat = 1.0
    """Turning rate at which blur loses 1 - 1/e of the returns, radians a second ("swift movements
    can negatively contribute", Sec. 3.2.1; the number is an assumption)."""

    def sigma(self, depth_m: Depths) -> Depths:
        """Return the standard deviation of depths measured head on, metres: noise and rounding."""
        steps = np.hypot(self.disparity_noise, 1 / np.sqrt(12))
        return self.disparity_step * steps * np.square(depth_m)


def measured(depths: Depths, params: NoiseParams, rng: np.random.Generator) -> Depths:
    """Return depths as the sensor reports them: with noise, in whole steps of disparity."""
    step = params.disparity_step
    if step == 0:
        return depths
    disparity = 1 / (depths * step) + rng.normal(0, params.disparity_noise, len(depths))
    return 1 / (np.maximum(np.rint(disparity), 1) * step)  # one step from infinity at the farthest


def mixed(first: Depths, second: Depths, weights: NDArray[np.float64]) -> Depths:
    """Return the means of two depths in disparity, by the (n,) weights of the second, 0 to 1.

    The sides of an edge mix into a point between them. Depths of one plane, seen at two places of
    the image, mix into its depth at the places' mean: 1 / depth is linear in the image.
    """
    return 1 / ((1 - weights) / first + weights / second)


def returned(
    incidence_rad: NDArray[np.float64],
    materials: NDArray[np.uint8],
    rate_rad_s: NDArray[np.float64],
    luck: NDArray[np.float64],
    params: NoiseParams,
) -> NDArray[np.bool_]:
    """Return which of n hits come back to the sensor.

    Parameters
    ----------
    incidence_rad : (n,) float
        Angle between ray and surface normal, radians.
    materials : (n,) uint8
        Indices of `MATERIALS`.
    rate_rad_s : (n,) float
        How fast the device turned, radians a second.
    luck : (n,) float
        Even over 0 to 1; hits of one window share it, as they are matched together.
    """
    slope = (params.blind_rad - incidence_rad) / (params.blind_rad - params.grazing_rad)
    chance = np.clip(slope, 0, 1) * np.exp(-np.square(rate_rad_s / params.blur_rad_s))
    chance *= np.where(materials == DARK, 1 - params.dark_loss, 1.0)
    return luck < chance
