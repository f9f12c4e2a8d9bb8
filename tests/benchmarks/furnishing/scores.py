"""Counts of what was found of true furniture, and tables of them over storeys and seeds."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from report import Column, Table

from furnishing.seen import STANDING
from storage.detections import IOU, IOU_3D
from storage.furniture import CLASSES, Furniture
from storage.plan import Plan, PlanFurniture
from tasks.evaluation.detections import EvaluationParams, detect
from tasks.exports.figures.intervals import mean_of

MEASURES = ((IOU, 0.25), (IOU, 0.5), (IOU_3D, 0.3))
NAMES = {(IOU, 0.25): "0.25", (IOU, 0.5): "0.5", (IOU_3D, 0.3): "3D 0.30"}
KINDS = (*CLASSES, "furniture")
HITS, TRUE, SEEN, FOUND = range(4)

SCORES = tuple(
    column
    for measure in MEASURES
    for column in (
        Column(f"recall {NAMES[measure]}", f"R {NAMES[measure]}", "{:.1%}"),
        Column(f"recall_pm {NAMES[measure]}", "+-", "{:.1%}"),
        Column(f"seen {NAMES[measure]}", "of seen", "{:.1%}"),
        Column(f"precision {NAMES[measure]}", "P", "{:.1%}"),
        Column(f"precision_pm {NAMES[measure]}", "+-", "{:.1%}"),
    )
)
COUNTS = (Column("true", "true"), Column("seen", "seen"), Column("seeds", "seeds"))
Key = tuple[str, str, tuple[str, float]]
"""Class, how it stands ('' any), metric and threshold."""


@dataclass(frozen=True, eq=False)
class Score:
    """What one variant found on one storey with one seed."""

    storey: str
    seed: int
    variant: str
    counts: dict[Key, NDArray[np.int64]]
    """hits, true pieces, those of them that were seen or hit, found pieces"""
    cpu_s: float
    planes_cpu_s: float


def counted(
    found: Furniture, truth: Plan, seen: NDArray[np.bool_], stands: NDArray[np.str_]
) -> dict[Key, NDArray[np.int64]]:
    """Return the counts of all classes, ways to stand and measures."""
    pieces = tuple(
        PlanFurniture(
            id=f"found-{i}",
            footprint=found.footprints[i],
            class_=str(found.classes[i]),
            base_m=float(found.base_m[i]),
            top_m=float(found.top_m[i]),
        )
        for i in range(len(found))
    )
    bare = replace(truth, rooms=(), walls=(), doors=(), windows=())
    rows = detect(replace(bare, furniture=pieces), bare, EvaluationParams())
    place = {piece.id: i for i, piece in enumerate(truth.furniture)}
    counts = {}
    for kind in KINDS:
        for measure in MEASURES:
            mine = (rows.classes == kind) & (rows.metrics == measure[0])
            mine &= np.isclose(rows.thresholds, measure[1])
            is_true, is_found = rows.true_ids[mine] != "", rows.found_ids[mine] != ""
            hit = is_true & is_found
            at = np.array([place.get(id_, -1) for id_ in rows.true_ids[mine]], np.int64)
            known = is_true & (seen[at] | hit)
            for stand in ("", *STANDING):
                of = is_true & ((stands[at] == stand) | (not stand))
                all_found = is_found.sum() if not stand else 0
                counts[kind, stand, measure] = np.array(
                    [(hit & of).sum(), of.sum(), (known & of).sum(), all_found]
                )
    return counts


def by_class(title: str, scores: Sequence[Score]) -> Table:
    """Return recall and precision of each class, and of all furniture."""
    rows = [_row(kind, scores, kind, "") for kind in KINDS]
    return Table(title, (Column("case", "class"), *SCORES, *COUNTS), rows)


def by_standing(title: str, scores: Sequence[Score]) -> Table:
    """Return recall of each class by how it stands: what is found falsely stands nowhere."""
    rows = [_row(f"{kind}, {s}", scores, kind, s) for kind in CLASSES for s in STANDING]
    columns = [c for c in SCORES if not c.key.startswith("precision")]
    return Table(title, (Column("case", "standing"), *columns, *COUNTS), rows)


def by_variant(title: str, scores: Sequence[Score], variants: Iterable[str]) -> Table:
    """Return recall and precision of each variant at a footprint IoU of 0.5, class by class."""
    columns, rows = [Column("case", "variant")], []
    for kind in KINDS:
        columns += [
            Column(f"{kind} recall", f"{kind} R", "{:.1%}"),
            Column(f"{kind} seen", "of seen", "{:.1%}"),
            Column(f"{kind} precision", "P", "{:.1%}"),
        ]
    for name in variants:
        own = [s for s in scores if s.variant == name]
        if not own:
            continue
        row: dict[str, Any] = {"case": name}
        for kind in KINDS:
            figures = _row(kind, own, kind, "")
            for key in ("recall", "seen", "precision"):
                row[f"{kind} {key}"] = figures[f"{key} 0.5"]
        rows.append(row)
    return Table(title, columns, rows)


def by_cost(title: str, scores: Sequence[Score]) -> Table:
    """Return processor seconds of finding and naming furniture beside those of finding planes."""
    columns = (
        Column("case", "storey"), Column("cpu_s", "furniture cpu s", "{:.2f}"),
        Column("planes_cpu_s", "planes cpu s", "{:.2f}"), Column("ratio", "ratio", "{:.2f}"),
    )  # fmt: skip
    rows = []
    for storey in dict.fromkeys(s.storey for s in scores):
        own = [s for s in scores if s.storey == storey]
        ours, theirs = (float(np.mean([getattr(s, f) for s in own])) for f in COSTS)
        ratio = ours / theirs if theirs else None
        rows.append({"case": storey, "cpu_s": ours, "planes_cpu_s": theirs, "ratio": ratio})
    return Table(title, columns, rows)


COSTS = ("cpu_s", "planes_cpu_s")


def recall(counts: NDArray[np.int64]) -> float:
    """Return the share of true pieces that were found; NaN without any."""
    return counts[HITS] / counts[TRUE] if counts[TRUE] else np.nan


def precision(counts: NDArray[np.int64]) -> float:
    """Return the share of found pieces that are true; NaN without any."""
    return counts[HITS] / counts[FOUND] if counts[FOUND] else np.nan


def pooled(scores: Iterable[Score], key: Key) -> NDArray[np.int64]:
    """Return the counts of several scores together."""
    return np.sum([s.counts[key] for s in scores], axis=0)


def _row(case: str, scores: Sequence[Score], kind: str, stand: str) -> dict[str, Any]:
    row: dict[str, Any] = {"case": case, "seeds": len({s.seed for s in scores})}
    for measure in MEASURES:
        key, name = (kind, stand, measure), NAMES[measure]
        total = pooled(scores, key)
        row |= {
            f"recall {name}": _known(recall(total)),
            f"recall_pm {name}": _within(scores, key, recall),
            f"seen {name}": total[HITS] / total[SEEN] if total[SEEN] else None,
            f"precision {name}": _known(precision(total)),
            f"precision_pm {name}": _within(scores, key, precision),
        }
    storeys = len({(s.storey, s.seed) for s in scores})
    row["true"], row["seen"] = (int(n) for n in pooled(scores, (kind, stand, MEASURES[0]))[1:3])
    return row | {"storeys": storeys}


def _within(
    scores: Sequence[Score], key: Key, figure: Callable[[NDArray[np.int64]], float]
) -> float | None:
    """Return half the 95 % interval of a figure over seeds; None of one seed."""
    seeds = sorted({s.seed for s in scores})
    each = [[s for s in scores if s.seed == seed] for seed in seeds]
    if len({frozenset(s.storey for s in some) for some in each}) > 1:
        return None  # seeds of different storeys do not differ by chance alone
    mean = mean_of(np.array([figure(pooled(some, key)) for some in each], float))
    return _known(mean.high - mean.value)


def _known(value: float) -> float | None:
    return None if np.isnan(value) else float(value)
