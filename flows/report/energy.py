"""Fig. 19: simulated energy of the crowd's devices."""

import numpy as np

from flows.report.data import Answers, Row, column, grouped, place_name
from storage.energy import BASELINES, MAPSENSE, QUERIES, STOREY
from tasks.exports.figures.energy import Spent, draw_energy_by_queries, draw_energy_by_storey
from tasks.exports.figures.intervals import mean_of
from tasks.exports.report import Cell, Section, Table

MOST_STOREYS = 12
"""Storeys drawn, and bars of as many."""
ABOUT = (
    "Joules are simulated from counted work and bytes by the energy model, never measured. Mean "
    "over the seeds of the draws, with its 95 % interval by Student's t."
)
PAPER = "In the paper MapSense takes 24 % less than GraMap and 46 % less than No Processing."
COLUMNS = ("storey", "queries", "against", "seeds", "less energy, %", "from", "to")


def energy_sections(answers: Answers) -> tuple[Section, Section]:
    """Return energy over the number of queries, and of whole storeys."""
    rows = answers.rows["energy"]
    by_queries = _spent([row for row in rows if row["series"] == QUERIES])
    by_storey = _spent([row for row in rows if row["series"] == STOREY])
    storeys = list(dict.fromkeys(s.storey for s in by_queries))
    curves = tuple(
        draw_energy_by_queries(f"figure_19a_{_file(storey)}", storey, here, _seeds(here))
        for storey in storeys[:MOST_STOREYS]
        if (here := [s for s in by_queries if s.storey == storey])
    )
    several = set(list(dict.fromkeys(s.storey for s in by_storey))[:MOST_STOREYS])
    shown = [s for s in by_storey if s.storey in several]
    bars = (draw_energy_by_storey("figure_19b", shown, _seeds(shown)),) if shown else ()
    quoted = answers.quoted("energy", "One row per storey, method, number of queries and seed:")
    sections = []
    for key, title, spent, pictures in (
        ("figure-19a", "Fig. 19a: energy over sensing queries", by_queries, curves),
        ("figure-19b", "Fig. 19b: energy of whole storeys, a query a room", by_storey, bars),
    ):
        missing = () if spent else (_not_charged(answers.charged),)
        if len({s.storey for s in spent}) > MOST_STOREYS:
            missing = (f"{MOST_STOREYS} of {len({s.storey for s in spent})} storeys are drawn.",)
        section = Section(
            key=key,
            title=title,
            text=(ABOUT, PAPER),
            badges=("simulated joules", _seeds(spent)) if spent else (),
            pictures=pictures,
            tables=(Table("What MapSense saves, simulated", COLUMNS, _saved(spent)),)
            if spent
            else (),
            missing=missing,
            queries=quoted,
        )
        sections.append(section)
    return sections[0], sections[1]


def _not_charged(others: tuple[str, ...]) -> str:
    """Say that there is no energy, and of which other buildings there is."""
    if not others:
        return "No energy was charged yet: `mapsense energy` does so."
    return f"No energy was charged under this name; there is energy of {', '.join(others)}."


def _spent(rows: list[Row]) -> list[Spent]:
    found = grouped(rows, lambda r: (place_name(r, rows), r["method"], r["n_queries"]))
    return [
        Spent(storey, method, int(n), column(part, "total_j"))
        for (storey, method, n), part in found.items()
    ]


def _saved(spent: list[Spent]) -> tuple[tuple[Cell, ...], ...]:
    """Return what MapSense saves of each baseline's energy, seed by seed."""
    totals = {(s.storey, s.n_queries, s.method): s.totals_j for s in spent}
    rows: list[tuple[Cell, ...]] = []
    for (storey, n, method), ours in totals.items():
        if method != MAPSENSE:
            continue
        for baseline in BASELINES:
            theirs = totals.get((storey, n, baseline))
            if theirs is None or len(theirs) != len(ours) or not np.all(theirs > 0):
                continue
            saving = mean_of(100 * (1 - ours / theirs))
            values = (saving.value, saving.low, saving.high)
            cells = tuple(None if np.isnan(v) else round(v, 1) for v in values)
            rows.append((storey, n, baseline, len(ours), *cells))
    return tuple(rows)


def _seeds(spent: list[Spent]) -> str:
    counts = sorted({len(s.totals_j) for s in spent})
    if counts[-1] == 1:
        return "1 seed"
    told = f"{counts[0]} to {counts[-1]}" if len(counts) > 1 else str(counts[0])
    return f"{told} seeds, 95 % interval"


def _file(storey: str) -> str:
    return storey.replace(" / ", "_")
