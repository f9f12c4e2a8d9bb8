"""Random forests: grown by scikit-learn, kept as arrays of ours, asked in one compiled call."""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any, Literal

import numba
import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PositiveInt

from storage.forest import LEAF, Forest
from storage.forest_provenance import Provenance
from tasks.params import Params


class ForestParams(Params):
    """How a forest is grown."""

    trees: PositiveInt = 100
    """Trees. The paper grows eight for furniture (Sec. 6) and names no number for doors; a hundred
    are right a little more often: of other furniture on training storeys held back precision is
    0.97 to 0.98 instead of 0.93 to 0.95, and probabilities are finer."""
    depth: PositiveInt | None = None
    """Greatest depth of a tree; None: as deep as it grows. Assumption."""
    leaf: PositiveInt = 2
    """Least examples at a leaf. Assumption."""
    share: float = Field(default=1.0, gt=0, le=1)
    """How many examples a tree draws, as a share of all there are. Assumption: all. Candidates of
    one opening are much alike, and a forest of many grows in time with fewer."""
    class_weights: Literal["equal", "balanced"] = "balanced"
    """What an example counts for: all the same, or each class the same in all. Assumption: there
    are many more things that are no door than doors."""
    seed: int = Field(default=0, ge=0, lt=2**32)
    """Seed of the draws of examples and features."""


@dataclass(frozen=True, eq=False)
class Examples:
    """n examples of known class; row i is one example in every array."""

    features: NDArray[np.float64]
    """(n, k), NaN where a feature is unknown"""
    labels: NDArray[np.int64]
    """(n,), the class by its place in the names of the classes"""
    groups: NDArray[np.str_]
    """(n,), where each came from, as `building/storey`: examples of one group are alike"""

    def __post_init__(self) -> None:
        n = len(self.features)
        if self.features.ndim != 2 or self.labels.shape != (n,) or self.groups.shape != (n,):
            raise ValueError(
                f"features {self.features.shape}, labels {self.labels.shape}, groups "
                f"{self.groups.shape}: expected (n, k), (n,), (n,)"
            )

    def __len__(self) -> int:
        return len(self.labels)

    def __getitem__(self, rows: NDArray[Any]) -> "Examples":
        """Return some examples, by their numbers or a mask."""
        return Examples(self.features[rows], self.labels[rows], self.groups[rows])


def joined(examples: Sequence[Examples]) -> Examples:
    """Return the examples of several sources, at least one, as one."""
    return Examples(
        np.concatenate([each.features for each in examples]),
        np.concatenate([each.labels for each in examples]),
        np.concatenate([each.groups for each in examples]),
    )


def fit(
    examples: Examples,
    feature_names: Sequence[str],
    class_names: Sequence[str],
    params: ForestParams,
) -> Forest:
    """Grow a forest that tells classes apart.

    Returns
    -------
    Forest
        Its provenance names parameters, versions and the number of examples of each group. The
        same examples in the same order and the same seed make the same forest. A class without
        examples is never predicted.

    Raises
    ------
    ValueError
        If the names are not one per feature, a label is no class, there is no example, or a
        feature is infinite.

    Notes
    -----
    scikit-learn learns at each node where examples go whose feature is unknown; where none was
    unknown in training, they go with the greater part of the examples.
    """
    # a second of imports, which no run needs that only predicts
    from sklearn.ensemble import RandomForestClassifier

    if examples.features.shape[1] != len(feature_names):
        raise ValueError(
            f"{examples.features.shape[1]} features, expected {len(feature_names)}: "
            f"{', '.join(feature_names)}"
        )
    if len(examples) == 0:
        raise ValueError("no example to learn from, expected at least one")
    if not np.isin(examples.labels, np.arange(len(class_names))).all():
        raise ValueError(f"labels: expected 0 to {len(class_names) - 1}")
    model = RandomForestClassifier(
        n_estimators=params.trees,
        max_depth=params.depth,
        min_samples_leaf=params.leaf,
        max_samples=params.share,
        class_weight="balanced" if params.class_weights == "balanced" else None,
        random_state=params.seed,
        n_jobs=-1,  # in threads; the trees are the same however many
    ).fit(_as_asked(examples.features), examples.labels)
    groups, counts = np.unique(examples.groups, return_counts=True)
    provenance = Provenance(
        parameters=params.model_dump(mode="json"),
        versions={name: version(name) for name in ("scikit-learn", "numpy")},
        examples=dict(zip(groups.tolist(), counts.tolist(), strict=True)),
    )
    return _converted(model, tuple(feature_names), tuple(class_names), provenance)


