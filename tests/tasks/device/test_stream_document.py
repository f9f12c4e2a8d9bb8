"""STREAM.md is enough to read a stream: a slow reader, written from it alone."""

import struct
from collections import defaultdict
from hashlib import blake2b
from itertools import product

import numpy as np
import pytest

from storage.points import PointCloud
from tasks.device.codec import encode_leaves
from tasks.device.entropy import KNOTS
from tasks.simulation.clouds import furnished_room

CLASSES = (0, 1, 2, 2, 3, 3, 4, 4, 5, 5)


def squash(x):
    knot, past = divmod(x + 2048, 128)
    line = KNOTS[knot] * (128 - past) + KNOTS[knot + 1] * past
    return min(max(line >> 7, 24), 65512)


STRETCH = []
for q in range(4096):
    x = STRETCH[-1] if STRETCH else -2048
    while x < 2047 and squash(x) >> 4 < q:
        x += 1
    STRETCH.append(x)


class Reader:
    """The range decoder and the mixed models."""

    def __init__(self, payload):
        self.payload, self.at = payload, 4
        self.low, self.high, self.code = 0, 2**32 - 1, int.from_bytes(payload[:4], "big")
        self.models = defaultdict(lambda: (2**21, 0))
        self.weights = defaultdict(lambda: [26214] * 4)

    def decide(self, contexts, weights_of):
        s = [min(max(STRETCH[self.models[c][0] >> 10], -2047), 2047) for c in contexts]
        w = self.weights[weights_of]
        mixed = sum(a * b for a, b in zip(w, s, strict=True)) >> 16
        p = squash(min(max(mixed, -2047), 2047))
        middle = self.low + (((self.high - self.low) * p) >> 16)
        one = int(self.code <= middle)
        if one:
            self.high = middle
        else:
            self.low = middle + 1
        while self.low >> 24 == self.high >> 24:
            byte = self.payload[self.at] if self.at < len(self.payload) else 0
            self.at += 1
            self.low = self.low << 8 & 0xFFFFFFFF
            self.high = self.high << 8 & 0xFFFFFFFF | 255
            self.code = self.code << 8 & 0xFFFFFFFF | byte
        for i in range(4):
            w[i] += (s[i] * (one * 65536 - p) * 6 + (1 << 17)) >> 18
        for c in contexts:
            value, n = self.models[c]
            value += ((one * (2**22 - 1) - value) * (655360 // (10 * n + 16))) >> 16
            self.models[c] = value, min(n + 1, 127)
        return one


def read_level(reader, nodes):
    """Return the cells of the next level: the occupied children, in Morton order."""
    order = {node: i for i, node in enumerate(nodes)}
    occupied, cells = set(), []

    def known(cell, node, child):
        of = tuple(v >> 1 for v in cell)
        if of == node:
            return (cell[0] & 1) * 4 + (cell[1] & 1) * 2 + (cell[2] & 1) < child
        return of not in order or order[of] < order[node]

    for node in nodes:
        near = [n for n in product(*[(v - 1, v, v + 1) for v in node]) if n in order]
        faces = tuple(
            tuple(v + step * (a == axis) for a, v in enumerate(node)) in order
            for axis in range(3)
            for step in (-1, 1)
        )
        around = list(product(*[range(2 * v - 1, 2 * v + 3) for v in node]))
        so_far = (1,)
        for child, place in enumerate(product((0, 1), repeat=3)):
            at = tuple(2 * v + p for v, p in zip(node, place, strict=True))
            contexts = [("faces", faces, so_far)]
            for axis in range(3):
                layer = [c for c in around if c[axis] == at[axis] and c != at]
                seen = [c for c in layer if known(c, node, child)]
                side = 2 * place[axis] - 1
                full = [
                    CLASSES[sum(n[axis] == node[axis] + s for n in near)] for s in (side, -side)
                ]
                contexts.append((axis, len(seen), sum(c in occupied for c in seen), *full))
            one = 1 if so_far == (1, *[0] * 7) else reader.decide(contexts, (faces, child))
            so_far = (*so_far, one)
            if one:
                occupied.add(at)
                cells.append(at)
    return cells


def read(data):
    """Return the centres of the leaves, as STREAM.md says."""
    version, _, depth, leaf_um = struct.unpack_from("<HBBI", data, 8)
    (points, count), origin = (
        struct.unpack_from("<2Q", data, 16),
        struct.unpack_from("<3d", data, 32),
    )
    low, length = struct.unpack_from("<3q", data, 56), struct.unpack_from("<Q", data, 92)[0]
    assert data[:8] == bytes.fromhex("894D534F0D0A1A0A") and version == 1
    assert data[100 + length :] == blake2b(data[: 100 + length], digest_size=8).digest()
    reader, cells = Reader(data[100 : 100 + length]), [(0, 0, 0)]
    for _ in range(depth):
        cells = read_level(reader, cells)
    assert reader.at == length and len(cells) == count <= points
    return ((np.array(cells) + low + 0.5) * (leaf_um / 1e6) - origin).astype(np.float32)


@pytest.mark.parametrize(("n", "leaf_um"), [(30, 10_000), (2000, 200_000)])
def test_a_reader_written_from_the_document_reads_a_stream(n, leaf_um):
    points = PointCloud(furnished_room(n, seed=1)[0], np.array([3.0, -4.0, 0.5]))
    found = read(encode_leaves(points, leaf_um).data)
    cells = np.unique(np.floor((points.origin + points.xyz) / (leaf_um / 1e6)), axis=0)
    expected = ((cells + 0.5) * (leaf_um / 1e6) - points.origin).astype(np.float32)
    assert sorted(map(tuple, found.tolist())) == sorted(map(tuple, expected.tolist()))
