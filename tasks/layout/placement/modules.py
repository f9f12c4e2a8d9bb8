"""Facade modules: what they say of a room's width where no rule does."""

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from grammars.model import Module
from tasks.layout.placement.widths import Chain

ON_MODULE = 0.5
"""Probability that a room no rule explains keeps to the facade's modules. Assumption."""


def with_modules(chain: Chain, module: Module | None) -> Chain:
    """Return a chain in which rooms without a rule are as wide as the nearest modules.

    Only where that is more probable than not: off the modules all widths are alike, on them the
    observed width has the module's spread and its own variance about a multiple.
    """
    if module is None:
        return chain
    width, spread = nearest_modules(
        np.diff(chain.observed_m), np.hypot(chain.sigma_m[1:], chain.sigma_m[:-1]), module
    )
    ruled = ~np.isnan(chain.width_m)
    return Chain(
        chain.observed_m,
        chain.sigma_m,
        np.where(ruled, chain.width_m, width),
        np.where(ruled, chain.spread_m, spread),
    )


def nearest_modules(
    widths_m: NDArray[np.float64], sigma_m: NDArray[np.float64], module: Module
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the multiples of a module that widths keep to, and their spread; NaN for none."""
    multiple = np.maximum(np.rint(widths_m / module.width_m), 1) * module.width_m
    off = norm.pdf(widths_m, multiple, np.hypot(sigma_m, module.spread_m))
    on = ON_MODULE * off > (1 - ON_MODULE) / module.width_m
    return np.where(on, multiple, np.nan), np.where(on, module.spread_m, np.nan)
