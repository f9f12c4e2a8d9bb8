"""What a deployment runs by the clock: map the storeys of a building that have new scans.

A tick lists the sources of each storey and compares them, by content, with what the storey's last
successful run took. Without news it ends at once: what maps a storey is not even imported then. A
storey with news is mapped from all of its scans; those computed before come from the cache.
"""

import logging
import os
import time
from pathlib import Path
from typing import Any
from uuid import UUID

from prefect import flow
from prefect.context import FlowRunContext
from prefect.logging.handlers import APILogHandler
from prefect.states import Completed, Failed
from pydantic import BaseModel, ConfigDict, Field, NonNegativeFloat, PositiveInt, field_validator

from flows.logs import event, written
from flows.news import News, find_news
from storage.artifacts import check_name
from storage.errors import MapSenseError
from storage.mapped_sources import read_mapped_sources
from storage.remote import refresh
from storage.stages import reason

FORM = "MAPSENSE_LOG"


class StoreySources(BaseModel):
    """Where the scans of a storey are found."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    storey: str
    """Name of the storey."""
    scans: tuple[str, ...] = Field(min_length=1)
    """Scan files, folders and patterns of such, or addresses as s3://bucket/prefix."""

    @field_validator("storey")
    @classmethod
    def _is_a_name(cls, value: str) -> str:
        return check_name(value)


@flow(name="mapping", flow_run_name="{building}")
def map_new_scans(
    building: str,
    storeys: list[StoreySources],
    store: str,
    settings: dict[str, Any] | None = None,
    settle_s: NonNegativeFloat = 60.0,
    jobs: PositiveInt | None = None,
) -> Any:
    """Map the storeys of a building that have new scans; one broken storey stops no other.

    Parameters
    ----------
    building : str
        Name its results are kept under.
    storeys : list of StoreySources
        Where the scans of each storey are found.
    store : str
        Folder of the store.
    settings : dict, optional
        Parameters of the stages over the defaults, by stage, as {"hough": {"gamma_cell": 25}}.
    settle_s : float
        A scan that was written less than so many seconds ago waits for the next tick.
    jobs : int, optional
        Stages that run at once; None: one per processor.
    """
    check_name(building)
    context = FlowRunContext.get()
    assert context is not None and context.flow_run is not None
    with written(_form(), _to_prefect(context.flow_run.id)):
        found: dict[str, News] = {}
        ends: dict[str, str] = {}
        broken: dict[str, str] = {}
        for entry in storeys:
            try:
                found[entry.storey] = _look(building, entry, store, settings or {}, settle_s)
            except MapSenseError as error:
                broken[entry.storey] = reason(error)
                _tell_broken(building, entry.storey, error)
        worth = {s: n for s, n in found.items() if _is_worth_a_run(n, building, s, store)}
        ends |= {s: _quiet(news) for s, news in found.items() if s not in worth}
        if worth:
            from flows.new_scans import map_storey_from

            for storey, news in worth.items():
                end = map_storey_from(news, building, storey, store, settings or {}, jobs)
                (ends if end.is_mapped else broken)[storey] = end.message
    told = {**ends, **broken}
    message = "; ".join(f"{entry.storey}: {told[entry.storey]}" for entry in storeys)
    if broken:
        return Failed(message=f"{len(broken)} of {len(storeys)} storeys failed: {message}")
    return Completed(message=message if worth else f"nothing new: {message}")


def _look(
    building: str, entry: StoreySources, store: str, settings: dict[str, Any], settle_s: float
) -> News:
    last = read_mapped_sources(store, building, entry.storey)
    news = find_news(entry.scans, store, settings, last, settle_s, time.time())
    event(
        "sources listed",
        building=building,
        storey=entry.storey,
        sources=len(news.sources),
        new=news.new,
        waiting=news.waiting,
        gone=news.gone,
    )
    return news


def _is_worth_a_run(news: News, building: str, storey: str, store: str) -> bool:
    """Return whether a storey is to be mapped; also if its results were taken away."""
    refresh(store, f"plans/{building}/{storey}")
    is_lost = not (Path(store) / "plans" / building / storey).is_dir()
    return news.is_worth_a_run() or (is_lost and bool(news.sources))


def _quiet(news: News) -> str:
    """Return what there is to say of a storey without news."""
    parts = [f"{len(news.sources)} scans, all known" if news.sources else "no scan yet"]
    if news.waiting:
        parts.append(f"still being written: {', '.join(news.waiting)}")
    if news.gone:
        parts.append(f"gone: {', '.join(news.gone)}")
    return ", ".join(parts)


def _tell_broken(building: str, storey: str, error: MapSenseError) -> None:
    text = reason(error)
    remedy = text.rpartition("; ")[2] if "; " in text else "see the error"
    event(
        "sources not read",
        logging.ERROR,
        building=building,
        storey=storey,
        error=text,
        remedy=remedy,
    )


def _form() -> str:
    """Return how events are written; a run that nobody watches writes them unless told not to."""
    return os.environ.get(FORM, "text")


def _to_prefect(flow_run: UUID) -> logging.Handler:
    """Return what sends events to the pages of a flow run, from whatever thread they are of."""

    def of_run(record: logging.LogRecord) -> bool:
        record.flow_run_id = str(flow_run)
        return True

    handler = APILogHandler()
    handler.addFilter(of_run)
    return handler
