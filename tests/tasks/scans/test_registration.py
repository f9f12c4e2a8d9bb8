"""Registration against a loop over points, by invariances, and alike for all that is registered."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from storage.points import PointCloud
from storage.snapshots import Snapshots
from tasks.scans.bundle import write_bundle
from tasks.scans.raw import DEVICE, Poses
from tasks.scans.read import ReadParams, read_scan
from tasks.scans.registration import register
from tasks.scans.sources import fingerprint

cv2 = pytest.importorskip("cv2")


def poses(k=6, seed=0, far=0.0):
    rng = np.random.default_rng(seed)
    turns = Rotation.random(k, random_state=seed)
    return turns, Poses(
        np.arange(k, dtype=float), rng.normal(size=(k, 3)) + far, turns.as_matrix(), DEVICE
    )


def cloud(n=300, k=6, seed=1):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(n, 3)), rng.integers(0, k, n).astype(np.int32)


def sandwiched(q, v):
    """Return q v q* of quaternions, scalar last, by Hamilton's rules written out."""

    def times(p, r):
        a, b = p[3] * r[3] - p[:3] @ r[:3], p[3] * r[:3] + r[3] * p[:3] + np.cross(p[:3], r[:3])
        return np.append(b, a)

    return times(times(q, np.append(v, 0.0)), q * (-1, -1, -1, 1))[:3]


@pytest.mark.parametrize(
    ("far", "type_", "atol"), [(0.0, np.float32, 1e-6), (5e6, np.float64, 1e-8)]
)
def test_each_point_is_turned_and_moved_by_its_snapshots_pose(far, type_, atol):
    turns, poses_ = poses(far=far)
    points, of = cloud()
    expected = [
        sandwiched(turns[s].as_quat(), point) + poses_.positions[s]
        for point, s in zip(points, of, strict=True)
    ]
    got = register(points, of, poses_)
    assert got.dtype == type_
    assert np.allclose(got, expected, rtol=0, atol=atol)
    assert np.allclose(
        register(points.astype(np.float32), of, poses_), expected, rtol=0, atol=atol + 1e-6
    )


def test_one_snapshot_may_have_seen_all_points():
    _, poses_ = poses()
    points, of = cloud()
    assert np.array_equal(
        register(points, 4, poses_), register(points, np.full_like(of, 4), poses_)
    )


def test_without_a_turn_and_a_way_nothing_moves():
    points, of = cloud()
    still = Poses(np.arange(6.0), np.zeros((6, 3)), np.tile(np.eye(3), (6, 1, 1)), DEVICE)
    assert np.array_equal(register(points, of, still), points.astype(np.float32))


def test_registering_twice_is_registering_by_the_product_of_the_poses():
    (_, first), (_, second) = poses(seed=2), poses(seed=3)
    points, of = cloud()
    both = Poses(
        first.times,
        np.einsum("kij,kj->ki", second.rotations, first.positions) + second.positions,
        second.rotations @ first.rotations,
        DEVICE,
    )
    twice = register(register(points, of, first), of, second)
    assert np.allclose(twice, register(points, of, both), atol=2e-6)


def test_distances_within_a_snapshot_stay():
    _, poses_ = poses()
    points, of = cloud()
    got = register(points, of, poses_)
    for s in range(6):
        ours, theirs = (x[of == s][:, None] - x[of == s][None] for x in (got, points))
        assert np.allclose(np.linalg.norm(ours, axis=2), np.linalg.norm(theirs, axis=2), atol=2e-6)


def test_no_points_are_registered_to_no_points():
    assert register(np.empty((0, 3)), np.empty(0, np.int32), poses()[1]).shape == (0, 3)


@pytest.mark.parametrize("snapshot", [-1, 6])
def test_a_snapshot_without_a_pose_is_an_error(snapshot):
    with pytest.raises(IndexError, match="expected 0 to 5"):
        register(np.zeros((1, 3)), snapshot, poses()[1])


def test_a_bundle_and_a_sequence_of_the_same_depth_images_make_the_same_cloud(tmp_path):
    """Written once as TUM RGB-D and once in the device frame: x right, y up, z back."""
    rng, f, c = np.random.default_rng(5), 50.0, (15.5, 11.5)
    turns, poses_ = poses(3, seed=7)
    images = rng.integers(5000, 20000, (3, 24, 32)).astype(np.uint16)
    lines = []
    for time, image in enumerate(images):
        path = tmp_path / "tum" / "depth" / f"{time}.0.png"
        path.parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(path), image)
        numbers = (*poses_.positions[time], *turns[time].as_quat())
        lines.append(" ".join([f"{time}.0", *(f"{number:.17g}" for number in numbers)]))
    (tmp_path / "tum" / "groundtruth.txt").write_text("\n".join(lines))
    np.savetxt(tmp_path / "tum" / "camera-intrinsics.txt", [[f, 0, c[0]], [0, f, c[1]], [0, 0, 1]])

    depth = images.reshape(3, -1) / 5000
    v, u = np.divmod(np.arange(24 * 32), 32)
    device = np.stack([(u - c[0]) / f * depth, (c[1] - v) / f * depth, -depth], axis=-1)
    # the camera, turned half about its x, is the device
    q = (turns * Rotation.from_euler("x", np.pi)).as_quat()[:, [3, 0, 1, 2]]
    seen = np.full(3, 24 * 32)
    write_bundle(
        tmp_path / "device.scan",
        PointCloud(
            device.reshape(-1, 3).astype(np.float32),
            np.zeros(3),
            np.repeat(np.arange(3, dtype=np.int32), 24 * 32),
        ),
        Snapshots(poses_.times, poses_.positions, q, seen),
        frame="device",
    )

    params = ReadParams(depth_stride=1, up="z")
    (tum, at, _), (bundle, also_at, _) = (
        read_scan(fingerprint(tmp_path / name), params) for name in ("tum", "device.scan")
    )
    # whole millimetres in the bundle
    assert np.allclose(tum.xyz, bundle.xyz, atol=0.9e-3)
    assert np.array_equal(tum.snapshot, bundle.snapshot)
    assert np.allclose(at.positions, also_at.positions)
    same = np.abs(np.einsum("ki,ki->k", at.rotations, also_at.rotations))
    assert np.allclose(same, 1)
