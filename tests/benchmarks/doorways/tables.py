"""Tables of doors and windows: pooled over storeys and seeds, with 95 % intervals over seeds."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from report import Column, Table

from doorways.storeys import Costs, Score
from storage.openings import STATES
from tasks.exports.figures.intervals import mean_of

SHARE = "{:.3f}"
DECILES = 10
SCORES = (
    Column("recall", "recall", SHARE), Column("recall_pm", "+-", SHARE),
    Column("precision", "precision", SHARE), Column("precision_pm", "+-", SHARE),
    *(Column(state, state, SHARE) for state in STATES),
    Column("told", "state", SHARE),
    Column("linked", "links", SHARE), Column("linked_pm", "+-", SHARE),
    Column("linked_whole", "whole", SHARE),
    Column("window_recall", "windows R", SHARE), Column("window_precision", "P", SHARE),
    Column("window_f1", "F1", SHARE), Column("window_f1_pm", "+-", SHARE),
    Column("doors", "doors"), Column("windows", "windows"), Column("seeds", "seeds"),
)  # fmt: skip
PART = (
    Column("case", "share hidden"), Column("doors", "doors"), Column("found", "found"),
    Column("recall", "recall", SHARE), Column("recall_pm", "+-", SHARE),
)  # fmt: skip
STEPS = ("trace", "candidates", "tell ours")
COSTS = (
    Column("case", "storey"), *(Column(step, f"{step} cpu s", "{:.2f}") for step in STEPS),
    Column("doors", "all", "{:.2f}"), Column("planes", "planes cpu s", "{:.2f}"),
    Column("ratio", "all / planes", "{:.2f}"), Column("seeds", "seeds"),
)  # fmt: skip


def variants_table(title: str, scores: Sequence[Score], names: Sequence[str]) -> Table:
    """Return a row per variant, pooled."""
    rows = [
        {"case": name} | row(some)
        for name in names
        if (some := [s for s in scores if s.variant == name])
    ]
    return Table(title, (Column("case", "variant"), *SCORES), rows)


def storeys_table(title: str, scores: Sequence[Score]) -> Table:
    """Return a row per storey."""
    names = dict.fromkeys(s.storey for s in scores)
    rows = [{"case": name} | row([s for s in scores if s.storey == name]) for name in names]
    return Table(title, (Column("case", "storey"), *SCORES), rows)


def deciles_table(title: str, scores: Sequence[Score]) -> Table:
    """Return a row per decile of what no ray reached of a door."""
    rows = []
    for decile in range(DECILES):

        def among(score: Score, decile: int = decile) -> np.ndarray:
            return np.minimum((score.hidden * DECILES).astype(int), DECILES - 1) == decile

        doors = sum(int(among(s).sum()) for s in scores)
        recall = _pooled(scores, lambda s, k=among: (s.hit[k(s)].sum(), k(s).sum()))
        rows.append(
            {
                "case": f"{10 * decile}-{10 * (decile + 1)} %",
                "doors": doors,
                "found": sum(int(s.hit[among(s)].sum()) for s in scores),
                "recall": recall[0],
                "recall_pm": recall[1],
            }
        )
    return Table(title, PART, rows)


def costs_table(title: str, costs: Sequence[Costs], planes: dict[str, float]) -> Table:
    """Return a row per storey: means over its seeds, beside what planes cost there."""
    rows = []
    for name in dict.fromkeys(c.storey for c in costs):
        own = [c for c in costs if c.storey == name]
        steps = {step: float(np.mean([c.seconds[step] for c in own])) for step in STEPS}
        doors = sum(steps.values())
        of_planes = planes.get(name)
        ratio = None if of_planes is None else doors / of_planes
        rest = {"doors": doors, "planes": of_planes, "ratio": ratio, "seeds": len(own)}
        rows.append({"case": name, **steps, **rest})
    return Table(title, COSTS, rows)


def row(scores: Sequence[Score]) -> dict[str, Any]:
    """Return the figures of some scores of one variant."""
    of_windows = [_window(i) for i in (0, 1)]
    figures: dict[str, Callable[[Score], tuple[int, int]]] = {
        "recall": lambda s: (s.hit.sum(), len(s.hit)),
        "precision": lambda s: (s.hit.sum(), s.doors),
        "told": lambda s: (s.told.sum(), s.hit.sum()),
        "linked": lambda s: (s.linked.sum(), s.hit.sum()),
        "linked_whole": lambda s: (s.linked_whole.sum(), s.hit.sum()),
        "window_recall": of_windows[0],
        "window_precision": of_windows[1],
        "window_f1": lambda s: (2 * s.windows[2], s.windows[0] + s.windows[1]),
    }
    for state in STATES:
        figures[state] = lambda s, k=state: (s.hit[s.states == k].sum(), (s.states == k).sum())
    found: dict[str, Any] = {}
    for name, figure in figures.items():
        found[name], found[f"{name}_pm"] = _pooled(scores, figure)
    return found | {
        "doors": sum(len(s.hit) for s in scores),
        "windows": sum(s.windows[0] for s in scores),
        "seeds": len({s.seed for s in scores}),
    }


def _window(of: int) -> Callable[[Score], tuple[int, int]]:
    return lambda s: (s.windows[2], s.windows[of])


def _pooled(
    scores: Sequence[Score], figure: Callable[[Score], tuple[int, int]]
) -> tuple[float | None, float | None]:
    """Return a share of all, and half the width of its interval over seeds; None if undefined.

    Seeds that not all storeys were mapped with are left out of the interval.
    """
    storeys = {s.storey for s in scores}
    shares = []
    for seed in sorted({s.seed for s in scores}):
        some = [s for s in scores if s.seed == seed]
        if {s.storey for s in some} == storeys:
            shares.append(_share(figure(s) for s in some))
    whole = _share(figure(s) for s in scores)
    mean = mean_of(np.array(shares, float))
    half = None if np.isnan(mean.high) else mean.high - mean.value
    return None if np.isnan(whole) else whole, half


def _share(counts: Any) -> float:
    right, all_ = (int(sum(some)) for some in zip(*counts, strict=True))
    return right / all_ if all_ else np.nan
