"""A simulated campaign: scans a person could have made, in the conventions all stages share."""

import numpy as np
import pytest
import shapely

from storage.plan import Plan
from tasks.simulation.plan import StoreyParams, make_storey
from tasks.simulation.rotations import matrices
from tasks.simulation.scans import CampaignParams, simulate_scans
from tasks.simulation.sensor import SensorParams
from tasks.simulation.volunteers import VolunteerParams

SMALL = {"sensor": SensorParams(rays=400), "volunteer": VolunteerParams(headings=4)}
EXACT = CampaignParams(pose_m=0.0, pose_rad=0.0, **SMALL)


@pytest.fixture(scope="module")
def plan() -> Plan:
    return make_storey(StoreyParams(seed=3, yaw_rad=0.4), "demo", "1")


@pytest.fixture(scope="module")
def scans(plan) -> dict:
    params = CampaignParams(seed=5, **SMALL)
    return {name: (cloud, poses) for name, cloud, poses in simulate_scans(plan, params)}


def test_every_room_is_scanned_and_some_by_a_second_volunteer(plan, scans):
    names = list(scans)
    assert names[: len(plan.rooms)] == [f"s{i:02d}v1" for i in range(len(plan.rooms))]
    assert len(names) == len(plan.rooms) + 3
    assert all(name.endswith("v2") for name in names[len(plan.rooms) :])


def test_snapshots_have_unit_quaternions_rising_times_and_count_their_points(scans):
    for cloud, poses in scans.values():
        assert np.linalg.norm(poses.rotations, axis=1) == pytest.approx(1.0)
        assert (np.diff(poses.times) > 0).all()
        assert (np.bincount(cloud.snapshot, minlength=len(poses)) == poses.points).all()
        assert cloud.xyz.dtype == np.float32 and cloud.snapshot.dtype == np.int32


def test_points_taken_back_to_the_device_lie_before_the_camera_within_its_frustum(scans):
    half = np.tan(np.deg2rad((45 / 2, 60 / 2)))
    for cloud, poses in scans.values():
        building_from_device = matrices(poses.rotations)[cloud.snapshot]
        offset = cloud.xyz - poses.positions[cloud.snapshot]
        device = np.einsum("nij,ni->nj", building_from_device, offset)
        assert (device[:, 2] < 0).all()
        assert (np.abs(device[:, :2]) <= -device[:, 2:] * half + 1e-3).all()
        assert np.linalg.norm(device, axis=1).max() < 4.0 + 6 * 0.015


def test_snapshots_are_taken_inside_their_room_at_hand_height(plan):
    for name, _, poses in simulate_scans(plan, EXACT):
        room = plan.rooms[int(name[1:3])]
        assert shapely.contains_xy(room.polygon, poses.positions[:, :2]).all()
        height = poses.positions[:, 2] - room.floor_m
        assert height.min() >= 1.4 and height.max() <= 1.6
        tall = [f.footprint for f in plan.furniture if f.class_ == "other" and f.room == room.id]
        solid = shapely.union_all(tall)
        assert not shapely.contains_xy(solid, poses.positions[:, :2]).any()


def test_the_pose_error_moves_points_and_poses_alike_by_centimetres(plan):
    wrong = CampaignParams(pose_m=0.01, pose_rad=np.deg2rad(0.3), **SMALL)
    shifts = []
    for (_, cloud, poses), (_, exact, truth) in zip(
        simulate_scans(plan, wrong), simulate_scans(plan, EXACT), strict=True
    ):
        shifts.append(np.linalg.norm(poses.positions[0] - truth.positions[0]))
        # distances between camera and points know nothing of the error
        found = np.linalg.norm(cloud.xyz - poses.positions[cloud.snapshot], axis=1)
        expected = np.linalg.norm(exact.xyz - truth.positions[exact.snapshot], axis=1)
        assert found == pytest.approx(expected, abs=1e-4)
    assert 0.005 < np.mean(shifts) < 0.03


def test_points_lie_on_what_the_plan_holds_within_the_noise(plan):
    _, cloud, _ = next(simulate_scans(plan, EXACT))
    x, y, z = cloud.xyz.T.astype(float)
    assert z.min() > -0.08 and z.max() < 2.8 + 0.08
    corridor = shapely.contains_xy(plan.rooms[0].polygon.buffer(-0.15), x, y)
    for height in (0.0, 2.8):
        off = z[corridor & (np.abs(z - height) < 0.06)] - height
        assert len(off) > 1000
        assert abs(off.mean()) < 5 * off.std() / np.sqrt(len(off))
        assert 0.002 < off.std() < 0.015


def test_the_same_seed_gives_the_same_bytes_and_another_seed_others(plan):
    def digest(seed: int) -> list[bytes]:
        scans = simulate_scans(plan, CampaignParams(seed=seed, second_scans=1, **SMALL))
        return [cloud.xyz.tobytes() + poses.rotations.tobytes() for _, cloud, poses in scans]

    first, again, other = digest(1), digest(1), digest(2)
    assert first == again
    assert not set(first) & set(other)


def test_an_empty_plan_has_no_scans():
    assert list(simulate_scans(Plan("b", "0"), CampaignParams())) == []
