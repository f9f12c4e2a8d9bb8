"""The stages of the layout: what a grammar's file makes of a storey's initial model (Sec. 4.2)."""

from pathlib import Path

from grammars.model import Grammar
from grammars.reading import read_grammar
from storage.faces import Faces
from storage.layout import Layout
from storage.layout_rooms import LayoutRooms
from storage.observations import Observations
from storage.rooms import Rooms
from storage.segments import Segments
from storage.sightings import Sightings
from storage.sources import Source
from storage.walls import Walls
from tasks.layout.crowd.crowd import fuse_scans
from tasks.layout.decoding.decode import DecodeParams, decode
from tasks.layout.extraction.observations import ExtractParams, extract_observations
from tasks.layout.placement.params import PlacementParams
from tasks.layout.placement.place import place_rooms


def observe(
    rooms: Rooms, faces: Faces, segments: list[Segments], grammar: Source, params: ExtractParams
) -> Observations:
    """Extract what the initial model says along the reference lines: `extract_observations`."""
    return extract_observations(rooms, faces, segments, _read(grammar), params)


def decode_rooms(
    observations: Observations, segments: list[Segments], grammar: Source, params: DecodeParams
) -> tuple[Layout, Sightings]:
    """Find the most probable rooms along each line, and hold scans against each other at them.

    See `decode` and `fuse_scans`.
    """
    rules = _read(grammar)
    layout = decode(observations, rules, params)
    return layout, fuse_scans(observations, layout, segments, rules.partition_m, params.crowd)


def place(
    rooms: Rooms,
    walls: Walls,
    observations: Observations,
    layout: Layout,
    sightings: Sightings,
    grammar: Source,
    params: PlacementParams,
) -> LayoutRooms:
    """Correct the initial model's rooms by the decoded ones: `place_rooms`."""
    return place_rooms(rooms, walls, observations, layout, _read(grammar), params, sightings)


def _read(grammar: Source) -> Grammar:
    return read_grammar(Path(grammar.path))
