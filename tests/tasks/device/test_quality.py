"""The quality model against hand-computed cases, scipy's rotations and real hand-held poses."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from scipy.stats import norm

from storage.snapshots import Snapshots, none
from tasks.device.quality import QualityParams, assess, roll, skewness

DATA = Path(__file__).parents[3].parent / "shared" / "data"
PARAMS = QualityParams()
EXP = {"half": 0.6065306597126334, "two": 0.1353352832366127}  # e^-0.5, e^-2


def held(roll_deg=90.0, heading_deg=0.0, tilt_deg=0.0):
    """Return the quaternions (a, b, c, d) of a device turned about its view axis (tilt), rolled,
    then turned about the vertical."""
    angles = np.broadcast_arrays(*np.atleast_1d(heading_deg, roll_deg, tilt_deg))
    turns = Rotation.from_euler("ZXZ", np.column_stack(angles), degrees=True)
    return turns.as_quat(scalar_first=True)


def snapshots(rotations, points):
    k = len(rotations)
    return Snapshots(np.arange(k) * 0.5, np.zeros((k, 3)), rotations, np.asarray(points, np.int64))


@pytest.mark.parametrize(
    ("quaternion", "degrees"),
    [
        # ab = 1/2, so atan2(1, 1 - 2 / 2) = 90: upright
        ([np.sqrt(0.5), np.sqrt(0.5), 0, 0], 90),
        # atan2(0, 1) = 0: lying on its back
        ([1, 0, 0, 0], 0),
        # atan2(0, 1 - 2) = 180: lying on its screen
        ([0, 1, 0, 0], 180),
        # ab = -1/2: upside down, facing on
        ([np.sqrt(0.5), -np.sqrt(0.5), 0, 0], -90),
        # turned about the vertical: cd + ab = 1/4 + 1/4, b^2 + c^2 = 1/2
        ([0.5, 0.5, 0.5, 0.5], 90),
        # a = cos 60, b = sin 60: 2 ab = sin 120, 1 - 2 b^2 = cos 120, 30 degrees towards the floor
        ([0.5, np.sqrt(0.75), 0, 0], 120),
    ],
)
def test_the_roll_of_a_quaternion_is_equation_1(quaternion, degrees):
    assert np.degrees(roll(np.array([quaternion], float))) == pytest.approx(degrees)


def test_the_roll_is_the_last_of_scipy_s_yaw_pitch_and_roll():
    turns = Rotation.random(500, rng=np.random.default_rng(1))
    found = roll(turns.as_quat(scalar_first=True))
    assert found == pytest.approx(turns.as_euler("ZYX")[:, 2], abs=1e-9)


@given(st.floats(-179, 179), st.floats(-180, 180), st.floats(-89, 89))
def test_the_heading_does_not_change_the_roll_nor_does_a_tilt_of_an_upright_device(
    roll_deg, heading_deg, tilt_deg
):
    assert roll(held(roll_deg, heading_deg)) == pytest.approx(np.radians(roll_deg), abs=1e-6)
    assert roll(held(90, heading_deg, tilt_deg)) == pytest.approx(np.pi / 2, abs=1e-6)


@pytest.mark.parametrize("side", [90, -90])
@pytest.mark.parametrize("heading", [0, 33, 180])
def test_a_device_on_its_side_has_no_roll_and_is_fully_skewed(side, heading):
    rolls = roll(held(90, heading, side))
    assert np.isnan(rolls).all()
    assert skewness(rolls, PARAMS) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("degrees", "expected"),
    [
        (90, 0),
        (120, 1 - EXP["half"]),  # one sigma: 1 - e^-1/2
        (60, 1 - EXP["half"]),
        (30, 1 - EXP["two"]),  # two sigma: 1 - e^-2
        (-90, 1 - np.exp(-18)),  # six sigma, the farthest there is
        # 100 degrees the short way round, not 260: 1 - e^(-(10/3)^2 / 2)
        (-170, 1 - np.exp(-50 / 9)),
    ],
)
def test_skewness_is_one_less_the_relative_density_at_the_shortest_angle(degrees, expected):
    assert skewness(np.radians([degrees]), PARAMS) == pytest.approx(expected, abs=1e-12)


def test_a_scan_worked_by_hand():
    # rolls 90, 90, 120, 60: P_sk = (0 + 0 + 2 (1 - e^-1/2)) / 4 = 0.196735
    # one of four at the threshold: P_in = 1/4; P_sum = 0.25 + 0.196735 - 0.049184 = 0.397551
    scan = snapshots(held([90, 90, 120, 60], [0, 45, 90, 200]), [5001, 5000, 80_000, 9000])
    quality = assess(scan, QualityParams(t_q=0.4))
    assert (quality.snapshots, quality.incomplete) == (4, 1)
    assert quality.p_in == 0.25
    assert quality.p_sk == pytest.approx(0.196735, abs=1e-6)
    assert quality.p_sk_worst == pytest.approx(0.393469, abs=1e-6)
    assert quality.p_sum == pytest.approx(0.397551, abs=1e-6)
    assert (quality.t_q, quality.accepted, quality.reason) == (0.4, True, "")
    stricter = assess(scan, QualityParams(t_q=0.39))
    assert (stricter.accepted, stricter.reason) == (False, "incomplete and skewed")
    assert stricter.p_sum == quality.p_sum


def test_a_snapshot_without_points_is_incomplete_and_its_pose_counts():
    quality = assess(snapshots(held([90, 120]), [0, 6000]), PARAMS)
    assert quality.p_in == 0.5
    assert quality.p_sk == pytest.approx((1 - EXP["half"]) / 2)


@pytest.mark.parametrize(
    ("rolls", "points", "reason"),
    [
        ([90, 90], [100, 100], "incomplete"),
        ([0, 0], [9000, 9000], "skewed"),
        ([0, 0], [100, 100], "incomplete and skewed"),
        ([120, 120], [100, 9000], "incomplete and skewed"),  # 0.5 and 0.39: neither alone
        ([90, 90], [100, 9000], ""),  # P_sum = T_q
    ],
)
def test_a_rejected_scan_says_what_there_is_too_much_of(rolls, points, reason):
    quality = assess(snapshots(held(rolls), points), QualityParams(t_q=0.5))
    assert (quality.reason, quality.accepted) == (reason, reason == "")


def test_a_cloud_without_snapshots_is_not_assessed():
    quality = assess(none(), QualityParams(t_q=1.0))
    found = (quality.p_in, quality.p_sk, quality.p_sk_worst, quality.p_sum, quality.accepted)
    assert found == (None,) * 5
    assert quality.reason == "not assessed"


@given(
    st.lists(st.tuples(st.floats(-180, 180), st.integers(0, 20_000)), min_size=1, max_size=20),
    st.integers(0, 20_000),
)
def test_the_fused_probability_is_that_of_either_of_two_independent_faults(scan, alpha_p):
    rolls, points = zip(*scan, strict=True)
    scan = snapshots(held(list(rolls)), points)
    quality = assess(scan, QualityParams(alpha_p=alpha_p))
    neither = (1 - quality.p_in) * (1 - quality.p_sk)
    assert quality.p_sum == pytest.approx(1 - neither, abs=1e-12)
    assert 0 <= quality.p_in <= quality.p_sum <= 1
    assert 0 <= quality.p_sk <= quality.p_sk_worst + 1e-12
    assert assess(scan, QualityParams(alpha_p=alpha_p, t_q=1)).accepted
    assert assess(scan, QualityParams(alpha_p=alpha_p + 1)).p_in >= quality.p_in


def device_poses(path):
    """Return the poses of a trajectory as those of a device and as those of its camera, whose
    y axis looks down and z axis ahead: a half turn about x."""
    if not path.exists():
        pytest.skip("the shared data is not there")
    camera = Rotation.from_quat(np.loadtxt(path)[:, 4:8])
    return camera * Rotation.from_euler("x", 180, degrees=True), camera


@pytest.mark.parametrize(
    ("path", "quantiles"),
    [  # roll of the camera's frame at 1, 25, 50, 75 and 99 %, as published with the data
        ("trajectories_tum/fr2_desk_groundtruth.txt", [-134.3, -129.8, -127.0, -121.8, -106.0]),
        (
            "kinect_kitchen_7scenes/trajectory_gravity_tum.txt",
            [-127.9, -121.0, -116.7, -112.6, -107.9],
        ),
    ],
)
def test_people_looking_down_at_a_table_hold_the_device_as_published(path, quantiles):
    device, camera = device_poses(DATA / path)
    shares = [0.01, 0.25, 0.5, 0.75, 0.99]
    of_camera = np.degrees(roll(camera.as_quat(scalar_first=True)))
    assert np.quantile(of_camera, shares) == pytest.approx(quantiles, abs=0.1)
    of_device = np.degrees(roll(device.as_quat(scalar_first=True)))
    assert np.quantile(of_device, shares) == pytest.approx(180 + np.array(quantiles), abs=0.1)


@pytest.mark.parametrize(
    "path",
    [
        "trajectories_tum/fr2_desk_groundtruth.txt",
        "kinect_kitchen_7scenes/trajectory_gravity_tum.txt",
    ],
)
def test_the_skewness_of_a_real_scan_is_the_mean_of_scipy_s_densities(path):
    device, camera = device_poses(DATA / path)
    degrees = device.as_euler("ZYX", degrees=True)[:, 2]
    bell = norm(90, 30)
    expected = np.mean(1 - bell.pdf(degrees) / bell.pdf(90))
    points = np.full(len(degrees), 250_000)  # a Kinect's image, nearly whole
    quality = assess(snapshots(device.as_quat(scalar_first=True), points), PARAMS)
    assert quality.p_in == 0
    assert quality.p_sk == pytest.approx(expected, abs=1e-9)
    # taken for a device's, the camera's poses are upside down: nothing would ever be accepted
    wrong = assess(snapshots(camera.as_quat(scalar_first=True), points), PARAMS)
    assert wrong.p_sk > 0.99 and not wrong.accepted
