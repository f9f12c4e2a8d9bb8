"""Depth sequences: TUM and 7-Scenes folders of a flat wall, whole and broken."""

import json

import numpy as np
import pytest

from storage.errors import InputError
from tasks.scans.read import ReadParams, read_scan
from tasks.scans.sources import fingerprint

cv2 = pytest.importorskip("cv2")

K = np.array([[50.0, 0, 31.5], [0, 50, 23.5], [0, 0, 1]])
SHAPE = (48, 64)
LEVEL = "-0.7071068 0 0 0.7071068"  # camera looks along y, its y is down: about x by -90 degrees


def depth_image(path, metres=2.0, factor=5000, holes=0):
    image = np.full(SHAPE, round(metres * factor), np.uint16)
    image[0, :holes] = 65535
    image[1, :holes] = 0
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), image)


def tum(folder, times=(1.0, 2.0, 3.0), lines=None, **image):
    for time in times:
        depth_image(folder / "depth" / f"{time:.4f}.png", **image)
    lines = lines or [f"{time + 0.004} {time} 0 1.5 {LEVEL}" for time in times]
    (folder / "groundtruth.txt").write_text("# t x y z q\n" + "\n".join(lines) + "\n")
    np.savetxt(folder / "camera-intrinsics.txt", K)
    return folder


def seven_scenes(folder, n=3, sub="frames"):
    for i in range(n):
        depth_image(folder / sub / f"frame-{i:06d}.depth.png", factor=1000)
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]], [i, 0, 1.5]
        np.savetxt(folder / sub / f"frame-{i:06d}.pose.txt", pose)
    np.savetxt(folder / "camera-intrinsics.txt", K)
    return folder


def read(folder, **params):
    return read_scan(fingerprint(folder), ReadParams(**({"depth_stride": 1} | params)))


def roll(q):
    a, b, c, d = q.T
    return np.degrees(np.arctan2(2 * (a * b + c * d), 1 - 2 * (b * b + c * c)))


@pytest.mark.parametrize("make", [tum, seven_scenes])
def test_a_wall_two_metres_ahead(tmp_path, make):
    cloud, snapshots, scan = read(make(tmp_path))
    assert np.allclose(cloud.xyz[:, 1], 2, atol=1e-5)
    # right is x, up is z: the image's first pixel lies at the upper left of the first camera
    offset = snapshots.positions[0, 0]
    expected = [offset - 31.5 / 50 * 2, 2, 1.5 + 23.5 / 50 * 2]
    assert np.allclose(cloud.xyz[0], expected, atol=1e-5)
    assert np.allclose(roll(snapshots.rotations), 90, atol=1e-4)
    assert snapshots.points.tolist() == [48 * 64] * 3
    assert np.array_equal(np.bincount(cloud.snapshot), snapshots.points)
    assert (scan.format, scan.snapshots, scan.points_not_finite) == ("depth", 3, 0)
    assert ("may not be level" in scan.notes) == (make is seven_scenes)


def test_frames_may_lie_in_the_folder_itself(tmp_path):
    assert len(read(seven_scenes(tmp_path, sub="."))[1]) == 3


def test_nothing_seen_is_dropped_and_counted(tmp_path):
    cloud, _, scan = read(tum(tmp_path, times=(1.0,), holes=10))
    assert scan.points_not_finite == 20
    assert scan.points_read == len(cloud) + 20 == 48 * 64


def test_depth_limits_stride_and_factor(tmp_path):
    folder = tum(tmp_path, times=(1.0,))
    assert len(read(folder, depth_stride=4)[0]) == 12 * 16
    assert np.allclose(read(folder, depth_factor=10000)[0].xyz[:, 1], 1, atol=1e-5)
    with pytest.raises(InputError, match="none of its 3072 points is usable"):
        read(folder, depth_max=1.5)


def test_a_trajectory_out_of_order_is_sorted_and_noted(tmp_path):
    ordered = read(tum(tmp_path / "a"))
    lines = [f"{time + 0.004} {time} 0 1.5 {LEVEL}" for time in (3.0, 1.0, 2.0)]
    cloud, snapshots, scan = read(tum(tmp_path / "b", lines=lines))
    assert np.array_equal(cloud.xyz, ordered[0].xyz)
    assert np.array_equal(snapshots.positions, ordered[1].positions)
    assert "groundtruth.txt is not in order of time: sorted." in scan.notes


def test_images_without_a_pose_are_left_out_and_noted(tmp_path):
    lines = [f"{time} {time} 0 1.5 {LEVEL}" for time in (1.0, 2.03)]
    _, snapshots, scan = read(tum(tmp_path, lines=lines))
    assert snapshots.times.tolist() == [1.0]
    assert "2 of 3 depth images have no pose within 0.02 s" in scan.notes
    assert len(read(tmp_path, pose_gap_s=0.05)[1]) == 2
    with pytest.raises(InputError, match="none of 3 depth images has a pose"):
        read(tum(tmp_path, lines=[f"9 0 0 0 {LEVEL}"]))


def test_times_given_twice_are_used_once_and_noted(tmp_path):
    lines = [f"{time} {x} 0 1.5 {LEVEL}" for time, x in ((1.0, 0), (1.0, 7), (2.0, 1), (3.0, 2))]
    folder = tum(tmp_path, lines=lines)
    index = "".join(f"{time} depth/{time:.4f}.png\n" for time in (1.0, 3.0, 2.0, 2.0))
    (folder / "depth.txt").write_text("# depth\n" + index)
    _, snapshots, scan = read(folder)
    assert snapshots.positions[:, 0].tolist() == [0, 1, 2]
    assert "1 poses of groundtruth.txt repeat a time" in scan.notes
    assert "1 depth images repeat a time" in scan.notes
    assert "depth.txt is not in order of time" in scan.notes


