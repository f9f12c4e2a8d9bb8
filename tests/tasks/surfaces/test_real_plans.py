"""Plans of two real storeys against what people read off the scans; skipped without the scans."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import shapely
from scipy.optimize import linear_sum_assignment
from shapely import LineString, Polygon, affinity

from storage.sources import Source
from tasks.device.codec import CodecParams, decode, encode
from tasks.device.voxels import VoxelParams, voxel_grid
from tasks.scans.read import ReadParams, read_scan
from tasks.surfaces.filtering import FilterParams, extract_segments
from tasks.surfaces.hough import HoughParams, detect_planes
from tasks.surfaces.intersection import IntersectParams, intersect_walls
from tasks.surfaces.label_params import LabelParams
from tasks.surfaces.labelling import label_surfaces
from tasks.surfaces.occupancy import OccupancyParams, occupied_space

DATA = Path(__file__).parents[3].parent / "shared" / "data"
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="the shared data is not there")

OFFICE = "tls_office_1/sample2_aligned.ply"
OFFICE_RAW = "tls_office_1/sample2_raw.ply"
FREIBURG = "freiburg_079_floor/fr_079_occupied.ply"


@cache
def found_rooms(path, seed=0):
    """Return the room polygons found in a scan, sent and decoded, with draws from a seed."""
    source = Source(name="scan", path=str(DATA / path), sha256="", size_bytes=0)
    points, snapshots, _ = read_scan(source, ReadParams())
    points = decode(encode(voxel_grid(points, VoxelParams()), CodecParams()))
    planes, labels = detect_planes(points, HoughParams(seed=seed))
    segments = extract_segments(points, snapshots, planes, labels, FilterParams())
    space = [occupied_space(points, OccupancyParams())]
    faces, coverage = label_surfaces([segments], LabelParams())
    rooms, _, _ = intersect_walls(faces, coverage, space, IntersectParams())
    return list(rooms.polygons)


def truth_of(path):
    return json.loads((DATA / path).with_name("truth.json").read_text())


def true_rooms(truth):
    return [Polygon(room["polygon"]) for room in truth["rooms"]]


def matched(found, true):
    """Return the IoU of each true room with the found one of the best one-to-one matching."""
    overlap = np.array([[a.intersection(b).area / a.union(b).area for b in true] for a in found])
    rows, columns = linear_sum_assignment(-overlap)
    best = np.zeros(len(true))
    best[columns] = overlap[rows, columns]
    return best


def f1(found, true):
    hits = (matched(found, true) > 0.5).sum()
    return 2 * hits / (len(found) + len(true))


def share_near(lines, outlines, metres):
    """Return the share of the lines' length that lies within a distance of the outlines."""
    near = shapely.union_all([p.exterior for p in outlines]).buffer(metres)
    lines = [LineString([line["p0"], line["p1"]]) for line in lines]
    return sum(line.intersection(near).length for line in lines) / sum(
        line.length for line in lines
    )


@pytest.mark.parametrize("seed", range(2))
def test_most_rooms_of_a_real_storey_are_found(seed):
    found = found_rooms(OFFICE, seed)
    assert f1(found, true_rooms(truth_of(OFFICE))) >= 0.9
    rounded = shapely.transform(np.array(found), lambda xy: np.round(xy, 4))
    assert all(p.is_valid and p.is_simple for p in rounded)


def test_rooms_seen_only_through_their_doors_are_found_more_often_than_not():
    # hardly half of each room was seen: which walls are found hangs on the draws
    true = true_rooms(truth_of(FREIBURG))
    assert np.mean([f1(found_rooms(FREIBURG, seed), true) for seed in range(2)]) >= 0.7


@pytest.mark.parametrize(
    ("path", "lines", "least"), [(OFFICE, "room_faces", 0.9), (FREIBURG, "walls", 0.85)]
)
def test_most_of_the_walls_of_a_real_storey_lie_on_the_outlines(path, lines, least):
    assert share_near(truth_of(path)[lines], found_rooms(path), 0.15) >= least


def test_the_rooms_found_in_a_real_storey_do_not_overlap():
    found = found_rooms(OFFICE)
    assert shapely.union_all(found).area == pytest.approx(sum(p.area for p in found), rel=1e-6)


def raw_office():
    """Return the rooms found in the raw scan of the office, moved into the aligned frame."""
    turn = np.array(truth_of(OFFICE)["raw_to_aligned"])
    matrix = [*turn[:2, :2].ravel(), *turn[:2, 3]]
    return [affinity.affine_transform(p, matrix) for p in found_rooms(OFFICE_RAW)]


def test_a_scan_turned_and_with_points_far_outside_gives_most_of_the_same_rooms():
    raw, aligned = raw_office(), found_rooms(OFFICE)
    assert (matched(raw, aligned) > 0.8).sum() >= 9
    true = true_rooms(truth_of(OFFICE))
    in_both = np.minimum(matched(raw, true), matched(aligned, true))
    assert (in_both >= 0.8).sum() >= 9


def test_what_is_seen_through_the_windows_is_no_room():
    building = shapely.union_all(true_rooms(truth_of(OFFICE))).convex_hull.buffer(1)
    assert all(p.intersection(building).area > 0.8 * p.area for p in raw_office())
