"""What a stage may take before it is stopped: seconds, memory.

Both are of the machine a stage runs on, not of what it computes: so they come from the environment
of its process, and no cache key knows them. `mapsense.toml` sets them for the processes it starts;
a worker of a Dask cluster that sets none is told those of the process that asks.
"""

import os
from dataclasses import dataclass

from storage.errors import MapSenseError

TIMEOUT_S, MEMORY_MB = "MAPSENSE_STAGE_TIMEOUT_S", "MAPSENSE_STAGE_MEMORY_MB"


class StageStopped(MapSenseError):
    """A stage took more than it may, or its process died."""


@dataclass(frozen=True)
class Limits:
    """What a stage may take; None: as much as it needs."""

    timeout_s: float | None = None
    """seconds from its inputs to its results"""
    memory_mb: int | None = None
    """data of the process it runs in, its libraries' own some 200 MB included"""

    def __bool__(self) -> bool:
        return self.timeout_s is not None or self.memory_mb is not None


def limits(asked: Limits | None = None) -> Limits:
    """Return the limits of this process's stages.

    Parameters
    ----------
    asked : Limits, optional
        Those of the process that asks for a stage, if that is another: what this one leaves open.

    Raises
    ------
    MapSenseError
        If one is no positive number.
    """
    asked = asked or Limits()
    memory_mb = _positive(MEMORY_MB)
    return Limits(
        _positive(TIMEOUT_S) or asked.timeout_s,
        asked.memory_mb if memory_mb is None else int(memory_mb),
    )


def _positive(name: str) -> float | None:
    text = os.environ.get(name, "")
    if not text:
        return None
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0 < value < float("inf"):
        raise MapSenseError(f"environment {name}={text}: expected a number greater than 0")
    return value
