"""Room classes and room units along a facade, drawn from stated statistics.

Table 1 of the paper gives two rules: a small office of 2.4 m with an a-priori probability of 0.06,
and two executives with an assistant's office of 19.2 m with 0.04. Both are multiples of a facade
module of 2.4 m. Every other number is an assumption.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

MODULE_M = 2.4
"""The facade module: the least width of Table 1, which divides the other."""
CIRCULATION = ("corridor",)
"""Classes one walks through to reach a room."""
BEARING = ("corridor", "stairs")
"""Classes within bearing walls."""
DRAWS = 200
"""Rows drawn before the wanted end rooms are given up: one in a few has them."""


class Part(NamedTuple):
    """A room of a unit."""

    class_: str
    modules: int


class Unit(NamedTuple):
    """A rule: one room, or several that always come together."""

    p_apriori: float
    parts: tuple[Part, ...]

    @property
    def modules(self) -> int:
        """Return the facade modules of all parts."""
        return sum(part.modules for part in self.parts)


UNITS: Mapping[str, Unit] = {
    "small_office": Unit(0.06, (Part("office", 1),)),
    "executives": Unit(0.04, (Part("executive", 3), Part("assistant", 2), Part("executive", 3))),
    "office": Unit(0.43, (Part("office", 2),)),
    "double_office": Unit(0.14, (Part("office", 3),)),
    "seminar": Unit(0.06, (Part("seminar", 4),)),
    "meeting": Unit(0.08, (Part("meeting", 3),)),
    "lab": Unit(0.08, (Part("lab", 3),)),
    "storage": Unit(0.06, (Part("storage", 1),)),
    "kitchen": Unit(0.02, (Part("kitchen", 2),)),
    "wc": Unit(0.02, (Part("wc", 1),)),
    "stairs": Unit(0.01, (Part("stairs", 2),)),
}
"""Rules and their a-priori probabilities, which sum to one: Table 1's two, the rest assumed."""


def draw_row(
    modules: int, rng: np.random.Generator, required: Sequence[str] = (), end_modules: int = 1
) -> list[Part]:
    """Return rooms that fill a row of facade modules.

    Parameters
    ----------
    modules : the row's length, facade modules
    required : units that must be among them
    end_modules : least modules of the first and the last room, whose facade a bend shortens

    Raises
    ------
    ValueError
        If no row of that length can be drawn.
    """
    for _ in range(DRAWS):
        parts = parts_of(_draw_units(modules, rng, required))
        if min(parts[0].modules, parts[-1].modules) >= end_modules:
            return parts
    raise ValueError(
        f"a row of {modules} modules with {list(required)} and end rooms of {end_modules} or more "
        "modules was not found; lengthen the row"
    )


def _draw_units(modules: int, rng: np.random.Generator, required: Sequence[str]) -> list[str]:
    names = list(required)
    left = modules - sum(UNITS[name].modules for name in names)
    if left < 0:
        raise ValueError(f"units {names} do not fit in {modules} modules; lengthen the row")
    while left > 0:
        fits = [name for name, unit in UNITS.items() if unit.modules <= left]
        weights = np.array([UNITS[name].p_apriori for name in fits])
        names.append(fits[int(rng.choice(len(fits), p=weights / weights.sum()))])
        left -= UNITS[names[-1]].modules
    return [names[i] for i in rng.permutation(len(names))]


def parts_of(names: Sequence[str]) -> list[Part]:
    """Return the rooms of named units in their order; a name that is none is a ValueError."""
    unknown = [name for name in names if name not in UNITS]
    if unknown:
        raise ValueError(f"units {unknown} are unknown; units are {', '.join(UNITS)}")
    return [part for name in names for part in UNITS[name].parts]
