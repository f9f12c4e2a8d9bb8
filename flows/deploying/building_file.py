"""A building's file: where its scans come from, and when they are mapped.

# north.toml; paths are relative to this file
building = "north"                  # name its results are kept under
grammar = "office"                  # or a file; left out: no grammar corrects the model
tags = ["campus"]
settle_s = 60                       # a scan written less than so many seconds ago waits
jobs = 2                            # stages at once; left out: one per processor
concurrency = 1                     # runs of this building at once, others wait for their turn

[schedule]                          # left out: the building is mapped when somebody asks
cron = "0 2 * * *"                  # or every_s = 900
timezone = "Europe/Berlin"          # left out: UTC

[[storeys]]
storey = "1"
scans = ["scans/1", "uploads/*.e57", "s3://bucket/north/1"]

[params.hough]                      # parameters over the defaults, by stage
gamma_cell = 25
"""

import glob
import re
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fsspec
from pydantic import ValidationError

from flows.assignments import merged
from flows.listing import is_remote
from flows.params import MapSenseParams, explain
from grammars.fields import Fields, shown
from grammars.library import find_grammar, library
from grammars.positions import line_numbers
from grammars.reading import read_grammar
from storage.artifacts import check_name
from storage.errors import InputError

SETTLE_S = 60.0
"""Seconds a scan must have been left alone before it is taken. Assumption."""
EVERY_LEAST_S = 10.0
"""Shortest interval: Prefect's scheduler itself looks every few seconds."""
_CREDENTIALS = re.compile(r"://[^/]*@")
_FIELDS = (
    *("building", "grammar", "tags", "settle_s", "jobs", "concurrency"),
    *("schedule", "storeys", "params"),
)


@dataclass(frozen=True)
class Timing:
    """When a building is looked at: by a cron line or an interval, exactly one of them."""

    cron: str | None
    every_s: float | None
    timezone: str

    def __str__(self) -> str:
        if self.cron is not None:
            return f"{self.cron} {self.timezone}"
        return f"every {self.every_s:g} s"


@dataclass(frozen=True)
class StoreyEntry:
    """Where the scans of a storey are found."""

    storey: str
    scans: tuple[str, ...]
    """absolute paths, patterns and addresses"""


@dataclass(frozen=True)
class BuildingFile:
    """What a building's file says."""

    path: Path
    building: str
    storeys: tuple[StoreyEntry, ...]
    settings: dict[str, Any]
    """parameters over the defaults by stage, the grammar among them"""
    timing: Timing | None
    tags: tuple[str, ...]
    settle_s: float
    jobs: int | None
    concurrency: int


def read_building(path: Path, base: dict[str, Any]) -> BuildingFile:
    """Read a building's file.

    Parameters
    ----------
    base : dict
        Parameters that the file may leave as they are, by stage: of settings.

    Raises
    ------
    InputError
        Naming file, line, field and remedy of the first thing that is wrong.
    """
    try:
        text = path.read_text("utf-8")
        values = tomllib.loads(text)
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})", "check the path") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(path, f"is no TOML ({error})", "correct it") from error
    top = Fields(path, line_numbers(text), (), "", values)
    top.only(_FIELDS)
    return BuildingFile(
        path=path,
        building=_name(top, "building"),
        storeys=_storeys(top),
        settings=_settings(top, base),
        timing=_timing(top),
        tags=_texts(top, "tags") if "tags" in values else (),
        settle_s=top.number("settle_s", 0) if "settle_s" in values else SETTLE_S,
        jobs=_count(top, "jobs") if "jobs" in values else None,
        concurrency=_count(top, "concurrency") if "concurrency" in values else 1,
    )


def _storeys(top: Fields) -> tuple[StoreyEntry, ...]:
    if "storeys" not in top.values:
        top.fail("storeys", "is missing", "add a table [[storeys]] for each storey")
    found: list[StoreyEntry] = []
    for table in top.tables("storeys", "storey"):
        table.only(("storey", "scans"))
        storey = _name(table, "storey")
        if storey in (entry.storey for entry in found):
            table.fail("storey", f"is {shown(storey)} twice", "name each storey once")
        scans = _texts(table, "scans")
        sources = (_source(table, ("scans", i), scan) for i, scan in enumerate(scans))
        found.append(StoreyEntry(storey, tuple(sources)))
    if not found:
        top.fail("storeys", "is empty", "add a table [[storeys]] for each storey")
    return tuple(found)


