"""The coded octree: what goes in comes out, in about as many bits as there is to know."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tasks.device import cells, entropy, neighbourhood
from tasks.device.octree import PayloadError, decode_cells, encode_cells


def keys_of(places, depth):
    """Return Morton codes bit by bit, ascending."""
    keys = set()
    for x, y, z in places:
        bits = [(v >> b) & 1 for b in reversed(range(depth)) for v in (x, y, z)]
        keys.add(int("".join(map(str, bits)) or "0", 2))
    return np.array(sorted(keys), np.uint64)


def trees():
    def of(depth):
        sides = st.integers(0, 2**depth - 1)
        places = st.lists(st.tuples(sides, sides, sides), min_size=1, max_size=60)
        return st.tuples(places, st.just(depth))

    return st.integers(0, 21).flatmap(of)


@settings(max_examples=150, deadline=None)
@given(trees())
def test_the_cells_of_a_tree_come_back(tree):
    places, depth = tree
    keys = keys_of(places, depth)
    found = decode_cells(encode_cells(keys, depth), depth, len(keys))
    np.testing.assert_array_equal(found, keys)
    assert sorted(set(places)) == sorted(map(tuple, cells.morton_cells(found).tolist()))


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32), st.floats(0.02, 0.98), st.integers(1, 4))
def test_dense_trees_come_back(seed, share, depth):
    rng = np.random.default_rng(seed)
    keys = np.flatnonzero(rng.random(8**depth) < share).astype(np.uint64)
    if len(keys):
        payload = encode_cells(keys, depth)
        np.testing.assert_array_equal(decode_cells(payload, depth, len(keys)), keys)


@settings(max_examples=50, deadline=None)
@given(st.lists(st.integers(0, 2**63 - 1), max_size=200))
def test_keys_are_sorted_and_made_unique(values):
    keys = np.array(values, np.uint64)
    np.testing.assert_array_equal(cells.sorted_unique(keys.copy(), 63), np.unique(keys))
    ordered, order = cells.sorted_order(keys.copy(), 63)
    np.testing.assert_array_equal(order, np.argsort(keys, kind="stable"))
    np.testing.assert_array_equal(ordered, np.sort(keys))


def test_a_full_cube_costs_next_to_nothing():
    keys = np.arange(8**6, dtype=np.uint64)
    assert 8 * len(encode_cells(keys, 6)) / len(keys) < 0.01


@pytest.mark.parametrize(("share", "depth", "surplus"), [(0.1, 7, 0.05), (0.5, 6, 0.02)])
def test_random_cells_cost_their_entropy(share, depth, surplus):
    rng = np.random.default_rng(5)
    keys = np.flatnonzero(rng.random(8**depth) < share).astype(np.uint64)
    entropy_bits = -(8**depth) * (share * math.log2(share) + (1 - share) * math.log2(1 - share))
    bits = 8 * len(encode_cells(keys, depth))
    # the surplus is what the models must see before they know
    assert 0.99 * entropy_bits < bits < (1 + surplus) * entropy_bits


def test_a_noisy_plane_costs_little_more_than_its_noise():
    # each column has one cell, at one of two heights by the toss of a coin: one bit a column
    rng = np.random.default_rng(2)
    side = np.arange(256)
    x, y = (v.ravel() for v in np.meshgrid(side, side))
    z = 128 + rng.integers(0, 2, x.size)
    keys = np.sort(cells.morton_keys(np.stack([x, y, z], axis=1) + np.float32(0.5),
                                     np.zeros(3), 1.0, np.zeros(3, np.int64)))  # fmt: skip
    assert 1.0 <= 8 * len(encode_cells(keys, 8)) / len(keys) < 1.3


def test_a_cut_long_or_miscounted_payload_failure():
    keys = np.flatnonzero(np.random.default_rng(1).random(8**3) < 0.4).astype(np.uint64)
    payload = encode_cells(keys, 3)
    for cut in range(len(payload)):
        with pytest.raises(PayloadError):
            decode_cells(payload[:cut], 3, len(keys))
    for wrong, count in ((payload + b"\0", 0), (payload, 1), (payload, -1)):
        with pytest.raises(PayloadError):
            decode_cells(wrong, 3, len(keys) + count)
    with pytest.raises(PayloadError):
        decode_cells(b"\0", 0, 1)


NEAR = list(itertools.product((-1, 0, 1), repeat=3))
CHILDREN = list(itertools.product((0, 1), repeat=3))


def test_the_tables_say_what_lies_beside_a_child():
    for child, at in enumerate(CHILDREN):
        for place, step in enumerate(NEAR):
            there = np.add(at, step)
            node = NEAR.index(tuple(there // 2))
            inside = CHILDREN.index(tuple(there % 2))
            assert neighbourhood.NODE_BESIDE[child, place] == node
            assert neighbourhood.CHILD_BESIDE[child, place] == inside
    assert NEAR[neighbourhood.SELF] == (0, 0, 0)
    assert sorted(np.abs(NEAR[place]).sum() for place in neighbourhood.FACES) == [1] * 6


def cells_of(window):
    bits = [b for b in range(64) if int(window) >> b & 1]
    return {(b // 16 - 1, b // 4 % 4 - 1, b % 4 - 1) for b in bits}


def test_the_tables_say_where_cells_lie_in_the_window():
    window = set(itertools.product(range(-1, 3), repeat=3))
    for place, step in enumerate(NEAR):
        at = [tuple(np.add(np.multiply(step, 2), child)) for child in CHILDREN]
        assert cells_of(neighbourhood.WINDOW_OF_NODE[place]) == window & set(at)
        for byte in (0, 1, 2, 37, 255):
            occupied = {at[child] for child in range(8) if byte >> child & 1}
            assert cells_of(neighbourhood.WINDOW_OF_BYTE[place, byte]) == window & occupied
    own = {cell for cell in window if set(cell) <= {0, 1}}
    for axis, side in itertools.product(range(3), range(2)):
        layer = {cell for cell in window if cell[axis] == side} - own
        assert cells_of(neighbourhood.WINDOW_OF_LAYER[axis, side]) == layer
    for child, axis in itertools.product(range(8), range(3)):
        before = [c for c in range(child) if CHILDREN[c][axis] == CHILDREN[child][axis]]
        bits = int(neighbourhood.BROTHERS[child, axis])
        assert [c for c in range(8) if bits >> c & 1] == before
        assert neighbourhood.SEEN_BROTHERS[child, axis] == len(before)
    for axis in range(3):
        for side in range(2):
            bits = int(neighbourhood.NODES_OF_SIDE[axis, side])
            assert [NEAR[p][axis] for p in range(27) if bits >> p & 1] == [2 * side - 1] * 9


def test_squashed_positions_are_the_logistic_function_and_stretch_undoes_them():
    position = np.arange(-2048, 2048)
    logistic = 65536 / (1 + np.exp(-position / 256))
    assert np.abs(entropy.SQUASH - logistic).max() < 300  # straight between the knots
    np.testing.assert_allclose(entropy.SQUASH[::128], np.clip(logistic[::128], 24, 65512), atol=1)
    assert (np.diff(entropy.SQUASH.astype(int)) >= 0).all()
    back = entropy.SQUASH[entropy.STRETCH.astype(int) + 2048] >> 4
    assert np.abs(back.astype(int) - np.arange(4096)).max() <= 4
