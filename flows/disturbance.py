"""Walls taken out of an initial model and put into it, to see how much a grammar mends."""

from collections.abc import Sequence

from flows import stages
from flows.params import MapSenseParams
from storage.artifacts import Place, Ref

Refs = Sequence[Ref]


def disturbed(place: Place, params: MapSenseParams, faces: Refs, rooms: Refs) -> tuple[Refs, Refs]:
    """Return what the stages `faces` and `rooms` made, with the walls missing and added asked for.

    For experiments alone: nothing is disturbed unless `disturb.missing` or `disturb.spurious` says
    so.
    """
    if not (params.disturb.missing or params.disturb.spurious):
        return faces, rooms
    made = stages.disturbed.submit(place, rooms, rooms, faces, params.disturb).result()
    instead = {ref.table: ref for ref in made}
    kept_faces, kept_rooms = (
        [instead.get(ref.table, ref) for ref in refs] for refs in (faces, rooms)
    )
    return kept_faces, kept_rooms
