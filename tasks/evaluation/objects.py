"""Objects of a plan as columns, and the rows of those matched, missed and falsely found."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from storage.plan import PlanFurniture, PlanOpening, PlanRoom
from tasks.evaluation.matching import Pairs

ANY = "furniture"
"""The class that all furniture is of."""


@dataclass(frozen=True, eq=False)
class Objects:
    """n objects of one kind; entry i is one of them in every array."""

    ids: NDArray[np.str_]
    """(n,)"""
    classes: NDArray[np.str_]
    """(n,), '' if it has none"""
    area_m2: NDArray[np.float64]
    """(n,), of a room; NaN of anything else"""
    width_m: NDArray[np.float64]
    """(n,), of a door or window; NaN of anything else"""

    def __len__(self) -> int:
        return len(self.ids)

    @classmethod
    def of_ids(cls, ids: Sequence[str]) -> "Objects":
        """Return objects of which nothing but the id is compared."""
        n = len(ids)
        nothing = np.full(n, np.nan)
        return cls(np.array(ids, np.str_), np.full(n, ""), nothing, nothing)

    @classmethod
    def of_rooms(cls, rooms: Sequence[PlanRoom]) -> "Objects":
        """Return rooms with class and area."""
        plain = cls.of_ids([room.id for room in rooms])
        areas = np.array([room.polygon.area for room in rooms], float)
        return cls(plain.ids, _classes(rooms), areas, plain.width_m)

    @classmethod
    def of_openings(cls, openings: Sequence[PlanOpening]) -> "Objects":
        """Return doors or windows with their width."""
        plain = cls.of_ids([opening.id for opening in openings])
        widths = np.array([opening.line.length for opening in openings], float)
        return cls(plain.ids, plain.classes, plain.area_m2, widths)

    @classmethod
    def of_furniture(cls, pieces: Sequence[PlanFurniture]) -> "Objects":
        """Return furniture with its class."""
        plain = cls.of_ids([piece.id for piece in pieces])
        return cls(plain.ids, _classes(pieces), plain.area_m2, plain.width_m)

    def of_class(self, class_: str) -> NDArray[np.int64]:
        """Return the indices of the objects of one class, of all if it is ANY."""
        return np.arange(len(self)) if class_ == ANY else np.flatnonzero(self.classes == class_)


def outcomes(
    class_: str,
    metric: str,
    threshold: float,
    found: Objects,
    true: Objects,
    taken: Pairs,
    true_among: NDArray[np.int64] | None = None,
    found_among: NDArray[np.int64] | None = None,
) -> dict[str, NDArray[Any]]:
    """Return the columns of `Detections` of one class, metric and threshold.

    Parameters
    ----------
    taken : the matches, one-to-one
    true_among, found_among : (k,) int, optional
        The objects that are missed, or false, unless they are matched; None: all.
    """
    missed = np.setdiff1d(_all(true, true_among), taken.true)
    false = np.setdiff1d(_all(found, found_among), taken.found)
    none = np.full(len(missed) + len(false), -1)
    i = np.concatenate([taken.found, none[: len(missed)], false])
    j = np.concatenate([taken.true, missed, none[: len(false)]])
    return {
        "classes": np.full(len(i), class_),
        "metrics": np.full(len(i), metric),
        "thresholds": np.full(len(i), threshold),
        "true_ids": _of(true.ids, j, ""),
        "found_ids": _of(found.ids, i, ""),
        "values": np.concatenate([taken.values, np.full(len(none), np.nan)]),
        "true_classes": _of(true.classes, j, ""),
        "found_classes": _of(found.classes, i, ""),
        "true_m2": _of(true.area_m2, j, np.nan),
        "found_m2": _of(found.area_m2, i, np.nan),
        "width_error_m": _of(found.width_m, i, np.nan) - _of(true.width_m, j, np.nan),
    }


def _all(objects: Objects, among: NDArray[np.int64] | None) -> NDArray[np.int64]:
    return np.arange(len(objects)) if among is None else among


def _of(values: NDArray[Any], index: NDArray[np.int64], nothing: str | float) -> NDArray[Any]:
    """Return the values at indices, `nothing` at -1."""
    return np.append(values, np.array([nothing], values.dtype))[index]


def _classes(objects: Sequence[PlanRoom] | Sequence[PlanFurniture]) -> NDArray[np.str_]:
    return np.array([some.class_ or "" for some in objects], np.str_)
