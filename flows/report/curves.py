"""Precision over recall, per class, metric and threshold."""

import numpy as np

from flows.report.data import (
    NOT_EVALUATED,
    Answers,
    Origin,
    Row,
    column,
    grouped,
    origin_badges,
    origins,
    seeds_told,
    variant_name,
    variant_order,
)
from tasks.exports.figures.canvas import Picture
from tasks.exports.figures.curves import Operating, draw_precision_recall
from tasks.exports.report import Section

CLASSES = (
    "room",
    "corner",
    "wall",
    "wall_end",
    "door",
    "window",
    "furniture",
    "table",
    "chair",
    "other",
)
METRICS = {
    "iou": "IoU of areas, exceeding",
    "iou_class": "IoU of areas and class, exceeding",
    "iou_width": "IoU of widths, exceeding",
    "iou_3d": "IoU of volumes, exceeding",
    "distance_m": "distance of at most, m",
    "links": "rooms linked, of IoU exceeding",
}
"""How two objects are compared, before the threshold."""


def curve_section(answers: Answers) -> Section:
    """Return precision over recall per class and metric."""
    rows = answers.rows["curves"]
    missing = [] if rows else [NOT_EVALUATED]
    pictures: list[Picture] = []
    for origin in origins(rows):
        points = _curve_points(origin.rows)
        drawn = {point.panel for point in points if not np.isnan(point.precisions).all()}
        missing += _classes_not_found(origin)
        shown = [point for point in points if point.panel in drawn]
        if shown:
            told = f"{origin.told}, {seeds_told(origin.rows)}"
            picture = draw_precision_recall(f"precision_recall{origin.suffix}", shown, told)
            pictures.append(picture)
    return Section(
        key="precision-recall",
        title="Precision and recall over thresholds",
        text=(
            "Each point is one threshold, written beside it; crosses are 95 % intervals over the "
            "seeds by Student's t. All storeys are counted together.",
        ),
        badges=origin_badges(rows),
        pictures=tuple(pictures),
        missing=tuple(missing),
        queries=answers.quoted("curves", "One row per class, metric, threshold, variant and seed:"),
    )


def _curve_points(rows: list[Row]) -> list[Operating]:
    found = grouped(rows, lambda r: (r["class"], r["metric"], r["variant"], r["threshold"]))
    keys = sorted(
        found,
        key=lambda k: (_place(k[0], CLASSES), _place(k[1], tuple(METRICS)), variant_order(k[2]), k),
    )
    points = []
    for class_, metric, variant, threshold in keys:
        part = found[class_, metric, variant, threshold]
        panel = f"{class_.replace('_', ' ')}\n{METRICS.get(metric, metric)}"
        recalls, precisions = column(part, "recall"), column(part, "precision")
        points.append(Operating(panel, variant_name(variant), threshold, recalls, precisions))
    return points


def _classes_not_found(origin: Origin) -> list[str]:
    classes = grouped(origin.rows, lambda row: row["class"])
    names = [name for name, rows in classes.items() if not any(row["n_found"] for row in rows)]
    names.sort(key=lambda name: _place(name, CLASSES))
    if not names:
        return []
    listed = ", ".join(name.replace("_", " ") for name in names)
    return [f"Not drawn ({origin.told}), for no plan has any: {listed}."]


def _place(name: str, known: tuple[str, ...]) -> int:
    return known.index(name) if name in known else len(known)
