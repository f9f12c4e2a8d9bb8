"""Parameters of plane labelling: its modules share them."""

from pydantic import NonNegativeFloat, PositiveFloat

from tasks.params import Params


class LabelParams(Params):
    """Parameters of plane labelling."""

    eps_wall: PositiveFloat = 0.2
    """Greatest distance of two segments of one wall, metres (Fig. 13)."""
    eps_norm: PositiveFloat = 0.2
    """Greatest norm of the cross product of their normals (Fig. 13, read as 2 x 10^-1)."""
    room_extent_m2: PositiveFloat = 1.0
    """Area below which a level is a lamp, a hole or a piece of furniture, square metres. Not in
    the paper."""
    room_extent_share: PositiveFloat = 0.2
    """The same as a share of the largest level's area. Not in the paper."""
    headroom_m: PositiveFloat = 1.9
    """Least height of a ceiling above the floor, metres. Not in the paper."""
    below_ceiling_m: PositiveFloat = 0.5
    """How far below the ceiling a wall may end and still be a wall, metres: partitions, door
    leaves and cupboards end lower. Not in the paper."""
    wall_height_m: PositiveFloat = 1.5
    """Height above the floor a wall must reach where no ceiling was seen, metres. Not in the
    paper."""
    lintel_m: NonNegativeFloat = 2.1
    """Height of a door's opening, metres: what is seen above it closes a wall over a door. Not in
    the paper."""
