"""Placement: the decoded rooms make the initial model the final plan (Sec. 4.2.2, Fig. 8)."""

from grammars.model import Grammar
from storage.layout import Layout
from storage.layout_rooms import LayoutRooms
from storage.observations import Observations
from storage.rooms import Rooms
from storage.sightings import NO_SIGHTINGS, Sightings
from storage.walls import Walls
from tasks.layout.placement.correction import Refused, corrected
from tasks.layout.placement.decoded_rows import decoded_rows
from tasks.layout.placement.labels import label_rooms
from tasks.layout.placement.params import PlacementParams
from tasks.layout.placement.repeated import with_sightings
from tasks.layout.placement.storey import Storey

INVALID = "would make the plan invalid"
"""Why a correction was refused."""


def place_rooms(
    rooms: Rooms,
    walls: Walls,
    observations: Observations,
    layout: Layout,
    grammar: Grammar,
    params: PlacementParams,
    sightings: Sightings = NO_SIGHTINGS,
) -> LayoutRooms:
    """Return the rooms of the final plan.

    Parameters
    ----------
    rooms, walls : the initial model
    observations : what it says along its reference lines
    layout : the decoded rooms; the best hypothesis of each line is placed
    grammar : the one that decoded them; its partitions and depths
    sightings : where the scans that agree have the walls of these rooms

    Returns
    -------
    LayoutRooms
        In the order of the initial rooms they are made of. Polygons are simple and overlap no more
        than the initial ones; see `tasks.layout.placement.validity`.

    Notes
    -----
    Side walls of rooms along a line go where observed positions and rule widths agree best
    (`widths`), fronts and backs onto the row's straight walls (`depths`). Only edges on these walls
    move; the rest of an outline stays. A correction is refused where it contradicts well observed
    walls (`guard`), and where the plan would not be valid with it: then the walls in question
    stay as observed, and rooms that cannot be joined or cut validly stay as they were. As each
    round refuses something more, and the initial model is what is left when all is refused, a
    valid plan is always reached.
    """
    rows = with_sightings(
        decoded_rows(observations, layout, params.end_sigma_m),
        layout,
        sightings,
        (grammar.partition_m, grammar.partition_spread_m),
    )
    storey = Storey(list(rooms.polygons), walls, rows, layout, grammar, params)
    refused = Refused()
    while True:
        plan = corrected(storey, refused)
        more = refused | plan.faults
        if more == refused:
            break
        refused = more
    reasons = [
        shape.refused or (INVALID if refused.concerns(shape, keys) else "")
        for shape, keys in zip(plan.shapes, plan.walls, strict=True)
    ]
    return label_rooms(
        plan.shapes, plan.pieces, reasons, plan.boundaries, storey.rows, layout, rooms
    )
