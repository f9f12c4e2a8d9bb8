"""Simulated storeys to learn from; no preset is among them, and none is ever scored on.

Grammars learn from bare storeys, each of a building's whole length; what tells doors and furniture
apart learns from small furnished ones and their scans.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from storage.plan import Plan
from tasks.simulation.campaign import CampaignParams
from tasks.simulation.furnishing import FurnishingParams
from tasks.simulation.layouts.double_loaded import DoubleLoadedParams
from tasks.simulation.layouts.irregular import IrregularParams
from tasks.simulation.layouts.open_plan import OpenPlanParams
from tasks.simulation.layouts.ring import RingParams
from tasks.simulation.openings import OpeningParams
from tasks.simulation.plan import StoreyParams, make_storey
from tasks.simulation.sensor import SensorParams
from tasks.simulation.volunteers import VolunteerParams

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
FURNISHED_SEED = 3000
"""Seed of the first furnished storey; the rest count on from it."""


@dataclass(frozen=True)
class Kind:
    """How a furnished storey is laid out, how its doors stand, and who scans it."""

    layout: Mapping[str, Any]
    """of `StoreyParams`"""
    states: tuple[float, float, float]
    """shares of doors that are open, ajar and shut. Assumption."""
    sensor: tuple[int, float]
    """pixels a snapshot keeps and seconds between two: a third to a half of Tango's points. Fewer
    are simulated in minutes. Assumption."""
    volunteers: int = 3
    skill: float = 0.7
    """mean of the volunteers'"""


SMALL: Mapping[str, Any] = {"layout": "small"}
USUAL, OFTEN_SHUT, OFTEN_AJAR = (0.45, 0.2, 0.35), (0.25, 0.25, 0.5), (0.35, 0.4, 0.25)
MOSTLY_SHUT = (0.2, 0.15, 0.65)
SPARSE, DENSE, QUICK, SLOW = (12_000, 1.0), (20_000, 0.8), (12_000, 0.7), (9_000, 1.2)


def _rows(modules: int, cut_outs: Literal[0, 1, 2] = 0) -> Mapping[str, Any]:
    rows = DoubleLoadedParams(modules=modules, cut_outs=cut_outs)
    return {"layout": "double_loaded", "double_loaded": rows}


def _open_plan(modules: int) -> Mapping[str, Any]:
    return {"layout": "open_plan", "open_plan": OpenPlanParams(modules=modules)}


def _wings(main_modules: int, wing_modules: int) -> Mapping[str, Any]:
    wings = IrregularParams(main_modules=main_modules, wing_modules=wing_modules)
    return {"layout": "irregular", "irregular": wings}


def _ring(least: int, most: int) -> Mapping[str, Any]:
    return {"layout": "ring", "ring": RingParams(modules_min=least, modules_max=most)}


