"""One seed for all that is drawn while a storey is mapped: repeats differ in it alone."""

from collections.abc import Iterator, Mapping
from hashlib import sha256
from typing import Any

from flows.params import MapSenseParams

SEED = "seed"
"""What a random stage calls the field of its parameters that everything is drawn from."""


def seeded(params: MapSenseParams, seed: int) -> MapSenseParams:
    """Return the parameters with the seed of every random stage drawn from one.

    Stages that draw nothing keep their parameters, and so their results of another seed.
    """
    return MapSenseParams.model_validate(_seeded(params.model_dump(), seed, ""))


def stage_seed(seed: int, field: str) -> int:
    """Return the seed of a stage's field: stages must not draw the same numbers."""
    return int(sha256(f"{seed}/{field}".encode()).hexdigest()[:8], 16)


def seeds_in(given: Mapping[str, Any], path: str = "") -> Iterator[str]:
    """Yield the names of the seeds that parameters set themselves, as `hough.seed`."""
    for name, value in given.items():
        if isinstance(value, Mapping):
            yield from seeds_in(value, f"{path}{name}.")
        elif name == SEED:
            yield path + name


def _seeded(values: Mapping[str, Any], seed: int, path: str) -> dict[str, Any]:
    drawn: dict[str, Any] = {}
    for name, value in values.items():
        if isinstance(value, Mapping):
            drawn[name] = _seeded(value, seed, f"{path}{name}.")
        elif name == SEED and value is not None:
            drawn[name] = stage_seed(seed, path + name)
        else:
            drawn[name] = value
    return drawn
