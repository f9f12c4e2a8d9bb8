"""Numbers of a plan that a simulation cannot do without."""

from storage.errors import MapSenseError


def known(value: float | None, owner: str, name: str) -> float:
    """Return a number of the plan; raise MapSenseError naming owner and field if it is unknown."""
    if value is None:
        raise MapSenseError(
            f"{owner}: '{name}' is unknown; a simulation needs it: set it, or complete the plan "
            "with stated assumptions"
        )
    return value