FURNISHED = (
    Kind(SMALL, USUAL, SPARSE),
    Kind(_rows(8), OFTEN_SHUT, DENSE),
    Kind(_open_plan(10), OFTEN_AJAR, QUICK),
    Kind(_wings(8, 5), USUAL, SPARSE),
    Kind(SMALL, OFTEN_SHUT, DENSE),
    Kind(_rows(9), OFTEN_AJAR, QUICK),
    Kind(_open_plan(11), USUAL, SPARSE),
    Kind(_wings(8, 6), OFTEN_SHUT, DENSE),
    Kind(SMALL, OFTEN_AJAR, QUICK),
    Kind(_rows(10), USUAL, SPARSE),
    # beyond the first ten: more doors that are shut, more volunteers and less skilled ones
    Kind(_ring(6, 6), MOSTLY_SHUT, SPARSE, 6, 0.65),
    Kind(_rows(9, 1), MOSTLY_SHUT, QUICK, 6, 0.75),
    Kind(_wings(9, 5), OFTEN_SHUT, SPARSE, 6, 0.7),
    Kind(SMALL, MOSTLY_SHUT, SLOW, 4, 0.6),
    Kind(_open_plan(12), OFTEN_SHUT, SPARSE, 6, 0.8),
    Kind(_rows(12, 2), MOSTLY_SHUT, SPARSE, 6, 0.7),
    Kind(_ring(6, 7), OFTEN_SHUT, SPARSE, 6, 0.7),
    Kind(_wings(9, 6), MOSTLY_SHUT, SLOW, 6, 0.8),
    Kind(_rows(11), OFTEN_AJAR, SPARSE, 6, 0.6),
    Kind(SMALL, MOSTLY_SHUT, DENSE, 4, 0.7),
    Kind(_rows(13), OFTEN_SHUT, SPARSE, 6, 0.7),
    Kind(_ring(7, 7), MOSTLY_SHUT, SPARSE, 6, 0.7),
)
"""The furnished storeys: 9 to 24 rooms each."""
DOORS_M = ((0.686, 0.811, 0.936), (0.811, 0.936, 1.061), (0.936, 1.061, 1.186))
"""Clear widths of doors, narrow, usual and wide: DIN 18101's leaves from 735 to 1235 mm."""
HEADS_M = (1.968, 2.093)
"""Clear heights of doors: DIN 18101's wall openings of 2000 and 2125 mm less 32 mm of frame."""
BEARING_M = (0.115, 0.175, 0.24, 0.3)
"""Thicknesses of bearing walls: bricks of 115 to 300 mm (DIN 105)."""


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


@dataclass(frozen=True)
class FurnishedStorey:
    """A storey to learn doors, windows and furniture from, and who scans it."""

    building: str
    storey: str
    params: StoreyParams
    campaign: CampaignParams
    scans_per_room: float

    def plan(self) -> Plan:
        """Return what is true of it."""
        return make_storey(self.params, self.building, self.storey)


def furnished_storeys() -> tuple[FurnishedStorey, ...]:
    """Return small storeys with openings and furniture, no two built and scanned alike."""
    return tuple(_furnished(i, FURNISHED_SEED + i, kind) for i, kind in enumerate(FURNISHED))


def _furnished(i: int, seed: int, kind: Kind) -> FurnishedStorey:
    rng = np.random.default_rng((seed, 0))
    rays, interval_s = kind.sensor
    openings = OpeningParams(
        doors_m=DOORS_M[int(rng.integers(len(DOORS_M)))],
        door_head_m=float(rng.choice(HEADS_M)),
        p_state=kind.states,
        window_m=_drawn(rng, 0.9, 2.0),
        sill_m=_drawn(rng, 0.3, 1.1),
        window_head_m=_drawn(rng, 2.0, 2.4),
    )
    furnishing = FurnishingParams(
        workplace_m2=_drawn(rng, 6.0, 11.0),
        cabinet_m2=_drawn(rng, 5.0, 12.0),
        clutter_m2=_drawn(rng, 8.0, 16.0),
        p_pushed_in=_drawn(rng, 0.3, 0.6),
    )
    params = StoreyParams(
        seed=seed,
        yaw_rad=_drawn(rng, -np.pi / 4, np.pi / 4),
        ceiling_m=_drawn(rng, 2.5, 3.2),
        bearing_m=float(rng.choice(BEARING_M)),
        inner_m=float(rng.choice(INNER_M)),
        openings=openings,
        furnishing=furnishing,
        **kind.layout,
    )
    campaign = CampaignParams(
        seed=seed,
        volunteers=kind.volunteers,
        skill=kind.skill,
        sensor=SensorParams(rays=rays),
        volunteer=VolunteerParams(interval_s=interval_s),
    )
    return FurnishedStorey(f"training{i + 1}", "1", params, campaign, _drawn(rng, 1.0, 1.6))


def _drawn(rng: np.random.Generator, least: float, most: float) -> float:
    return round(float(rng.uniform(least, most)), 3)
