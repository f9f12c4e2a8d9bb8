"""The stages of doors and windows: what a forest's file makes of a storey's images (Sec. 5)."""

from pathlib import Path

from storage.candidates import Candidates
from storage.layout_rooms import LayoutRooms
from storage.layout_walls import LayoutWalls
from storage.openings import Openings
from storage.rooms import Rooms
from storage.snapshots import Snapshots
from storage.sources import Source
from storage.wall_images import WallImages
from storage.walls import Walls
from tasks.doors.classifying import read_classifier
from tasks.doors.openings import OpeningsParams, find_openings


def openings(
    candidates: Candidates,
    images: WallImages,
    walls: Walls,
    rooms: Rooms,
    snapshots: list[Snapshots],
    forest: Source,
    params: OpeningsParams,
) -> Openings:
    """Tell doors and windows from the rest and find each once: `find_openings`.

    Raises
    ------
    InputError
        If the forest's file is none, or of something else than openings.
    """
    trained = read_classifier(Path(forest.path))
    return find_openings(candidates, images, walls, rooms, snapshots, trained, params)


def layout_openings(
    candidates: Candidates,
    images: WallImages,
    walls: LayoutWalls,
    rooms: LayoutRooms,
    snapshots: list[Snapshots],
    forest: Source,
    params: OpeningsParams,
) -> Openings:
    """Find the doors and windows of a plan its grammar has corrected: `openings`."""
    return openings(candidates, images, walls.walls, rooms.rooms, snapshots, forest, params)
