"""Score doors and windows on stored storeys: ours, the paper's way, ours without an ingredient.

    python tests/benchmarks/doors.py --from-store STORE ... --campaigns DIR [--seeds N]
        [--ablations N] [--storeys NAME ...] [--training DIR] [--jobs N] [--json FILE]

Scored are the storeys of grammar.py but those that parameters were chosen on: the stores hold what
`mapsense evaluate` made of them, the campaigns their truth. Nothing is mapped: the functions of the
door stages take the stored rooms, walls, points and snapshots.

With --training, the work folder of `mapsense train doors`, ours is the forest that comes with
MapSense, and the classifiers of other variants learn from the same storeys. Without, all learn from
the storeys that parameters were chosen on, as the stores hold them.

With --ablations, only ours and the paper's way see the seeds from that one on.
"""

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from commands import ask
from correction.stored import Stored, stored_models
from correction.storeys import STOREYS, Scored, chosen
from doorways.learning import TUNING, of_storey, of_training, only
from doorways.storeys import TABLES, Costs, Doorways, Score
from doorways.tables import costs_table, deciles_table, row, storeys_table, variants_table
from doorways.truth import hidden_shares
from doorways.variants import OURS, THE_PAPER, VARIANTS, Variant
from numpy.typing import NDArray
from report import Report, Target

from flows.forests import shipped
from flows.learners import OPENINGS_FOREST
from storage.candidates import FEATURES
from storage.forest import Forest
from tasks.doors.classifying import read_classifier
from tasks.doors.examples import CLASSES
from tasks.forest import Examples, fit, joined, predict
from tasks.held_out import SVM_EXAMPLES, by_svm

PLANES = """
with each as (
  select building, storey, scan, avg(cpu_s) as cpu_s from stages
  where stage = 'planes' and outcome = 'computed' group by all
)
select building, storey, sum(cpu_s) as cpu_s from each group by all
"""
MAIN = (OURS, THE_PAPER)
TARGETS = (
    ("recall", "doors recall", 0.96, 0.99),
    ("precision", "doors precision", 0.90, 0.97),
    ("window_f1", "windows F1", 0.85, None),
    ("linked", "rooms linked right, of found doors", 0.98, None),
)
NOTES = [
    "Simulated storeys; a door or window is found at an IoU over 0.5 on the wall plane, one to",
    "one, nothing is aligned. open, ajar, shut: recall of doors whose leaf stands so. state:",
    "right, of doors found. links: doors found that link the true rooms, leaving out rooms that",
    "were not found; whole: with those. +-: 95 % over seeds. Share hidden: of a true door's",
    "rectangle, what no ray reached that was cast at the walls of the true plan, from the face",
    "that sees it better. Processor seconds are of all threads; those of planes as stored.",
]


Way = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""Probabilities of classes, (n, c), by a variant's features, (n, k)."""


