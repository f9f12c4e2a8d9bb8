"""Up axis and unit, where the cloud makes them certain.

A wrong guess is worse than none, so each needs evidence that no indoor scan of the usual axes and
unit shows. Ranges are quantiles: a few points seen through windows lie hundreds of metres away.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

UNITS = {"centimetres": 0.01, "millimetres": 0.001}
STOREY = (1.2, 12.0)
"""Heights one storey's scan may have, metres; they span less than a factor of ten up to their
end, so that at most one of centimetres and millimetres fits."""
TOO_HIGH = 120.0
"""No storey is so high: the coordinates cannot be metres."""
FOOTPRINT = (1.5, 500.0)
"""Extents along the ground one storey's scan may have, metres."""

ROOM_HEIGHT = (1.8, 12.0)
"""Heights between floor and ceiling that tell up from sideways, metres: a corridor may be less
wide."""
GROUND = 4.0
"""Least extent along the ground that tells up from sideways, metres: few corridors are as high."""

_BULK = (0.02, 0.98)
_MOST = (0.1, 0.9)
_BINS = 100
_END = 15  # bins at either end in which floor and ceiling are looked for
_FLATTER = 1.3  # the least extent is the height only if the others exceed it by this factor
_STRONGER = 3.0  # floor and ceiling must outweigh walls along other axes by this factor
_FILLED = 0.1  # share of the height that half of the points span at least, unless they trail off
_SURFACE = 6.0  # mean bins; the weight of a floor or a ceiling in three neighbouring bins


@dataclass(frozen=True)
class Guess:
    """An up axis or a scale, whether it was guessed, and what a person should know."""

    value: str | float
    guessed: bool
    note: str = ""


def guess_up(sample: NDArray[np.float64]) -> Guess:
    """Return "y" if the cloud is certainly y up, else "z".

    Parameters
    ----------
    sample : (m, 3) float
        Finite points spread over the cloud, file axes and unit.

    Notes
    -----
    The vertical axis is the one along which two horizontal surfaces, floor and ceiling, stand at
    the ends. Walls along an axis look alike, hence y counts only if it is the shortest axis and
    its surfaces outweigh those of x and z threefold: a corridor's walls hardly do.
    """
    low, high = np.quantile(sample, _BULK, axis=0)
    extent = high - low
    ends = [_surfaces(sample[:, axis]) for axis in range(3)]
    others = max(min(ends[0]), min(ends[2]))
    ground = min(extent[0], extent[2])
    flat = ground >= _FLATTER * extent[1] and _is_room(extent[1], ground)
    if not flat or min(ends[1]) < _SURFACE or min(ends[1]) < min(ends[2]):
        return Guess("z", False)
    if min(ends[1]) >= _STRONGER * others:
        return Guess(
            "y",
            True,
            f"Up axis guessed: y, as floor and ceiling stand {extent[1]:.4g} units apart along y, "
            "the shortest axis, and no surface as large stands across x or z.",
        )
    return Guess("z", False, "Up axis taken as z, but it may be y: set 'up' if it is.")


def guess_scale(sample: NDArray[np.float64]) -> Guess:
    """Return the metres per unit if the cloud certainly is in centimetres or millimetres, else 1.

    Parameters
    ----------
    sample : (m, 3) float
        Finite points spread over the cloud, z up, file unit.
    """
    low, high = np.quantile(sample, _BULK, axis=0)
    height = high[2] - low[2]
    if height < TOO_HIGH:
        return Guess(1.0, False)
    for unit, scale in UNITS.items():
        ground = scale * max(high[0] - low[0], high[1] - low[1])
        fits = STOREY[0] <= scale * height < STOREY[1] and FOOTPRINT[0] <= ground <= FOOTPRINT[1]
        if fits and _is_one_storey(sample[:, 2], unit):
            return Guess(
                scale,
                True,
                f"Unit guessed: {unit}, as the cloud is {height:.4g} units high and no storey "
                f"has {height:.4g} m.",
            )
    if np.diff(np.quantile(sample[:, 2], _MOST)) < TOO_HIGH:  # only some far points are high
        return Guess(1.0, False)
    return Guess(
        1.0,
        False,
        f"Unit taken as metres although the cloud is {height:.4g} units high: set 'scale'.",
    )


def _is_room(height: float, ground: float) -> bool:
    """Return whether some unit makes the extents those of a room."""
    scales = (1.0, *UNITS.values())
    fits = [ROOM_HEIGHT[0] <= s * height < ROOM_HEIGHT[1] and s * ground >= GROUND for s in scales]
    return any(fits)


def _is_one_storey(heights: NDArray[np.float64], unit: str) -> bool:
    """Return whether the heights are those of one storey: no slabs within, and a clear extent.

    The extent is clear between a floor and a ceiling; in millimetres, where metres would be a
    cloud of a kilometre and more, an evenly filled range of heights will do.
    """
    weights = _histogram(heights)
    between = weights[2 * _END : -2 * _END]
    slabs = between > max(_SURFACE, weights.max() / 2)
    if slabs.sum() >= 2:  # floors of several storeys: then the unit may be ten times larger
        return False
    low, quarter, most, high = np.quantile(heights, (_BULK[0], 0.25, 0.75, _BULK[1]))
    filled = most - quarter >= _FILLED * (high - low)
    return min(_surfaces(heights)) >= _SURFACE or bool(unit == "millimetres" and filled)


def _surfaces(values: NDArray[np.float64]) -> tuple[float, float]:
    """Return the weights of the strongest surfaces at both ends, in mean bins.

    Noise and a slight tilt spread a surface over neighbouring bins; what lies between surfaces
    fills all of them and is subtracted.
    """
    weights = _histogram(values)
    weights = np.convolve(weights - np.median(weights), np.ones(3), "same")
    return float(weights[:_END].max()), float(weights[-_END:].max())


def _histogram(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the points per bin over the bulk of the values and a tenth beyond, mean 1."""
    low, high = np.quantile(values, _BULK)
    margin = 0.05 * (high - low)
    if margin <= 0:
        return np.ones(_BINS)
    counts, _ = np.histogram(values, _BINS, (low - margin, high + margin))
    return counts * (_BINS / max(counts.sum(), 1))
