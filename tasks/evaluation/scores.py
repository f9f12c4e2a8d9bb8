"""Precision, recall and F1 of detections."""

from dataclasses import dataclass

import numpy as np

from storage.detections import Detections


@dataclass(frozen=True)
class Score:
    """How well one class was found at one threshold; None where nothing was compared."""

    class_: str
    metric: str
    threshold: float
    n_true: int
    n_found: int
    n_matched: int
    precision: float | None
    """matched / found; None if none was found"""
    recall: float | None
    """matched / true; None if there is none"""
    f1: float
    """2 matched / (found + true), their harmonic mean: 0 if either is empty"""
    value: float | None
    """mean IoU, or metres, of the matched"""
    class_accuracy: float | None
    """share of the matched with a true class that have it"""


def scores(detections: Detections) -> list[Score]:
    """Return one score per class, metric and threshold that has rows, in the order of the rows."""
    groups: dict[tuple[str, str, float], list[int]] = {}
    columns = (detections.classes, detections.metrics, detections.thresholds)
    for row, (class_, metric, threshold) in enumerate(zip(*columns, strict=True)):
        groups.setdefault((str(class_), str(metric), float(threshold)), []).append(row)
    return [_score(detections, *key, np.array(rows)) for key, rows in groups.items()]


def _score(
    detections: Detections, class_: str, metric: str, threshold: float, rows: np.ndarray
) -> Score:
    true, found = detections.true_ids[rows] != "", detections.found_ids[rows] != ""
    matched = true & found
    classed = matched & (detections.true_classes[rows] != "")
    right = detections.true_classes[rows] == detections.found_classes[rows]
    n_true, n_found, n = int(true.sum()), int(found.sum()), int(matched.sum())
    return Score(
        class_=class_,
        metric=metric,
        threshold=threshold,
        n_true=n_true,
        n_found=n_found,
        n_matched=n,
        precision=n / n_found if n_found else None,
        recall=n / n_true if n_true else None,
        f1=2 * n / (n_found + n_true),
        value=float(detections.values[rows][matched].mean()) if n else None,
        class_accuracy=float(right[classed].mean()) if classed.any() else None,
    )
