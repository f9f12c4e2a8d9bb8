"""Fig. 18b: what was found of what is there; and the results that are told first."""

import numpy as np

from flows.report.data import (
    MOST_GROUPS,
    NOT_EVALUATED,
    Answers,
    Origin,
    Row,
    column,
    grouped,
    origin_badges,
    origins,
    seeds_told,
    told_first,
    variant_name,
    variant_order,
)
from tasks.exports.figures.canvas import Picture
from tasks.exports.figures.intervals import mean_of
from tasks.exports.figures.scores import Scores, draw_scores
from tasks.exports.report import Cell, Number, Section, Table

PAPER_RECALL = {"walls": "97.6 %", "doors": "96 %", "furniture": "74.6 %"}
"""Mean recall in Fig. 18b of the paper."""
WANTED = ("rooms", "walls", "doors", "windows", "furniture")


def score_section(answers: Answers) -> Section:
    """Return recall, and precision beside it, of what the paper looks for."""
    rows = answers.rows["scores"]
    missing = [] if rows else [NOT_EVALUATED]
    pictures: list[Picture] = []
    tables: list[Table] = []
    for origin in origins(rows):
        drawn = [row for row in origin.rows if _found_any(row, origin.rows)]
        missing += _never_found(origin)
        if not drawn:
            continue
        parts = _score_rows(drawn)
        told = f"{origin.told}, {seeds_told(drawn)}"
        pictures.append(draw_scores(f"figure_18b{origin.suffix}", parts[:MOST_GROUPS], told))
        table = Table(
            f"Means, 95 % intervals over plans ({origin.told})", SCORE_COLUMNS, _table(parts)
        )
        tables.append(table)
    return Section(
        key="figure-18b",
        title="Fig. 18b: recall of walls, doors and furniture, with precision",
        text=(
            "A point is one plan of one storey: upper its recall, lower its precision; the tick is "
            "the mean. Nothing is aligned, matches are one-to-one.",
            "The paper reports recall alone, of its point clouds: walls 97.6 %, doors 96 %, "
            "furniture 74.6 %.",
        ),
        badges=origin_badges(rows),
        pictures=tuple(pictures),
        tables=tuple(tables),
        missing=tuple(missing),
        queries=answers.quoted("scores", "One row per plan and class:"),
    )


SCORE_COLUMNS = (
    "class",
    "criterion",
    "variant",
    "plans",
    "recall, %",
    "from",
    "to",
    "precision, %",
    "from",
    "to",
)


def _score_rows(rows: list[Row]) -> list[Scores]:
    found = grouped(rows, lambda r: (r["place"], r["what"], r["criterion"], r["variant"]))
    keys = sorted(found, key=lambda key: (key[0], variant_order(key[3])))
    return [
        Scores(
            key[1],
            key[2],
            variant_name(key[3]),
            column(found[key], "recall"),
            column(found[key], "precision"),
        )
        for key in keys
    ]


def _table(parts: list[Scores]) -> tuple[tuple[Cell, ...], ...]:
    rows: list[tuple[Cell, ...]] = []
    for part in parts:
        recall, precision = mean_of(part.recalls), mean_of(part.precisions)
        means = (recall, precision)
        values = [value for mean in means for value in (mean.value, mean.low, mean.high)]
        cells = tuple(None if np.isnan(v) else round(100 * v, 1) for v in values)
        rows.append((part.class_, part.criterion, part.variant, len(part.recalls), *cells))
    return tuple(rows)


def _found_any(row: Row, rows: list[Row]) -> bool:
    """Return whether any plan has an object of the row's class."""
    return any(r["n_found"] > 0 for r in rows if r["what"] == row["what"])


def _never_found(origin: Origin) -> list[str]:
    """Say which classes no plan has, and how many are there."""
    told = []
    classes = grouped(origin.rows, lambda row: row["what"])
    for what in WANTED:
        rows = classes.get(what, [])
        if not rows:
            told.append(f"No {what} ({origin.told}): neither the truth nor any plan has one.")
        elif not any(row["n_found"] > 0 for row in rows):
            true = max(_true_by_variant(rows))
            told.append(
                f"No {what} yet ({origin.told}): no plan has one, the truth has {true:,.0f}. "
                "Recall is 0 %, precision is not defined."
            )
    return told


def _true_by_variant(rows: list[Row]) -> list[float]:
    """Return how many true objects there are, once for each variant and seed."""
    parts = grouped(rows, lambda row: (row["variant"], row["seed"])).values()
    return [sum(row["n_true"] for row in part) for part in parts]


def headline(answers: Answers) -> tuple[Number, ...]:
    """Return the few results that are read first: of the final models."""
    numbers: list[Number] = []
    for origin in origins(answers.rows["areas"]):
        variant = told_first({row["variant"] for row in origin.rows})
        of_final = [row for row in origin.rows if row["variant"] == variant]
        errors = column(of_final, "error_m2")
        known = errors[~np.isnan(errors)]
        note = f"{variant_name(variant)}, {len(errors)} rooms, {origin.told}"
        if len(known):
            numbers.append(Number(f"{np.median(known):.2f} m²", "median error of area", note))
    for origin in origins(answers.rows["scores"]):
        variant = told_first({row["variant"] for row in origin.rows})
        for what in ("walls", "doors", "furniture"):
            rows = [r for r in origin.rows if r["what"] == what and r["variant"] == variant]
            if not rows:
                continue
            recall = mean_of(column(rows, "recall")).value
            precision = mean_of(column(rows, "precision")).value
            note = f"{rows[0]['criterion']}; paper {PAPER_RECALL[what]}; {origin.told}"
            if not np.isnan(precision):
                note = f"precision {100 * precision:.0f} %; {note}"
            value = "none there" if np.isnan(recall) else f"{100 * recall:.0f} %"
            numbers.append(Number(value, f"recall of {what}", note))
    return tuple(numbers)
