"""The scan bundle: its round trip, and what is wrong with foreign ones."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

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


def without(name):
    return lambda table: table.drop_columns([name])


def of_version(version):
    def change(table):
        metadata = table.schema.metadata | {b"mapsense.schema_version": version}
        return table.replace_schema_metadata(metadata)

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
