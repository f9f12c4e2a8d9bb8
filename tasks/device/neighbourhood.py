"""Where things lie around a node of an octree, as tables.

A node's neighbourhood is 27 nodes, itself included: neighbour (x, y, z), each of -1, 0, 1, has
place 9 (x + 1) + 3 (y + 1) + z + 1. A node's children have places 4 x + 2 y + z. Its window is the
4 x 4 x 4 cells of the children's level around it: its own children and one cell on every side;
cell (x, y, z) is bit 16 x + 4 y + z of 64.

The compiled code of `tasks.device.entropy` holds these tables as constants: whoever changes one
touches that file as well, so that it is compiled anew.
"""

import numpy as np
from numpy.typing import NDArray

SELF = 13
"""Place of a node in its own neighbourhood."""


def _lattice(values: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return (k^3, 3): all triples of k values, the last one changing fastest."""
    return np.stack(np.meshgrid(values, values, values, indexing="ij"), axis=-1).reshape(-1, 3)


_NODES, _CHILDREN, _CELLS = (_lattice(np.arange(*ends)) for ends in ((-1, 2), (0, 2), (0, 4)))
_BIT = np.uint64(1) << np.arange(64, dtype=np.uint64)


def _union(chosen: NDArray[np.bool_]) -> NDArray[np.uint64]:
    """Return the windows, as 64 bits each, of the cells chosen along the last axis."""
    return np.bitwise_or.reduce(np.where(chosen, _BIT, np.uint64(0)), axis=-1)


_beside = _CHILDREN[:, None] + _NODES[None]
NODE_BESIDE: NDArray[np.int64] = ((_beside >> 1) + 1) @ np.array([9, 3, 1])
"""(8, 27): the neighbour of the parent in which a neighbour of a child lies."""
CHILD_BESIDE: NDArray[np.int64] = (_beside & 1) @ np.array([4, 2, 1])
"""(8, 27): and which child of it that is."""

_of_node = ((_CELLS + 1) // 2 - 1)[None] == _NODES[:, None]  # the window begins at cell -1
_is_child = ((_CELLS + 1) % 2) @ np.array([4, 2, 1])
_in_byte = (np.arange(256)[:, None] >> _is_child[None] & 1).astype(bool)
WINDOW_OF_NODE: NDArray[np.uint64] = _union(_of_node.all(axis=-1))
"""(27,): the cells of the window that are children of a neighbour."""
WINDOW_OF_BYTE: NDArray[np.uint64] = _union(_of_node.all(axis=-1)[:, None] & _in_byte[None])
"""(27, 256): those that are occupied if this is the neighbour's occupancy byte."""

_same = _CELLS.T[:, None] == np.array([1, 2])[None, :, None]
_around = ((_CELLS < 1) | (_CELLS > 2)).any(axis=1)
WINDOW_OF_LAYER: NDArray[np.uint64] = _union(_same & _around)
"""(3, 2): the 12 cells of the window around a node, across each axis, in its lower and upper
layer of children."""
_brother = (_CHILDREN[:, None] == _CHILDREN[None]) & (np.arange(8)[:, None] > np.arange(8)[None])[
    ..., None
]
BROTHERS: NDArray[np.int64] = np.moveaxis(_brother, -1, 1) @ (1 << np.arange(8))
"""(8, 3): the children before a child that share its layer across each axis, one bit a place."""
SEEN_BROTHERS: NDArray[np.int64] = _brother.sum(axis=1)
"""(8, 3): how many these are."""
_side = np.array([-1, 1])[None, :, None] == _NODES.T[:, None]
NODES_OF_SIDE: NDArray[np.int64] = _side @ (1 << np.arange(27))
"""(3, 2): the neighbours on the lower and the upper side along each axis, one bit a place."""
FACES: NDArray[np.int64] = np.array([4, 22, 10, 16, 12, 14])
"""Places of the neighbours that share a face with the node."""