@dataclass(frozen=True, eq=False)
class BySvm:
    """A support vector machine, trained when it is asked: training is no part of what is timed."""

    examples: Examples

    def __call__(self, features: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return probabilities of classes."""
        return by_svm(len(CLASSES), OPENINGS_FOREST)(self.examples, features)


def main() -> int:
    """Score all storeys asked for, and print the tables."""
    options = _options()
    stores = [store.resolve() for store in options.from_store]
    storeys = [scored for scored in chosen(options.storeys) if scored.name not in TUNING]
    models = stored_models(storeys, stores, options.seeds, TABLES)
    if not models:
        raise SystemExit("none of these storeys in the stores: name others with --from-store")
    with ProcessPoolExecutor(options.jobs) as pool:
        forest, examples, learnt = _learnt(options, stores, pool)
        wanted = VARIANTS if options.ablations != 0 else MAIN
        ways = {variant.name: _way(variant, forest, examples) for variant in wanted}
        first = {model.scored.name: model for model in reversed(models)}
        hidden_in = partial(hidden_of, campaigns=options.campaigns)
        hidden = dict(zip(first, pool.map(hidden_in, first.values()), strict=True))
        run = partial(score_all, ways=ways, campaigns=options.campaigns)
        variants = [
            VARIANTS if options.ablations is None or m.seed < options.ablations else MAIN
            for m in models
        ]
        results = list(pool.map(run, models, [hidden[m.scored.name] for m in models], variants))
    scores = [score for some, _ in results for score in some]
    costs = [of_model for _, of_model in results]
    report = _report(scores, costs, _planes(stores, storeys), learnt)
    print(report.text())
    if options.json is not None:
        options.json.write_text(json.dumps([report.as_json()], indent=1))
    return 0


def score_all(
    stored: Stored,
    hidden: NDArray[np.float64],
    variants: Sequence[Variant],
    ways: dict[str, Way],
    campaigns: Path,
) -> tuple[list[Score], Costs]:
    """Return the scores of variants on one storey and seed, and what the steps cost."""
    model = Doorways(stored, campaigns)
    model.warm_up()
    # ours last: by then all that is compiled has been loaded
    order = sorted(variants, key=lambda v: (v.candidates == OURS.candidates, v == OURS))
    scores = [model.score(variant, ways[variant.name], hidden) for variant in order]
    print(f"{stored.scored.name}, seed {stored.seed}: scored", file=sys.stderr, flush=True)
    return scores, model.costs


def hidden_of(stored: Stored, campaigns: Path) -> NDArray[np.float64]:
    """Return how much of each true door of a storey no ray reached."""
    model = Doorways(stored, campaigns)
    return hidden_shares(model.truth, model.points, model.snapshots)


def _learnt(
    options: argparse.Namespace, stores: Sequence[Path], pool: ProcessPoolExecutor
) -> tuple[Forest, Examples, str]:
    """Return our forest, the examples that others learn from, and what these are, in words."""
    if options.training is not None:
        forest = read_classifier(options.forest or shipped("doors"))
        examples = of_training(options.training, forest)
        count = len(forest.provenance.storeys)
        return forest, examples, f"{count} training storeys, none of those scored"
    tuning = stored_models(chosen(TUNING), stores, 1, TABLES)
    if not tuning:
        raise SystemExit("none of the storeys to learn from in the stores: name --training")
    learn = partial(of_storey, campaigns=options.campaigns)
    examples = joined(list(pool.map(learn, tuning)))
    forest = fit(examples, FEATURES, CLASSES, OPENINGS_FOREST)
    names = ", ".join(model.scored.name for model in tuning)
    return forest, examples, f"{names}, seed 0: no --training was named"


def _way(variant: Variant, forest: Forest, examples: Examples) -> Way:
    known = [FEATURES.index(name) for name in variant.features]
    if variant.classifier == "svm":
        rng = np.random.default_rng(0)
        some = rng.permutation(len(examples))[:SVM_EXAMPLES]
        return BySvm(only(examples[some], known))
    if variant.features != forest.features:
        forest = fit(only(examples, known), variant.features, CLASSES, OPENINGS_FOREST)
    return partial(predict, forest)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--from-store", type=Path, nargs="+", required=True)
    parser.add_argument("--campaigns", type=Path, required=True, help="folder of all campaigns'")
    parser.add_argument("--seeds", type=int, default=10, help="repeats of each storey")
    parser.add_argument("--ablations", type=int, help="seeds of the other variants; all without")
    names = ", ".join(s.name for s in STOREYS if s.name not in TUNING)
    parser.add_argument("--storeys", nargs="*", default=[], help=f"all without; of {names}")
    parser.add_argument("--training", type=Path, help="work folder of 'mapsense train doors'")
    parser.add_argument("--forest", type=Path, help="our forest; the one that comes along without")
    parser.add_argument("--jobs", type=int, help="storeys at once; one per processor without")
    parser.add_argument("--json", type=Path, help="write raw figures there")
    options = parser.parse_args()
    if options.seeds < 1:
        parser.error(f"--seeds {options.seeds}: expected at least 1")
    if options.ablations is not None and options.ablations < 0:
        parser.error(f"--ablations {options.ablations}: expected at least 0")
    if options.forest is not None and options.training is None:
        parser.error("--forest: name its --training too, which other variants learn from")
    return options


def _planes(stores: Sequence[Path], storeys: Sequence[Scored]) -> dict[str, float]:
    """Return the processor seconds of the plane stage by the storey's name."""
    names = {(scored.building, scored.storey): scored.name for scored in storeys}
    return {
        names[row["building"], row["storey"]]: row["cpu_s"]
        for store in stores
        for row in ask(store, PLANES)
        if (row["building"], row["storey"]) in names
    }


def _report(
    scores: Sequence[Score], costs: Sequence[Costs], planes: dict[str, float], learnt: str
) -> Report:
    ours = [score for score in scores if score.variant == OURS.name]
    report = Report("Doors and windows", notes=[*NOTES, f"Learnt from: {learnt}."])
    report.tables += [
        variants_table("all storeys", scores, [v.name for v in VARIANTS]),
        storeys_table("ours, storey by storey", ours),
        deciles_table("ours, by what was hidden of a door", ours),
    ]
    of_costs = costs_table("ours, processor seconds of a storey, one core", costs, planes)
    report.tables.append(of_costs)
    found = row(ours)
    for figure, what, target, aim in TARGETS:
        for bound in (target, aim):
            if bound is not None:
                report.targets.append(Target(what, found[figure], bound, at_least=True))
    ratios = [r["ratio"] for r in of_costs.rows if r["ratio"] is not None]
    worst = max(ratios, default=None)
    report.targets.append(Target("doors' time / planes', worst storey", worst, 1.0, "x"))
    return report


if __name__ == "__main__":
    sys.exit(main())
