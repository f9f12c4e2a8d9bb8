"""The scan bundle: its round trip, and what is wrong with foreign ones."""

from dataclasses import replace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from scipy.spatial.transform import Rotation

from storage.errors import InputError, StoreError
from storage.points import PointCloud
from storage.snapshots import Snapshots, none
from tasks.scans.bundle import POINTS_FILE, SNAPSHOTS_FILE, write_bundle
from tasks.scans.read import ReadParams, read_scan
from tasks.scans.sources import fingerprint


def example(n=500, origin=(0.0, 0.0, 0.0)):
    rng = np.random.default_rng(3)
    xyz = rng.integers(-5000, 5000, (n, 3)).astype(np.float32) * np.float32(1e-3)
    quaternions = rng.normal(size=(4, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    quaternions[quaternions[:, 0] < 0] *= -1
    links = np.sort(rng.integers(0, 4, n)).astype(np.int32)
    positions = rng.normal(size=(4, 3)) + origin
    snapshots = Snapshots(
        np.arange(4.0), positions, quaternions, np.bincount(links, minlength=4) + 7
    )
    return PointCloud(xyz, np.array(origin), links), snapshots


def read(folder):
    return read_scan(fingerprint(folder), ReadParams())


@pytest.mark.parametrize("origin", [(0.0, 0.0, 0.0), (512_345.0, 5_412_345.0, 250.0)])
def test_a_bundle_gives_back_what_was_written(tmp_path, origin):
    cloud, snapshots = example(origin=origin)
    write_bundle(tmp_path / "a.scan", cloud, snapshots)
    got, poses, scan = read(tmp_path / "a.scan")
    assert np.allclose(got.origin + got.xyz, cloud.origin + cloud.xyz, atol=1e-5)
    assert np.array_equal(got.snapshot, cloud.snapshot)
    for name in ("times", "positions", "rotations", "points"):
        assert np.allclose(getattr(poses, name), getattr(snapshots, name)), name
    assert (scan.name, scan.format, scan.up, scan.up_guessed) == ("a", "bundle", "z", False)


def test_a_bundle_without_snapshots(tmp_path):
    cloud, _ = example()
    write_bundle(tmp_path / "a", PointCloud(cloud.xyz, cloud.origin), none())
    got, snapshots, _ = read(tmp_path / "a")
    assert got.snapshot is None
    assert len(snapshots) == 0


def test_a_bundle_replaces_the_one_before_and_leaves_nothing_beside_it(tmp_path):
    cloud, snapshots = example()
    write_bundle(tmp_path / "a.scan", cloud, snapshots)
    write_bundle(tmp_path / "a.scan", example(60)[0], snapshots)
    assert len(read(tmp_path / "a.scan")[0]) == 60
    assert [path.name for path in tmp_path.iterdir()] == ["a.scan"]


def test_a_bundle_is_not_written_over_other_files(tmp_path):
    (tmp_path / "a.scan").mkdir()
    (tmp_path / "a.scan" / "thesis.doc").write_text("years of work")
    with pytest.raises(StoreError, match="holds other files"):
        write_bundle(tmp_path / "a.scan", *example())
    assert (tmp_path / "a.scan" / "thesis.doc").exists()
    assert [path.name for path in tmp_path.iterdir()] == ["a.scan"]


def in_device_frame(n=500):
    """Return a cloud in the device frame of its snapshots, and each point in the building's."""
    cloud, snapshots = example(n)
    turns = Rotation.from_quat(snapshots.rotations[:, [1, 2, 3, 0]])[cloud.snapshot]
    return cloud, snapshots, turns.apply(cloud.xyz) + snapshots.positions[cloud.snapshot]


def test_points_in_the_device_frame_are_registered_by_their_poses(tmp_path):
    cloud, snapshots, expected = in_device_frame()
    write_bundle(tmp_path / "a.scan", cloud, snapshots, frame="device")
    got, poses, scan = read(tmp_path / "a.scan")
    assert np.allclose(got.xyz, expected, atol=2e-6)
    assert np.array_equal(got.snapshot, cloud.snapshot)
    assert np.allclose(poses.positions, snapshots.positions)
    assert (scan.points_read, scan.points_kept) == (500, 500)


def test_a_device_far_from_the_origin_is_registered_to_the_millimetre(tmp_path):
    cloud, snapshots, expected = in_device_frame()
    far = np.array([512_345.678, 5_412_345.678, 250.0])
    moved = replace(snapshots, positions=snapshots.positions + far)
    write_bundle(tmp_path / "a.scan", cloud, moved, frame="device")
    got, _, _ = read(tmp_path / "a.scan")
    assert np.allclose(got.origin + got.xyz, expected + far, atol=1e-3)


def test_a_bundle_that_names_no_frame_is_registered_already(tmp_path):
    cloud, snapshots = example()
    write_bundle(tmp_path / "a.scan", cloud, snapshots)
    file = tmp_path / "a.scan" / POINTS_FILE
    table = pq.read_table(file)
    assert table.schema.metadata[b"mapsense.frame"] == b"building"
    pq.write_table(of_frame(None)(table), file)
    assert np.allclose(read(tmp_path / "a.scan")[0].xyz, cloud.xyz, atol=1e-5)


def test_device_points_without_snapshots_or_with_an_origin_are_not_written_failure(tmp_path):
    cloud, snapshots = example()
    far = PointCloud(cloud.xyz, np.array([1.0, 0, 0]), cloud.snapshot)
    for points, poses in (
        (PointCloud(cloud.xyz, cloud.origin), snapshots),
        (cloud, none()),
        (far, snapshots),
    ):
        with pytest.raises(ValueError, match="need snapshots, and no origin"):
            write_bundle(tmp_path / "a.scan", points, poses, frame="device")
    assert not (tmp_path / "a.scan").exists()


def without(name):
    return lambda table: table.drop_columns([name])


def of_version(version):
    def change(table):
        metadata = table.schema.metadata | {b"mapsense.schema_version": version}
        return table.replace_schema_metadata(metadata)

    return change


def of_frame(name, origin="[0.0, 0.0, 0.0]"):
    def change(table):
        metadata = {k: v for k, v in table.schema.metadata.items() if k != b"mapsense.frame"}
        metadata[b"mapsense.origin_m"] = origin.encode()
        return table.replace_schema_metadata(metadata | ({b"mapsense.frame": name} if name else {}))

    return change


def of_type(name, type_):
    def change(table):
        at = table.schema.names.index(name)
        return table.set_column(at, name, table[name].cast(type_))

    return change


def of_values(name, values):
    def change(table):
        at = table.schema.names.index(name)
        field = table.schema.field(name).with_nullable(True)
        return table.set_column(at, field, pa.array(values, field.type))

    return change


@pytest.mark.parametrize(
    ("file", "change", "message"),
    [
        (POINTS_FILE, without("y_mm"), "has no column 'y_mm'"),
        (SNAPSHOTS_FILE, without("qa"), "has no column 'qa'"),
        (POINTS_FILE, of_version(b"0"), "has schema version '0', expected '1'"),
        (SNAPSHOTS_FILE, lambda t: t.replace_schema_metadata(None), "holds table ''"),
        (POINTS_FILE, of_type("x_mm", pa.float64()), "column 'x_mm' is double, expected int32"),
        (POINTS_FILE, of_values("snapshot", [9] * 500), "runs from 9 to 9, there are 4 snapshots"),
        (POINTS_FILE, of_values("snapshot", [1, None] * 250), "empty in 250 of 500 rows"),
        (POINTS_FILE, of_values("x_mm", [1, None] * 250), "'x_mm' has 250 empty values"),
        (POINTS_FILE, of_frame(b"camera"), "metadata 'mapsense.frame' is 'camera', expected"),
        (POINTS_FILE, of_frame(b"device", "[1, 0, 0]"), "'mapsense.origin_m' is not 0"),
        (
            POINTS_FILE,
            lambda t: of_frame(b"device")(of_values("snapshot", [None] * 500)(t)),
            "no snapshots to register by",
        ),
        (SNAPSHOTS_FILE, of_values("qa", [5.0] * 4), "row 0 is no pose"),
        (SNAPSHOTS_FILE, of_values("x_m", [0, 0, np.nan, 0]), "row 2 is no pose"),
    ],
)
def test_a_foreign_table_is_named(tmp_path, file, change, message):
    folder = tmp_path / "a.scan"
    write_bundle(folder, *example())
    pq.write_table(change(pq.read_table(folder / file)), folder / file)
    with pytest.raises(InputError, match=file) as caught:
        read(folder)
    assert message in str(caught.value)


@pytest.mark.parametrize("file", [POINTS_FILE, SNAPSHOTS_FILE])
@pytest.mark.parametrize("content", [None, b"", b"PAR1 and no more"])
def test_a_missing_or_cut_table_is_named(tmp_path, file, content):
    folder = tmp_path / "a.scan"
    write_bundle(folder, *example())
    (folder / file).unlink()
    if content is not None:
        (folder / file).write_bytes(content)
    with pytest.raises(InputError, match=file):
        read(folder)


@pytest.mark.parametrize("simulated", [True, False])
def test_a_simulated_bundle_says_so_to_who_reads_it(tmp_path, simulated):
    cloud = PointCloud(np.random.default_rng(0).random((50, 3), np.float32), np.zeros(3))
    write_bundle(tmp_path / "s.scan", cloud, none(), simulated=simulated)
    assert read(tmp_path / "s.scan")[2].simulated is simulated
