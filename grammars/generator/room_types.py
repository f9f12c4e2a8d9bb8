"""Types of rooms: a class, a width and a depth, learnt from the rooms along lines."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grammars.generator.frontages import Frontage
from grammars.generator.groups import group_values
from grammars.generator.params import LearnParams
from grammars.model import Part

NAMELESS = re.compile(r"room_\d+x\d+")
"""Classes of rooms without a name: width and depth, centimetres."""
METRE_DECIMALS = 4
"""Lengths are learnt to 0.1 mm: what plan files hold."""


@dataclass(frozen=True)
class RoomTypes:
    """Types of rooms by class, then width; and which of them each room is."""

    parts: tuple[Part, ...]
    of: tuple[int, ...]
    """type of each room, in the order they were handed over"""


def classes_of(frontages: Sequence[Frontage], params: LearnParams) -> list[str]:
    """Return each room's class: its own, as `LearnParams.classes` renames it, or one by its size.

    Rooms without a name are grouped by width, and the rooms of each group by depth; such a class is
    named after both, in centimetres: `room_340x560`.
    """
    nameless = [i for i, f in enumerate(frontages) if not f.class_]
    widths = np.array([frontages[i].width_m for i in nameless])
    depths = np.array([frontages[i].depth_m for i in nameless])
    by_width = group_values(widths, params.spread_floor_m)
    given = [frontage.class_ or "" for frontage in frontages]
    names = [params.classes.get(class_, class_) for class_ in given]
    for group in range(by_width.max(initial=-1) + 1):
        rooms = np.nonzero(by_width == group)[0]
        by_depth = group_values(depths[rooms], params.depth_apart_m)
        for deep in range(by_depth.max() + 1):
            alike = rooms[by_depth == deep]
            size = [round(float(v[alike].mean()) * 100) for v in (widths, depths)]
            for room in alike:
                names[nameless[int(room)]] = "room_{}x{}".format(*size)
    return names


def room_types(frontages: Sequence[Frontage], params: LearnParams) -> RoomTypes:
    """Return the types of rooms: the widths of each class in groups (`group_values`).

    A type's spread is that of its rooms, shrunk to the spread common to all types: with d_i the
    deviations of its n rooms and s0 the common spread, s^2 = (sum d_i^2 + v s0^2) / (n - 1 + v),
    v = `spread_samples`; and at least `spread_floor_m`. s0^2 is the median of the types' variances,
    each as often as it has degrees of freedom: one motley type does not blur the rest; where no
    two rooms are of one type, s0 is `spread_unknown_m`.
    """
    widths = np.array([f.width_m for f in frontages])
    depths = np.array([f.depth_m for f in frontages])
    classes = np.array([f.class_ for f in frontages], dtype=object)
    members: list[tuple[str, NDArray[np.int64]]] = []
    for class_ in sorted(set(classes)):
        rooms = np.nonzero(classes == class_)[0]
        labels = group_values(widths[rooms], params.spread_floor_m)
        if NAMELESS.fullmatch(class_):  # a group of widths already
            labels[:] = 0
        members += [(class_, rooms[labels == g]) for g in range(labels.max() + 1)]
    groups = [rooms for _, rooms in members]
    unknown, prior = params.spread_unknown_m, params.spread_samples
    width_spreads = _spreads(widths, groups, params.spread_floor_m, unknown, prior)
    depth_spreads = _spreads(depths, groups, params.depth_floor_m, unknown, prior)
    of = np.empty(len(frontages), np.int64)
    parts = []
    for i, (class_, rooms) in enumerate(members):
        of[rooms] = i
        sizes = float(widths[rooms].mean()), width_spreads[i], float(depths[rooms].mean())
        numbers = (round(value, METRE_DECIMALS) for value in (*sizes, depth_spreads[i]))
        parts.append(Part(class_, *numbers))
    return RoomTypes(tuple(parts), tuple(of.tolist()))


def _spreads(
    values: NDArray[np.float64],
    groups: Sequence[NDArray[np.int64]],
    floor: float,
    unknown: float,
    prior_samples: float,
) -> list[float]:
    sums = [float(((values[g] - values[g].mean()) ** 2).sum()) for g in groups]
    pairs = list(zip(sums, groups, strict=True))
    several = sorted((s / (len(g) - 1), len(g) - 1) for s, g in pairs if len(g) > 1)
    freedom = np.cumsum([f for _, f in several])
    middle = int(np.searchsorted(freedom, freedom[-1] / 2)) if several else 0
    common = several[middle][0] if several else unknown**2
    common = max(common, floor**2)
    return [
        max(float(np.sqrt((s + prior_samples * common) / (len(g) - 1 + prior_samples))), floor)
        for s, g in pairs
    ]
