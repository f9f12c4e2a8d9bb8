"""A simulated campaign: scans a person could have made, in the conventions all stages share."""

import os
import subprocess
import sys
from dataclasses import replace
from hashlib import sha256
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
import shapely
from shapely import LineString, box

from storage.plan import Plan, PlanFurniture, PlanRoom, PlanWall
from storage.plan_geojson import read_plan, write_plan
from tasks.simulation.campaign import (
    CampaignParams,
    shares,
    simulate_scan,
    simulate_scans,
    skills,
)
from tasks.simulation.drift import DriftParams
from tasks.simulation.mesh import storey_mesh
from tasks.simulation.noise import NoiseParams
from tasks.simulation.rotations import matrices
from tasks.simulation.sensor import Scene, SensorParams
from tasks.simulation.volunteers import VolunteerParams

SMALL = {"sensor": SensorParams(rays=300), "volunteer": VolunteerParams(interval_s=2.0)}
EXACT = {"place_m": 0.0, "place_rad": 0.0, "walk_m": 0.0, "walk_rad": 0.0, "turn_rad": 0.0}
FLOOR_M, CEILING_M = 0.2, 2.7


def storey(name="0") -> Plan:
    """Two rooms of 5 x 4 m side by side, a desk and a tall cabinet in the first."""
    rooms = [
        PlanRoom(f"r{i}", box(*ends), floor_m=FLOOR_M, ceiling_m=CEILING_M)
        for i, ends in enumerate(((0, 0, 5, 4), (5.2, 0, 10.2, 4)))
    ]
    lines = [((-0.1, y), (10.3, y)) for y in (-0.1, 4.1)]
    lines += [((x, -0.1), (x, 4.1)) for x in (-0.1, 5.1, 10.3)]
    walls = [
        PlanWall(f"w{i}", LineString(line), 0.2, FLOOR_M, CEILING_M) for i, line in enumerate(lines)
    ]
    desk = PlanFurniture("d", box(1, 3, 2.6, 4), "table", FLOOR_M, FLOOR_M + 0.74, "r0")
    cabinet = PlanFurniture("c", box(4.2, 0, 5, 1), "other", FLOOR_M, FLOOR_M + 1.9, "r0")
    return Plan("b", name, tuple(rooms), tuple(walls), furniture=(desk, cabinet))


def bits(scan) -> bytes:
    arrays = (scan.cloud.xyz, scan.cloud.snapshot, scan.snapshots.positions)
    arrays += (scan.snapshots.rotations, scan.snapshots.times, scan.snapshots.points)
    return b"".join(array.tobytes() for array in arrays)


@pytest.fixture(scope="module")
def scans() -> list:
    return list(simulate_scans(storey(), CampaignParams(seed=5, scans=16, **SMALL)))


def test_every_room_is_scanned_in_turn_each_time_by_somebody_else(scans):
    assert [scan.name[:3] for scan in scans[:2]] == ["s00", "s01"]
    assert len({scan.name for scan in scans}) == 16
    for room in ("r0", "r1"):
        of = [scan for scan in scans if scan.room == room]
        assert len(of) == 8
        assert sorted(scan.volunteer for scan in of[:6]) == [1, 2, 3, 4, 5, 6]
        assert [scan.name.endswith("n2") for scan in of] == [False] * 6 + [True] * 2
        assert all(f"v{scan.volunteer}" in scan.name for scan in of)


def test_volunteers_differ_in_skill_around_the_mean():
    params = CampaignParams(skill=0.6, skill_spread=0.3)
    assert sorted(skills(params)) == pytest.approx([0.3, 0.42, 0.54, 0.66, 0.78, 0.9])
    assert skills(CampaignParams(volunteers=1, skill=0.6)) == pytest.approx([0.6])
    assert list(skills(params)) != list(skills(params.model_copy(update={"seed": 1})))


def test_snapshots_have_unit_quaternions_rising_times_and_count_their_points(scans):
    for scan in scans:
        poses = scan.snapshots
        assert np.linalg.norm(poses.rotations, axis=1) == pytest.approx(1.0)
        assert (np.diff(poses.times) > 0).all()
        assert (np.bincount(scan.cloud.snapshot, minlength=len(poses)) == poses.points).all()
        assert scan.cloud.xyz.dtype == np.float32 and scan.cloud.snapshot.dtype == np.int32
        assert scan.duration_s == poses.times[-1]


def test_points_lie_before_the_camera_within_its_frustum(scans):
    params = SensorParams()
    for scan in scans:
        right, up, back = scan.cloud.xyz.T.astype(float)
        assert (np.abs(right / back) * params.focal_px <= params.columns / 2).all()
        assert (np.abs(up / back) * params.focal_px <= params.rows / 2).all()
        off = 6 * params.noise.sigma(np.array([params.depth_max_m]))[0]
        assert -params.depth_max_m - off < back.min() and back.max() < -0.49


def test_snapshots_are_taken_inside_their_room_clear_of_what_is_tall(scans):
    plan = storey()
    for scan in scans:
        (room,) = (room for room in plan.rooms if room.id == scan.room)
        true = scan.truth.views.positions
        assert shapely.contains_xy(room.polygon, true[:, :2]).all()
        assert not shapely.contains_xy(plan.furniture[1].footprint, true[:, :2]).any()
        assert np.ptp(true[:, 2]) == 0
        assert 1.3 <= true[0, 2] - FLOOR_M <= 1.6


