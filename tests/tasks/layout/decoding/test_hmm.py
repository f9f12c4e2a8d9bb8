"""Eq. 10 and 11 against enumeration of all sequences, and against another library."""

from itertools import pairwise, product

import numpy as np
import pytest
from scipy import stats

from tasks.layout.decoding.hmm import Model, rule_posteriors, viterbi
from tasks.layout.decoding.transitions import logarithm, transition_matrix

MODELS = ("conditional", "paper")


def model(rules, transitions, seed, sigma=1.0):
    rng = np.random.default_rng(seed)
    p_a = rng.dirichlet(np.ones(rules))
    p_r = rng.dirichlet(np.ones(rules), rules)
    matrix = transition_matrix(p_a, p_r, transitions, 0.0)
    return Model(np.log(p_a), np.log(matrix), rng.uniform(2, 8, rules), sigma)


def enumerated(m, observations):
    """Return all sequences, in the order of their indices, and the log p of each."""
    sequences = list(product(range(len(m.widths)), repeat=len(observations)))
    scores = []
    for sequence in sequences:
        log_p = m.log_initial[sequence[0]]
        log_p += sum(m.log_transitions[i, j] for i, j in pairwise(sequence))
        log_p += stats.norm.logpdf(observations, m.widths[list(sequence)], m.sigma).sum()
        scores.append(log_p)
    return sequences, np.array(scores)


@pytest.mark.parametrize("transitions", MODELS)
@pytest.mark.parametrize("seed", range(4))
def test_the_sequence_found_is_the_best_of_all(transitions, seed):
    m = model(4, transitions, seed, sigma=0.5 + seed)
    observations = np.random.default_rng(seed).uniform(1, 9, (3, 5))
    paths, log_p = viterbi(m, observations, np.full(3, 5))
    for line in range(3):
        sequences, scores = enumerated(m, observations[line])
        assert tuple(paths[line]) == sequences[scores.argmax()]
        assert log_p[line] == pytest.approx(scores.max())


@pytest.mark.parametrize("transitions", MODELS)
def test_paths_are_those_of_hmmlearn(transitions):
    hmm = pytest.importorskip("hmmlearn.hmm")
    m = model(40, transitions, seed=5)
    observations = np.random.default_rng(6).uniform(1, 9, (30, 25))
    theirs = hmm.GaussianHMM(40, "diag", init_params="")
    theirs.startprob_, theirs.transmat_ = np.exp(m.log_initial), np.exp(m.log_transitions)
    theirs.means_, theirs.covars_ = m.widths[:, None], np.ones((40, 1))
    paths, log_p = viterbi(m, observations, np.full(30, 25))
    for line, widths in enumerate(observations):
        their_log_p, their_path = theirs.decode(widths[:, None])
        assert paths[line].tolist() == their_path.tolist()
        assert log_p[line] == pytest.approx(their_log_p)


def test_lines_of_different_lengths_are_decoded_as_if_alone():
    m = model(5, "conditional", seed=1)
    rng = np.random.default_rng(2)
    counts = np.array([3, 0, 7, 1] * 20)  # more lines than a thread takes on
    observations = np.where(np.arange(7) < counts[:, None], rng.uniform(1, 9, (80, 7)), np.nan)
    paths, log_p = viterbi(m, observations, counts)
    for line, count in enumerate(counts):
        alone, score = viterbi(m, observations[line : line + 1, :count], np.array([count]))
        assert paths[line].tolist() == [*alone[0], *[-1] * (7 - count)]
        assert log_p[line] == score[0]


def test_of_equal_sequences_the_lowest_indices_win():
    m = Model(np.log(np.full(3, 1 / 3)), np.log(np.full((3, 3), 1 / 3)), np.full(3, 4.0), 1.0)
    assert viterbi(m, np.full((1, 6), 4.0), np.array([6]))[0].tolist() == [[0] * 6]


def test_a_line_whose_every_sequence_is_impossible_has_none():
    initial, onward = np.array([1.0, 0.0]), np.array([[0.0, 1.0], [0.0, 0.0]])
    m = Model(logarithm(initial), logarithm(onward), np.array([3.0, 5.0]), 1.0)
    paths, log_p = viterbi(m, np.array([[3.0, 5.0, 3.0], [3.0, 5.0, 0.0]]), np.array([3, 2]))
    assert paths.tolist() == [[-1, -1, -1], [0, 1, -1]]
    assert log_p[0] == -np.inf and np.isfinite(log_p[1])


@pytest.mark.parametrize("transitions", MODELS)
def test_rule_posteriors_are_the_shares_of_all_sequences(transitions):
    m = model(3, transitions, seed=3)
    observations = np.random.default_rng(4).uniform(1, 9, 5)
    sequences, scores = enumerated(m, observations)
    p = np.exp(scores - scores.max())
    p /= p.sum()
    expected = np.zeros((5, 3))
    for sequence, share in zip(sequences, p, strict=True):
        expected[np.arange(5), sequence] += share
    assert rule_posteriors(m, observations) == pytest.approx(expected)


def test_a_mirrored_line_has_the_mirrored_sequence_where_order_has_no_direction():
    rng = np.random.default_rng(7)
    pairs = rng.random((6, 6))
    pairs += pairs.T
    p_a = pairs.sum(axis=1) / pairs.sum()  # each pair as often in either order
    m = Model(np.log(p_a), np.log(pairs / pairs.sum(axis=1)[:, None]), rng.uniform(2, 8, 6), 1.0)
    observations = rng.uniform(1, 9, (20, 12))
    paths, log_p = viterbi(m, observations, np.full(20, 12))
    mirrored, mirrored_log_p = viterbi(m, observations[:, ::-1], np.full(20, 12))
    np.testing.assert_array_equal(mirrored, paths[:, ::-1])
    assert mirrored_log_p == pytest.approx(log_p)
