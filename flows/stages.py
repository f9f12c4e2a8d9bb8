"""The stages of the pipeline: pure functions made cached, timed tasks, one line each."""

from flows.params import MapSenseParams
from tasks.device.codec import decode, encode
from tasks.device.energy import savings as average_savings
from tasks.device.energy import simulate_energy
from tasks.device.quality import assess
from tasks.device.sweep import sweep
from tasks.device.targets import solve_targets
from tasks.device.voxels import voxel_grid
from tasks.device.work import tally_work
from tasks.doors import stages as doors
from tasks.doors.candidates import find_candidates
from tasks.doors.trace import trace_layout_walls, trace_walls
from tasks.evaluation.detections import evaluate_plans
from tasks.evaluation.disturbance import disturb
from tasks.evaluation.planes import evaluate_planes
from tasks.evaluation.points import evaluate_points
from tasks.evaluation.rooms import room_errors as compare_rooms
from tasks.evaluation.walls import evaluate_walls
from tasks.furniture.classification import classify_furniture, classify_furniture_of_layout
from tasks.furniture.segments import (
    find_furniture_segments,
    find_furniture_segments_of_layout,
)
from tasks.layout.stages import decode_rooms, observe, place
from tasks.scans.read import read_scan
from tasks.stage.declare import stage
from tasks.surfaces.filtering import extract_segments
from tasks.surfaces.hough import detect_planes
from tasks.surfaces.intersection import intersect_walls, wall_up
from tasks.surfaces.labelling import label_surfaces
from tasks.surfaces.occupancy import occupied_space

clouds = stage(read_scan, name="clouds")
quality = stage(assess, name="quality")
voxels = stage(voxel_grid, name="voxels")
streams = stage(encode, name="streams")
decoded = stage(decode, name="decoded")
planes = stage(detect_planes, name="planes")
segments = stage(extract_segments, name="segments")
occupancy = stage(occupied_space, name="occupancy")
faces = stage(label_surfaces, name="faces")
rooms = stage(intersect_walls, name="rooms")

disturbed = stage(disturb, name="disturbed")
observations = stage(observe, name="observations")
layout = stage(decode_rooms, name="layout")
layout_rooms = stage(place, name="layout_rooms")
layout_walls = stage(wall_up, name="layout_walls")

wall_images = stage(trace_walls, name="wall_images")
layout_wall_images = stage(trace_layout_walls, name="wall_images")
opening_candidates = stage(find_candidates, name="opening_candidates")
openings = stage(doors.openings, name="openings")
layout_openings = stage(doors.layout_openings, name="openings")
furniture_segments = stage(find_furniture_segments, name="furniture_segments")
layout_furniture_segments = stage(find_furniture_segments_of_layout, name="furniture_segments")
furniture = stage(classify_furniture, name="furniture")
layout_furniture = stage(classify_furniture_of_layout, name="furniture")

room_errors = stage(compare_rooms, name="room_errors")
plane_detections = stage(evaluate_planes, name="plane_detections")
point_quality = stage(evaluate_points, name="point_quality")
detections = stage(evaluate_plans, name="detections")
wall_quality = stage(evaluate_walls, name="wall_quality")
scan_work = stage(tally_work, name="scan_work")
energy = stage(simulate_energy, name="energy")
savings = stage(average_savings, name="savings")
energy_sweep = stage(sweep, name="energy_sweep")
energy_targets = stage(solve_targets, name="energy_targets")

PER_SCAN = len((clouds, quality, voxels, streams, decoded, planes, segments, occupancy))
PER_STOREY = len((faces, rooms))
PER_GRAMMAR = len((observations, layout, layout_rooms, layout_walls))
PER_KIND = {
    "doors": len((wall_images, opening_candidates, openings)),
    "furniture": len((furniture_segments, furniture)),
}
PER_PLAN = len((detections, wall_quality))
PER_TRUE_SCAN = len((plane_detections,))


def of_mapping(scans: int, params: MapSenseParams) -> int:
    """Return how many stages the mapping of a storey runs."""
    of_grammar = PER_GRAMMAR * (params.grammar is not None)
    of_objects = sum(PER_KIND[kind] for kind in params.detect)
    return PER_SCAN * scans + PER_STOREY + of_grammar + of_objects
