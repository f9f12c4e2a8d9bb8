"""The storeys grammars are scored on, those they are learnt from, and the scans of both. Simulated.

A building is a layout of one size, its wings at one angle: its storeys differ in the rooms drawn
along the corridor. Of each one storey is scored and another, its sibling, is known.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from commands import mapsense

from grammars.generator.learning import learn
from grammars.generator.params import LearnParams
from grammars.writing import write_grammar
from storage.campaign import FILE
from storage.plan import Plan
from storage.plan_geojson import read_plan, write_plan
from tasks.simulation.layouts.double_loaded import DoubleLoadedParams
from tasks.simulation.layouts.irregular import IrregularParams, irregular_layout
from tasks.simulation.layouts.ring import RingParams
from tasks.simulation.plan import StoreyParams, make_storey
from tasks.simulation.presets import PRESETS

PRESET, SIMULATED = "paper", "simulated"
"""The campaign of the presets, and the building their results are kept under, as in results.py."""
SAME, OTHER = "same", "other"
"""A grammar of the building's other storey, and one of all other buildings of the type."""
SCORED_SEED, SIBLING_SEED, PRESET_SIBLING_SEED = 1000, 2000, 2104
"""First seeds of the rooms: of the unseen scored storeys, of their siblings, of the presets'."""
CAMPAIGN_SEED = 5
SCANS_PER_ROOM = 1.3
SENSOR = ("campaign.sensor.rays=12000", "campaign.volunteer.interval_s=1.0")
"""Of the unseen storeys: fewer points than a phone makes, so that ten are simulated in minutes."""


@dataclass(frozen=True)
class Scored:
    """A storey that is scored."""

    building: str
    """what its results are kept under"""
    storey: str
    campaign: str
    """folder of its campaign below that of all"""
    params: StoreyParams
    sibling: StoreyParams
    """what is known of the building: another of its storeys"""

    @property
    def name(self) -> str:
        """What people call it."""
        return self.storey if self.is_preset else self.building

    @property
    def is_preset(self) -> bool:
        """Whether it is one of the paper's."""
        return self.building == SIMULATED

    @property
    def kind(self) -> str:
        """The building's type."""
        return self.params.layout

    def scans(self, campaigns: Path) -> Path:
        """Return the folder of its scans."""
        return campaigns / self.campaign / self.storey / "scans"

    def truth(self, campaigns: Path) -> Path:
        """Return the file of its true plan."""
        return campaigns / self.campaign / self.storey / "truth.geojson"


def _unseen() -> list[Scored]:
    layouts: list[tuple[str, dict[str, Any]]] = [
        *(
            (f"ring{i}", {"layout": "ring", "ring": RingParams(modules_min=n, modules_max=n)})
            for i, n in enumerate((8, 10, 9))
        ),
        *(
            (f"slab{i}", {"layout": "double_loaded",
                          "double_loaded": DoubleLoadedParams(modules=n)})
            for i, n in enumerate((12, 16, 20, 14))
        ),
        *(
            (f"bent{i}", {"layout": "irregular",
                          "irregular": IrregularParams(main_modules=m, wing_modules=w)})
            for i, (m, w) in enumerate(((9, 6), (11, 7), (10, 8)))
        ),
    ]  # fmt: skip
    drawn = [
        StoreyParams(seed=SCORED_SEED + k, yaw_rad=_yaw(k), **size)
        for k, (_, size) in enumerate(layouts)
    ]
    return [
        Scored(name, "1", name, params, _another(params, SIBLING_SEED + k))
        for k, ((name, _), params) in enumerate(zip(layouts, drawn, strict=True))
    ]


def _another(params: StoreyParams, seed: int) -> StoreyParams:
    """Return another storey of a building: what the first one's seed drew of its shell is kept."""
    if params.layout != "irregular":
        return params.model_copy(update={"seed": seed})
    corridor = irregular_layout(params.irregular, np.random.default_rng(params.seed))[0].cell
    main, wing = np.diff(np.array(corridor.exterior.coords)[:3], axis=0)
    bend = float(np.arctan2(wing[1], wing[0]) - np.arctan2(main[1], main[0]))
    pinned = params.irregular.model_copy(update={"bend_min_rad": bend, "bend_max_rad": bend})
    return params.model_copy(update={"seed": seed, "irregular": pinned})


def _yaw(k: int) -> float:
    return float(np.deg2rad(7 * k - 30))


def _preset(name: str, params: StoreyParams) -> Scored:
    # the same size and rows of its own: a preset names its rooms one by one
    size = getattr(params, params.layout).model_copy(update={"rows": None})
    drawn = {"seed": PRESET_SIBLING_SEED, params.layout: size}
    return Scored(SIMULATED, name, PRESET, params, params.model_copy(update=drawn))


STOREYS = (*(_preset(name, params) for name, params in PRESETS.items()), *_unseen())


def chosen(names: Sequence[str]) -> list[Scored]:
    """Return the storeys of some names, all without any; SystemExit for an unknown one."""
    known = {scored.name: scored for scored in STOREYS}
    if unknown := [name for name in names if name not in known]:
        raise SystemExit(f"unknown storey {unknown[0]!r}: use of {', '.join(known)}")
    return [known[name] for name in names] if names else list(STOREYS)


def simulate(storeys: Sequence[Scored], campaigns: Path) -> None:
    """Make the campaigns that are not there yet."""
    for scored in storeys:
        folder = campaigns / scored.campaign
        if (folder / FILE).exists():
            continue
        if scored.is_preset:
            mapsense("simulate", "--preset", PRESET, "--out", str(folder))
            continue
        plan = make_storey(scored.params, scored.building, scored.storey)
        path = campaigns / f"{scored.building}.geojson"
        path.parent.mkdir(parents=True, exist_ok=True)
        write_plan(plan, path)
        scans = int(SCANS_PER_ROOM * len(plan.rooms))
        settings = [word for setting in SENSOR for word in ("--set", setting)]
        mapsense(
            "simulate", str(path), "--scans", str(scans), "--seed", str(CAMPAIGN_SEED),
            "--building", scored.building, *settings, "--out", str(folder),
        )  # fmt: skip


def write_grammars(storeys: Sequence[Scored], folder: Path) -> None:
    """Write the grammars of storeys, each under its storey's name in a folder per kind."""
    plans: Mapping[str, Plan] = _Siblings(folder / "siblings")
    for scored in storeys:
        others = [s.name for s in STOREYS if s.kind == scored.kind and s.name != scored.name]
        for kind, learnt_from in ((SAME, [scored.name]), (OTHER, others)):
            path = grammar_file(folder, kind, scored)
            path.parent.mkdir(parents=True, exist_ok=True)
            write_grammar(learn([plans[name] for name in learnt_from], LearnParams()), path)


def grammar_file(folder: Path, kind: str, scored: Scored) -> Path:
    """Return the file of a storey's grammar."""
    return folder / kind / f"{scored.building}-{scored.storey}.toml"


class _Siblings(dict[str, Plan]):
    """The known storey of each building by its name, made when it is first asked for."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def __missing__(self, name: str) -> Plan:
        path = self.folder / f"{name}.geojson"
        if not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            (scored,) = chosen([name])
            write_plan(make_storey(scored.sibling, name, "2"), path)
        self[name] = read_plan(path)
        return self[name]
