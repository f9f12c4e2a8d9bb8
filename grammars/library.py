"""The grammars that come with MapSense: where they are, and how those that were learnt are made."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from grammars.generator.learning import learn
from grammars.generator.params import LearnParams
from grammars.model import Grammar
from storage.errors import InputError
from storage.plan import Plan

FOLDER = Path(__file__).parent


class Recipe(NamedTuple):
    """What a grammar is for, and what it was learnt from."""

    building_type: str
    about: str


RECIPES: Mapping[str, Recipe] = {
    "office": Recipe(
        "office building",
        "Learnt from simulated storeys (tasks/simulation/training.py, kind 'office'): cells on\n"
        "both sides of a corridor, every third storey an open-plan office across from cells.\n"
        "Rooms are drawn from stated statistics with a facade module of 2.4 m; no real building.\n",
    ),
    "institute": Recipe(
        "campus or institute",
        "Learnt from simulated storeys (tasks/simulation/training.py, kind 'institute'): rings\n"
        "with rooms in the core, every third storey two wings at an angle. Rooms at the corners\n"
        "of a core stand along two lines, along one with their depth; no real building.\n",
    ),
    "residence": Recipe(
        "small flats along a corridor",
        "Learnt from a real storey: Westport House, Dundee, storey 3, an indoor map published by\n"
        "WRLD (github.com/wrld3d/wrld-indoor-maps-api, CC BY 4.0). Widths and frequencies of the\n"
        "rooms along its main corridors; they have no names: classes are widths x depths in cm.\n",
    ),
}
"""Grammars that are learnt. `hospital` is written by hand."""


def learn_library(name: str, plans: Sequence[Plan]) -> Grammar:
    """Learn one of `RECIPES` from its plans."""
    return learn(plans, LearnParams(), name, *RECIPES[name])


def library() -> dict[str, Path]:
    """Return the files of the grammars that come with MapSense, by name."""
    return {path.stem: path for path in sorted(FOLDER.glob("*.toml"))}


def find_grammar(name: str) -> Path:
    """Return a grammar's file by its name in the library, or by its path.

    Raises
    ------
    InputError
        If there is neither.
    """
    known = library()
    if name in known:
        return known[name]
    if not Path(name).is_file():
        remedy = f"name a file, or a grammar that comes with MapSense: {', '.join(known)}"
        raise InputError(name, "is no grammar", remedy)
    return Path(name)
