"""The grammar corrects the initial model: Fig. 2's second half of the layout (Sec. 4.2)."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from flows import stages
from flows.ended import made_by
from flows.params import MapSenseParams
from flows.plans import grammar_source
from flows.results import Corrected
from storage.artifacts import Place, Ref


def correct(
    place: Place, params: MapSenseParams, faces: Any, rooms: Any, segments: Sequence[Ref]
) -> Corrected:
    """Correct an initial model by the grammar that is named, if one is.

    Parameters
    ----------
    faces, rooms : what the stages of these names made
    segments : those of every scan, in the storey's order
    """
    if params.grammar is None:
        return Corrected()
    grammar = grammar_source(params.grammar)
    seen = stages.observations.submit(place, rooms, faces, segments, grammar, params.extract)
    layout = stages.layout.submit(place, seen, grammar, params.decode)
    final = stages.layout_rooms.submit(place, rooms, rooms, seen, layout, grammar, params.place)
    walls = stages.layout_walls.submit(place, final, faces, params.intersect)
    made, why = made_by((seen, layout, final, walls))
    if why:
        problem = f"grammar {Path(grammar.path).stem} not applied: {why}"
        return Corrected(grammar.path, (), problem)
    return Corrected(grammar.path, tuple(made))