def predict(forest: Forest, features: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the probability of each class: the mean over the trees of its share at their leaves.

    Parameters
    ----------
    features : (n, k) float
        In the order of the forest's names. NaN is an unknown feature: each node that asks for it
        says on which side it goes on (see `fit`). Features count to 32-bit precision.

    Returns
    -------
    (n, c) float
        Rows sum to one; equal to scikit-learn's `predict_proba` of the forest it grew.

    Raises
    ------
    ValueError
        If `features` is not (n, k), or one is infinite or beyond a 32-bit float.
    """
    k = len(forest.features)
    if features.ndim != 2 or features.shape[1] != k:
        raise ValueError(f"features: expected (n, {k}), got {features.shape}")
    return _predict(
        _as_asked(features),
        forest.roots,
        forest.asked,
        forest.thresholds,
        forest.nan_left,
        forest.left,
        forest.right,
        forest.shares,
    )


def _as_asked(features: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return features to the precision that trees are grown and asked in."""
    with np.errstate(over="ignore"):
        asked = np.ascontiguousarray(features, np.float32)
    if np.isinf(asked).any():
        row, column = np.argwhere(np.isinf(asked))[0]
        raise ValueError(f"feature {column} of row {row}: expected finite or NaN")
    return asked


@numba.njit(cache=True, nogil=True)
def _predict(
    features: NDArray[np.float32],
    roots: NDArray[np.int64],
    asked: NDArray[np.int32],
    thresholds: NDArray[np.float64],
    nan_left: NDArray[np.bool_],
    left: NDArray[np.int64],
    right: NDArray[np.int64],
    shares: NDArray[np.float64],
) -> NDArray[np.float64]:
    n, c = len(features), shares.shape[1]
    found = np.zeros((n, c))
    # tree by tree, in their order: sums round as scikit-learn's do, and a tree stays in the cache
    for root in roots:
        for i in range(n):
            node = root
            while asked[node] != LEAF:
                value = features[i, asked[node]]
                goes_left = nan_left[node] if np.isnan(value) else value <= thresholds[node]
                node = left[node] if goes_left else right[node]
            for j in range(c):
                found[i, j] += shares[node, j]
    for i in range(n):
        for j in range(c):
            found[i, j] /= len(roots)
    return found


def _converted(
    model: Any, features: tuple[str, ...], classes: tuple[str, ...], provenance: Provenance
) -> Forest:
    """Return a forest of scikit-learn's as arrays of ours: its trees one behind the other."""
    trees = [estimator.tree_ for estimator in model.estimators_]
    roots = np.cumsum([0] + [tree.node_count for tree in trees[:-1]])
    leaf = np.concatenate([tree.children_left for tree in trees]) == -1

    def children(name: str) -> NDArray[np.int64]:
        moved = [getattr(tree, name) + root for tree, root in zip(trees, roots, strict=True)]
        return np.where(leaf, LEAF, np.concatenate(moved))

    def nodes(name: str, at_leaves: Any) -> NDArray[Any]:
        return np.where(leaf, at_leaves, np.concatenate([getattr(t, name) for t in trees]))

    shares = np.zeros((len(leaf), len(classes)))
    # scikit-learn knows the classes it met, in ascending order
    shares[:, model.classes_] = np.concatenate([tree.value[:, 0, :] for tree in trees])
    shares[~leaf] = 0
    return Forest(
        features=features,
        classes=classes,
        roots=roots.astype(np.int64),
        asked=nodes("feature", LEAF).astype(np.int32),
        thresholds=nodes("threshold", 0.0),
        nan_left=nodes("missing_go_to_left", False).astype(bool),
        left=children("children_left"),
        right=children("children_right"),
        shares=shares,
        provenance=provenance,
    )
