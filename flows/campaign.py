"""Simulate a crowdsensing campaign: volunteers scan a building's storeys, into a folder."""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from storage.artifacts import check_name
from storage.campaign import Campaign, CampaignScan, CampaignStorey, write_campaign
from storage.errors import MapSenseError
from storage.plan import Plan
from storage.plan_geojson import read_plan, write_plan
from storage.plan_ifc import ifc_storeys, read_ifc_storey
from tasks.params import Params
from tasks.scans.bundle import write_bundle
from tasks.simulation.campaign import CampaignParams, Recording, shares, simulate_scans
from tasks.simulation.defaults import SimulationDefaults, complete_plan
from tasks.simulation.ifc import IfcMeshParams, ifc_mesh
from tasks.simulation.mesh import Mesh, storey_mesh
from tasks.simulation.presets import PRESETS, preset
from tasks.simulation.sensor import Scene

OPEN_SHARE = 0.5
"""Share of an IFC building's doors that stand open while it is scanned. Assumption."""
PAPER = ("ring", "wing")
"""The presets that stand for the paper's two storeys."""
PAPER_SCANS = 105
"""Scans of the paper's campaign (Sec. 7.1)."""


class SimulationParams(Params):
    """Parameters of simulating a campaign."""

    campaign: CampaignParams = CampaignParams()
    """Who scans what."""
    defaults: SimulationDefaults = SimulationDefaults()
    """What a plan that leaves sizes open is given."""
    ifc: IfcMeshParams = IfcMeshParams()
    """How an IFC building becomes a mesh."""


@dataclass(frozen=True, eq=False)
class Site:
    """A storey to be scanned: the truth, and its mesh."""

    plan: Plan
    mesh: Mesh


def preset_sites(name: str, building: str) -> list[Site]:
    """Return the storeys of a preset; `paper` is both of the paper's."""
    names = PAPER if name == "paper" else (name,)
    for unknown in [n for n in names if n not in PRESETS]:
        raise MapSenseError(f"preset '{unknown}': there are {', '.join(['paper', *PRESETS])}")
    plans = [preset(n, building, n) for n in names]
    return [Site(plan, storey_mesh(plan)) for plan in plans]


def plan_sites(path: Path, storey: str | None, params: SimulationParams) -> list[Site]:
    """Return the storeys of a plan: the one of a GeoJSON file; of an IFC file all, or the named."""
    if path.suffix.lower() != ".ifc":
        plan = complete_plan(read_plan(path), params.defaults)
        if not plan.rooms:
            raise MapSenseError(f"{path}: the plan has no room; there is nothing to scan")
        return [Site(plan, storey_mesh(plan))]
    names = [storey] if storey is not None else list(ifc_storeys(path))
    sites = [_ifc_site(path, name, params) for name in names]
    found = [site for site in sites if site.plan.rooms]
    if not found:
        raise MapSenseError(f"{path}: no storey of it has a room; there is nothing to scan")
    return found


def _ifc_site(path: Path, storey: str, params: SimulationParams) -> Site:
    """Return a storey of an IFC building with doors drawn open or shut."""
    plan = read_ifc_storey(path, storey)
    rng = np.random.default_rng((params.campaign.seed, len(plan.doors)))
    doors = tuple(
        replace(door, state="open" if rng.random() < OPEN_SHARE else "shut")
        if door.state == "unknown"
        else door
        for door in plan.doors
    )
    plan = complete_plan(replace(plan, doors=doors), params.defaults)
    opened = {door.id for door in doors if door.state == "open"}
    return Site(plan, ifc_mesh(path, storey, params.ifc, opened))


def simulate(
    sites: Sequence[Site],
    folder: Path,
    building: str,
    scans: int | None,
    params: CampaignParams,
    told: Callable[[str], None],
) -> Campaign:
    """Simulate the scans of some storeys into a folder and return what it holds.

    Parameters
    ----------
    scans : int, optional
        Scans of all storeys together, shared by their numbers of rooms; None: one of each room.

    Raises
    ------
    MapSenseError
        If two storeys would lie in one folder.
    """
    names = [_name_of(site.plan) for site in sites]
    if twice := [name for name in names if names.count(name) > 1]:
        raise MapSenseError(f"two plans are of storey '{twice[0]}': give each its own name")
    plans = tuple(site.plan for site in sites)
    each = shares(scans, plans) if scans is not None else tuple(len(p.rooms) for p in plans)
    storeys = []
    for site, name, count in zip(sites, names, each, strict=True):
        truth = folder / name / "truth.geojson"
        write_plan(site.plan, truth)
        of_storey = params.model_copy(update={"scans": count})
        recorded = record_scans(site, folder / name / "scans", of_storey, told) if count else ()
        storeys.append(
            CampaignStorey(
                storey=name,
                truth=truth.relative_to(folder).as_posix(),
                scans=tuple(_record(s, p.relative_to(folder).as_posix()) for p, s in recorded),
            )
        )
    campaign = Campaign(building=building, simulated=True, seed=params.seed, storeys=tuple(storeys))
    write_campaign(campaign, folder)
    return campaign


def record_scans(
    site: Site, folder: Path, params: CampaignParams, told: Callable[[str], None]
) -> Iterator[tuple[Path, Recording]]:
    """Simulate a storey's scans into a folder; yield each with its bundle once it is written."""
    for scan in simulate_scans(site.plan, params, Scene(site.mesh)):
        path = folder / f"{scan.name}.scan"
        write_bundle(path, scan.cloud, scan.snapshots, frame="device", simulated=True)
        told(f"simulated scan {site.plan.storey}/{scan.name}: {len(scan.cloud):,} points")
        yield path, scan


def _record(scan: Recording, path: str) -> CampaignScan:
    """Return what a campaign remembers of a scan."""
    return CampaignScan(
        scan=scan.name,
        path=path,
        room=scan.room,
        volunteer=f"v{scan.volunteer}",
        skill=round(scan.skill, 3),
        duration_s=scan.duration_s,
        points=len(scan.cloud),
    )


def _name_of(plan: Plan) -> str:
    """Return a storey's name as one that can be a folder."""
    name = re.sub(r"\.{2,}", ".", re.sub(r"[^A-Za-z0-9_.-]+", "_", plan.storey))
    return check_name(name.strip(".-")[:100] or "0")
