"""Fig. 18a: how far the areas of mapped rooms are from the true ones."""

import numpy as np

from flows.report.data import (
    MOST_GROUPS,
    NOT_EVALUATED,
    Answers,
    Row,
    column,
    grouped,
    is_initial,
    origin_badges,
    origins,
    place_name,
    seeds_told,
    variant_name,
    variant_order,
)
from tasks.exports.figures.areas import AreaErrors, draw_area_errors
from tasks.exports.figures.canvas import Picture
from tasks.exports.report import Cell, Section, Table

NO_INITIAL = (
    "No initial model is scored apart: either it is the final one, for nothing refined it, or a "
    "plan alone was compared."
)


def area_section(answers: Answers) -> Section:
    """Return the distribution of the rooms' area errors per storey and variant."""
    rows = answers.rows["areas"]
    pictures: list[Picture] = []
    tables: list[Table] = []
    missing = [] if rows else [NOT_EVALUATED]
    if rows and not any(is_initial(row["variant"]) for row in rows):
        missing.append(NO_INITIAL)
    for origin in origins(rows):
        groups = _area_groups(origin.rows)
        if len(groups) > MOST_GROUPS:
            missing.append(f"{MOST_GROUPS} of {len(groups)} distributions are drawn.")
        told = f"{origin.told}, {seeds_told(origin.rows)}"
        picture = draw_area_errors(f"figure_18a{origin.suffix}", groups[:MOST_GROUPS], told)
        pictures.append(picture)
        tables.append(Table(f"Area error, m² ({origin.told})", AREA_COLUMNS, _area_rows(groups)))
    return Section(
        key="figure-18a",
        title="Fig. 18a: error of room areas",
        text=(
            "|true - found| area of each true room, with the room it shares most area with. The "
            "box spans the quartiles, the thick line is the median, whiskers reach the last room "
            "within 1.5 times the box, and every room is a point.",
            "In the paper the grammar takes 76 % (ifp) and 74 % (IPVS) off the mean error, and the "
            "worst room errs by 1.2 m² instead of 4.5 m².",
        ),
        badges=origin_badges(rows),
        pictures=tuple(pictures),
        tables=tuple(tables),
        missing=tuple(missing),
        queries=answers.quoted("areas", "One row per true room and plan:"),
    )


AREA_COLUMNS = ("storey", "variant", "plans", "rooms", "missed", "mean", "median", "p95", "worst")


def _area_groups(rows: list[Row]) -> list[AreaErrors]:
    found = grouped(rows, lambda row: (place_name(row, rows), row["variant"]))
    groups = []
    for (place, variant), part in found.items():
        errors = column(part, "error_m2")
        plans = len({row["seed"] for row in part})
        known = errors[~np.isnan(errors)]
        missed = len(errors) - len(known)
        groups.append((variant, AreaErrors(place, variant_name(variant), known, missed, plans)))
    groups.sort(key=lambda group: (group[1].storey, variant_order(group[0])))
    return [group for _, group in groups]


def _area_rows(groups: list[AreaErrors]) -> tuple[tuple[Cell, ...], ...]:
    rows: list[tuple[Cell, ...]] = []
    for g in groups:
        e = g.errors_m2
        measures: tuple[Cell, ...] = (None, None, None, None)
        if len(e):
            values = (e.mean(), np.median(e), np.quantile(e, 0.95), e.max())
            measures = tuple(round(float(v), 3) for v in values)
        rows.append((g.storey, g.variant, g.seeds, len(e) + g.missed, g.missed, *measures))
    return tuple(rows)
