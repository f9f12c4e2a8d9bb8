"""Two fixed storeys that stand for the paper's two floors. Simulated: no real building."""

import numpy as np

from storage.plan import Plan
from tasks.simulation.layouts.double_loaded import DoubleLoadedParams
from tasks.simulation.layouts.ring import RingParams
from tasks.simulation.plan import StoreyParams, make_storey

RING_SIDES_M = (4.77, 19.46, 4.91, 21.86, 4.91, 19.46, 4.88, 21.86)
"""The reference lines around the corridor of the storey the authors' group published."""

PRESETS = {
    "ring": StoreyParams(
        seed=4,
        layout="ring",
        yaw_rad=float(np.deg2rad(12)),
        ring=RingParams(
            sides_m=RING_SIDES_M,
            rows=(
                ("office",),
                ("executives",),
                ("small_office", "small_office"),
                ("office", "double_office", "office", "kitchen"),
                ("office",),
                ("office", "small_office", "double_office", "office"),
                ("small_office", "storage"),
                ("seminar", "small_office", "office", "office"),
            ),
        ),
    ),
    "wing": StoreyParams(
        seed=2,
        layout="double_loaded",
        yaw_rad=float(np.deg2rad(-7)),
        double_loaded=DoubleLoadedParams(
            modules=20,
            rows=(
                (
                    *("stairs", "office", "small_office", "double_office", "office", "wc", "wc"),
                    *("small_office", "office", "small_office", "seminar"),
                ),
                ("kitchen", "executives", "office", "storage", "lab", "office", "office"),
            ),
            cut_outs=1,
        ),
    ),
}
"""`ring`: the photogrammetrists' storey around a ring corridor, its reference lines as published,
with both of Table 1's rules; `wing`: the computer scientists' second floor, with overlapped rooms
at its lower right (Sec. 7.4), where the paper's grammar saw a single room. Which rooms lie where is
published of neither: assumed."""


def preset(name: str, building: str | None = None, storey: str = "1") -> Plan:
    """Return a preset's plan; the building is named after it unless named otherwise."""
    if name not in PRESETS:
        raise KeyError(f"preset '{name}' is unknown; presets are {', '.join(PRESETS)}")
    return make_storey(PRESETS[name], building or name, storey)
