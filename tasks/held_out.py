"""How well classes are told apart on storeys that were not trained on: some held back in turn."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from storage.forest_provenance import ClassScore
from tasks.forest import Examples, ForestParams, fit, joined, predict

Classifier = Callable[[Examples, NDArray[np.float64]], NDArray[np.float64]]
"""Learns from examples and returns the (m, c) probabilities of classes of other features."""
SVM_EXAMPLES = 5000
"""Examples an SVM learns from at most: its time grows with more than their square."""
FOLDS = 3
"""Parts that groups are held back in. More groups than that are as many to learn from anew."""
More = Callable[[Examples], Examples]
"""Makes further examples of some: what it makes must never be held back beside them."""


def by_forest(classes: int, params: ForestParams) -> Classifier:
    """Return a random forest as a classifier of a number of classes."""

    def classify(examples: Examples, features: NDArray[np.float64]) -> NDArray[np.float64]:
        names = [str(i) for i in range(features.shape[1])]
        forest = fit(examples, names, [str(i) for i in range(classes)], params)
        return predict(forest, features)

    return classify


def by_svm(classes: int, params: ForestParams) -> Classifier:
    """Return the paper's alternative, a support vector machine, as a classifier.

    It tells no probabilities: the class it decides for has all. Features are scaled to unit
    variance, unknown ones are taken for the median of the known: it takes no NaN. Classes count
    as the forest's parameters say; the rest is scikit-learn's defaults, a radial kernel. Of more
    than SVM_EXAMPLES examples as many are drawn.
    """

    def classify(examples: Examples, features: NDArray[np.float64]) -> NDArray[np.float64]:
        # a second of imports, which no run needs that only predicts
        from sklearn.impute import SimpleImputer
        from sklearn.pipeline import make_pipeline
        from sklearn.preprocessing import StandardScaler
        from sklearn.svm import SVC

        if len(examples) > SVM_EXAMPLES:
            rng = np.random.default_rng(params.seed)
            examples = examples[rng.choice(len(examples), SVM_EXAMPLES, replace=False)]
        known = np.unique(examples.labels)
        if len(known) == 1:  # an SVM needs two classes to tell apart
            decided = np.full(len(features), known[0])
        else:
            weights = "balanced" if params.class_weights == "balanced" else None
            model = make_pipeline(
                SimpleImputer(strategy="median", keep_empty_features=True),
                StandardScaler(),
                SVC(class_weight=weights),
            )
            decided = model.fit(examples.features, examples.labels).predict(features)
        return np.eye(classes)[decided]

    return classify


def nothing_more(examples: Examples) -> Examples:
    """Return no further examples."""
    return examples[np.zeros(len(examples), bool)]


def enlarged(classify: Classifier, more: More) -> Classifier:
    """Return a classifier that learns besides from what is made of the examples it learns from."""

    def classify_enlarged(examples: Examples, features: NDArray[np.float64]) -> NDArray[np.float64]:
        return classify(joined([examples, more(examples)]), features)

    return classify_enlarged


def held_out(examples: Examples, classes: int, classify: Classifier) -> NDArray[np.float64]:
    """Return what is said of each example by a classifier that learnt from the other groups.

    Parameters
    ----------
    examples : Examples
        Of two or more groups.
    classify : Classifier
        Trained anew for each of FOLDS parts of the groups, without it; for each group if there are
        no more than that.

    Returns
    -------
    (n, c) float
        Probabilities.

    Raises
    ------
    ValueError
        If all examples are of one group.
    """
    groups = np.unique(examples.groups)
    if len(groups) < 2:
        raise ValueError(f"{len(groups)} group of examples, expected 2 or more to hold one back")
    found = np.zeros((len(examples), classes))
    folds = min(FOLDS, len(groups))
    for first in range(folds):
        held = np.isin(examples.groups, groups[first::folds])
        found[held] = classify(examples[~held], examples.features[held])
    return found


def class_scores(
    examples: Examples, class_names: Sequence[str], probabilities: NDArray[np.float64]
) -> tuple[ClassScore, ...]:
    """Return what was right of each class if each example is of its most probable one.

    Parameters
    ----------
    probabilities : (n, c) float
        The first of several that are as probable is taken.
    """
    said = probabilities.argmax(axis=1)
    return tuple(
        ClassScore(
            class_=name,
            examples=int((examples.labels == i).sum()),
            predicted=int((said == i).sum()),
            right=int(((examples.labels == i) & (said == i)).sum()),
        )
        for i, name in enumerate(class_names)
    )


def cross_validated(
    examples: Examples, class_names: Sequence[str], params: ForestParams, more: More = nothing_more
) -> dict[str, tuple[ClassScore, ...]]:
    """Return the scores of forest and SVM on groups held back, as of `held_out`.

    Parameters
    ----------
    more : callable
        Makes further examples of those that are not held back, to learn from besides.
    """
    n = len(class_names)
    return {
        name: class_scores(examples, class_names, held_out(examples, n, enlarged(classify, more)))
        for name, classify in (("forest", by_forest(n, params)), ("svm", by_svm(n, params)))
    }
