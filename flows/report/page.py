"""The report of a store: the paper's figures from what was measured, as files and as one page."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from flows.report import queries
from flows.report.areas import area_section
from flows.report.curves import curve_section
from flows.report.data import Answers
from flows.report.energy import energy_sections
from flows.report.plans import plan_section
from flows.report.scores import headline, score_section
from flows.report.times import time_section
from storage.artifacts import check_name
from storage.catalog import Catalog
from storage.errors import MapSenseError, StoreError
from storage.files import write_whole
from storage.remote import refresh
from tasks.exports.report import Report, Section, render_report

PAGE, FIGURES = "report.html", "figures"
"""What is written into the folder of a report."""
ASKED = {
    "plans": queries.PLANS,
    "areas": queries.AREAS,
    "scores": queries.SCORES,
    "curves": queries.CURVES,
    "times": queries.TIMES,
    "energy": queries.ENERGY,
    "runs": queries.RUNS,
}


def write_report(store: Path, out: Path, building: str | None = None) -> Path:
    """Write the figures as SVG and PNG, and a page that shows them; return the page.

    Parameters
    ----------
    store : folder of a store
    out : folder to write into
    building : report on it and on the scans of its campaign alone; None: on everything

    Raises
    ------
    StoreError
        If there is no store, or nothing can be written.
    MapSenseError
        If nothing of the building is in the store.
    """
    refresh(store, "runs")
    if not (store / "runs").is_dir():
        raise StoreError(f"{store}: is no store (it has no folder runs); name one with --store")
    answers = ask(store, building)
    report = tell(answers, store, building)
    for section in report.sections:
        for picture in (*section.pictures, *section.files):
            for suffix, data in ((".svg", picture.svg), (".png", picture.png)):
                write_whole(out / FIGURES / f"{picture.name}{suffix}", data, "figure")
    write_whole(out / PAGE, render_report(report).encode(), "report")
    return out / PAGE


def ask(store: Path, building: str | None) -> Answers:
    """Return all that is told, each with the query it answers."""
    catalog = Catalog(store)
    buildings: tuple[str, ...] = ()
    if building is not None:
        try:
            check_name(building)
        except ValueError as error:
            raise MapSenseError(f"--building: {error}") from error
        # what the scans of a campaign cost is kept under a name of its own
        buildings = (building, f"{building}.scans")
    sql = {name: queries.written(text, buildings) for name, text in ASKED.items()}
    rows = {name: catalog.query(text).to_pylist() for name, text in sql.items()}
    if building is not None and not rows["runs"]:
        found = catalog.query("select distinct building from runs order by building")
        there = ", ".join(row["building"] for row in found.to_pylist()) or "none"
        raise MapSenseError(f"{store}: has no building '{building}'; there are: {there}")
    charged = catalog.query("select distinct building from energy order by building")
    names = tuple(row["building"] for row in charged.to_pylist())
    return Answers(rows, sql, tuple(catalog.problems), names)


def tell(answers: Answers, store: Path, building: str | None) -> Report:
    """Return the report of what was answered."""
    runs = answers.rows["runs"]
    ends = [run["ended_at"] for run in runs if run["ended_at"] is not None]
    text = [
        f"Store {store.resolve().name}: {len(runs)} runs of {_storeys(runs)}"
        + (f", the last ended {max(ends):%Y-%m-%d %H:%M} UTC." if ends else "."),
        "Every figure is drawn from the answer of the query quoted under it; "
        "`mapsense query` answers it again.",
    ]
    sections: tuple[Section, ...] = (
        plan_section(answers, store),
        area_section(answers),
        score_section(answers),
        curve_section(answers),
        time_section(answers),
        *energy_sections(answers),
    )
    badges = ("some data simulated",) if _simulated(answers) else ()
    return Report(
        title=f"MapSense: {building or 'what was measured'}",
        text=tuple(text),
        badges=badges,
        numbers=headline(answers),
        missing=tuple(f"Left out: {problem}." for problem in answers.problems),
        sections=sections,
    )


def _storeys(runs: list[dict[str, Any]]) -> str:
    buildings = sorted({run["building"] for run in runs})
    return f"{', '.join(buildings)}" if buildings else "no building"


def _simulated(answers: Answers) -> bool:
    rows: list[Mapping[str, Any]] = [*answers.rows["areas"], *answers.rows["scores"]]
    return bool(answers.rows["energy"]) or any(row["simulated"] for row in rows)
