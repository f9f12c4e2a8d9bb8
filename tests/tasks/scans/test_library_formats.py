"""PCD, LAS, LAZ and E57: the same points as their libraries give, and clear errors."""

import numpy as np
import pytest

from storage.errors import InputError
from tasks.scans.e57 import read_e57
from tasks.scans.las import read_las
from tasks.scans.pcd import read_pcd

laspy = pytest.importorskip("laspy")
pye57 = pytest.importorskip("pye57")

HALF_TURN = np.array([0.0, 0.0, 0.0, 1.0])  # about z
QUARTER = np.array([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])


def points(n=1000, seed=0):
    return np.random.default_rng(seed).uniform(-5, 5, (n, 3))


def joined(raw):
    return np.concatenate([chunk.xyz for chunk in raw.chunks])


def las_file(path, xyz, withheld=None):
    header = laspy.LasHeader(point_format=1, version="1.2")
    header.scales, header.offsets = [0.001] * 3, np.floor(xyz.min(axis=0))
    las = laspy.LasData(header)
    las.x, las.y, las.z = xyz.T
    if withheld is not None:
        las.withheld = withheld
    las.write(str(path))
    return path


def e57_file(path, scans):
    with pye57.E57(str(path), mode="w") as file:
        for data, rotation, translation in scans:
            file.write_scan_raw(data, rotation=rotation, translation=np.array(translation, float))
    return path


def cartesian(xyz, **extra):
    return dict(zip(("cartesianX", "cartesianY", "cartesianZ"), xyz.T, strict=True)) | extra


@pytest.mark.parametrize("suffix", ["las", "laz"])
def test_las_keeps_georeferenced_millimetres(tmp_path, suffix):
    xyz = points() + np.array([512_345, 5_412_345, 250])
    raw = read_las(las_file(tmp_path / f"a.{suffix}", xyz))
    assert np.abs(joined(raw) - xyz).max() <= 0.0005001
    assert joined(raw).dtype == np.float64
    theirs = laspy.read(str(tmp_path / f"a.{suffix}"))
    assert np.array_equal(joined(raw), theirs.xyz)


def test_las_leaves_withheld_points_out(tmp_path):
    withheld = np.arange(1000) % 10 == 0
    raw = read_las(las_file(tmp_path / "a.las", points(), withheld))
    assert (raw.points_read, raw.points_invalid, len(joined(raw))) == (1000, 100, 900)


@pytest.mark.parametrize("suffix", ["las", "laz"])
@pytest.mark.parametrize("keep", [3, 100, 0.5, 0.97])
def test_a_cut_las_is_named(tmp_path, suffix, keep):
    data = las_file(tmp_path / f"whole.{suffix}", points(20_000)).read_bytes()
    path = tmp_path / f"cut.{suffix}"
    path.write_bytes(data[: keep if keep > 1 else int(keep * len(data))])
    with pytest.raises(InputError, match=rf"cut\.{suffix}: "):
        read_las(path)


@pytest.mark.parametrize(
    ("suffix", "at", "damage", "message"),
    [
        ("las", 100, b"\xff\xff\xff\xff", "4294967295 records do not fit"),
        ("las", 96, b"\xff\xff\xff\x7f", "records do not fit"),
        ("laz", 327, b"\xff\xff\xff\xff", "has no table of chunks"),
        ("laz", -20, bytes(20), r"damaged\.laz: "),
    ],
)
def test_damaged_counts_are_named_before_anything_is_allocated(
    tmp_path, suffix, at, damage, message
):
    data = bytearray(las_file(tmp_path / f"whole.{suffix}", points()).read_bytes())
    at %= len(data)
    data[at : at + len(damage)] = damage
    path = tmp_path / f"damaged.{suffix}"
    path.write_bytes(data)
    with pytest.raises(InputError, match=message):
        read_las(path)


def test_many_chunks_of_laz_are_read_in_order(tmp_path):
    xyz = points(120_000)
    assert np.abs(joined(read_las(las_file(tmp_path / "a.laz", xyz))) - xyz).max() < 0.00051


def test_a_las_header_of_a_billion_points_is_named(tmp_path):
    path = las_file(tmp_path / "a.las", points())
    data = bytearray(path.read_bytes())
    data[107:111] = (2**32 - 1).to_bytes(4, "little")
    path.write_bytes(data)
    with pytest.raises(InputError, match="promises 4294967295 points, the file holds 1000"):
        read_las(path)


@pytest.mark.parametrize(
    ("reader", "suffix"),
    [(read_las, "las"), (read_las, "laz"), (read_e57, "e57"), (read_pcd, "pcd")],
)
@pytest.mark.parametrize("content", [b"", b"rubbish\n" * 500, bytes(4000)])
def test_rubbish_is_named_not_crashed_on(tmp_path, reader, suffix, content):
    path = tmp_path / f"bad.{suffix}"
    path.write_bytes(content)
    with pytest.raises(InputError, match=rf"bad\.{suffix}: "):
        reader(path)
    assert path.exists()


def test_every_posed_e57_scan_is_a_snapshot(tmp_path):
    a, b = points(seed=1), points(700, seed=2)
    path = e57_file(
        tmp_path / "a.e57",
        [(cartesian(a), HALF_TURN, [0, 0, 1]), (cartesian(b), QUARTER, [10, 0, 2])],
    )
    raw = read_e57(path)
    assert np.allclose(raw.chunks[0].xyz, a * [-1, -1, 1] + [0, 0, 1], atol=1e-5)
    turned = np.stack([-b[:, 1], b[:, 0], b[:, 2]], axis=1)
    assert np.allclose(raw.chunks[1].xyz, turned + np.array([10, 0, 2]), atol=1e-5)
    assert [chunk.snapshot for chunk in raw.chunks] == [0, 1]
    assert raw.poses.positions.tolist() == [[0, 0, 1], [10, 0, 2]]
    theirs = pye57.E57(str(path)).read_scan(1, ignore_missing_fields=True)
    assert np.allclose(raw.chunks[1].xyz[:, 0], theirs["cartesianX"], atol=1e-5)


