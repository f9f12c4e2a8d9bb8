"""The verb `wall`: how the doors of one wall of a mapped storey were found, step by step (Fig. 16).

The images, candidates and openings are those the store holds; what lies between them is made again
from these, by the run's parameters.
"""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flows.answers import existing_store
from flows.forests import shipped
from flows.params import MapSenseParams, parse_params
from flows.verbs import checked_name, writable
from storage.artifacts import Place, Ref, read
from storage.candidates import CANDIDATES, Candidates
from storage.errors import MapSenseError
from storage.layout_walls import LAYOUT_WALLS
from storage.made import WHOLE, made
from storage.openings import DOOR, OPENINGS, Openings
from storage.runs import COMPLETED, PARTIAL, Run, read_runs
from storage.snapshots import SNAPSHOTS, Snapshots
from storage.wall_images import WALL_IMAGES, WallImages
from storage.walls import WALLS, Walls
from tasks.doors.classifying import read_classifier
from tasks.doors.lines import Lines
from tasks.doors.steps import FaceSteps, face_steps
from tasks.exports.door_panels import (
    Panel,
    depth_image,
    draw_panels,
    edge_image,
    label_image,
    mask_image,
    traced_panels,
)

SUFFIXES = (".png", ".svg")


@dataclass(frozen=True, eq=False)
class Looked:
    """What a run has made on its way to the doors of a storey."""

    run: Run
    params: MapSenseParams
    images: WallImages
    candidates: Candidates
    openings: Openings
    walls: Walls
    snapshots: list[Snapshots]


def draw_wall(
    building: str,
    storey: str,
    wall: str | None,
    room: str | None,
    out: Path,
    store: Path | None,
    as_json: bool,
) -> int:
    """Draw the panels of a wall, and say what is on it.

    Parameters
    ----------
    wall : its id in the plan, as w12; None: the one with most doors
    room : id of the room that looks at it, as r3; None: its first
    """
    root = existing_store(store)
    for name in (building, storey):
        checked_name(name)
    if out.suffix.lower() not in SUFFIXES:
        raise MapSenseError(f"--out {out}: expected a file {' or '.join(SUFFIXES)}")
    writable(out.parent, "folder of the picture", "--out")
    looked = _looked(root, building, storey)
    face = chosen_face(looked.images, looked.openings, wall, room)
    steps = face_steps(
        face,
        looked.images,
        looked.walls,
        looked.candidates,
        looked.openings,
        looked.snapshots,
        read_classifier(shipped("doors")),
        (looked.params.candidates, looked.params.openings),
    )
    images, pixel_m = looked.images, looked.images.pixel_m
    ids = f"wall w{images.walls[face]} from room r{images.rooms[face]}"
    note = f"{building}/{storey}, {looked.run.started_at:%Y-%m-%d}; pixels of {pixel_m:.2g} m"
    title = f"{ids}: {len(steps.doors)} of {len(looked.openings.of_kind(DOOR))} doors"
    draw_panels(panels(images, face, steps), pixel_m, title, note, out)
    found = {
        "wall": f"w{images.walls[face]}",
        "room": f"r{images.rooms[face]}",
        "candidates": len(steps.candidates),
        "likely_doors": len(steps.likely),
        "doors": len(steps.doors),
        "run": looked.run.id,
        "out": str(out.resolve()),
    }
    print(json.dumps(found, indent=1) if as_json else f"{ids}, {building}/{storey}: {out}")
    return 0


def panels(images: WallImages, face: int, steps: FaceSteps) -> list[Panel]:
    """Return the eight panels of a face, in the order the steps are taken."""
    labels, depth, _ = traced_panels(images, face)
    straight, plain = depth_image(steps.depth), label_image(images.labels[face])
    edges = steps.edges
    fused = mask_image((edges.upright > 0) | (edges.level > 0))
    lines = np.concatenate([_upright(steps.uprights), _level(steps.levels)])
    clusters = len(np.unique(steps.clusters[steps.clusters >= 0]))
    return [
        depth,
        labels,
        Panel("edges: Canny's blue, Sobel's red, both black", edge_image(edges.canny, edges.sobel)),
        Panel(f"lines among both: {len(lines)}", fused, lines=lines),
        Panel(
            f"candidates: {len(steps.candidates)}", straight, rectangles=_drawn(steps.candidates)
        ),
        Panel(
            f"doors by the classifier: {len(steps.likely)}", plain, rectangles=_drawn(steps.likely)
        ),
        Panel(
            f"clusters of what may be doors: {clusters}",
            plain,
            rectangles=_drawn(steps.clustered),
            groups=steps.clusters,
        ),
        Panel(f"doors: {len(steps.doors)}", straight, rectangles=_drawn(steps.doors)),
    ]


