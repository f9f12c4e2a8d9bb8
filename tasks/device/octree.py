"""An octree over cells as a string of bytes, and back.

The tree is coded breadth first: level by level from the root, each with one occupancy byte for
every node that is not empty, in Morton order. `tasks.device.entropy` codes the bytes.
"""

import numpy as np
from numpy.typing import NDArray

from tasks.device import cells, entropy


class PayloadError(ValueError):
    """The payload is not what an encoder made of so many cells."""


def encode_cells(keys: NDArray[np.uint64], depth: int) -> bytes:
    """Return the payload of a tree of `depth` levels.

    Parameters
    ----------
    keys : (n,) uint64
        Morton codes of the occupied cells, ascending, all different, under 8^depth; n > 0.
    depth : int
        0 to 21. A tree of depth 0 is its one cell and has an empty payload.
    """
    bytes_of_levels = []
    for _ in range(depth):
        keys, bytes_ = cells.occupancy(keys)
        bytes_of_levels.append(bytes_)
    if not bytes_of_levels:
        return b""
    above, models, coder = entropy.above_root(), entropy.fresh_models(), entropy.fresh_coder()
    buffer, done = np.empty(0, np.uint8), []
    for bytes_ in reversed(bytes_of_levels):
        level = _level(bytes_, last=bytes_ is bytes_of_levels[0])
        buffer = np.empty(len(bytes_) * entropy.WORST_NODE_BYTES + 4, np.uint8)
        coder[3] = 0
        entropy.code_level(False, above, level, models, coder, buffer)
        done.append(buffer[: coder[3]].tobytes())
        above = level
    tail = np.empty(4, np.uint8)
    coder[3] = 0
    entropy.finish_encoder(coder, tail)
    return b"".join((*done, tail.tobytes()))


def decode_cells(payload: bytes, depth: int, count: int) -> NDArray[np.uint64]:
    """Return the Morton codes, ascending, of the cells of a payload.

    Nothing is allocated on the word of `depth` and `count`: each level's size follows from what
    was decoded before it.

    Raises
    ------
    PayloadError
        If the payload ends too early or too late, or holds another number of cells.
    """
    keys = np.zeros(1, np.uint64)
    if depth > 0:
        buffer = np.frombuffer(
            payload, np.uint8
        ).copy()  # the compiled code takes arrays to write to
        above, models, coder = entropy.above_root(), entropy.fresh_models(), entropy.fresh_coder()
        entropy.start_decoder(coder, buffer)
        for number in range(depth):
            level = _level(np.zeros(len(keys), np.uint8), last=number == depth - 1)
            found = entropy.code_level(True, above, level, models, coder, buffer)
            if found < 0:
                raise PayloadError("the payload ends within the tree")
            if found > count:  # every node has a cell at least
                raise PayloadError(f"more cells than the {count} its header says")
            keys, above = cells.children(keys, level.bytes, found), level
        if coder[3] != len(payload):
            raise PayloadError("the payload goes on after the tree")
    elif payload:
        raise PayloadError("the payload goes on after the tree")
    if len(keys) != count:
        raise PayloadError(f"{len(keys)} cells where its header says {count}")
    return keys


def _level(bytes_: NDArray[np.uint8], last: bool) -> entropy.Level:
    n = len(bytes_)
    near = np.empty((0 if last else n, 27), np.int32)
    return entropy.Level(bytes_, np.empty(n, np.int32), near)
