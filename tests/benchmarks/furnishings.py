"""Score furniture found on the storeys that stores hold, with each ingredient on and off.

    python tests/benchmarks/furnishings.py --from-store STORE ... --campaigns DIR --training DIR
        [--seeds N] [--ablation-seeds N] [--storeys NAME ...] [--jobs N] [--json FILE]

Scored are the two storeys of the simulated campaign of the paper's size and ten others of three
types of building (grammar.py), as results.py's and grammar.py's stores hold them: the clouds the
server decoded and the rooms of the initial model, with each seed. The forests learn from the
storeys that `mapsense train furniture --work DIR` keeps, none of which is scored. On four of the
ten storeys the search for segments was tuned; they are told apart.
"""

import argparse
import json
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

from correction.stored import stored_models
from correction.storeys import STOREYS, chosen
from furnishing.chain import forests, score_all
from furnishing.scores import (
    MEASURES,
    Score,
    by_class,
    by_cost,
    by_standing,
    by_variant,
    pooled,
    precision,
    recall,
)
from furnishing.stored import surroundings, training
from furnishing.variants import ALL, OTHERS
from report import Report, Target

TUNED = ("slab0", "slab1", "bent0", "ring0")
"""Storeys the search for segments was tuned on; their truth taught no forest."""
PAPER_RECALL = 0.746
AIMS = {"table": (0.95, 0.9), "chair": (0.92, 0.9)}
"""Recall and precision aimed at."""
NOTES = [
    "Simulated storeys. R: recall of all true pieces; of seen: of those that a scan saw, which are",
    "those of whose level surface (a chair's: its seat) a tenth of the 4 cm cells hold points",
    "within 4 cm of it, chairs with 15 points on their backs, other pieces with a tenth of a side",
    "that stands at no wall, and what was found besides; P: precision. Matches are one to one, of",
    "one class (furniture: of any), at an IoU of footprints over 0.25 and 0.5, of boxes over 0.3.",
    "+-: 95 % over seeds, which differ in the planes drawn and so in the rooms, not in the scans.",
    "Half hidden: chairs 30 % under a table, and what was seen of less than half of its surface.",
]


def main() -> int:
    """Score all storeys and variants asked for, and print the tables."""
    options = _options()
    storeys = chosen(options.storeys)
    stores = [store.resolve() for store in options.from_store]
    models = surroundings(
        stored_models(storeys, stores, options.seeds), options.campaigns.resolve()
    )
    if not models:
        raise SystemExit("no initial model of these storeys in the stores")
    taught = training(options.training.resolve())
    variants = [ALL, *OTHERS] if options.ablation_seeds else [ALL]
    scores: list[Score] = []
    with ProcessPoolExecutor(options.jobs or len(os.sched_getaffinity(0))) as pool:
        known = forests(taught, variants, pool)
        asked = [variants if m.seed < options.ablation_seeds else [ALL] for m in models]
        for model, found in zip(
            models, pool.map(partial(score_all, known=known), models, asked), strict=True
        ):
            print(f"{model.name}, seed {model.seed}: scored", file=sys.stderr, flush=True)
            scores += found
    reports = _reports(scores, options.ablation_seeds)
    for report in reports:
        print(report.text())
    if options.json is not None:
        options.json.write_text(json.dumps([r.as_json() for r in reports], indent=1))
    return 0


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    names = ", ".join(scored.name for scored in STOREYS)
    parser.add_argument("--from-store", type=Path, nargs="+", required=True, help="mapped storeys")
    parser.add_argument("--campaigns", type=Path, required=True, help="folder of their campaigns")
    parser.add_argument(
        "--training", type=Path, required=True, help="what `mapsense train --work` keeps"
    )
    parser.add_argument("--seeds", type=int, default=10, help="repeats of each storey")
    parser.add_argument("--ablation-seeds", type=int, default=1, help="of them with all variants")
    parser.add_argument("--storeys", nargs="*", default=[], help=f"all without; of {names}")
    parser.add_argument("--jobs", type=int, help="storeys at once; one per processor without")
    parser.add_argument("--json", type=Path, help="write raw figures there")
    options = parser.parse_args()
    if options.seeds < 1:
        parser.error(f"--seeds {options.seeds}: expected at least 1")
    return options


def _reports(scores: list[Score], ablated: int) -> list[Report]:
    main_ = [s for s in scores if s.variant == ALL.name]
    presets = {scored.name for scored in STOREYS if scored.is_preset}
    groups = {
        "presets": [s for s in scores if s.storey in presets],
        "unseen storeys": [s for s in scores if s.storey not in presets and s.storey not in TUNED],
        "storeys tuned on": [s for s in scores if s.storey in TUNED],
    }
    first = Report("Furniture", notes=NOTES)
    for title, some in groups.items():
        own = [s for s in some if s.variant == ALL.name]
        if own:
            first.tables += [by_class(title, own), by_standing(f"{title}, how it stands", own)]
            if title != "storeys tuned on":
                first.targets += _targets(title, own)
    for storey in dict.fromkeys(s.storey for s in main_):
        first.tables.append(by_class(storey, [s for s in main_ if s.storey == storey]))
    first.tables.append(by_cost("Cost, mean over seeds", main_))
    share = sum(s.cpu_s for s in main_) / max(sum(s.planes_cpu_s for s in main_), 1e-9)
    first.targets.append(Target("time / plane stage", share, 1.0, "x", of_time=True))
    if not ablated:
        return [first]
    ablations = Report("Furniture, each ingredient on and off, footprint IoU 0.5")
    for title, some in groups.items():
        own = [s for s in some if s.seed < ablated]
        if own:
            names = [variant.name for variant in (ALL, *OTHERS)]
            ablations.tables.append(by_variant(title, own, names))
    return [first, ablations]


def _targets(title: str, scores: list[Score]) -> list[Target]:
    def target(what: str, value: float, bound: float) -> Target:
        return Target(f"{title}: {what}", 100 * value, 100 * bound, " %", at_least=True)

    loose = MEASURES[0]
    targets = [target("recall", recall(pooled(scores, ("furniture", "", loose))), PAPER_RECALL)]
    for kind, (aim_recall, aim_precision) in AIMS.items():
        counts = pooled(scores, (kind, "", loose))
        targets.append(target(f"recall of {kind}s", recall(counts), aim_recall))
        targets.append(target(f"precision of {kind}s", precision(counts), aim_precision))
    return targets


if __name__ == "__main__":
    sys.exit(main())
