"""What Prefect's own pages show of a storey's run: the plan, figures, where the report lies.

Artifacts are a courtesy to those who watch: whatever goes wrong with them is said in the log and
fails nothing.
"""

import base64
import json
import logging
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from typing import Any
from uuid import UUID

from prefect.client.orchestration import SyncPrefectClient
from prefect.client.schemas.actions import ArtifactCreate, ArtifactUpdate

from storage.artifacts import Place
from storage.stages import StageRow
from tasks.stage.ledger import watched

log = logging.getLogger("mapsense")

PICTURE_LIMIT = 1_500_000
"""Largest picture that is put into Prefect's database, bytes; of a larger one the path is told."""
STEP = 5.0
"""Percents of progress between two messages to the server."""


def key_of(what: str, building: str, storey: str) -> str:
    """Return an artifact's key: lower-case letters, digits and dashes, one for each storey."""
    name = f"{building}-{storey}"
    plain = re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")
    if plain != name or "-" in building or "-" in storey:
        # names that differ in what a key cannot hold, or in where they part, stay apart
        plain = f"{plain}-{sha256(f'{building}/{storey}'.encode()).hexdigest()[:6]}".lstrip("-")
    return f"{what}-{plain}"


def storey_artifacts(summary: dict[str, Any], flow_run: UUID | None) -> list[ArtifactCreate]:
    """Return what is shown of a run, by its summary."""
    building, storey = summary["building"], summary["storey"]

    def artifact(what: str, type_: str, data: Any, about: str) -> ArtifactCreate:
        key = key_of(what, building, storey)
        return ArtifactCreate(
            key=key, type=type_, data=data, description=about, flow_run_id=flow_run
        )

    name, folder = f"{building}/{storey}", Path(summary["out"])
    shown = [
        artifact("summary", "markdown", _page(summary, folder), f"{name}: how the run ended"),
        artifact("metrics", "table", json.dumps(_metrics(summary)), f"{name}: what was found"),
        artifact("stages", "table", json.dumps(_stages(summary)), f"{name}: what it cost"),
    ]
    picture = _picture(folder) if summary["found"] is not None else None
    if picture is not None:
        shown.insert(0, artifact("plan", "image", picture, f"{name}: the plan"))
    return shown


@contextmanager
def progress_shown(
    place: Place, stages: int, flow_run: UUID, client: SyncPrefectClient
) -> Iterator[None]:
    """Show meanwhile how many stages of a storey's run have ended."""
    created = client.create_artifact(
        ArtifactCreate(
            key=key_of("progress", place.building, place.storey),
            type="progress",
            data=0.0,
            description=f"{place.building}/{place.storey}: stages that have ended",
            flow_run_id=flow_run,
        )
    )
    with watched(_counter(place, stages, lambda percent: _update(client, created.id, percent))):
        yield
    _update(client, created.id, 100.0)


def _counter(
    place: Place, stages: int, told: Callable[[float], None]
) -> Callable[[Place, StageRow], None]:
    ended, said = 0, 0.0

    def count(of: Place, row: StageRow) -> None:
        nonlocal ended, said
        if of.run != place.run:
            return
        ended += 1
        percent = min(100.0 * ended / stages, 100.0)
        if percent - said >= STEP:
            said = percent
            told(percent)

    return count


def _update(client: SyncPrefectClient, artifact: UUID, percent: float) -> None:
    try:
        client.update_artifact(artifact, ArtifactUpdate(data=round(percent, 1)))
    except Exception as error:
        log.warning("progress is not shown (%s)", error)


def _page(summary: dict[str, Any], folder: Path) -> str:
    lines = [f"## {summary['building']}/{summary['storey']}: {summary['state']}"]
    if summary["message"]:
        lines += ["", _plain(summary["message"])]
    left_out = [*summary["skipped"], *summary["rejected"]]
    if left_out:
        lines += ["", "| scan left out | why |", "| --- | --- |"]
        lines += [f"| {_plain(s['scan'])} | {_plain(s['reason'])} |" for s in left_out]
        again = f"mapsense rerun --building {summary['building']} --storey {summary['storey']}"
        lines += ["", f"Once they are mended: `{again}`"]
    lines += ["", f"Plan, drawings and summary: [{folder}]({folder.as_uri()})"]
    report = f"mapsense report --building {summary['building']} --out report"
    lines += ["", f"Figures: `{report} --store {summary['store']}`"]
    if summary["simulated"]:
        lines += ["", "Made from simulated scans."]
    return "\n".join(lines) + "\n"


def _metrics(summary: dict[str, Any]) -> list[dict[str, Any]]:
    found, used = summary["found"] or {}, summary["used"]
    rows = {
        "state": summary["state"],
        "rooms": found.get("rooms"),
        "walls": found.get("walls"),
        "doors": found.get("doors"),
        "windows": found.get("windows"),
        "furniture": found.get("furniture"),
        "area, m²": found.get("area_m2"),
        "scans used": len(used["scans"]),
        "scans skipped": len(summary["skipped"]),
        "scans rejected": len(summary["rejected"]),
        "points": used["points"],
        "seconds": summary["seconds"],
        "run": summary["run"],
    }
    return [{"metric": name, "value": value} for name, value in rows.items() if value is not None]


def _stages(summary: dict[str, Any]) -> list[dict[str, Any]]:
    return [{"stage": stage, **cost} for stage, cost in summary["stages"].items()]


def _picture(folder: Path) -> str | None:
    """Return the plan's drawing as an address that holds the picture itself."""
    try:
        data = (folder / "plan.png").read_bytes()
    except OSError:
        return None
    if len(data) > PICTURE_LIMIT:
        return None
    return "data:image/png;base64," + base64.b64encode(data).decode()


def _plain(text: str) -> str:
    """Return a text that is no markup: names of scans are anybody's."""
    return re.sub(r"([\\`*_{}\[\]<>|#!])", r"\\\1", " ".join(text.split()))
