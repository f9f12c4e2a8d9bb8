"""The classifier of openings: a forest's file, and what the forest says of candidates (Sec. 5)."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from storage.candidates import FEATURES, Candidates
from storage.errors import InputError
from storage.forest import Forest, open_forest
from tasks.doors.examples import CLASSES
from tasks.forest import predict


def read_classifier(path: Path) -> Forest:
    """Read a forest of `CLASSES` by `FEATURES`, or by some of them as the paper's.

    Raises
    ------
    InputError
        If the file is no forest, or one that tells something else apart.
    """
    forest = open_forest(path)
    unknown = sorted(set(forest.features) - set(FEATURES))
    if unknown or forest.classes != CLASSES:
        problem = f"tells {', '.join(forest.classes)} apart"
        if unknown:
            problem = f"asks for {', '.join(unknown)}"
        raise InputError(
            path,
            f"the forest {problem}, expected {', '.join(CLASSES)} by features of openings",
            "name another file, or train it anew with 'mapsense train doors'",
        )
    return forest


def classified(candidates: Candidates, forest: Forest) -> NDArray[np.float64]:
    """Return the probability of each of `CLASSES`, (n, c).

    Parameters
    ----------
    forest : as of `read_classifier`
    """
    asked = [FEATURES.index(name) for name in forest.features]
    return predict(forest, candidates.features[:, asked])
