"""Tables of scores: means over rooms, storeys and seeds, with 95 % intervals over seeds."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from report import Column, Table

from correction.chain import Score
from correction.variants import NONE, Variant
from tasks.exports.figures.intervals import mean_of

SCORES = (
    Column("mean_m2", "mean m2", "{:.3f}"), Column("mean_pm", "+-", "{:.3f}"),
    Column("p95_m2", "p95", "{:.2f}"), Column("max_m2", "max", "{:.2f}"),
    Column("less", "less", "{:.0%}"), Column("all_m2", "with missed", "{:.3f}"),
    Column("recall", "recall", "{:.3f}"), Column("f1", "F1", "{:.3f}"),
    Column("f1_pm", "+-", "{:.3f}"), Column("classes", "classes", "{:.3f}"),
    Column("walls", "rows", "{:.2f}"), Column("lines", "lines", "{:.2f}"),
)  # fmt: skip
"""Of a variant: |area error| of the rooms found, how much less its mean is than the initial
model's, the mean with missed rooms at all of their area, what of the true rooms was found, classes
right, lines with the right rows of walls and with the right sequences of classes."""


def table(title: str, heading: str, rows: list[dict[str, Any]]) -> Table:
    """Return rows of scores as a table; `case` names each."""
    seeds = (Column("seeds", "seeds"),)
    return Table(title, (Column("case", heading), *SCORES, *seeds), rows)


def by_storey(scores: Sequence[Score], storey: str, variants: Iterable[str]) -> Table:
    """Return the scores of a storey."""
    own = [s for s in scores if s.storey == storey]
    return table(storey, "variant", _rows(own, variants))


def pooled(title: str, scores: Sequence[Score], variants: Iterable[str]) -> Table:
    """Return the scores over the rooms of several storeys."""
    return table(title, "variant", _rows(scores, variants))


def disturbed(title: str, scores: Sequence[Score], variants: Sequence[Variant]) -> Table:
    """Return scores of variants that spoil the initial model, against that spoilt alike."""
    rows = []
    for variant in variants:
        spoilt = variant.name.rpartition("-")[2]
        initial = [s for s in scores if s.variant == f"{NONE}-{spoilt}"]
        rows += _row(variant.name, [s for s in scores if s.variant == variant.name], initial)
    return table(title, "variant", rows)


def mean_error(scores: Iterable[Score]) -> float:
    """Return the mean area error over all rooms found."""
    return float(np.nanmean(np.concatenate([s.error_m2 for s in scores])))


def _rows(scores: Sequence[Score], variants: Iterable[str]) -> list[dict[str, Any]]:
    initial = [s for s in scores if s.variant == NONE]
    return [
        row
        for name in variants
        for row in _row(name, [s for s in scores if s.variant == name], initial)
    ]


def _row(name: str, scores: list[Score], initial: list[Score]) -> list[dict[str, Any]]:
    if not scores:
        return []
    errors = np.concatenate([s.error_m2 for s in scores])
    whole = np.where(np.isnan(errors), np.concatenate([s.true_m2 for s in scores]), errors)
    true, found = sum(len(s.true_m2) for s in scores), sum(s.found for s in scores)
    hits, lines = sum(s.hits for s in scores), sum(s.lines.count for s in scores)
    seeds = sorted({s.seed for s in scores})
    each = [[s for s in scores if s.seed == seed] for seed in seeds]
    if len({frozenset(s.storey for s in some) for some in each}) > 1:
        each = []  # seeds of different storeys do not differ by chance alone
    before = mean_error(initial) if initial else float("nan")
    return [
        {
            "case": name,
            "mean_m2": float(np.nanmean(errors)),
            "mean_pm": _within([mean_error(some) for some in each]),
            "p95_m2": float(np.nanquantile(errors, 0.95)),
            "max_m2": float(np.nanmax(errors)),
            "less": None if name == NONE or not initial else 1 - float(np.nanmean(errors)) / before,
            "all_m2": float(whole.mean()),
            "recall": hits / true,
            "f1": 2 * hits / (true + found),
            "f1_pm": _within([_f1(some) for some in each]),
            "classes": sum(s.classed[0] for s in scores) / hits if lines and hits else None,
            "walls": sum(s.lines.walls for s in scores) / lines if lines else None,
            "lines": sum(s.lines.classes for s in scores) / lines if lines else None,
            "seeds": len(seeds),
        }
    ]


def _f1(scores: Sequence[Score]) -> float:
    return 2 * sum(s.hits for s in scores) / sum(len(s.true_m2) + s.found for s in scores)


def _within(values: Sequence[float]) -> float | None:
    """Return half the width of the confidence interval of a mean, None of a single value."""
    mean = mean_of(np.array(values, float))
    return None if np.isnan(mean.high) else mean.high - mean.value