def test_e57_points_marked_invalid_are_left_out(tmp_path):
    state = (np.arange(1000) % 4).clip(0, 2).astype(np.int8)
    data = cartesian(points(), cartesianInvalidState=state)
    raw = read_e57(e57_file(tmp_path / "a.e57", [(data, HALF_TURN, [0, 0, 0])]))
    assert (raw.points_read, raw.points_invalid) == (1000, 750)


def test_e57_poses_that_are_no_rotations_are_named(tmp_path):
    path = e57_file(tmp_path / "a.e57", [(cartesian(points()), np.zeros(4), [0, 0, 0])])
    with pytest.raises(InputError, match=r"a\.e57: the pose of scan 0 .* length 0"):
        read_e57(path)


def test_spherical_e57_points_become_cartesian(tmp_path):
    lib = pye57.libe57
    path = tmp_path / "a.e57"
    values = {
        "sphericalRange": np.array([1.0, 2.0, 3.0]),
        "sphericalAzimuth": np.array([0.0, np.pi / 2, np.pi]),
        "sphericalElevation": np.array([0.0, 0.0, np.pi / 6]),
    }
    with pye57.E57(str(path), mode="w") as file:
        image = file.image_file
        scan, prototype = lib.StructureNode(image), lib.StructureNode(image)
        scan.set("guid", lib.StringNode(image, "{a}"))
        buffers = lib.VectorSourceDestBuffer()
        for name, array in values.items():
            prototype.set(name, lib.FloatNode(image, 0.0, lib.E57_DOUBLE, -10.0, 10.0))
            buffers.append(lib.SourceDestBuffer(image, name, array, 3, True, True))
        cloud = lib.CompressedVectorNode(image, prototype, lib.VectorNode(image, True))
        scan.set("points", cloud)
        file.data3d.append(scan)
        writer = cloud.writer(buffers)
        writer.write(3)
        writer.close()
    raw = read_e57(path)
    half = 3 * np.sqrt(0.75)
    assert np.allclose(joined(raw), [[1, 0, 0], [0, 2, 0], [-half, 0, 1.5]], atol=1e-6)
    assert raw.poses is None


def test_a_cut_e57_is_named(tmp_path):
    path = e57_file(tmp_path / "a.e57", [(cartesian(points(5000)), HALF_TURN, [0, 0, 0])])
    data = path.read_bytes()
    for keep in (50, len(data) // 2, len(data) - 1024):
        path.write_bytes(data[:keep])
        with pytest.raises(InputError, match=r"a\.e57: "):
            read_e57(path)


PCD = (
    "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z rgb\nSIZE {size} {size} {size} 4\nTYPE F F F F\n"
    "COUNT 1 1 1 1\nWIDTH {n}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {n}\nDATA {kind}\n"
)


def pcd_file(path, xyz, kind, type_=np.float32):
    head = PCD.format(size=np.dtype(type_).itemsize, n=len(xyz), kind=kind).encode()
    rows = np.zeros(len(xyz), [("x", type_), ("y", type_), ("z", type_), ("rgb", "<f4")])
    for axis, name in enumerate("xyz"):
        rows[name] = xyz[:, axis]
    text = "".join(f"{x!r} {y!r} {z!r} 0\n" for x, y, z in xyz.tolist()).encode()
    path.write_bytes(head + (text if kind == "ascii" else rows.tobytes()))
    return path


@pytest.mark.parametrize(
    ("kind", "type_"), [("ascii", np.float32), ("binary", np.float32), ("binary", np.float64)]
)
def test_pcd_by_hand(tmp_path, kind, type_):
    raw = read_pcd(pcd_file(tmp_path / "a.pcd", points(), kind, type_))
    assert np.allclose(joined(raw), points(), atol=1e-6)


def test_compressed_pcd_by_open3d(tmp_path):
    open3d = pytest.importorskip("open3d")
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points()))
    path = tmp_path / "a.pcd"
    open3d.io.write_point_cloud(str(path), cloud, compressed=True)
    assert np.allclose(joined(read_pcd(path)), points(), atol=1e-6)
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(InputError, match=r"a\.pcd: the header promises 1000 points"):
        read_pcd(path)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("x y z rgb", "x y w rgb", "expected x, y and z"),
        ("DATA binary", "DATA holographic", "DATA is 'holographic'"),
        ("POINTS 1000", "POINTS many", "POINTS is 'many'"),
        ("POINTS 1000", f"POINTS {10**12}", "promises 1000000000000 points"),
        ("COUNT 1 1 1 1", "COUNT 1 1", "do not agree"),
        ("FIELDS", "FELDER", "no line 'FIELDS'"),
    ],
)
def test_a_malformed_pcd_header_is_named(tmp_path, old, new, message):
    path = pcd_file(tmp_path / "a.pcd", points(), "binary")
    path.write_bytes(path.read_bytes().replace(old.encode(), new.encode()))
    with pytest.raises(InputError, match=r"a\.pcd: ") as caught:
        read_pcd(path)
    assert message in str(caught.value)
