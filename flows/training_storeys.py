"""The storeys classifiers learn from: simulated, scanned and mapped, once for all trainings."""

from collections.abc import Callable
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

from flows.campaign import Site, simulate
from flows.params import MapSenseParams
from flows.request import StoreyRequest
from flows.runner import task_runner
from flows.storey import map_storey
from storage.artifacts import Place, Ref
from storage.campaign import FILE, read_campaign
from storage.errors import MapSenseError
from storage.fingerprint import code_fingerprint
from storage.made import WHOLE, made
from storage.plan import Plan
from storage.plan_geojson import read_plan
from storage.runs import new_id
from tasks.simulation.campaign import simulate_scans
from tasks.simulation.mesh import storey_mesh
from tasks.simulation.training import FurnishedStorey

CAMPAIGNS, STORE = "campaigns", "store"
"""Folders below the work's: the scans, and what was made of them."""


@dataclass(frozen=True, eq=False)
class MappedStorey:
    """A training storey as it was mapped, and what is true of it."""

    mapping: Place
    """of the run that mapped it"""
    request: StoreyRequest
    """of a run of its own: what is made of it beyond the mapping"""
    made: dict[str, dict[str, Ref]]
    """what the mapping made, by table and scan"""
    truth: Plan

    def whole(self, table: str) -> Ref:
        """Return what was made of the whole storey."""
        return self.made[table][WHOLE]

    def of_scans(self, table: str) -> list[Ref]:
        """Return what was made of each scan that could be used, in the order of their names."""
        return [self.made[table][scan] for scan in self.made["segments"]]


def simulation_code() -> str:
    """Return what the code that simulates scans is known by."""
    return code_fingerprint(simulate_scans)


def scanned(storey: FurnishedStorey, work: Path, told: Callable[[str], None]) -> Path:
    """Return the folder of a storey's campaign; simulated if it is not there yet.

    The folder is named by all that decides what is in it, the simulation's code included: what an
    interruption left behind is made again, and what another version made is never taken.
    """
    whole = (storey.params, storey.campaign)
    asked = [simulation_code(), *(part.model_dump_json() for part in whole)]
    asked += [storey.building, storey.storey, repr(storey.scans_per_room)]
    name = sha256("\n".join(asked).encode()).hexdigest()[:12]
    folder = work / CAMPAIGNS / f"{storey.building}-{name}"
    if not (folder / FILE).exists():  # written last
        plan = storey.plan()
        scans = round(storey.scans_per_room * len(plan.rooms))
        site = Site(plan, storey_mesh(plan))
        simulate([site], folder, storey.building, scans, storey.campaign, told)
    return folder


def mapped(
    storey: FurnishedStorey, campaign: Path, work: Path, params: MapSenseParams, jobs: int
) -> MappedStorey:
    """Map a storey that was scanned; what was mapped before comes from the cache.

    Raises
    ------
    MapSenseError
        If there is no plan at all.
    """
    (of_storey,) = read_campaign(campaign).storeys
    request = StoreyRequest(
        store=str(work / STORE),
        building=storey.building,
        storey=storey.storey,
        scans=tuple(str(campaign / scan.path) for scan in of_storey.scans),
        params=params.model_copy(update={"detect": ()}),  # what is to be learnt
        verb="train",
    )
    mapping: Any = map_storey.with_options(task_runner=task_runner(jobs))
    state = mapping(request, return_state=True)
    if not state.is_completed():
        error = state.result(raise_on_failure=False)
        why = error if isinstance(error, BaseException) else state.message
        raise MapSenseError(f"training storey {storey.building}/{storey.storey}: {why}")
    truth = read_plan(campaign / of_storey.truth)
    # the run of the mapping has ended: what follows is another's
    after = request.model_copy(update={"run": new_id()})
    return MappedStorey(request.place(), after, made(request.place()), truth)
