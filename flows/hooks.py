"""What happens as a storey's run ends, besides its results: Prefect calls these."""

import logging
from typing import Any

from prefect.client.orchestration import get_client

from flows.artifacts import storey_artifacts
from flows.logs import run_ended
from flows.request import StoreyRequest
from flows.summaries import read_summary

log = logging.getLogger("mapsense")


def tell(flow: Any, flow_run: Any, state: Any) -> None:
    """Write the events of a run's end."""
    summary = _summary_of(flow_run)
    if summary is not None:
        run_ended(summary)


def publish(flow: Any, flow_run: Any, state: Any) -> None:
    """Show on the pages of Prefect's server what a run has made."""
    summary = _summary_of(flow_run)
    if summary is None:
        return
    try:
        with get_client(sync_client=True) as client:
            for artifact in storey_artifacts(summary, flow_run.id):
                client.create_artifact(artifact)
    except Exception as error:  # the storey is mapped, whatever the server says
        log.warning("%s/%s: no artifacts (%s)", summary["building"], summary["storey"], error)


def _summary_of(flow_run: Any) -> dict[str, Any] | None:
    request = StoreyRequest.model_validate(flow_run.parameters["request"])
    return read_summary(request.folder(), request.run)
