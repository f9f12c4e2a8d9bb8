"""Simulated storeys to learn grammars from; no preset is among them, and none is ever scored on."""

from collections.abc import Mapping

import numpy as np

from storage.plan import Plan
from tasks.simulation.furnishing import FurnishingParams
from tasks.simulation.layouts.double_loaded import DoubleLoadedParams
from tasks.simulation.layouts.irregular import IrregularParams
from tasks.simulation.layouts.open_plan import OpenPlanParams
from tasks.simulation.layouts.ring import RingParams
from tasks.simulation.plan import StoreyParams, make_storey

STOREYS = 16
"""Storeys of each kind of building, each a building of its own."""
DEPTHS_M = (4.8, 5.1, 5.4, 5.7)
"""Depths of rooms between centre lines, metres. Assumption."""
CORRIDORS_M = (1.9, 2.1, 2.4)
"""Widths of corridors between centre lines, metres. Assumption."""
INNER_M = (0.1, 0.125, 0.15)
"""Thicknesses of partitions: boards on studs of 50, 75 and 100 mm (DIN 18183)."""
BARE = FurnishingParams(
    workplace_m2=1e3, open_workplace_m2=1e3, cabinet_m2=1e3, clutter_m2=1e3, corridor_m2=1e3
)
"""Hardly any furniture: walls alone teach a grammar, and furnishing takes longer than building."""
FIRST_SEEDS: Mapping[str, int] = {"office": 1000, "institute": 2000}
"""Seed of the first storey of each kind; the rest count on from it."""


def training_storeys(kind: str) -> tuple[Plan, ...]:
    """Return storeys of one kind of building.

    `office`: cellular offices on both sides of a corridor, every third an open-plan office across
    from cells; `institute`: rings, every third storey two wings at an angle.

    Raises
    ------
    KeyError
        If there is no such kind.
    """
    if kind not in FIRST_SEEDS:
        raise KeyError(f"no storeys of kind '{kind}'; kinds are {', '.join(FIRST_SEEDS)}")
    first = FIRST_SEEDS[kind]
    make = {"office": _office, "institute": _institute}[kind]
    return tuple(
        make_storey(make(i, first + i), f"simulated {kind} {i + 1}", "1") for i in range(STOREYS)
    )


def _office(i: int, seed: int) -> StoreyParams:
    rng = np.random.default_rng((seed, 0))
    inner, corridor = float(rng.choice(INNER_M)), float(rng.choice(CORRIDORS_M))
    south, north = (float(d) for d in rng.choice(DEPTHS_M, 2))
    if i % 3 == 2:
        modules = int(rng.integers(12, 20, endpoint=True))
        plan = OpenPlanParams(modules=modules, corridor_m=corridor, depth_m=south)
        return StoreyParams(
            seed=seed, layout="open_plan", inner_m=inner, open_plan=plan, furnishing=BARE
        )
    rows = DoubleLoadedParams(
        modules=int(rng.integers(12, 28, endpoint=True)),
        corridor_m=corridor,
        depth_south_m=south,
        depth_north_m=north,
    )
    return StoreyParams(
        seed=seed, layout="double_loaded", inner_m=inner, double_loaded=rows, furnishing=BARE
    )


def _institute(i: int, seed: int) -> StoreyParams:
    rng = np.random.default_rng((seed, 0))
    inner, corridor = float(rng.choice(INNER_M)), float(rng.choice(CORRIDORS_M))
    depth = float(rng.choice(DEPTHS_M))
    if i % 3 == 2:
        wings = IrregularParams(
            main_modules=int(rng.integers(9, 16, endpoint=True)),
            wing_modules=int(rng.integers(6, 12, endpoint=True)),
            corridor_m=corridor,
            depth_m=depth,
        )
        return StoreyParams(
            seed=seed, layout="irregular", inner_m=inner, irregular=wings, furnishing=BARE
        )
    ring = RingParams(modules_min=8, modules_max=14, corridor_m=corridor, depth_m=depth)
    return StoreyParams(seed=seed, layout="ring", inner_m=inner, ring=ring, furnishing=BARE)