def _source(table: Fields, field: tuple[str, int], source: str) -> str:
    place = (*table.place, *field)
    if not is_remote(source):
        folder = Path(table.source).parent.resolve()
        # of a pattern only the part before it is a path to be made absolute
        return str(folder / source) if glob.has_magic(source) else str((folder / source).resolve())
    scheme = source.partition("://")[0]
    if scheme not in fsspec.available_protocols():
        wrong = f"'scans' has {shown(source)}: nothing reads '{scheme}://'"
        table.fail_at(place, wrong, "use a path, or an address as s3://bucket/prefix")
    if _CREDENTIALS.search(source):
        wrong = f"'scans' has an address of '{scheme}://' with credentials in it"
        table.fail_at(place, wrong, "put them into the environment of the worker")
    if glob.has_magic(source):
        wrong = f"'scans' has {shown(source)}: an address cannot be a pattern"
        table.fail_at(place, wrong, "name the prefix that the scans lie below")
    return source


def _settings(top: Fields, base: dict[str, Any]) -> dict[str, Any]:
    own = top.table("params", "params").values if "params" in top.values else {}
    given = merged(base, own)
    if "grammar" in own:
        top.fail_at(("params", "grammar"), "'grammar' is no parameter here", "put it at the top")
    if "grammar" in top.values:
        given["grammar"] = _grammar(top)
    try:
        MapSenseParams.model_validate(given)
    except ValidationError as error:
        place = ("params", *(part for part in error.errors()[0]["loc"]))
        remedy = "correct it, or the settings it goes with"
        top.fail_at(place, explain(error, MapSenseParams), remedy)
    return given


def _grammar(top: Fields) -> str:
    name = top.text("grammar")
    if name in library():
        return name
    path = (Path(top.source).parent / name).resolve()
    try:
        read_grammar(find_grammar(str(path)))
    except InputError as error:
        top.fail("grammar", f"is {shown(name)}: {error.path}: {error.field}", error.remedy)
    return str(path)


def _timing(top: Fields) -> Timing | None:
    table = top.optional_table("schedule", "schedule")
    if table is None:
        return None
    table.only(("cron", "every_s", "timezone"))
    if ("cron" in table.values) == ("every_s" in table.values):
        remedy = 'add cron = "0 2 * * *", or every_s = 900'
        table.fail("cron", "or 'every_s': exactly one says when", remedy)
    if "cron" in table.values:
        timezone = table.text("timezone") if "timezone" in table.values else "UTC"
        _check_zone(table, timezone)
        return Timing(_cron(table, timezone), None, timezone)
    if "timezone" in table.values:
        table.fail("timezone", "says nothing beside 'every_s'", "take it out")
    return Timing(None, table.number("every_s", EVERY_LEAST_S), "UTC")


def _cron(table: Fields, timezone: str) -> str:
    from prefect.client.schemas.schedules import CronSchedule

    cron = table.text("cron")
    try:
        CronSchedule(cron=cron, timezone=timezone)
    except ValueError:
        remedy = "expected minute hour day month weekday, as 0 2 * * * for two at night"
        table.fail("cron", f"is {shown(cron)}", remedy)
    return cron


def _check_zone(table: Fields, timezone: str) -> None:
    from zoneinfo import ZoneInfo

    try:
        ZoneInfo(timezone)
    except (ValueError, OSError, KeyError):
        table.fail("timezone", f"is {shown(timezone)}", "expected a name as Europe/Berlin")


def _name(table: Fields, field: str) -> str:
    name = table.text(field)
    try:
        return check_name(name)
    except ValueError as error:
        _, _, remedy = str(error).partition(": ")
        table.fail(field, f"is {shown(name)}", f"expected {remedy}")


def _texts(table: Fields, field: str) -> tuple[str, ...]:
    values = table.elements(field)
    for i, value in enumerate(values):
        if not isinstance(value, str) or not value.strip():
            place = (*table.place, field, i)
            table.fail_at(place, f"'{field}' has {shown(value)}", "expected texts in quotes")
    if not values:
        table.fail(field, "is empty", "name at least one, or take it out")
    return tuple(values)


def _count(table: Fields, field: str) -> int:
    value = table.value(field)
    if not isinstance(value, int) or isinstance(value, bool) or value < 1:
        table.fail(field, f"is {shown(value)}", "expected a whole number of 1 or more")
    return value
