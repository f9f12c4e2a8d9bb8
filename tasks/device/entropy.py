"""Adaptive entropy coding of an octree's occupancy bytes, in whole numbers only.

An occupancy byte is coded as eight binary decisions, child 0 (bit 0) first. Four adaptive models
guess each of them: one from the pattern of the node's six face neighbours and of the children
coded so far, and one for each axis from how full the layers across that axis are; in a scan, one
axis runs through the surface, and along it the occupancy changes. Their guesses are mixed in the
logistic domain with weights that learn (Mahoney 2005, "Adaptive weighing of context models for
lossless data compression"), and the mixed probability drives a binary range coder.

What a model looks at, encoder and decoder both know: the nodes of the level, and the children of
the nodes that come earlier in it. There is no floating-point number here: rounding differs
between machines, and one differing bit ends in garbage.
"""

from typing import NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray

from tasks.device.cells import ones
from tasks.device.neighbourhood import (
    BROTHERS,
    CHILD_BESIDE,
    FACES,
    NODE_BESIDE,
    NODES_OF_SIDE,
    SEEN_BROTHERS,
    SELF,
    WINDOW_OF_BYTE,
    WINDOW_OF_LAYER,
    WINDOW_OF_NODE,
)

MODELS = 4
WORST_NODE_BYTES = 32
"""Each of a node's eight decisions moves at most the coder's four bytes out."""
COUNTED = 127
"""Decisions after which a probability moves at a fixed pace."""
PACE = np.array([655360 // (10 * n + 16) for n in range(COUNTED + 1)])
"""Share of the way, of 65536, a probability moves after n decisions: the mean of what it saw."""
LEARNING = 6
"""Pace of the mixing weights, in units of 2^-18."""
FIRST_WEIGHT = 26214
"""Of 65536: four models that agree are believed more than one."""
KNOTS = (
    22, 36, 60, 98, 162, 267, 439, 720, 1179, 1921, 3108, 4971, 7812, 11955, 17625, 24743,
    32768, 40793, 47911, 53581, 57724, 60565, 62428, 63615, 64357, 64816, 65097, 65269,
    65374, 65438, 65476, 65500, 65514, 65514,
)  # fmt: skip
"""65536 / (1 + exp(-x / 256)) for x = -2048, -1920, ... 2048, and once more the last."""
SURE = 24
"""Of 65536: no probability is nearer to 0 or 1."""
FULLNESS = np.array([0, 1, 2, 2, 3, 3, 4, 4, 5, 5])
"""Class of how many of a layer's nine nodes are occupied."""
CLASSES = 6
SEEN_STEP = CLASSES * CLASSES
FULL_STEP = 16 * SEEN_STEP
"""A layer's context counts sides, known cells and occupied cells in these steps."""


class Level(NamedTuple):
    """n nodes of one level in Morton order; entry i is one node everywhere."""

    bytes: NDArray[np.uint8]
    """(n,), which children are occupied"""
    first: NDArray[np.int32]
    """(n,), index of the node's first child in the next level"""
    near: NDArray[np.int32]
    """(n, 27), indices in this level of the nodes of the neighbourhood, -1 where there is none;
    without rows if no level follows that needs it"""


class Models(NamedTuple):
    """What has been learnt so far. An entry is a probability of 22 bits and a count of 10."""

    faces: NDArray[np.uint32]
    """(64 * 256,), by face neighbours and children coded so far"""
    layers: NDArray[np.uint32]
    """(3, 256 * 36), by fullness of the child's layer and of the layers beside the node"""
    weights: NDArray[np.int32]
    """(64 * 8, 4), of 65536, by face neighbours and child"""


def fresh_models() -> Models:
    """Return models that know nothing."""
    half = np.uint32(1 << 31)
    return Models(
        faces=np.full(64 * 256, half),
        layers=np.full((3, 256 * CLASSES * CLASSES), half),
        weights=np.full((64 * 8, MODELS), FIRST_WEIGHT, np.int32),
    )


def fresh_coder() -> NDArray[np.int64]:
    """Return a range coder at its start: low end, high end, code, position in the buffer."""
    return np.array([0, 0xFFFFFFFF, 0, 0], np.int64)


def above_root() -> Level:
    """Return a level of one node whose only child is the root."""
    near = np.full((1, 27), -1, np.int32)
    near[0, SELF] = 0
    return Level(np.ones(1, np.uint8), np.zeros(1, np.int32), near)


def _squash() -> NDArray[np.uint16]:
    """Return the probability, of 65536, at logistic position -2048 ... 2047."""
    position = np.arange(4096)
    knots, past = np.array(KNOTS), position & 127
    value = (knots[position >> 7] * (128 - past) + knots[(position >> 7) + 1] * past) >> 7
    return np.clip(value, SURE, 65536 - SURE).astype(np.uint16)


SQUASH = _squash()
STRETCH = np.clip(np.searchsorted(SQUASH >> 4, np.arange(4096)) - 2048, -2047, 2047).astype(
    np.int16
)
"""The inverse: logistic position of a probability of 4096."""


@nb.njit(cache=True, nogil=True)
def start_decoder(coder, buffer):
    """Read the first four bytes."""
    for _ in range(4):
        byte = np.int64(buffer[coder[3]]) if coder[3] < buffer.size else 0
        coder[2] = (coder[2] << 8) | byte
        coder[3] += 1


@nb.njit(cache=True, nogil=True)
def finish_encoder(coder, buffer):
    """Write what is left; return the length of the whole."""
    for shift in (24, 16, 8, 0):
        buffer[coder[3]] = np.uint8((coder[0] >> shift) & 255)
        coder[3] += 1
    return coder[3]


@nb.njit(cache=True, nogil=True)
def code_level(decoding, above, level, models, coder, buffer):
    """Code the occupancy bytes of a level's nodes.

    Parameters
    ----------
    decoding : bool
        Whether to read `level.bytes` from the buffer, or to write them to it.
    above : Level
        The level of the nodes' parents, complete.
    level : Level
        Gets `first` and, if it has rows, `near`; when decoding, `bytes`.
    models, coder
        Carried on from level to level.
    buffer : (b,) uint8
        The payload, or room for `WORST_NODE_BYTES` more for each node.

    Returns
    -------
    int
        Nodes of the next level; -1 if the payload ended before the nodes did.
    """
    face_model, layer_model, weights = models.faces, models.layers, models.weights
    uncles, firsts = np.empty(27, np.uint8), np.empty(27, np.int32)
    near = np.empty(27, np.int32)
    layers = np.empty((3, 2), np.int64)
    low, high, code, position = coder
    node = children = 0
    for parent in range(above.bytes.size):
        _around_parent(above, parent, uncles, firsts)
        brothers = np.int64(above.bytes[parent])
        for place in range(8):
            if not (brothers >> place) & 1:
                continue
            _around_child(uncles, firsts, place, near)
            if level.near.shape[0]:
                level.near[node] = near
            around, occupied, known = _look_around(near, node, level.bytes)
            _look_along(around, occupied, known, layers)
            faces = 0
            for face in range(6):
                faces |= ((around >> FACES[face]) & 1) << face
            byte, low, high, code, position = _code_byte(
                decoding, np.int64(level.bytes[node]), faces, layers,
                face_model, layer_model, weights, low, high, code, position, buffer,
            )  # fmt: skip
            if decoding and position > buffer.size:
                return -1
            level.bytes[node] = byte
            level.first[node] = children
            children += ones(byte)
            node += 1
    coder[0], coder[1], coder[2], coder[3] = low, high, code, position
    return children


@nb.njit(inline="always")
def _around_parent(above, parent, bytes_, first):
    """Write the bytes of the nodes around a parent and where their children begin."""
    for k in range(27):
        at = above.near[parent, k]
        bytes_[k] = above.bytes[at] if at >= 0 else 0
        first[k] = above.first[at] if at >= 0 else 0


@nb.njit(inline="always")
def _around_child(bytes_, first, place, near):
    """Write the indices of the nodes around a child of that parent, -1 where there is none."""
    for k in range(27):
        uncle, child = NODE_BESIDE[place, k], CHILD_BESIDE[place, k]
        byte = np.int64(bytes_[uncle])
        index = first[uncle] + ones(byte & ((1 << child) - 1))
        near[k] = index if (byte >> child) & 1 else -1


@nb.njit(inline="always")
def _look_around(near, node, bytes_):
    """Return the neighbourhood's nodes, the window's occupied cells and its known cells, as bits.

    Known are the children of the nodes already coded, and that a missing node has none.
    """
    around = 0
    occupied = known = np.uint64(0)
    for k in range(27):
        if near[k] < 0:
            known |= WINDOW_OF_NODE[k]
            continue
        around |= 1 << k
        if near[k] < node:
            known |= WINDOW_OF_NODE[k]
            occupied |= WINDOW_OF_BYTE[k, bytes_[near[k]]]
    return around, occupied, known


@nb.njit(inline="always")
def _look_along(around, occupied, known, layers):
    """Write what lies along each axis, for the lower and the upper layer of a node's children.

    How many of the twelve cells around the children in their layer are known, how many of them
    are occupied, and how full the neighbourhood is on the layer's side and on the other.
    """
    for axis in range(3):
        lower = FULLNESS[ones(around & NODES_OF_SIDE[axis, 0])]
        upper = FULLNESS[ones(around & NODES_OF_SIDE[axis, 1])]
        for side in range(2):
            cells = WINDOW_OF_LAYER[axis, side]
            sides = lower * CLASSES + upper if side == 0 else upper * CLASSES + lower
            layers[axis, side] = (
                ones(occupied & cells) * FULL_STEP + ones(known & cells) * SEEN_STEP + sides
            )


@nb.njit(inline="always")
def _learn(entry, bit):
    """Return a model's entry after a decision."""
    value = np.int64(entry)
    probability, count = value >> 10, value & 1023
    probability += ((bit * 0x3FFFFF - probability) * PACE[count]) >> 16
    return np.uint32((probability << 10) | min(count + 1, COUNTED))


@nb.njit(inline="always")  # a call would count references of every array, for every node
def _code_byte(
    decoding, byte, faces, layers,
    face_model, layer_model, weights, low, high, code, position, buffer,
):  # fmt: skip
    """Code one node's byte; return it with the coder's new state."""
    coded = 1  # a leading one, then the bits so far
    found = 0  # the children so far
    for child in range(8):
        if child == 7 and coded == 128:  # no node is empty: the last child must be there
            found = 128
            break
        a = np.uint64(faces * 256 + coded)
        b = np.uint64(
            layers[0, (child >> 2) & 1]
            + SEEN_BROTHERS[child, 0] * SEEN_STEP
            + ones(found & BROTHERS[child, 0]) * FULL_STEP
        )
        c = np.uint64(
            layers[1, (child >> 1) & 1]
            + SEEN_BROTHERS[child, 1] * SEEN_STEP
            + ones(found & BROTHERS[child, 1]) * FULL_STEP
        )
        d = np.uint64(
            layers[2, (child >> 0) & 1]
            + SEEN_BROTHERS[child, 2] * SEEN_STEP
            + ones(found & BROTHERS[child, 2]) * FULL_STEP
        )
        p = np.int64(STRETCH[face_model[a] >> 20])
        q = np.int64(STRETCH[layer_model[0, b] >> 20])
        r = np.int64(STRETCH[layer_model[1, c] >> 20])
        s = np.int64(STRETCH[layer_model[2, d] >> 20])
        w = np.uint64(faces * 8 + child)
        mixed = (
            weights[w, 0] * p + weights[w, 1] * q + weights[w, 2] * r + weights[w, 3] * s
        ) >> 16
        probability = np.int64(SQUASH[min(2047, max(-2047, mixed)) + 2048])

        middle = low + (((high - low) * probability) >> 16)
        bit = np.int64(code <= middle) if decoding else (byte >> child) & 1
        if bit:
            high = middle
        else:
            low = middle + 1
        while (low ^ high) & 0xFF000000 == 0:
            if decoding:
                read = np.int64(buffer[position]) if position < buffer.size else 0
                code = ((code << 8) & 0xFFFFFFFF) | read
            else:
                buffer[position] = np.uint8(high >> 24)
            position += 1
            low = (low << 8) & 0xFFFFFFFF
            high = ((high << 8) & 0xFFFFFFFF) | 255

        error = ((bit << 16) - probability) * LEARNING
        weights[w, 0] += (p * error + (1 << 17)) >> 18
        weights[w, 1] += (q * error + (1 << 17)) >> 18
        weights[w, 2] += (r * error + (1 << 17)) >> 18
        weights[w, 3] += (s * error + (1 << 17)) >> 18
        face_model[a] = _learn(face_model[a], bit)
        layer_model[0, b] = _learn(layer_model[0, b], bit)
        layer_model[1, c] = _learn(layer_model[1, c], bit)
        layer_model[2, d] = _learn(layer_model[2, d], bit)
        coded = (coded << 1) | bit
        found |= bit << child
    return found, low, high, code, position
