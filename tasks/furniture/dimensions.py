"""Real sizes of tables, chairs and other furniture, metres: facts, each with its source.

The catalogue is one furnisher's (IKEA Saudi Arabia, April 2020), from the table published by
TidyTuesday (rfordatascience/tidytuesday, data/2020/2020-11-03/ikea.csv, commit 2c423bac, CC0), its
series but three tenths: quantiles of 87 to 92 chairs (53 of known height; chairs, folding, office
and swivel chairs, no covers, cushions or sets), 66 tables and 19 desks whose plan size is told, 91
cabinets, 247 bookcases and shelves. A chair's height there is its total height.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
CATALOGUE_M: Mapping[str, Mapping[str, tuple[float, ...]]] = {
    "chair": {
        "width": (0.41, 0.47, 0.53, 0.68, 0.69),
        "depth": (0.38, 0.50, 0.58, 0.67, 0.69),
        "top": (0.76, 0.81, 0.84, 0.96, 1.07),
    },
    "table": {
        "width": (1.10, 1.20, 1.48, 1.50, 2.00),
        "depth": (0.60, 0.60, 0.75, 0.75, 0.90),
        "top": (0.71, 0.73, 0.74, 0.74, 0.75),
    },
    "desk": {
        "width": (0.73, 1.10, 1.20, 1.55, 1.60),
        "depth": (0.40, 0.50, 0.70, 0.74, 0.80),
        "top": (0.73, 0.74, 0.74, 0.75, 0.76),
    },
    "cabinet": {
        "width": (0.35, 0.60, 0.96, 1.60, 2.83),
        "depth": (0.30, 0.35, 0.42, 0.47, 0.48),
        "top": (0.35, 0.93, 1.34, 1.97, 2.14),
    },
    "shelf": {
        "width": (0.29, 0.65, 0.89, 1.74, 2.59),
        "depth": (0.25, 0.30, 0.37, 0.50, 0.51),
        "top": (0.15, 0.77, 1.50, 1.90, 2.26),
    },
}
"""Sizes at QUANTILES, by kind and measure."""
SEAT_M = (0.40, 0.48)
"""Lowest and highest seat: the usual range; catalogues tell total heights. Assumption."""
TABLES_M: NDArray[np.float64] = np.array(
    [
        *((length, depth) for depth in (0.8, 0.6) for length in (1.2, 1.4, 1.6, 1.8)),
        (2.0, 0.8),
        (1.2, 0.7),
        (1.4, 0.7),
        (1.5, 0.75),
        (1.8, 0.75),
        (0.8, 0.8),
        (0.7, 0.7),
    ]
)
"""(k, 2), length and depth of usual tables: desks of EN 527-1 (1200 to 2000 mm in steps of 200, 600
or 800 mm deep), the catalogue's commonest, seminar tables, laboratory benches and square tables.
The last three kinds are assumptions."""


SHALLOW_M = 0.47
"""Depth up to which a piece is an office cabinet or a shelf, metres; deeper ones are cupboards."""
CABINETS_M, CUPBOARDS_M = (0.8, 1.0, 1.2), (0.6, 0.7)
"""Usual widths: of office cabinets and shelves (800, 1000 and 1200 mm), of kitchen cupboards (600
mm, EN 1116) and washstands. The last is an assumption."""


def widths_m(depth_m: float) -> tuple[float, ...]:
    """Return the usual widths of cabinets, shelves or cupboards of a depth, metres."""
    return CABINETS_M if depth_m <= SHALLOW_M else CUPBOARDS_M


def draw_m(kind: str, measure: str, rng: np.random.Generator, n: int) -> NDArray[np.float64]:
    """Return n sizes drawn from the quantiles of a kind's measure, metres."""
    shares = rng.uniform(QUANTILES[0], QUANTILES[-1], n)
    drawn: NDArray[np.float64] = np.interp(shares, QUANTILES, CATALOGUE_M[kind][measure])
    return drawn
