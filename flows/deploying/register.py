"""Register the deployments of buildings with a Prefect server; what is as it should be stays."""

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

from prefect import Flow
from prefect.client.orchestration import SyncPrefectClient, get_client
from prefect.client.schemas.actions import DeploymentScheduleCreate, WorkPoolCreate
from prefect.client.schemas.filters import (
    DeploymentFilter,
    DeploymentFilterTags,
    FlowFilter,
    FlowFilterName,
)
from prefect.client.schemas.objects import ConcurrencyLimitStrategy, ConcurrencyOptions
from prefect.client.schemas.responses import DeploymentResponse
from prefect.client.schemas.schedules import CronSchedule, IntervalSchedule
from prefect.exceptions import ObjectNotFound
from prefect.flows import load_flow_from_entrypoint
from prefect.utilities.callables import parameter_schema
from prefect.workers.utilities import get_default_base_job_template_for_infrastructure_type

from flows.deploying.building_file import BuildingFile, Timing
from flows.deploying.prefect_file import Shared

TAG = "mapsense"
"""Every deployment of ours has it: so those whose file is gone are found."""
SLUG = "clock"
PAGE = 100
"""Deployments asked for at a time."""
ANCHOR = datetime(2026, 1, 1, tzinfo=UTC)
"""Intervals count from here, not from the moment of deploying: deployed again, ticks stay."""


@dataclass(frozen=True)
class Registered:
    """What became of a building's deployment."""

    building: str
    deployment: str
    outcome: str
    """created, updated, unchanged"""
    note: str = ""


def register(
    buildings: Sequence[BuildingFile], shared: Shared, store: str
) -> tuple[list[Registered], list[str]]:
    """Register a deployment for each building.

    Returns
    -------
    list of Registered
        What became of each building.
    list of str
        Deployments of ours on the server, as flow/name, that are none of these buildings.
    """
    flow: Flow[..., Any] = load_flow_from_entrypoint(shared.entrypoint, use_placeholder_flow=False)
    with get_client(sync_client=True) as client:
        _provide_pool(client, shared.work_pool)
        done = [_register(client, flow, building, shared, store) for building in buildings]
        names = {registered.deployment for registered in done}
        others = sorted(name for name in _ours(client, flow) if name not in names)
    return done, others


def parameters_of(building: BuildingFile, store: str) -> dict[str, Any]:
    """Return what a building's runs are asked for."""
    given: dict[str, Any] = {
        "building": building.building,
        "storeys": [{"storey": s.storey, "scans": list(s.scans)} for s in building.storeys],
        "store": store,
        "settings": building.settings,
        "settle_s": building.settle_s,
    }
    return given | ({"jobs": building.jobs} if building.jobs is not None else {})


def _provide_pool(client: SyncPrefectClient, name: str) -> None:
    """Make a pool of processes if there is none of that name."""
    try:
        client.read_work_pool(name)
    except ObjectNotFound:
        template = asyncio.run(get_default_base_job_template_for_infrastructure_type("process"))
        pool = WorkPoolCreate(name=name, type="process", base_job_template=template or {})
        client.create_work_pool(pool)


def _register(
    client: SyncPrefectClient,
    flow: Flow[..., Any],
    building: BuildingFile,
    shared: Shared,
    store: str,
) -> Registered:
    name = f"{flow.name}/{building.building}"
    before = _read(client, name)
    paused = before is not None and any(not s.active for s in before.schedules)
    queued = ConcurrencyOptions(collision_strategy=ConcurrencyLimitStrategy.ENQUEUE)
    wanted: dict[str, Any] = {
        "entrypoint": shared.entrypoint,
        "parameters": parameters_of(building, store),
        "tags": sorted({TAG, *shared.tags, *building.tags}),
        "description": shared.description,
        "work_pool_name": shared.work_pool,
        "job_variables": shared.job_variables,
        "concurrency_limit": building.concurrency,
        "concurrency_options": queued,
        "schedules": _schedules(building.timing, active=not paused),
        "parameter_openapi_schema": parameter_schema(flow).model_dump(exclude_unset=True),
    }
    if shared.work_queue is not None:
        wanted["work_queue_name"] = shared.work_queue
    note = "its schedule is paused, and stays so" if paused and building.timing else ""
    if before is not None and _is_as_wanted(before, wanted):
        return Registered(building.building, name, "unchanged", note)
    flow_id = client.create_flow_from_name(flow.name)
    client.create_deployment(
        flow_id=flow_id,
        name=building.building,
        enforce_parameter_schema=True,
        pull_steps=[],  # the module is installed where the worker runs
        **wanted,
    )
    outcome = "created" if before is None else "updated"
    return Registered(building.building, name, outcome, note)


def _read(client: SyncPrefectClient, name: str) -> DeploymentResponse | None:
    try:
        return client.read_deployment_by_name(name)
    except ObjectNotFound:
        return None


def _schedules(timing: Timing | None, active: bool) -> list[DeploymentScheduleCreate]:
    if timing is None:
        return []
    schedule: CronSchedule | IntervalSchedule
    if timing.cron is not None:
        schedule = CronSchedule(cron=timing.cron, timezone=timing.timezone)
    else:
        assert timing.every_s is not None
        schedule = IntervalSchedule(
            interval=timedelta(seconds=timing.every_s), anchor_date=ANCHOR, timezone="UTC"
        )
    return [DeploymentScheduleCreate(schedule=schedule, active=active, slug=SLUG)]


def _is_as_wanted(before: DeploymentResponse, wanted: dict[str, Any]) -> bool:
    """Return whether a deployment is on the server as it should be."""
    limit = before.global_concurrency_limit
    found = {
        "entrypoint": before.entrypoint,
        "parameters": before.parameters,
        "tags": sorted(before.tags),
        "description": before.description,
        "work_pool_name": before.work_pool_name,
        "job_variables": before.job_variables,
        "concurrency_limit": limit.limit if limit is not None else None,
        "concurrency_options": before.concurrency_options,
        "schedules": [_plain(s) for s in before.schedules],
        "parameter_openapi_schema": before.parameter_openapi_schema,
    }
    expected = wanted | {"schedules": [_plain(s) for s in wanted["schedules"]]}
    return all(found[name] == expected[name] for name in found)


def _plain(schedule: Any) -> dict[str, Any]:
    """Return what of a schedule we set."""
    names = {"cron", "timezone", "interval", "anchor_date"}
    given: dict[str, Any] = schedule.schedule.model_dump(mode="json", include=names)
    return given | {"active": schedule.active, "slug": schedule.slug}


def _ours(client: SyncPrefectClient, flow: Flow[..., Any]) -> list[str]:
    """Return the deployments of the flow that a building's file was registered as."""
    found: list[DeploymentResponse] = []
    while True:
        page = client.read_deployments(
            flow_filter=FlowFilter(name=FlowFilterName(any_=[flow.name])),
            deployment_filter=DeploymentFilter(tags=DeploymentFilterTags(all_=[TAG])),
            limit=PAGE,
            offset=len(found),
        )
        found += page
        if len(page) < PAGE:
            return [f"{flow.name}/{d.name}" for d in found if "building" in d.parameters]
