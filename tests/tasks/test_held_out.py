"""What is held back is not learnt from, and scores are counted by hand."""

import numpy as np
import pytest

from tasks.forest import Examples, ForestParams
from tasks.held_out import (
    FOLDS,
    by_svm,
    class_scores,
    cross_validated,
    enlarged,
    held_out,
    nothing_more,
)

CLASSES = ("door", "other")


def drawn(n=240, seed=0, groups=4):
    """Return examples that one feature decides, of the same kind in every group."""
    rng = np.random.default_rng(seed)
    features = rng.normal(size=(n, 3))
    labels = (features[:, 1] > 0.5).astype(int)
    return Examples(features, labels, np.array([f"b{i % groups}/1" for i in range(n)]))


def test_each_group_is_asked_of_one_that_learnt_from_all_others():
    examples = drawn(groups=3)
    asked = []

    def spy(learnt, features):
        asked.append((set(learnt.groups.tolist()), len(features)))
        return np.tile([0.0, 1.0], (len(features), 1))

    held_out(examples, 2, spy)
    names = {"b0/1", "b1/1", "b2/1"}
    assert asked == [(names - {name}, 80) for name in sorted(names)]


def test_many_groups_are_held_back_several_at_a_time_and_each_once():
    examples = drawn(groups=7)
    learnt = []

    def spy(some, features):
        learnt.append(set(some.groups.tolist()))
        return np.tile([0.0, 1.0], (len(features), 1))

    told = held_out(examples, 2, spy)
    names = set(examples.groups.tolist())
    held = [names - some for some in learnt]
    assert len(held) == FOLDS and set.union(*held) == names
    assert sum(len(some) for some in held) == len(names)
    assert (told[:, 1] == 1).all()


def test_answers_come_back_in_the_order_of_the_examples():
    examples = drawn()
    told = held_out(examples, 2, lambda _, features: np.column_stack((features[:, 1],) * 2))
    np.testing.assert_array_equal(told[:, 0], examples.features[:, 1])


def test_a_group_that_only_its_own_examples_explain_is_not_explained():
    # labels of each group are its own: who had seen the group would be right everywhere
    examples = drawn(groups=2)
    own = Examples(
        np.column_stack((examples.groups == "b1/1", examples.features[:, 0])).astype(float),
        (examples.groups == "b1/1").astype(int),
        examples.groups,
    )
    scores = cross_validated(own, CLASSES, ForestParams(trees=10))
    for of_classifier in scores.values():
        assert [score.right for score in of_classifier] == [0, 0]


def test_more_is_made_of_what_is_not_held_back_alone():
    examples = drawn(groups=3)
    made_of, learnt = [], []

    def more(some):
        made_of.append(set(some.groups.tolist()))
        return Examples(some.features[:5], some.labels[:5], np.full(5, "table"))

    def spy(some, features):
        learnt.append((set(some.groups.tolist()), len(some)))
        return np.tile([1.0, 0.0], (len(features), 1))

    told = held_out(examples, 2, enlarged(spy, more))
    names = {"b0/1", "b1/1", "b2/1"}
    assert made_of == [names - {name} for name in sorted(names)]
    assert learnt == [(names - {name} | {"table"}, 165) for name in sorted(names)]
    assert len(told) == len(examples)  # what was made is not scored
    assert len(nothing_more(examples)) == 0


def test_an_svm_learns_from_so_many_examples_at_most(monkeypatch):
    monkeypatch.setattr("tasks.held_out.SVM_EXAMPLES", 60)
    examples = drawn()
    told = by_svm(2, ForestParams())(examples, examples.features)
    again = by_svm(2, ForestParams())(examples, examples.features)
    np.testing.assert_array_equal(told, again)
    other = by_svm(2, ForestParams(seed=1))(examples, examples.features)
    assert (told != other).any()  # of 60 drawn otherwise


def test_what_one_feature_decides_is_told_apart_by_forest_and_svm():
    scores = cross_validated(drawn(), CLASSES, ForestParams(trees=30))
    assert set(scores) == {"forest", "svm"}
    for name, least in (("forest", 0.95), ("svm", 0.85)):
        for score in scores[name]:
            assert score.precision >= least and score.recall >= least


def test_scores_count_by_hand():
    examples = Examples(np.zeros((5, 1)), np.array([0, 0, 0, 1, 1]), np.array(list("aabbb")))
    said = np.array([[0.9, 0.1], [0.2, 0.8], [0.5, 0.5], [0.1, 0.9], [1.0, 0.0]])
    door, other = class_scores(examples, CLASSES, said)
    assert (door.examples, door.predicted, door.right) == (3, 3, 2)
    assert (other.examples, other.predicted, other.right) == (2, 2, 1)
    assert (door.precision, other.recall) == (2 / 3, 1 / 2)


def test_an_svm_takes_unknown_features_and_a_single_class():
    examples = drawn()
    gaps = examples.features.copy()
    gaps[::9, 0] = np.nan
    gaps[:, 2] = np.nan
    told = by_svm(2, ForestParams())(Examples(gaps, examples.labels, examples.groups), gaps)
    assert (told.argmax(axis=1) == examples.labels).mean() > 0.85
    alone = examples[examples.labels == 1]
    told = by_svm(2, ForestParams())(alone, examples.features)
    np.testing.assert_array_equal(told, np.tile([0.0, 1.0], (len(examples), 1)))


def test_one_group_cannot_be_held_back():
    with pytest.raises(ValueError, match="1 group of examples"):
        held_out(drawn(groups=1), 2, by_svm(2, ForestParams()))