def test_a_quaternion_a_little_off_is_normalised_and_noted(tmp_path):
    quaternion = "-0.72 0 0 0.72"
    lines = [f"{time} 0 0 0 {quaternion}" for time in (1.0, 2.0, 3.0)]
    _, snapshots, scan = read(tum(tmp_path, lines=lines))
    assert np.allclose(np.linalg.norm(snapshots.rotations, axis=1), 1)
    assert "3 quaternions of groundtruth.txt were off unit length: normalised." in scan.notes


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("2 0 0 0 0 0 0 0", "line 3 has a quaternion of length 0"),
        ("2 0 0 0 1 1 1 1", "line 3 has a quaternion of length 2"),
        ("2 0 0 0 0 0 1", "line 3 has 7 columns"),
        ("2 0 0 0 0 0 0 one", "line 3 has 8 columns or a value that is no finite number"),
        ("2 nan 0 0 0 0 0 1", "line 3 has 8 columns or a value that is no finite number"),
    ],
)
def test_a_bad_pose_is_named_by_its_line(tmp_path, line, message):
    folder = tum(tmp_path, lines=[f"1 0 0 0 {LEVEL}", line])
    with pytest.raises(InputError, match=r"groundtruth\.txt: ") as caught:
        read(folder)
    assert message in str(caught.value)


def test_lost_and_missing_frames_are_left_out_and_noted(tmp_path):
    folder = seven_scenes(tmp_path, 4)
    np.savetxt(folder / "frames" / "frame-000001.pose.txt", np.full((4, 4), np.nan))
    (folder / "frames" / "frame-000002.pose.txt").unlink()
    _, snapshots, scan = read(folder)
    assert np.allclose(snapshots.times, [0, 0.1])
    assert "2 of 4 depth images have no pose in its .pose.txt file" in scan.notes


@pytest.mark.parametrize(
    ("pose", "message"),
    [
        (np.diag([2.0, 1, 1, 1]), "is no rotation and translation"),
        (np.diag([-1.0, 1, 1, 1]), "is no rotation and translation"),
        (np.eye(3), r"holds a matrix of shape \(3, 3\)"),
    ],
)
def test_a_matrix_that_is_no_pose_is_named(tmp_path, pose, message):
    folder = seven_scenes(tmp_path)
    np.savetxt(folder / "frames" / "frame-000001.pose.txt", pose)
    with pytest.raises(InputError, match=rf"frame-000001\.pose\.txt: .*{message}"):
        read(folder)


@pytest.mark.parametrize("keep", [0, 4, 60, 0.5, 0.99])
def test_a_cut_image_is_named(tmp_path, keep):
    path = tum(tmp_path) / "depth" / "2.0000.png"
    data = path.read_bytes()
    path.write_bytes(data[: int(keep * len(data)) if 0 < keep < 1 else keep])
    with pytest.raises(InputError, match=r"2\.0000\.png: "):
        read(tmp_path)


def test_an_image_of_another_kind_is_named(tmp_path):
    path = tum(tmp_path) / "depth" / "2.0000.png"
    cv2.imwrite(str(path), np.zeros((48, 64, 3), np.uint8))
    with pytest.raises(InputError, match="8 bits and 3 channels; expected depth as 16 bits"):
        read(tmp_path)


@pytest.mark.parametrize(
    "text",
    [
        {"fx": 50, "fy": 50, "cx": 31.5, "cy": 23.5},
        {"width": 64, "height": 48, "intrinsic_matrix": [50, 0, 0, 0, 50, 0, 31.5, 23.5, 1]},
    ],
)
def test_intrinsics_may_be_json(tmp_path, text):
    expected = read(tum(tmp_path))[0].xyz
    (tmp_path / "camera-intrinsics.txt").unlink()
    (tmp_path / "intrinsics.json").write_text(json.dumps(text))
    assert np.array_equal(read(tmp_path)[0].xyz, expected)


def test_intrinsics_missing_or_wrong(tmp_path):
    folder = tum(tmp_path)
    (folder / "camera-intrinsics.txt").write_text("50 0 31.5\n")
    with pytest.raises(InputError, match=r"camera-intrinsics\.txt: holds a matrix of shape"):
        read(folder)
    (folder / "camera-intrinsics.txt").unlink()
    with pytest.raises(InputError, match="no intrinsics file"):
        read(folder)
    assert len(read(folder, intrinsics=(50, 50, 31.5, 23.5))[1]) == 3


def test_a_sequence_without_its_trajectory_is_named(tmp_path):
    folder = tum(tmp_path)
    (folder / "groundtruth.txt").rename(folder / "trajectory_a.txt")
    assert len(read(folder)[1]) == 3
    (folder / "trajectory_b.txt").write_text((folder / "trajectory_a.txt").read_text())
    with pytest.raises(InputError, match=r"found trajectory_a\.txt, trajectory_b\.txt"):
        read(folder)
    assert len(read(folder, trajectory="trajectory_b.txt")[1]) == 3
    with pytest.raises(InputError, match=r"other\.txt: cannot be read"):
        read(folder, trajectory="other.txt")
