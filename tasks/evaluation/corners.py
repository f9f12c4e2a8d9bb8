"""The corners of a plan's rooms."""

import numpy as np
from numpy.typing import NDArray

from storage.plan import Plan

STRAIGHT_RAD = 2e-3
"""Turn below which a vertex lies on a straight edge: what rounding to 0.1 mm makes of 0.1 m."""


def corners(plan: Plan) -> tuple[list[str], NDArray[np.float64]]:
    """Return ids and positions, (c, 2), of the corners of every room, holes included.

    A vertex at which the outline goes straight on is no corner.
    """
    ids: list[str] = []
    found = [np.empty((0, 2))]
    for room in plan.rooms:
        rings = [room.polygon.exterior, *room.polygon.interiors]
        of_room = np.concatenate([_turning(np.array(ring.coords)[:-1, :2]) for ring in rings])
        ids += [f"{room.id}/{number}" for number in range(len(of_room))]
        found.append(of_room)
    return ids, np.concatenate(found)


def _turning(ring: NDArray[np.float64]) -> NDArray[np.float64]:
    ring = ring[np.any(ring != np.roll(ring, 1, axis=0), axis=1)]
    before, after = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
    cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    turn = np.arctan2(cross, np.einsum("ij,ij->i", before, after))
    return ring[np.abs(turn) > STRAIGHT_RAD]
