"""How a door's leaf stands: open, ajar or shut."""

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from storage.openings import STATES, UNKNOWN
from tasks.params import Params


class StateParams(Params):
    """When a state is said."""

    least_share: float = Field(default=0.45, ge=0, le=1)
    """Share of a door's probability its likeliest state must have to be said; a third is what three
    states have that nothing tells apart. Assumption."""


def states(probabilities: NDArray[np.float64], params: StateParams) -> NDArray[np.str_]:
    """Return the state of each door, UNKNOWN where none stands out.

    Parameters
    ----------
    probabilities : (n, 3) float
        Of open, ajar and shut, as the classifier says by what is empty, by depth and by the leaf;
        they need not sum to one.
    """
    total = np.maximum(probabilities.sum(axis=1), 1e-12)
    likeliest = probabilities.argmax(axis=1)
    share = probabilities.max(axis=1, initial=0.0) / total
    return np.where(share >= params.least_share, np.array(STATES)[likeliest], UNKNOWN)
