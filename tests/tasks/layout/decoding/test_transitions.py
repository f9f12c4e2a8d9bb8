"""Both models of how rules follow each other."""

import numpy as np
import pytest

from tasks.layout.decoding.transitions import logarithm, transition_matrix

P_A = np.array([0.5, 0.3, 0.2])
P_R = np.array([[0.1, 0.6, 0.3], [0.7, 0.2, 0.1], [0.25, 0.25, 0.5]])


def test_conditional_without_smoothing_is_the_relationship_probability():
    assert transition_matrix(P_A, P_R, "conditional", 0.0) == pytest.approx(P_R)


def test_smoothing_mixes_the_a_priori_probabilities_in():
    found = transition_matrix(P_A, np.eye(3), "conditional", 0.1)
    assert found[0] == pytest.approx([0.95, 0.03, 0.02])


def test_paper_is_eq_9_divided_by_its_sum():
    found = transition_matrix(P_A, P_R, "paper", 0.0)
    for i in range(3):
        ratios = [(P_A[j] / P_A[i]) * (P_R[j, i] / P_R[i, j]) for j in range(3)]
        assert found[i] == pytest.approx([ratio / sum(ratios) for ratio in ratios])


def test_eq_9_favours_the_rarer_order():
    p_a = np.array([0.5, 0.5])
    often_then_rarely = np.array([[0.2, 0.8], [0.1, 0.9]])
    found = transition_matrix(p_a, often_then_rarely, "paper", 0.0)
    assert found[0, 1] < found[0, 0] and found[1, 0] > found[1, 1]


@pytest.mark.parametrize("model", ["conditional", "paper"])
@pytest.mark.parametrize("smoothing", [0.0, 0.3])
def test_rows_sum_to_one(model, smoothing):
    found = transition_matrix(P_A, P_R, model, smoothing)
    assert found.sum(axis=1) == pytest.approx(np.ones(3))


def test_a_rule_that_is_never_applied_gets_no_probability_by_eq_9():
    never = np.array([[0.4, 0.6, 0.0], [0.5, 0.5, 0.0], [0.5, 0.5, 0.0]])
    found = transition_matrix(np.array([0.5, 0.5, 0.0]), never, "paper", 0.1)
    assert (found[:, 2] == 0).all() and np.isfinite(found).all()


def test_the_logarithm_of_nothing_is_minus_infinity():
    assert logarithm(np.array([0.0, 1.0])).tolist() == [-np.inf, 0.0]
