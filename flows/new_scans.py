"""Map one storey from what a tick found, and note what was taken."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

from prefect.client.orchestration import get_client
from prefect.context import FlowRunContext

from flows import stages
from flows.artifacts import progress_shown
from flows.building import with_jobs
from flows.logs import event
from flows.news import News, known_by
from flows.params import parse_params
from flows.request import StoreyRequest
from flows.settings import default_jobs
from flows.summaries import read_summary
from storage.errors import MapSenseError
from storage.mapped_sources import MappedSources, write_mapped_sources
from storage.stages import reason

VERB = "scheduled"
"""What asked for runs that the clock began."""


class End(NamedTuple):
    """How the run of a storey has ended."""

    is_mapped: bool
    message: str


def map_storey_from(
    news: News,
    building: str,
    storey: str,
    store: str,
    settings: dict[str, Any],
    jobs: int | None,
) -> End:
    """Map a storey from all its scans; what was taken is noted only if there is a plan."""
    try:
        request = StoreyRequest(
            store=store,
            building=building,
            storey=storey,
            scans=tuple(source.url for source in news.sources),
            params=parse_params(settings),
            verb=VERB,
        )
    except MapSenseError as error:
        event("run refused", logging.ERROR, building=building, storey=storey, error=reason(error))
        return End(False, reason(error))
    with _progress(request, len(news.sources)):
        state = with_jobs(jobs or default_jobs())(request, return_state=True)
    summary = read_summary(request.folder(), request.run)
    if not state.is_completed():
        return End(False, str(state.message))
    taken = MappedSources(request.run, known_by(settings), news.sources)
    write_mapped_sources(store, building, storey, taken)
    return End(True, _told(news, summary))


@contextmanager
def _progress(request: StoreyRequest, scans: int) -> Iterator[None]:
    context = FlowRunContext.get()
    assert context is not None and context.flow_run is not None
    expected = stages.of_mapping(scans, request.params)
    with (
        get_client(sync_client=True) as client,
        progress_shown(request.place(), expected, context.flow_run.id, client),
    ):
        yield


def _told(news: News, summary: dict[str, Any] | None) -> str:
    """Return what there is to say of a storey that was mapped."""
    why = (
        f"{len(news.new)} new" if news.new else "other settings" if news.other_settings else "lost"
    )
    parts = [f"mapped from {len(news.sources)} scans, {why}"]
    if summary is not None and summary["message"]:
        parts.append(summary["message"])
    if news.waiting:
        parts.append(f"still being written: {', '.join(news.waiting)}")
    if news.gone:
        parts.append(f"gone: {', '.join(news.gone)}")
    return ", ".join(parts)
