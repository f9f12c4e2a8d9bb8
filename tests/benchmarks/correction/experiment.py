"""The main rows as an experiment of the evaluation flow, and what SQL says of its store."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from commands import ask, mapsense
from report import Table

from correction.storeys import Scored
from correction.tables import table
from correction.variants import HOSPITAL, NONE, WRONG, Variant

ERRORS = """
with each as (
  select building, storey, variant, seed, avg(abs(found_m2 - true_m2)) as mean_m2
  from detections where class = 'room' and metric = 'iou' and threshold = 0 group by all
), over_seeds as (
  select building, storey, variant, count(*) as seeds, confidence95(mean_m2) as mean_pm
  from each group by all
)
select building, storey, variant, any_value(seeds) as seeds, any_value(mean_pm) as mean_pm,
       avg(abs(found_m2 - true_m2)) as mean_m2,
       quantile_cont(abs(found_m2 - true_m2), 0.95) as p95_m2,
       max(abs(found_m2 - true_m2)) as max_m2,
       avg(coalesce(abs(found_m2 - true_m2), true_m2)) filter (true_id is not null) as all_m2
from detections join over_seeds using (building, storey, variant)
where class = 'room' and metric = 'iou' and threshold = 0
group by building, storey, variant
"""
ROOMS = """
select building, storey, variant, recall, f1, f1_pm
from recall_precision where class = 'room' and metric = 'iou' and threshold = 0.5
"""
CLASSES = """
select building, storey, variant, accuracy as classes
from class_accuracy where threshold = 0.5
"""


def write_experiment(
    path: Path,
    storeys: Sequence[Scored],
    variants: Sequence[Variant],
    campaigns: Path,
    grammars: Path,
    seeds: int,
) -> None:
    """Write variants as an experiment of `mapsense evaluate`; JSON's texts are TOML's too."""
    lines = [f"seeds = {seeds}"]
    for scored in storeys:
        entry = {
            "building": scored.building,
            "storey": scored.storey,
            "scans": [str(scored.scans(campaigns).resolve())],
            "truth": str(scored.truth(campaigns).resolve()),
        }
        lines += ["", "[[storeys]]", *(f"{k} = {json.dumps(v)}" for k, v in entry.items())]
    for variant in variants:
        lines += ["", f"[variants.{variant.name}]  # {variant.about}"]
        lines += _grammar(variant, grammars)
        lines += [f"{name} = {json.dumps(value)}" for name, value in variant.settings.items()]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _grammar(variant: Variant, grammars: Path) -> list[str]:
    if variant.grammar == NONE:
        return []
    of_each = grammars.resolve() / variant.grammar / "{building}-{storey}.toml"
    named = HOSPITAL if variant.grammar == WRONG else str(of_each)
    return [f"grammar = {json.dumps(named)}"]


def evaluate(path: Path, store: Path, jobs: int | None) -> None:
    """Run an experiment; what the store has already is not computed again."""
    at_once = [] if jobs is None else ["--jobs", str(jobs)]
    mapsense("evaluate", str(path), "--store", str(store), *at_once)


def store_tables(
    store: Path, storeys: Sequence[Scored], variants: Sequence[Variant]
) -> list[Table]:
    """Return a table per storey of what the store says of the variants."""
    found: dict[tuple[str, str, str], dict[str, Any]] = {}
    for sql in (ERRORS, ROOMS, CLASSES):
        for row in ask(store, sql):
            key = row["building"], row["storey"], row["variant"]
            found.setdefault(key, {}).update(row)
    tables = []
    for scored in storeys:
        rows = []
        initial = found.get((scored.building, scored.storey, NONE))
        for variant in variants:
            row = found.get((scored.building, scored.storey, variant.name))
            if row is not None:
                row = row | {"case": variant.name}
                if initial is not None and variant.name != NONE:
                    row["less"] = 1 - row["mean_m2"] / initial["mean_m2"]
                if variant.grammar == NONE:
                    row["classes"] = None  # nobody said any
                rows.append(row)
        tables.append(table(f"{scored.name}: SQL over the store", "variant", rows))
    return tables
