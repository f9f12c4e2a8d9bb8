"""What happens as a storey's run ends, besides its results: Prefect calls these."""

import json
import logging
from typing import Any

from prefect.client.orchestration import get_client

from flows.artifacts import storey_artifacts
from flows.logs import run_ended
from flows.request import StoreyRequest

log = logging.getLogger("mapsense")


def tell(flow: Any, flow_run: Any, state: Any) -> None:
    """Write the events of a run's end."""
    summary = summary_of(StoreyRequest.model_validate(flow_run.parameters["request"]))
    if summary is not None:
        run_ended(summary)


def publish(flow: Any, flow_run: Any, state: Any) -> None:
    """Show on the pages of Prefect's server what a run has made."""
    summary = summary_of(StoreyRequest.model_validate(flow_run.parameters["request"]))
    if summary is None:
        return
    try:
        with get_client(sync_client=True) as client:
            for artifact in storey_artifacts(summary, flow_run.id):
                client.create_artifact(artifact)
    except Exception as error:  # the storey is mapped, whatever the server says
        log.warning("%s/%s: no artifacts (%s)", summary["building"], summary["storey"], error)


def summary_of(request: StoreyRequest) -> dict[str, Any] | None:
    """Return the summary a run has left, None if it left none."""
    try:
        text = (request.folder() / "summary.json").read_text("utf-8")
        summary: dict[str, Any] = json.loads(text)
    except (OSError, ValueError):
        return None
    return summary if summary["run"] == request.run else None
