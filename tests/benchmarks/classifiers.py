"""Forests: our predictions against scikit-learn's, and the forest against the paper's SVM."""

from functools import partial
from typing import Any

import numpy as np
from harness import BenchmarkError, Case, Prepared, measure
from numpy.typing import NDArray
from report import TIMES, Column, Report, Table, Target

from flows.forests import KINDS, shipped
from storage.forest import open_forest
from tasks.forest import Examples, ForestParams, fit, predict

OURS, SKLEARN = "ours", "scikit-learn"
FEATURES, CLASSES = 40, ("door", "window", "other")
TRAINED = 3000
ASKED = {500: 0.5, 50_000: 1.0}
"""Candidates of a storey, and of a hundred of them; and the target, our time as a share of
scikit-learn's: of few candidates it mostly sets out for each tree."""
UNKNOWN = 0.2
"""Share of features that are unknown: the other face of an outer wall has none."""
ROUNDS = 7
COLUMNS = (
    Column("case", "method"), *TIMES, Column("ratio", "ours / theirs", "{:.3f}"),
    Column("microseconds", "us a candidate", "{:.2f}"),
)  # fmt: skip
SCORE_COLUMNS = (
    Column("case", "classifier"), Column("class", "class"), Column("examples", "examples"),
    Column("precision", "precision", "{:.3f}"), Column("recall", "recall", "{:.3f}"),
)  # fmt: skip
NOTES = [
    "Both must return the same probabilities (checked here). scikit-learn predicts on all cores,",
    "ours on one. Scores are those the forests' files name: training storeys held back in turn,",
    "simulated scans; the SVM learnt from the same examples, scaled.",
]


def classifiers(quick: bool) -> Report:
    """Measure predictions, and tell the scores of the forests that come with MapSense."""
    report = Report("Classifiers of doors and furniture", notes=list(NOTES))
    for asked, bound in ASKED.items():
        found = measure(
            Case(OURS, partial(prepare_ours, asked)),
            [Case(SKLEARN, partial(prepare_sklearn, asked), rival=True)],
            1 if quick else ROUNDS,
        )
        if found[OURS].figures != found[SKLEARN].figures:
            raise BenchmarkError(f"{asked}: {found[OURS].figures}, {found[SKLEARN].figures}")
        rows = [m.row() | {"microseconds": 1e6 * m.median_s / asked} for m in found.values()]
        rows[1]["ratio"] = ratio = found[OURS].ratio(found[SKLEARN])
        title = f"{ForestParams().trees} trees, {asked:,} candidates, {FEATURES} features"
        report.tables.append(Table(title, COLUMNS, rows))
        what = f"{asked:,} candidates: time / {SKLEARN}"
        report.targets.append(Target(what, ratio, bound, "x", of_time=True))
    for kind in KINDS:
        if shipped(kind).is_file():
            rows = _scores(kind)
            report.tables.append(Table(f"{kind}, storeys held back in turn", SCORE_COLUMNS, rows))
    return report


def _scores(kind: str) -> list[dict[str, Any]]:
    scores = open_forest(shipped(kind)).provenance.scores
    return [
        {
            "case": classifier,
            "class": score.class_,
            "examples": score.examples,
            "precision": score.precision,
            "recall": score.recall,
        }
        for classifier, of_classes in scores.items()
        for score in of_classes
    ]


def _drawn(n: int, seed: int) -> Examples:
    rng = np.random.default_rng(seed)
    features = rng.normal(size=(n, FEATURES))
    labels = np.digitize(features[:, :4].sum(axis=1) + rng.normal(size=n), (-2.0, 2.0))
    features[rng.uniform(size=features.shape) < UNKNOWN] = np.nan
    return Examples(features, labels, np.full(n, "drawn"))


def _judge(found: NDArray[np.float64]) -> dict[str, Any]:
    return {"sums": np.round(found.sum(axis=0), 6).tolist()}


def prepare_ours(asked: int) -> Prepared:
    """Return our forest, compiled, and what it is asked."""
    names = [f"f{i}" for i in range(FEATURES)]
    forest = fit(_drawn(TRAINED, 0), names, CLASSES, ForestParams())
    features = _drawn(asked, 1).features
    predict(forest, features[:1])
    return Prepared(lambda: predict(forest, features), _judge)


def prepare_sklearn(asked: int) -> Prepared:
    """Return scikit-learn's forest of the same parameters, on all cores."""
    from joblib import parallel_config
    from sklearn.ensemble import RandomForestClassifier

    examples, params = _drawn(TRAINED, 0), ForestParams()
    model = RandomForestClassifier(
        params.trees,
        min_samples_leaf=params.leaf,
        class_weight=params.class_weights,
        random_state=params.seed,
    ).fit(examples.features, examples.labels)
    features = _drawn(asked, 1).features

    def run() -> NDArray[np.float64]:
        with parallel_config("threading", n_jobs=-1):
            return model.predict_proba(features)

    run()
    return Prepared(run, _judge)
