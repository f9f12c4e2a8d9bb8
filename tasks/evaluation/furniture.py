"""Furniture against furniture: footprints, and upright boxes over them."""

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from storage.plan import PlanFurniture
from tasks.evaluation.matching import Pairs, overlapping


def footprints(found: Sequence[PlanFurniture], true: Sequence[PlanFurniture]) -> Pairs:
    """Return the pairs whose footprints share area, with their intersection over union."""
    return overlapping([piece.footprint for piece in found], [piece.footprint for piece in true])


def boxes(found: Sequence[PlanFurniture], true: Sequence[PlanFurniture], over: Pairs) -> Pairs:
    """Return the pairs that share volume, with the intersection over union of their volumes.

    A piece is its footprint from base to top; one whose heights are unknown is in no pair.

    Parameters
    ----------
    over : the pairs of `footprints`
    """
    heights, true_heights = extents(found)[over.found], extents(true)[over.true]
    areas = shapely.area(np.array([piece.footprint for piece in found], object))[over.found]
    true_areas = shapely.area(np.array([piece.footprint for piece in true], object))[over.true]
    # iou = both / (a + b - both), solved for both
    shared = over.values / (1 + over.values) * (areas + true_areas)
    low = np.maximum(heights[:, 0], true_heights[:, 0])
    high = np.minimum(heights[:, 1], true_heights[:, 1])
    both = shared * np.maximum(high - low, 0)
    volumes = areas * np.ptp(heights, axis=1) + true_areas * np.ptp(true_heights, axis=1)
    values = both / np.maximum(volumes - both, 1e-12)
    # NaN, a height that nobody knows, is not greater than zero
    return Pairs(over.found, over.true, values).at(values > 0)


def extents(pieces: Sequence[PlanFurniture]) -> NDArray[np.float64]:
    """Return base and top, (n, 2), NaN where unknown."""
    return np.array([(p.base_m, p.top_m) for p in pieces], float).reshape(-1, 2)
