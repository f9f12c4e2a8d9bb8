"""What happens in a run, one line per event: for people, and as JSON for programs.

MAPSENSE_LOG=json makes each line a JSON object, MAPSENSE_LOG=text a sentence with fields: for runs
that a worker or another program starts. The fields are the same in both forms: run,
building, storey, scan and stage say where; a failure adds `error` and `remedy`.

    stage failed run=20261122T... building=north storey=1 scan=b stage=clouds error="..." ...
"""

import json
import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from typing import Any, TextIO

from storage.artifacts import Place
from storage.runs import COMPLETED
from storage.stages import StageRow
from tasks.stage.ledger import watched

log = logging.getLogger("mapsense")
# written where somebody asked for it, see `written`, and nowhere else
log.addHandler(logging.NullHandler())
log.propagate = False

FIELDS = (
    *("run", "building", "storey", "scan", "stage", "outcome", "state"),
    *("wall_s", "new", "waiting", "gone", "sources", "error", "remedy"),
)
"""Fields of an event, in the order they are written in; one that does not apply is left out."""


def event(message: str, level: int = logging.INFO, **fields: Any) -> None:
    """Say that something happened; each name of `fields` is one of `FIELDS`."""
    if unknown := set(fields) - set(FIELDS):
        raise ValueError(f"no fields of an event: {', '.join(sorted(unknown))}")
    given = {name: fields[name] for name in FIELDS if fields.get(name) not in (None, (), [], "")}
    log.log(level, message, extra={"event": given})


def stage_ended(place: Place, row: StageRow) -> None:
    """Say that a stage has ended."""
    failed = row.error is not None
    event(
        f"stage {row.outcome}",
        logging.ERROR if failed else logging.INFO,
        run=row.run,
        building=place.building,
        storey=place.storey,
        scan=row.scan,
        stage=row.stage,
        outcome=row.outcome,
        wall_s=round(row.wall_s, 3),
        error=row.error,
        remedy=remedy(row.error, place, row.scan) if row.error is not None else None,
    )


def run_ended(summary: dict[str, Any]) -> None:
    """Say how the run of a storey has ended, and why for each scan that was left out."""
    place = Place(
        store=summary.get("store", ""),
        run=summary["run"],
        building=summary["building"],
        storey=summary["storey"],
    )
    about = {"run": place.run, "building": place.building, "storey": place.storey}
    for skipped in summary.get("skipped", []):
        event(
            "scan skipped",
            logging.ERROR,
            **about,
            scan=skipped["scan"],
            error=skipped["reason"],
            remedy=remedy(skipped["reason"], place, skipped["scan"]),
        )
    well = summary["state"] == COMPLETED
    message = summary["message"] or None
    event(
        "run ended",
        logging.INFO if well else logging.ERROR,
        **about,
        state=summary["state"],
        error=None if well else message,
        remedy=None if well else remedy(message or "", place),
    )


def remedy(error: str, place: Place, scan: str | None = None) -> str:
    """Return what to do about a failure: what its text says, and the command that tries again."""
    _, found, own = error.rpartition("; ")
    again = f"mapsense rerun --building {place.building} --storey {place.storey}"
    if not found:
        own = f"replace or remove scan {scan}" if scan is not None else "see 'mapsense status'"
    return f"{own}; then {again}"


@contextmanager
def written(form: str, *more: logging.Handler, stream: TextIO | None = None) -> Iterator[None]:
    """Write the events of this process meanwhile, on stderr unless another stream is named.

    Parameters
    ----------
    form : "text", "json", or "none": on no stream
    *more : logging.Handler
        Others that are handed the events, as text.
    """
    handlers = list(more)
    for handler in more:
        handler.setFormatter(TextLines())
    if form != "none":
        lines = logging.StreamHandler(stream or sys.stderr)
        lines.setFormatter(JsonLines() if form == "json" else TextLines())
        handlers.append(lines)
    level = log.level
    log.setLevel(logging.INFO)
    for handler in handlers:
        log.addHandler(handler)
    try:
        with watched(stage_ended):
            yield
    finally:
        for handler in handlers:
            log.removeHandler(handler)
        log.setLevel(level)


class JsonLines(logging.Formatter):
    """One JSON object per event."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the line of an event."""
        head = {
            "time": datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds"),
            "level": record.levelname.lower(),
            "event": record.getMessage(),
        }
        fields = getattr(record, "event", {})
        return json.dumps(head | fields, ensure_ascii=False, default=str)


class TextLines(logging.Formatter):
    """The event, then key=value; what holds a blank or a quote is quoted."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the line of an event."""
        fields = getattr(record, "event", {})
        parts = [f"{name}={_shown(value)}" for name, value in fields.items()]
        return " ".join([record.getMessage(), *parts])


def _shown(value: Any) -> str:
    if isinstance(value, list | tuple):
        value = ",".join(str(one) for one in value)
    text = str(value)
    plain = text.isprintable() and not any(c in text for c in ' "=')
    return text if plain else json.dumps(text, ensure_ascii=False)
