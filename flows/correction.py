"""The grammar corrects the initial model: Fig. 2's second half of the layout (Sec. 4.2)."""

from collections.abc import Sequence
from pathlib import Path, PurePath
from typing import Any

import numpy as np

from flows import stages
from flows.ended import made_by
from flows.params import MapSenseParams
from flows.plans import grammar_source
from flows.results import Corrected
from storage.artifacts import Place, Ref, read
from storage.sightings import DRIFTS, SIGHTINGS, Sightings


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
    layout = stages.layout.submit(place, seen, segments, grammar, params.decode)
    final = stages.layout_rooms.submit(
        place, rooms, rooms, seen, layout, layout, grammar, params.place
    )
    walls = stages.layout_walls.submit(place, final, faces, params.intersect)
    made, why = made_by((seen, layout, final, walls))
    if why:
        problem = f"grammar {Path(grammar.path).stem} not applied: {why}"
        return Corrected(grammar.path, (), problem)
    sightings = next(ref for ref in made if ref.table == SIGHTINGS.table)
    names = [_scan(ref) for ref in segments]
    note = told(read(SIGHTINGS, sightings, place.store), names)
    return Corrected(grammar.path, tuple(made), note=note)


def told(sightings: Sightings, names: Sequence[str]) -> str:
    """Return in a sentence which scans contradict the others at the decoded walls; '' none.

    Parameters
    ----------
    names : of the storey's scans, in its order
    """
    parts = []
    for scan in np.unique(sightings.scans[sightings.drift_m != 0]).tolist():
        own = (sightings.scans == scan) & (sightings.drift_m != 0)
        most = float(np.abs(sightings.drift_m[own]).max())
        out = int((sightings.left_out[own] == DRIFTS).sum())
        faces = f"left out at {out} of {own.sum()} wall faces"
        parts.append(f"scan {names[scan]} is off by {most:.2f} m from the others: {faces}")
    return "; ".join(parts)


def _scan(ref: Ref) -> str:
    """Return the scan that an artifact of one scan is of, by the folder it lies in."""
    return next(p for p in PurePath(ref.uri).parts if p.startswith("scan=")).removeprefix("scan=")
