"""`mapsense wall`: which wall of a mapped storey is drawn, and what it says where it cannot be."""

import json
from datetime import UTC, datetime

import matplotlib.image
import numpy as np
import pytest

from flows.cli import main
from storage import stages
from storage.artifacts import Place, write
from storage.candidates import CANDIDATES, FEATURES, Candidates
from storage.forest import write_forest
from storage.openings import OPENINGS, Openings
from storage.runs import Run, recorded
from storage.snapshots import SNAPSHOTS, none
from storage.stages import StageRow
from storage.wall_images import EMPTY, OCCUPIED, WALL_IMAGES, WallImages
from storage.walls import WALLS, Walls
from tasks.doors.candidates import CandidateParams, find_candidates
from tasks.doors.examples import CLASSES
from tasks.forest import Examples, ForestParams, fit

START = datetime(2026, 1, 1, tzinfo=UTC)
DOORS = ((0, 1.0), (1, 0.8), (1, 3.0))
"""Walls with doors, and where along them each begins."""
WIDE = 0.96


def images():
    """Return two walls along x: w0 between r0 and r1, w1 seen from r0 alone."""
    labels = [np.full((120, 70), OCCUPIED, np.uint8) for _ in range(3)]
    for face, wall in enumerate((0, 0, 1)):
        for on, at in DOORS:
            if on == wall:
                begin = at if face != 1 else 4.8 - at - WIDE
                first = round(begin / 0.04)
                labels[face][first : first + 24, :49] = EMPTY
    depths = [np.where(label == EMPTY, 2.0, 0.0).astype(np.float32) for label in labels]
    return WallImages(
        pixel_m=0.04,
        walls=np.array([0, 0, 1], np.int32),
        rooms=np.array([0, 1, 0], np.int32),
        opposite=np.array([1, 0, -1], np.int32),
        origins=np.array([(0, 0.05), (4.8, -0.05), (0, 5)]),
        axes=np.array([(1.0, 0), (-1, 0), (1, 0)]),
        base_m=np.zeros(3),
        labels=tuple(labels),
        depths=tuple(depths),
        empty=tuple((label == EMPTY).astype(np.uint8) * 255 for label in labels),
        rays=np.ones(3, np.int64),
    )


def walls():
    lines = np.array([[(0, 0), (4.8, 0)], [(0, 5), (4.8, 5)]], float)
    return Walls(
        lines,
        np.array([0.1, np.nan]),
        np.zeros(2),
        np.full(2, 2.8),
        np.array([(0, 1), (0, -1)], np.int32),
        np.ones(2),
    )


def openings():
    y = np.array([0.0, 5.0])
    lines = [[(at, y[wall]), (at + WIDE, y[wall])] for wall, at in DOORS]
    n = len(DOORS)
    return Openings(
        kinds=np.array(["door"] * n),
        lines=np.array(lines),
        sill_m=np.zeros(n),
        head_m=np.full(n, 1.96),
        walls=np.array([wall for wall, _ in DOORS], np.int32),
        rooms=np.array([(0, 1), (0, -1), (0, -1)], np.int32),
        states=np.array(["open"] * n),
        confidences=np.ones(n),
    )


def mapped(store, made, storey="1"):
    """Record a run that made some things of a storey."""
    place = Place(store=str(store), run=f"run{storey}", building="hut", storey=storey)
    with recorded(str(store), Run(place.run, "map", "hut", storey, "{}", START)) as record:
        for i, (kind, value) in enumerate(made):
            at = place.of_scan("a") if kind is SNAPSHOTS else place
            uri = write(kind, value, at).uri
            row = StageRow(
                f"{place.run}-{i}", place.run, at.scan, kind.table, str(i), "computed",
                1.0, 1.0, None, 0, 0, 0, 0, None, START, (uri,),
            )  # fmt: skip
            stages.append(place, row)
        record.end("completed", "")


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    folder = tmp_path_factory.mktemp("store")
    seen = images()
    found = find_candidates(seen, CandidateParams())
    assert isinstance(found, Candidates) and len(found)
    made = [(WALL_IMAGES, seen), (CANDIDATES, found), (OPENINGS, openings())]
    mapped(folder, [*made, (WALLS, walls()), (SNAPSHOTS, none())])
    mapped(folder, [(WALLS, walls())], storey="2")
    return folder


@pytest.fixture
def wall(store, tmp_path, monkeypatch, capsys):
    """Return what runs the verb: its exit code, answer or error, and the picture's file."""
    n = 40
    rng = np.random.default_rng(0)
    drawn = Examples(rng.normal(size=(n, len(FEATURES))), np.arange(n) % len(CLASSES),
                     np.full(n, "a"))  # fmt: skip
    forest = tmp_path / "forest.parquet"
    write_forest(fit(drawn, FEATURES, CLASSES, ForestParams(trees=3)), forest)
    monkeypatch.setattr("flows.panels.shipped", lambda kind: forest)

    def run(*arguments, storey="1", out="wall.png"):
        capsys.readouterr()
        file = tmp_path / out
        given = ["--building", "hut", "--storey", storey, "--store", store, "--out", file, "--json"]
        with pytest.raises(SystemExit) as left:
            main([str(word) for word in ("wall", *arguments, *given)])
        said = capsys.readouterr()
        answer = json.loads(said.out) if said.out else said.err
        return left.value.code, answer, file

    return run


def test_the_wall_with_most_doors_is_drawn_if_none_is_named(wall):
    code, found, file = wall()
    assert code == 0
    assert (found["wall"], found["room"], found["doors"]) == ("w1", "r0", 2)
    picture = matplotlib.image.imread(file)
    assert picture.shape[1] == 1600 and picture[..., :3].std() > 0.05


@pytest.mark.parametrize(
    ("named", "expected"),
    [
        (("w0",), ("w0", "r0", 1)),
        (("w0", "--room", "r1"), ("w0", "r1", 1)),
        (("--room", "r1"), ("w0", "r1", 1)),
    ],
)
def test_a_wall_and_the_room_that_looks_at_it_can_be_named(wall, named, expected):
    code, found, file = wall(*named, out="wall.svg")
    assert code == 0 and (found["wall"], found["room"], found["doors"]) == expected
    assert found["candidates"] > 0 and file.read_text().startswith("<?xml")


@pytest.mark.parametrize(
    ("named", "said"),
    [
        (("w7",), "--wall w7: the plan has no wall of this id"),
        (("w1", "--room", "r1"), "--room r1: does not look at wall w1; rooms that do: r0"),
        (("--room", "r9"), "--room r9: the plan has no room of this id with a wall"),
    ],
)
def test_what_is_not_in_the_plan_is_said(wall, named, said):
    code, error, file = wall(*named)
    assert code == 1 and said in error and not file.exists()


def test_a_storey_nobody_looked_for_doors_in_is_said(wall):
    code, error, _ = wall(storey="2")
    assert code == 1 and "hut/2: no run in" in error and "mapsense map" in error


def test_a_file_that_is_no_picture_is_refused(wall):
    code, error, _ = wall(out="wall.txt")
    assert code == 1 and "expected a file .png or .svg" in error
