"""What a run hands over: the plan, its drawings, and a summary of what was used and found."""

import json
from collections import defaultdict
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from flows.request import StoreyRequest
from flows.summaries import FILE as SUMMARY
from storage import coverage as stored_coverage
from storage.artifacts import Ref
from storage.files import write_whole
from storage.plan import Plan
from storage.plan_geojson import read_plan, to_geojson, write_plan
from storage.quality import Quality
from storage.remote import share
from storage.runs import COMPLETED, FAILED, PARTIAL
from storage.scans import Scan
from storage.stages import StageRow, of_run
from tasks.exports.coverage import Coverage
from tasks.exports.drawing import draw_plan

INITIAL, FINAL = "initial.geojson", "plan.geojson"
"""Files of the initial and of the final model."""


@dataclass(frozen=True)
class Skipped:
    """A scan that was not used, and why."""

    scan: str
    reason: str


@dataclass(frozen=True)
class UsedScan:
    """What of a used scan others may compare: its decoded points and their segments."""

    name: str
    points: Ref
    segments: Ref


@dataclass(frozen=True)
class Corrected:
    """What a grammar made of an initial model."""

    grammar: str = ""
    """file of the grammar; '' if none was named"""
    made: tuple[Ref, ...] = ()
    """observations, layout, sightings, the final plan's rooms and walls; none if it is not used"""
    problem: str = ""
    """why it could not be used"""
    note: str = ""
    """which scans contradict the others, and had no say where they do"""


@dataclass(frozen=True)
class Mapped:
    """What a run has made of a storey."""

    initial: Plan
    plan: Plan
    """the final one: the initial one, corrected by the grammar if there is one"""
    corrected: Corrected
    unfound: tuple[str, ...]
    """why doors and windows, or furniture, could not be looked for"""
    coverage: stored_coverage.Coverage
    scans: tuple[Scan, ...]
    quality: tuple[Quality, ...]
    """of each scan"""
    rejected: tuple[Skipped, ...]
    """scans the quality gate kept on their devices"""
    rows: dict[str, int]
    """rows of each table, over all scans"""
    used: tuple[UsedScan, ...]

    @property
    def problems(self) -> tuple[str, ...]:
        """Return what could not be done with the scans that were used."""
        grammar = (self.corrected.problem,) if self.corrected.problem else ()
        return (*grammar, *self.unfound)


def write_results(request: StoreyRequest, mapped: Mapped) -> None:
    """Write the plan and its drawings, each whole or not at all."""
    folder = request.folder()
    write_plans(mapped, request.store, folder)
    seen = mapped.coverage
    drawn = Coverage(seen.centres(), seen.cell_m, seen.scans)
    drawings = (folder / "plan.svg", folder / "plan.png")
    draw_plan(mapped.plan, drawn, *drawings)
    share(request.store, *drawings)


def write_plans(mapped: Mapped, store: str, folder: Path) -> None:
    """Write the initial and the final model, each whole or not at all."""
    write_plan(mapped.initial, folder / INITIAL)
    write_plan(mapped.plan, folder / FINAL)
    share(store, folder / INITIAL, folder / FINAL)


def is_corrected(initial: Path, final: Path) -> bool:
    """Return whether a final model has other rooms or walls than the initial one it came from."""
    models = (read_plan(path) for path in (initial, final))
    bare = (replace(model, doors=(), windows=(), furniture=()) for model in models)
    first, last = (to_geojson(model) for model in bare)
    return first != last


def summarise(
    request: StoreyRequest,
    mapped: Mapped | None,
    skipped: list[Skipped],
    message: str,
    started_at: datetime,
) -> dict[str, Any]:
    """Return what was used, skipped and found, and what it cost."""
    return {
        "building": request.building,
        "storey": request.storey,
        "state": state_of(mapped, skipped),
        "message": message,
        "simulated": mapped is not None and mapped.plan.simulated,
        "run": request.run,
        "used": {
            "scans": [_scan(*s) for s in zip(mapped.scans, mapped.quality, strict=True)]
            if mapped
            else [],
            "points": sum(scan.points_kept for scan in mapped.scans) if mapped else 0,
            "grammar": mapped.corrected.grammar or None if mapped else None,
            "params": request.params.model_dump(mode="json"),
        },
        "rejected": [{"scan": s.scan, "reason": s.reason} for s in mapped.rejected]
        if mapped
        else [],
        "skipped": [{"scan": s.scan, "reason": s.reason} for s in skipped],
        "found": _found(mapped) if mapped else None,
        "seconds": round((datetime.now(UTC) - started_at).total_seconds(), 3),
        "stages": stage_costs(of_run(request.place())),
        "store": request.store,
        "out": str(request.folder()),
    }


def state_of(mapped: Mapped | None, skipped: list[Skipped]) -> str:
    """Return how a run ended."""
    if mapped is None:
        return FAILED
    return PARTIAL if skipped or mapped.problems else COMPLETED


def write_summary(request: StoreyRequest, summary: dict[str, Any]) -> None:
    """Write summary.json into the folder of the results."""
    text = json.dumps(summary, indent=1, ensure_ascii=False) + "\n"
    write_whole(request.folder() / SUMMARY, text.encode(), "summary")
    share(request.store, request.folder() / SUMMARY)


def stage_costs(rows: list[StageRow]) -> dict[str, dict[str, float | int]]:
    """Return for each stage how often it was computed and cached, and its seconds."""
    costs: dict[str, dict[str, float | int]] = defaultdict(
        lambda: {"computed": 0, "cached": 0, "failed": 0, "wall_s": 0.0, "cpu_s": 0.0}
    )
    for row in rows:
        cost = costs[row.stage]
        cost[row.outcome] += 1
        cost["wall_s"] = round(cost["wall_s"] + row.wall_s, 3)
        cost["cpu_s"] = round(cost["cpu_s"] + row.cpu_s, 3)
    return dict(costs)


def _scan(scan: Scan, quality: Quality) -> dict[str, Any]:
    return {
        "scan": scan.name,
        "format": scan.format,
        "points": scan.points_kept,
        "points_read": scan.points_read,
        "snapshots": scan.snapshots,
        "p_in": quality.p_in,
        "p_sk": quality.p_sk,
        "p_sum": quality.p_sum,
        "up": scan.up,
        "scale": scan.scale,
        "notes": scan.notes,
    }


def _found(mapped: Mapped) -> dict[str, Any]:
    rooms = mapped.plan.rooms
    return {
        "rooms": len(rooms),
        "walls": len(mapped.plan.walls),
        "doors": len(mapped.plan.doors),
        "windows": len(mapped.plan.windows),
        "furniture": len(mapped.plan.furniture),
        "area_m2": round(sum(room.polygon.area for room in rooms), 2),
        "floor_m": mapped.coverage.floor_level_m,
        "ceiling_m": mapped.coverage.ceiling_level_m,
        "rows": mapped.rows,
    }
