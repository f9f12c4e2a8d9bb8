"""The grammar corrects the initial model: Fig. 2's second half of the layout (Sec. 4.2)."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from prefect.futures import PrefectFuture

from flows import stages
from flows.params import MapSenseParams
from flows.plans import grammar_source
from flows.results import Corrected
from storage.artifacts import Place, Ref
from storage.stages import reason


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
    made: list[Ref] = []
    for future in (seen, layout, final, walls):
        future.wait()
        if not future.state.is_completed():
            name = Path(grammar.path).stem
            return Corrected(grammar.path, (), f"grammar {name} not applied: {_why(future)}")
        made.append(future.result())
    return Corrected(grammar.path, tuple(made))


def _why(future: PrefectFuture[Any]) -> str:
    error = future.state.result(raise_on_failure=False)
    return reason(error) if isinstance(error, BaseException) else str(future.state.message)
