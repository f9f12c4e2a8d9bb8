"""How probable it is that an observed wall divides rooms: a stated model of the evidence."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tasks.params import Params


class PresenceParams(Params):
    """Weights of a logistic model: log-odds add up. None is in the paper."""

    base: float = -4.0
    """Log-odds of a branch that nothing speaks for. Assumption."""
    divides: float = 4.0
    """Gain where rooms of the initial model differ on its two sides all along. Assumption."""
    covered: float = 2.5
    """Gain where wall was seen across the whole depth of the rooms. Assumption."""
    both: float = 1.5
    """Gain where both faces were seen: a cabinet shows one. Assumption."""
    height: float = 1.0
    """Gain where it was seen from floor to ceiling. Assumption."""
    scans: float = 0.5
    """Gain per doubling of the scans that saw it. Assumption."""


def presence(
    divides: NDArray[np.float64],
    covered: NDArray[np.float64],
    both: NDArray[np.bool_],
    height: NDArray[np.float64],
    scans: NDArray[np.int64],
    params: PresenceParams,
) -> NDArray[np.float64]:
    """Return the probability that each branch is a wall that divides rooms, (n,).

    Parameters
    ----------
    divides : (n,) float
        Share of the rooms' depth along which two different rooms lie beside it, 0..1.
    covered : (n,) float
        Share of the rooms' depth along which wall was seen, 0..1.
    both : (n,) bool
        Whether both faces were seen.
    height : (n,) float
        Share of the rooms' height it was seen over, 0..1.
    scans : (n,) int
        Scans that saw it.
    """
    odds = (
        params.base
        + params.divides * divides
        + params.covered * covered
        + params.both * both
        + params.height * height
        + params.scans * np.log2(np.maximum(scans, 1))
    )
    return np.asarray(1 / (1 + np.exp(-odds)))


class JointParams(Params):
    """Weights of the same model for a wall that nobody saw, by the gaps it leaves. Assumptions.

    On storeys simulated for tuning 44 of 58 fronts and rears had a gap where a wall that was seen
    joins them, and none at 2,798 places where none does; much less is believed of either.
    """

    base: float = -4.0
    """Log-odds where nothing speaks for a wall."""
    gap: float = 4.5
    """Gain of each, front and rear, that has a gap there."""
    solid: float = -1.5
    """Loss where one runs through."""


def joint_presence(says: Sequence[int], params: JointParams) -> float:
    """Return the probability that a wall nobody saw divides a room.

    Parameters
    ----------
    says : of front and rear 1 for a gap, -1 where it runs through, 0 where that is not known
    """
    odds = params.base + sum(params.gap if s > 0 else params.solid for s in says if s)
    return float(1 / (1 + np.exp(-odds)))
