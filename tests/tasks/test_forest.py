"""Forests against scikit-learn's own answers, and the examples they learn from."""

import numpy as np
import pytest
from sklearn.ensemble import RandomForestClassifier

from storage.forest import open_forest, read_forest, write_forest
from tasks.forest import Examples, ForestParams, fit, joined, predict

FEATURES, CLASSES = ("a", "b", "c", "d"), ("door", "window", "other")


def drawn(n, seed=0, unknown=0.0):
    """Return examples of three classes by two of four features, with some unknown."""
    rng = np.random.default_rng(seed)
    features = rng.normal(size=(n, len(FEATURES)))
    labels = np.digitize(features[:, 0] + features[:, 2], (-1.0, 0.7))
    features[rng.uniform(size=features.shape) < unknown] = np.nan
    return Examples(features, labels, np.array([f"b{i % 4}/1" for i in range(n)]))


def reference(params):
    return RandomForestClassifier(
        n_estimators=params.trees,
        max_depth=params.depth,
        min_samples_leaf=params.leaf,
        max_samples=params.share,
        class_weight=None if params.class_weights == "equal" else "balanced",
        random_state=params.seed,
    )


@pytest.mark.parametrize("unknown", [0.0, 0.2])
@pytest.mark.parametrize(
    "params",
    [
        ForestParams(trees=8, seed=5),
        ForestParams(trees=20, depth=3, class_weights="equal"),
        ForestParams(trees=3, leaf=1),
        ForestParams(trees=6, share=0.25),
        ForestParams(trees=1, leaf=1000),  # nothing but a root
    ],
)
def test_predictions_are_those_of_scikit_learn(params, unknown):
    examples = drawn(300, unknown=unknown)
    asked = drawn(500, seed=1, unknown=0.2).features
    model = reference(params).fit(examples.features, examples.labels)
    found = predict(fit(examples, FEATURES, CLASSES, params), asked)
    np.testing.assert_allclose(found, model.predict_proba(asked), rtol=0, atol=1e-15)
    np.testing.assert_allclose(found.sum(axis=1), 1)


def test_a_forest_from_its_file_predicts_the_same(tmp_path):
    examples = drawn(300, unknown=0.3)
    forest = fit(examples, FEATURES, CLASSES, ForestParams(trees=10))
    write_forest(forest, tmp_path / "forest.parquet")
    again = read_forest(tmp_path / "forest.parquet", FEATURES, CLASSES)
    asked = drawn(200, seed=2, unknown=0.3).features
    np.testing.assert_array_equal(predict(again, asked), predict(forest, asked))


def test_a_value_at_a_threshold_goes_where_its_32_bits_say():
    examples = drawn(300)
    params = ForestParams(trees=5)
    forest = fit(examples, FEATURES, CLASSES, params)
    model = reference(params).fit(examples.features, examples.labels)
    asking = forest.asked >= 0
    asked = np.zeros((3 * asking.sum(), len(FEATURES)))
    at = forest.thresholds[asking]
    rows = np.arange(len(asked))
    near = np.concatenate((at, np.nextafter(at, np.inf), np.nextafter(at, -np.inf)))
    asked[rows, np.tile(forest.asked[asking], 3)] = near
    np.testing.assert_allclose(
        predict(forest, asked), model.predict_proba(asked), rtol=0, atol=1e-15
    )


def test_the_same_seed_makes_the_same_file_and_another_seed_another(tmp_path):
    examples = drawn(200)
    for name, seed in (("a", 0), ("b", 0), ("c", 1)):
        forest = fit(examples, FEATURES, CLASSES, ForestParams(trees=4, seed=seed))
        write_forest(forest, tmp_path / name)
    first, again, other = ((tmp_path / name).read_bytes() for name in "abc")
    assert first == again != other


def test_a_class_without_examples_is_never_predicted():
    examples = drawn(200)
    two = examples[examples.labels != 1]
    found = predict(fit(two, FEATURES, CLASSES, ForestParams(trees=5)), examples.features)
    assert found.shape == (200, 3)
    assert (found[:, 1] == 0).all() and (found[:, [0, 2]].max(axis=0) > 0.5).all()


def test_examples_of_one_class_are_all_predicted_to_be_it(tmp_path):
    examples = drawn(100)
    forest = fit(examples[examples.labels == 2], FEATURES, CLASSES, ForestParams(trees=3))
    np.testing.assert_array_equal(predict(forest, examples.features), [[0, 0, 1]] * 100)
    write_forest(forest, tmp_path / "one")
    assert len(open_forest(tmp_path / "one")) == 3


def test_nothing_asked_is_nothing_answered():
    forest = fit(drawn(50), FEATURES, CLASSES, ForestParams(trees=2))
    assert predict(forest, np.zeros((0, 4))).shape == (0, 3)


def test_provenance_tells_parameters_versions_and_groups():
    made = fit(drawn(50), FEATURES, CLASSES, ForestParams(trees=2, seed=9)).provenance
    assert made.parameters["seed"] == 9 and made.parameters["trees"] == 2
    assert set(made.versions) == {"scikit-learn", "numpy"}
    assert made.examples == {"b0/1": 13, "b1/1": 13, "b2/1": 12, "b3/1": 12}


@pytest.mark.parametrize(
    ("features", "said"),
    [
        (np.zeros((2, 3)), r"expected \(n, 4\), got \(2, 3\)"),
        (np.zeros(4), r"expected \(n, 4\), got \(4,\)"),
        (np.array([[0, 0, 0, 0], [0, np.inf, 0, 0]]), "feature 1 of row 1"),
        (np.array([[0, 0, 0, 1e39]]), "feature 3 of row 0"),
    ],
)
def test_prediction_failure(features, said):
    forest = fit(drawn(50), FEATURES, CLASSES, ForestParams(trees=1))
    with pytest.raises(ValueError, match=said):
        predict(forest, features)


def test_fitting_failure():
    examples = drawn(10)
    with pytest.raises(ValueError, match="4 features, expected 3"):
        fit(examples, FEATURES[:3], CLASSES, ForestParams())
    with pytest.raises(ValueError, match="labels: expected 0 to 1"):
        fit(examples, FEATURES, CLASSES[:2], ForestParams())
    with pytest.raises(ValueError, match="no example"):
        fit(examples[np.zeros(10, bool)], FEATURES, CLASSES, ForestParams())


def test_examples_are_joined_and_chosen_row_by_row():
    first, second = drawn(5, seed=1), drawn(7, seed=2)
    both = joined([first, second])
    assert len(both) == 12
    np.testing.assert_array_equal(both[np.arange(5, 12)].features, second.features)
    np.testing.assert_array_equal(both[both.labels == 1].labels, 1)
    with pytest.raises(ValueError, match=r"expected \(n, k\), \(n,\), \(n,\)"):
        Examples(first.features, second.labels, first.groups)
