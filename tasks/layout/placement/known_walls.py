"""Walls that a grammar of this very building knows the place of, where its lines were laid.

Each of its lines lies on a corridor's wall faces, and along it is the space that the rules cut
into rooms: front, rear and both ends of a row. Storeys of a building share these walls.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grammars.model import Grammar, ReferenceLine
from tasks.layout.placement.decoded_rows import DecodedRow

CORRIDOR = "corridor"
"""Kind of a corridor's own face; those of rooms are 'near', 'far' and 'end'."""
KNOWN = (CORRIDOR, "near", "far", "end")
"""All kinds."""
ALONG_WEIGHT = 0.05
"""How much ends of rows count against their sides where lines were moved: rows end at rooms."""
SAME_M = 1e-6
"""Lines nearer to where the grammar has them were not moved, metres: rounding only."""


@dataclass(frozen=True, eq=False)
class KnownWalls:
    """w faces of walls, each with its room to the left of one who walks from start to end."""

    ends: NDArray[np.float64]
    """(w, 2, 2)"""
    kind: tuple[str, ...]
    """'corridor', 'near', 'far' or 'end' of each"""

    def __len__(self) -> int:
        return len(self.ends)


def known_walls(grammar: Grammar, rows: Sequence[DecodedRow], ids: Sequence[str]) -> KnownWalls:
    """Return the faces that the grammar knows, as the lines were laid onto the storey.

    Parameters
    ----------
    ids : names of the rows' lines; lines of the grammar's have its names
    """
    by_id = {line.id: line for line in grammar.lines}
    given = [(by_id[name], row) for name, row in zip(ids, rows, strict=True) if name in by_id]
    ends: list[NDArray[np.float64]] = [np.empty((0, 2, 2))]
    kinds: list[str] = []
    if given:
        turn, shift = _laid([line for line, _ in given], [row for _, row in given])
        storeys = {line.storey for line, _ in given}
        for line in (known for known in grammar.lines if known.storey in storeys):
            faces, names = _faces(line)
            ends.append(faces @ turn.T + shift)
            kinds += names
    return KnownWalls(np.concatenate(ends), tuple(kinds))


def _faces(line: ReferenceLine) -> tuple[NDArray[np.float64], list[str]]:
    faces, names = [(line.end, line.start)], [CORRIDOR]
    if line.space is not None:
        corners = line.space
        faces += [(corners[i], corners[(i + 1) % 4]) for i in range(4)]
        names += ["near", "end", "far", "end"]
    return np.array(faces, float), names


def _laid(
    lines: Sequence[ReferenceLine], rows: Sequence[DecodedRow]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the turn and shift of all lines: least squares beside them, less so along them."""
    ends = np.array([(line.start, line.end) for line in lines], float)
    step = ends[:, 1] - ends[:, 0]
    along = np.array([row.frame.along for row in rows])
    start = np.array([row.frame.start for row in rows])
    sine = (step[:, 0] * along[:, 1] - step[:, 1] * along[:, 0]).sum()
    angle = float(np.arctan2(sine, (step * along).sum()))
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    left = np.column_stack([-along[:, 1], along[:, 0]])
    middle = start + along * np.array([[row.frame.length / 2] for row in rows])
    off = middle - ends.mean(axis=1) @ turn.T
    sides = np.concatenate([(off * left).sum(axis=1), ALONG_WEIGHT * (off * along).sum(axis=1)])
    if abs(angle) < SAME_M and np.abs(sides[: len(lines)]).max() < SAME_M:
        return np.eye(2), np.zeros(2)
    shift = np.linalg.lstsq(np.concatenate([left, ALONG_WEIGHT * along]), sides, rcond=None)[0]
    return turn, shift
