"""3DTK files: centimetres, left-handed, y up, registered by their poses."""

import numpy as np
import pytest

from storage.errors import InputError
from tasks.scans.read import ReadParams, read_scan
from tasks.scans.sources import fingerprint

POINTS = np.random.default_rng(0).uniform(-300, 300, (50, 3))


def scan(folder, name="s0", pose="0 0 0\n0 0 0\n"):
    folder.mkdir(exist_ok=True)
    np.savetxt(folder / f"{name}.3d", POINTS)
    if pose is not None:
        (folder / f"{name}.pose").write_text(pose)
    return folder


def read(path):
    return read_scan(fingerprint(path), ReadParams())


def test_right_forward_and_up_become_x_y_and_z(tmp_path):
    cloud, snapshots, record = read(scan(tmp_path / "a") / "s0.3d")
    assert np.allclose(cloud.xyz, POINTS[:, [0, 2, 1]] / 100, atol=1e-6)
    assert snapshots.points.tolist() == [50]
    assert (record.up, record.scale, record.up_guessed, record.scale_guessed) == (
        "y", 0.01, False, False
    )  # fmt: skip


def test_the_angles_turn_about_x_then_y_then_z_of_the_scan(tmp_path):
    # a quarter about y takes z to x and x to -z: as a matrix in 3DTK's own axes
    cloud, snapshots, _ = read(scan(tmp_path / "a", pose="100 200 300 0 90 0") / "s0.3d")
    turned = np.stack([POINTS[:, 2], POINTS[:, 1], -POINTS[:, 0]], axis=1)
    turned += np.array([100, 200, 300])
    assert np.allclose(cloud.xyz, turned[:, [0, 2, 1]] / 100, atol=1e-6)
    assert np.allclose(snapshots.positions, [[1, 3, 2]])


def test_a_folder_of_scans_is_registered_as_snapshots(tmp_path):
    scan(tmp_path / "a", "s0")
    cloud, snapshots, record = read(scan(tmp_path / "a", "s1", "0 0 500 0 0 0"))
    assert np.bincount(cloud.snapshot).tolist() == [50, 50]
    assert np.allclose(cloud.xyz[50:] - cloud.xyz[:50], [0, 5, 0], atol=1e-5)
    assert "the order of the scans stands in for seconds" in record.notes
    assert np.allclose(snapshots.positions, [[0, 0, 0], [0, 5, 0]])


def test_a_scan_without_a_pose_has_no_snapshot(tmp_path):
    cloud, snapshots, _ = read(scan(tmp_path / "a", pose=None) / "s0.3d")
    assert cloud.snapshot is None
    assert len(snapshots) == 0


@pytest.mark.parametrize("pose", ["", "1 2 3", "0 0 0 0 0 nan", "a b c d e f"])
def test_a_bad_pose_is_named(tmp_path, pose):
    with pytest.raises(InputError, match=r"s0\.pose: "):
        read(scan(tmp_path / "a", pose=pose) / "s0.3d")
