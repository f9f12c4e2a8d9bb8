"""How decoded rooms are placed."""

from typing import Literal

from pydantic import Field, PositiveFloat

from tasks.params import Params


class PlacementParams(Params):
    """How decoded rooms are placed. Not in the paper unless said; figures are assumptions."""

    widths: Literal["fuse", "replace", "observed"] = "fuse"
    """Observed and rule widths fused by their uncertainty; or the rule's replaces the observed
    (the paper's); or the observed stays."""
    limit: PositiveFloat = 3.0
    """The guard: standard deviations from which a rule contradicts what was observed."""
    most_wrong: float = Field(default=0.5, ge=0, le=1)
    """The guard: share of the rules between well-observed walls that may contradict these before no
    rule is trusted."""
    firm_presence: float = Field(default=0.9, ge=0, le=1)
    """Presence from which a wall whose two faces were seen counts as well observed."""
    cut_posterior: float = Field(default=0.9, ge=0, le=1)
    """Posterior of a wall that a room is cut at. Of storeys simulated for tuning, with walls taken
    away and without, 22 of 25 missed walls decoded had more than 0.8, and one of 120 false ones,
    by a grammar of hospitals; at 0.8 a grammar of other buildings cut a room of another storey in
    two that is one."""
    join_posterior: float = Field(default=0.9, ge=0, le=1)
    """Posterior that a wall which was seen is none, which rooms are joined at: false ones had 0.95
    and more by grammars of the type, true ones up to 0.8."""
    least_gain: float = 3.0
    """Gain of a room, the mean of a storey, from which rooms are joined and cut: how much more
    probable a grammar makes what was seen of a room than if it were of any width, in logarithms. On
    storeys simulated for tuning grammars of the type had 4.7 and more, a hospital's up to 1.6."""
    face_sigma_m: PositiveFloat = 0.03
    """Standard deviation of a wall's face seen along all its length, metres."""
    end_sigma_m: PositiveFloat = 0.05
    """Standard deviation of where a line ends, metres: the axis of a wall seen from one side."""
    on_wall_m: PositiveFloat = 0.15
    """A room's side this near to an observed face lies on it, metres."""
    align_m: PositiveFloat = 0.12
    """Rooms whose fronts or backs differ by no more share one straight wall, metres."""
    hidden_m: PositiveFloat = 0.6
    """A face that furniture hides is taken for one no further before it, metres: what cupboards are
    deep."""
    beyond_m: PositiveFloat = 0.35
    """A face was put no further behind the wall it is of, metres."""
    known_sigma_m: PositiveFloat = 0.01
    """Standard deviation of a wall's place from storey to storey of one building, metres: DIN 18202
    allows 24 mm over 6 m in plan, taken for more than two of them."""
    drift_m: PositiveFloat = 0.05
    """Standard deviation of where a storey's scans put a wall in the building, metres: they drift
    together, faces near each other alike."""
    thickest_m: PositiveFloat = 0.5
    """Rooms further apart are no neighbours, metres."""
    thinnest_m: PositiveFloat = 0.02
    """No wall is made thinner than this, metres."""
    least_room_m2: PositiveFloat = 1.0
    """No room is cut into smaller ones, square metres."""
