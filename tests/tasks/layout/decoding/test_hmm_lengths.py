"""The length constraint, as Fig. 8 prunes and exactly, against enumeration and a transcription."""

from itertools import pairwise, product

import numpy as np
import pytest
from scipy import stats

from tasks.layout.decoding.hmm import Model
from tasks.layout.decoding.hmm_lengths import viterbi_pruned, viterbi_within
from tasks.layout.decoding.transitions import transition_matrix

MODELS = ("conditional", "paper")
CASES = [(model, seed, length) for model in MODELS for seed in range(3) for length in (12, 16, 22)]


def model(transitions, seed, rules=4):
    rng = np.random.default_rng(seed)
    p_a, p_r = rng.dirichlet(np.ones(rules)), rng.dirichlet(np.ones(rules), rules)
    matrix = transition_matrix(p_a, p_r, transitions, 0.0)
    return Model(np.log(p_a), np.log(matrix), rng.integers(20, 60, rules) / 10, 1.0)


def observed(seed):
    return np.random.default_rng(seed + 100).uniform(2, 7, 4)


def best_of_all(m, observations, length):
    found = (-np.inf, None)
    for sequence in product(range(len(m.widths)), repeat=len(observations)):
        widths = m.widths[list(sequence)]
        if widths.sum() > length + 1e-9:
            continue
        steps = pairwise(sequence)
        log_p = m.log_initial[sequence[0]] + sum(m.log_transitions[i, j] for i, j in steps)
        log_p += stats.norm.logpdf(observations, widths, m.sigma).sum()
        if log_p > found[0]:
            found = (log_p, list(sequence))
    return found


def fig_8(m, observations, length):
    """Lines 12 to 25, word for word: probabilities, and a path kept with each state."""
    eta, width, path = {}, {}, {}
    for i, w in enumerate(m.widths):
        if w <= length + 1e-9:
            eta[i] = np.exp(m.log_initial[i]) * stats.norm.pdf(observations[0], w, m.sigma)
            width[i], path[i] = w, [i]
    for o in observations[1:]:
        new_eta, new_width, new_path = {}, {}, {}
        for i, w in enumerate(m.widths):
            for j in eta:
                if w + width[j] > length + 1e-9:
                    continue  # skip the path
                alpha = eta[j] * np.exp(m.log_transitions[j, i]) * stats.norm.pdf(o, w, m.sigma)
                if i not in new_eta or alpha > new_eta[i]:
                    new_eta[i], new_width[i], new_path[i] = alpha, w + width[j], [*path[j], i]
        eta, width, path = new_eta, new_width, new_path
    if not eta:
        return -np.inf, None
    best = max(eta, key=eta.get)
    return np.log(eta[best]), path[best]


@pytest.mark.parametrize(("transitions", "seed", "length"), CASES)
def test_the_exact_programme_finds_the_best_of_all_sequences_that_fit(transitions, seed, length):
    m, observations = model(transitions, seed), observed(seed)
    path, log_p = viterbi_within(m, observations, length, 0.1)
    expected, sequence = best_of_all(m, observations, length)
    assert log_p == pytest.approx(expected)
    assert path.tolist() == ([-1] * 4 if sequence is None else sequence)


@pytest.mark.parametrize(("transitions", "seed", "length"), CASES)
def test_pruning_finds_what_fig_8_finds(transitions, seed, length):
    m, observations = model(transitions, seed), observed(seed)
    path, log_p = viterbi_pruned(m, observations, length)
    expected, sequence = fig_8(m, observations, length)
    assert log_p == pytest.approx(expected)
    assert path.tolist() == ([-1] * 4 if sequence is None else sequence)


def test_the_cases_are_constrained_and_pruning_loses_some():
    lost, bound = 0, 0
    for transitions, seed, length in CASES:
        m, observations = model(transitions, seed), observed(seed)
        free, within = (best_of_all(m, observations, at)[0] for at in (np.inf, length))
        bound += within < free
        lost += viterbi_pruned(m, observations, length)[1] < within - 1e-9
    assert bound >= 3 and lost >= 1


def test_a_line_too_short_for_any_rule_has_no_sequence():
    m = model("conditional", 0)
    for path, log_p in (
        viterbi_pruned(m, observed(0), 1.0),
        viterbi_within(m, observed(0), 1.0, 0.01),
    ):
        assert path.tolist() == [-1] * 4 and log_p == -np.inf


def test_widths_that_fill_the_line_fit_it():
    m = Model(np.zeros(1), np.zeros((1, 1)), np.array([0.1]), 1.0)
    # ten times 0.1 is more than 1 by rounding, nine times less
    observations = np.full(10, 0.1)
    assert viterbi_pruned(m, observations, 1.0)[0].tolist() == [0] * 10
    assert viterbi_within(m, observations, 1.0, 0.01)[0].tolist() == [0] * 10
    assert viterbi_pruned(m, observations, 0.99)[0].tolist() == [-1] * 10


def test_without_observations_there_is_nothing_to_explain():
    m = model("conditional", 0)
    assert viterbi_pruned(m, np.empty(0), 5.0)[1] == 0.0
    assert viterbi_within(m, np.empty(0), 5.0, 0.01)[1] == 0.0
