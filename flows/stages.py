"""The stages of the pipeline: pure functions made cached, timed tasks, one line each."""

from tasks.scans.read import read_scan
from tasks.stage.declare import stage
from tasks.surfaces.filtering import extract_segments
from tasks.surfaces.hough import detect_planes
from tasks.surfaces.intersection import intersect_walls
from tasks.surfaces.labelling import label_surfaces
from tasks.surfaces.occupancy import occupied_space

clouds = stage(read_scan, name="clouds")
planes = stage(detect_planes, name="planes")
segments = stage(extract_segments, name="segments")
occupancy = stage(occupied_space, name="occupancy")
faces = stage(label_surfaces, name="faces")
rooms = stage(intersect_walls, name="rooms")

PER_SCAN = (clouds, planes, segments, occupancy)
PER_STOREY = (faces, rooms)