def chosen_face(images: WallImages, openings: Openings, wall: str | None, room: str | None) -> int:
    """Return the face of a wall that a room looks at, by their ids in the plan.

    Raises
    ------
    MapSenseError
        If there is no such wall, or that room does not look at it.
    """
    if not len(images):
        raise MapSenseError("the storey has no wall that a room looks at")
    if wall is None:
        doors = np.bincount(
            openings.walls[openings.of_kind(DOOR)], minlength=images.walls.max() + 1
        )
        return int(np.argmax(np.where(_among(room, images), doors[images.walls], -1)))
    of_wall = np.flatnonzero([f"w{w}" == wall for w in images.walls])
    if not len(of_wall):
        raise MapSenseError(f"--wall {wall}: the plan has no wall of this id that a room looks at")
    seen_from = [face for face in of_wall if room in (None, f"r{images.rooms[face]}")]
    if not seen_from:
        rooms = ", ".join(f"r{images.rooms[face]}" for face in of_wall)
        raise MapSenseError(f"--room {room}: does not look at wall {wall}; rooms that do: {rooms}")
    return int(seen_from[0])


def _among(room: str | None, images: WallImages) -> NDArray[np.bool_]:
    """Return which faces a room looks at; all if none is named."""
    among = np.array([room in (None, f"r{r}") for r in images.rooms])
    if not among.any():
        raise MapSenseError(f"--room {room}: the plan has no room of this id with a wall")
    return among


def _looked(root: Path, building: str, storey: str) -> Looked:
    """Return what the last run that looked for doors has made of a storey."""
    for run in reversed(read_runs(root, building, storey)):
        if run.state not in (COMPLETED, PARTIAL):
            continue
        refs = made(Place(store=str(root), run=run.id, building=building, storey=storey))
        if OPENINGS.table in refs:
            return _read(root, run, refs)
    raise MapSenseError(
        f"{building}/{storey}: no run in {root} has looked for doors; map the storey with "
        "'mapsense map'"
    )


def _read(root: Path, run: Run, refs: dict[str, dict[str, Ref]]) -> Looked:
    asked = run.request().get("params", {})
    if LAYOUT_WALLS.table in refs:
        walls = read(LAYOUT_WALLS, refs[LAYOUT_WALLS.table][WHOLE], root).walls
    else:
        walls = read(WALLS, refs[WALLS.table][WHOLE], root)
    return Looked(
        run,
        parse_params(asked),
        read(WALL_IMAGES, refs[WALL_IMAGES.table][WHOLE], root),
        read(CANDIDATES, refs[CANDIDATES.table][WHOLE], root),
        read(OPENINGS, refs[OPENINGS.table][WHOLE], root),
        walls,
        [read(SNAPSHOTS, ref, root) for ref in refs[SNAPSHOTS.table].values()],
    )


def _upright(lines: Lines) -> NDArray[np.float64]:
    """Return upright lines by their ends on the face, (k, 2, 2)."""
    ends = np.column_stack([lines.places, lines.begins, lines.places, lines.ends])
    return ends.reshape(-1, 2, 2)


def _level(lines: Lines) -> NDArray[np.float64]:
    """Return level lines by their ends on the face, (k, 2, 2)."""
    ends = np.column_stack([lines.begins, lines.places, lines.ends, lines.places])
    return ends.reshape(-1, 2, 2)


def _drawn(boxes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return boxes of begin, end, bottom and top as a panel has them: from, bottom, to, top."""
    return boxes[:, [0, 2, 1, 3]]