def test_registered_by_the_true_poses_points_lie_on_the_rooms_surfaces():
    exact = SensorParams(rays=300, noise=NoiseParams(disparity_step=0, jitter_px=0, mixing=0))
    plan = replace(storey(), furniture=())
    params = CampaignParams(sensor=exact, volunteer=VolunteerParams(interval_s=2.0))
    for scan in simulate_scans(plan, params):
        turns, at = matrices(scan.truth.views.rotations), scan.truth.views.positions
        of = scan.cloud.snapshot
        points = np.einsum("nij,nj->ni", turns[of], scan.cloud.xyz) + at[of]
        (room,) = (room for room in plan.rooms if room.id == scan.room)
        off = np.minimum(
            shapely.distance(shapely.points(points[:, :2]), room.polygon.exterior),
            np.minimum(np.abs(points[:, 2] - FLOOR_M), np.abs(points[:, 2] - CEILING_M)),
        )
        assert len(off) > 1000
        assert off.max() < 1e-4


def test_what_the_device_believes_is_off_by_centimetres_or_not_at_all(scans):
    shifts = [
        np.linalg.norm(scan.snapshots.positions - scan.truth.views.positions, axis=1).mean()
        for scan in scans
    ]
    assert 0.005 < np.mean(shifts) < 0.06
    exact = CampaignParams(drift=DriftParams(**EXACT), scans=1, **SMALL)
    (scan,) = simulate_scans(storey(), exact)
    assert scan.snapshots.positions == pytest.approx(scan.truth.views.positions)
    assert scan.snapshots.rotations == pytest.approx(scan.truth.views.rotations)


def test_bad_volunteers_make_scans_that_the_quality_model_detects():
    share = SMALL["sensor"].rays / SensorParams().rays

    def mean_quality(skill):
        params = CampaignParams(scans=12, skill=skill, skill_spread=0.0, skill_day=0.0, **SMALL)
        found = []
        for scan in simulate_scans(storey(), params):
            incomplete = np.mean(scan.snapshots.points <= 5000 * share)
            a, b, c, d = scan.snapshots.rotations.T
            roll = np.arctan2(2 * (a * b + c * d), 1 - 2 * (b * b + c * c))  # Eq. 1
            off = np.degrees(roll) - 90
            skewed = np.mean(1 - np.exp(-(off**2) / (2 * 30**2)))  # Eq. 2
            found.append((incomplete, skewed, incomplete + skewed - incomplete * skewed))  # Eq. 3
        return np.mean(found, axis=0)

    good, bad = mean_quality(1.0), mean_quality(0.2)
    assert bad[0] > good[0] + 0.4
    assert bad[1] > good[1] + 0.1
    assert good[2] < 0.4 < 0.7 < bad[2]


def test_a_scan_is_the_same_alone_and_however_many_follow(scans):
    plan = storey()
    scene = Scene(storey_mesh(plan), threads=1)
    params = CampaignParams(seed=5, **SMALL)
    assert bits(simulate_scan(scene, plan, 11, params)) == bits(scans[11])
    few = simulate_scans(plan, params.model_copy(update={"scans": 3}))
    assert [bits(scan) for scan in few] == [bits(scan) for scan in scans[:3]]


def test_the_same_seed_gives_the_same_bytes_and_another_seed_or_storey_others(scans):
    def made(plan, seed):
        params = CampaignParams(seed=seed, scans=16, **SMALL)
        return [bits(scan) for scan in islice(simulate_scans(plan, params), 2)]

    first = [bits(scan) for scan in scans[:2]]
    assert made(storey(), 5) == first
    assert not set(made(storey(), 6)) & set(first)
    assert not set(made(storey("1"), 5)) & set(first)


ANOTHER_RUN = """
import sys
from hashlib import sha256
from pathlib import Path
from storage.plan_geojson import read_plan
from tasks.simulation.campaign import CampaignParams, simulate_scans
params = CampaignParams.model_validate_json(sys.argv[2])
scan = next(simulate_scans(read_plan(Path(sys.argv[1])), params))
print(sha256(scan.cloud.xyz.tobytes() + scan.snapshots.positions.tobytes()).hexdigest())
"""


def test_another_run_with_other_threads_gives_the_same_bytes(tmp_path):
    write_plan(storey(), tmp_path / "plan.geojson")
    params = CampaignParams(seed=5, **SMALL)
    scan = next(simulate_scans(read_plan(tmp_path / "plan.geojson"), params))
    here = sha256(scan.cloud.xyz.tobytes() + scan.snapshots.positions.tobytes()).hexdigest()
    environment = os.environ | {"OMP_NUM_THREADS": "3", "PYTHONHASHSEED": "7"}
    run = subprocess.run(
        (sys.executable, "-c", ANOTHER_RUN, tmp_path / "plan.geojson", params.model_dump_json()),
        env=environment,
        cwd=Path(__file__).parents[3],
        capture_output=True,
        text=True,
        check=True,
    )
    assert run.stdout.strip() == here


def test_a_campaigns_scans_are_shared_out_by_rooms():
    small = replace(storey(), rooms=storey().rooms[:1])
    assert shares(105, (storey(), small)) == (70, 35)
    assert sum(shares(104, (storey(), small, storey()))) == 104
    assert shares(7, (replace(small, rooms=()),)) == (0,)


def test_an_empty_plan_has_no_scans():
    assert list(simulate_scans(Plan("b", "0"), CampaignParams(scans=5))) == []
