"""Redundant rectangles of one opening made one: k-means, as the paper and per door (Sec. 5)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, NonNegativeFloat, PositiveFloat, PositiveInt

from tasks.params import Params

Array = NDArray[np.float64]
LEAST_SCORE = 1e-6
"""What no probability counts as less than: a mean of improbable rectangles is still one."""


class MergingParams(Params):
    """How rectangles are clustered."""

    overlap: float = Field(default=0.2, gt=0, lt=1)
    """Rectangles whose IoU exceeds this are of one opening. Assumption."""
    share_weight_m: NonNegativeFloat = 0.2
    """Metres a difference of one in an area share counts for beside metres between centres: place
    decides, shares (Sec. 5) help. Assumption."""
    rounds: PositiveInt = 20
    """Most rounds of k-means. Assumption."""
    paper_k: PositiveInt = 2
    """Clusters of a wall in the paper's own way: Fig. 16g shows two."""
    power: PositiveFloat = 2.0
    """A rectangle counts in its cluster's mean by its probability to this power. Assumption."""


@dataclass(frozen=True, eq=False)
class Rectangles:
    """n classified rectangles on one wall; entry i is one in every array."""

    boxes: Array
    """(n, 4), begin and end along the wall, lower and upper side, metres"""
    scores: Array
    """(n,), probability"""
    shares: Array
    """(n, 3), occupied, empty and occluded"""

    def __len__(self) -> int:
        return len(self.boxes)

    def described(self, share_weight_m: float) -> Array:
        """Return what k-means compares: centre, root of the area, shares; in metres."""
        begin, end, low, high = self.boxes.T
        size = np.sqrt((end - begin) * (high - low))
        return np.column_stack(
            [(begin + end) / 2, (low + high) / 2, size, share_weight_m * self.shares]
        )


def per_door(rectangles: Rectangles, params: MergingParams) -> tuple[NDArray[np.int64], Array]:
    """Return the cluster of each rectangle, (n,), and each cluster's mean box, (k, 4).

    A wall may have several doors: the clusters begin at the rectangles that are the most probable
    of all that overlap them, one for each place, and every cluster is kept.
    """
    seeds = _peaks(rectangles, params.overlap)
    described = rectangles.described(params.share_weight_m)
    clusters = _k_means(described, described[seeds], params.rounds)
    return clusters, _means(rectangles, clusters, len(seeds), params)


def per_wall(rectangles: Rectangles, params: MergingParams) -> tuple[NDArray[np.int64], Array]:
    """Return the paper's clusters: of a wall, one alone is kept, as cluster 0; -1 for the rest.

    Notes
    -----
    Sec. 5: the cluster of the greatest empty and the least occupied and occluded area wins. The
    paper leaves open where k-means begins: here at the most probable rectangle and then each time
    at the one furthest from those before, so that no draw decides.
    """
    described = rectangles.described(params.share_weight_m)
    first = [int(np.argmax(rectangles.scores))]
    while len(first) < min(params.paper_k, len(rectangles)):
        away = np.linalg.norm(described[:, None] - described[first], axis=2).min(axis=1)
        first.append(int(np.argmax(away)))
    clusters = _k_means(described, described[first], params.rounds)
    areas = np.prod(rectangles.boxes[:, [1, 3]] - rectangles.boxes[:, [0, 2]], axis=1)
    occupied, empty, occluded = (rectangles.shares * areas[:, None]).T
    gain = empty - occupied - occluded
    there = np.unique(clusters)
    winner = max(there, key=lambda k: (float(gain[clusters == k].mean()), -k))
    kept = np.where(clusters == winner, 0, -1)
    return kept, _means(rectangles, kept, 1, params)


def weights(scores: Array, params: MergingParams) -> Array:
    """Return what rectangles of some probabilities count for in a mean, (n,), above zero."""
    return np.maximum(scores, LEAST_SCORE) ** params.power


def iou(box: Array, boxes: Array) -> Array:
    """Return the IoU of a box, (4,), with others, (n, 4): begin, end, lower and upper side."""
    wide = np.minimum(box[1], boxes[:, 1]) - np.maximum(box[0], boxes[:, 0])
    high = np.minimum(box[3], boxes[:, 3]) - np.maximum(box[2], boxes[:, 2])
    both = np.maximum(wide, 0) * np.maximum(high, 0)
    areas = (boxes[:, 1] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 2])
    return both / np.maximum((box[1] - box[0]) * (box[3] - box[2]) + areas - both, 1e-12)


def _peaks(rectangles: Rectangles, overlap: float) -> list[int]:
    left = np.ones(len(rectangles), bool)
    peaks = []
    for i in np.argsort(-rectangles.scores, kind="stable"):
        if left[i]:
            peaks.append(int(i))
            left &= iou(rectangles.boxes[i], rectangles.boxes) <= overlap
    return peaks


def _k_means(described: Array, centres: Array, rounds: int) -> NDArray[np.int64]:
    """Return the cluster of each row by Lloyd's rounds; one that loses all keeps its centre."""
    clusters = np.full(len(described), -1)
    centres = centres.copy()
    for _ in range(rounds):
        apart = np.linalg.norm(described[:, None] - centres, axis=2)
        nearest = np.argmin(apart, axis=1)
        if (nearest == clusters).all():
            break
        clusters = nearest
        for k in np.unique(clusters):
            centres[k] = described[clusters == k].mean(axis=0)
    return clusters


def _means(
    rectangles: Rectangles, clusters: NDArray[np.int64], k: int, params: MergingParams
) -> NDArray[np.float64]:
    """Return the mean box of each cluster, weighted by probability; NaN where none is left."""
    means = np.full((k, 4), np.nan)
    for cluster in np.unique(clusters[clusters >= 0]):
        some = clusters == cluster
        counts = weights(rectangles.scores[some], params)
        means[cluster] = np.average(rectangles.boxes[some], axis=0, weights=counts)
    return means
