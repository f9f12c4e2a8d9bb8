"""What may be a piece of furniture: a box with the surface it was found by."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tasks.furniture.boxes import Box

BACK, SEAT, TOP, FRONT, ON_TABLE, SOFA = range(6)
"""What a candidate was found by: a back, a patch at seat height, any other patch, the front of a
tall piece, a panel on a table, a seat for several with a back or arms."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """One possible piece of furniture. Heights are metres over the floor."""

    box: Box
    """its whole footprint, as far as it is known"""
    seen: NDArray[np.int64]
    """(m,), places of its upper surfaces in the scene's `where`"""
    height: float
    """of its level surface"""
    top: float
    """of its highest part"""
    found_by: int
    """BACK, SEAT, TOP, FRONT, ON_TABLE or SOFA"""
    siblings: int = 1
    """pieces that its patch or panel was split into, itself included"""
    seen_box: Box | None = None
    """box around what was seen of it; None: the same"""
    panel: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """of the panel it was found by: width and thickness seen, metres, and the share of its columns
    that show it; 0 without one"""
    base: float = 0.0
    """where it begins"""
