"""The facade module that a building's rooms are multiples of."""

import numpy as np
from numpy.typing import NDArray

from grammars.generator.params import LearnParams
from grammars.model import Module

STEP_M = 0.001
"""Modules are tried to the millimetre, then fitted."""
BEYOND = 0.1
"""Share of rooms that may be off: at corners, and where stairs and shafts break the grid."""


def find_module(widths_m: NDArray[np.float64], params: LearnParams) -> Module | None:
    """Return the greatest module that nine in ten rooms are multiples of, or None.

    A module m fits if the spread about its multiples, estimated from the 90 % of rooms that are
    nearest to one, is at most `module_spread_max` of m. m is then fitted by least squares to those
    rooms, w = k m, and its spread is at least `spread_floor_m`.
    """
    if len(widths_m) < params.module_rooms_min:
        return None
    modules = np.arange(params.module_max_m, params.module_min_m - STEP_M / 2, -STEP_M)
    kept = int(np.ceil((1 - BEYOND) * len(widths_m)))
    off = np.abs(widths_m - _multiples(widths_m, modules[:, None]) * modules[:, None])
    spreads = np.sqrt((np.sort(off, axis=1)[:, :kept] ** 2).mean(axis=1))
    fits = spreads <= params.module_spread_max * modules
    if not fits.any():
        return None
    # the best of the first run of modules that fit
    first = int(np.argmax(fits))
    end = first + int(np.argmin(np.append(fits[first:], False)))
    module = float(modules[first + int(np.argmin((spreads / modules)[first:end]))])
    k = _multiples(widths_m, module)
    near = np.argsort(np.abs(widths_m - k * module), kind="stable")[:kept]
    if len(np.unique(k[near])) < 2:  # rooms all alike show their width, no module
        return None
    module = float(k[near] @ widths_m[near] / (k[near] @ k[near]))
    spread = float(np.sqrt(np.mean((widths_m[near] - k[near] * module) ** 2)))
    return Module(round(module, 4), round(max(spread, params.spread_floor_m), 4))


def _multiples(
    widths_m: NDArray[np.float64], modules: NDArray[np.float64] | float
) -> NDArray[np.float64]:
    return np.maximum(np.rint(widths_m / modules), 1)
