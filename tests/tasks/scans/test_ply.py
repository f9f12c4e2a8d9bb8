"""PLY: any layout of text or binary, and what is wrong with the broken ones."""

import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from storage.errors import InputError
from tasks.scans.ply import read_ply
from tasks.scans.ply_header import TYPES

ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": ""}
FACES = "element face 2\nproperty list uchar int vertex_indices\n"


def xyz_of(path: Path) -> np.ndarray:
    return np.concatenate([np.zeros((0, 3)), *(chunk.xyz for chunk in read_ply(path).chunks)])


def header(format_: str, properties: str, n: int, before: str = "", after: str = "") -> bytes:
    text = f"ply\nformat {format_} 1.0\ncomment made by hand\n{before}element vertex {n}\n"
    return f"{text}{properties}{after}end_header\n".encode()


def body(format_: str, rows: np.ndarray) -> bytes:
    if format_ == "ascii":
        return "".join(" ".join(str(v) for v in row.tolist()) + "\n" for row in rows).encode()
    return rows.tobytes()


def face_rows(format_: str) -> bytes:
    if format_ == "ascii":
        return b"3 0 1 2\n4 0 1 2 3\n"
    order = ORDERS[format_]
    return struct.pack(order + "B3i", 3, 0, 1, 2) + struct.pack(order + "B4i", 4, 0, 1, 2, 3)


@st.composite
def layouts(draw: st.DrawFn) -> tuple[str, list[tuple[str, str]], np.ndarray, str]:
    format_ = draw(st.sampled_from(sorted(ORDERS)))
    kind = draw(st.sampled_from(["float", "double", "int", "short", "float64"]))
    mixed = draw(st.booleans())
    kinds = {axis: draw(st.sampled_from(["float", "double", "int"])) if mixed else kind
             for axis in "xyz"}  # fmt: skip
    extras = draw(st.lists(st.sampled_from(sorted(TYPES)), max_size=4))
    columns = [*kinds.items(), *((f"extra{i}", type_) for i, type_ in enumerate(extras))]
    columns = draw(st.permutations(columns))
    n = draw(st.integers(0, 40))
    order = ORDERS[format_] or "<"
    rows = np.zeros(n, [(name, order + TYPES[type_]) for name, type_ in columns])
    values = draw(st.lists(st.integers(-9000, 9000), min_size=n * 3, max_size=n * 3))
    for i, axis in enumerate("xyz"):
        rows[axis] = np.array(values[i::3]) / (1 if TYPES[kinds[axis]][0] == "i" else 8)
    return format_, columns, rows, draw(st.sampled_from(["", "before", "after"]))


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(layouts())
def test_any_layout_gives_back_its_values(tmp_path, layout):
    format_, columns, rows, faces = layout
    properties = "".join(f"property {type_} {name}\n" for name, type_ in columns)
    head = header(format_, properties, len(rows), **{faces: FACES} if faces else {})
    parts = [body(format_, rows)]
    if faces:
        parts.insert(0 if faces == "before" else 1, face_rows(format_))
    path = tmp_path / "a.ply"
    path.write_bytes(head + b"".join(parts))
    expected = np.stack([rows[axis].astype(float) for axis in "xyz"], axis=1)
    assert np.array_equal(xyz_of(path), expected)
    assert read_ply(path).points_read == len(rows)


@pytest.mark.parametrize("ascii_", [True, False])
@pytest.mark.parametrize("type_", [np.float32, np.float64])
def test_open3d_reads_the_same_points(tmp_path, ascii_, type_):
    open3d = pytest.importorskip("open3d")
    xyz = np.random.default_rng(2).uniform(-20, 20, (5000, 3)).astype(type_)
    cloud = open3d.t.geometry.PointCloud(open3d.core.Tensor(xyz))
    cloud.point.colors = open3d.core.Tensor(np.full((5000, 3), 7, np.uint8))
    path = tmp_path / "a.ply"
    assert open3d.t.io.write_point_cloud(str(path), cloud, write_ascii=ascii_)
    theirs = open3d.t.io.read_point_cloud(str(path)).point.positions.numpy()
    # its text reader goes through doubles and back in its own way: the last bit may differ
    assert xyz_of(path) == pytest.approx(theirs.astype(float), abs=2e-6 if ascii_ else 0)


def test_points_marked_invalid_are_left_out(tmp_path):
    rows = np.zeros(6, [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("valid", "u1")])
    rows["x"], rows["valid"] = np.arange(6), [1, 0, 1, 1, 0, 1]
    head = header(
        "binary_little_endian",
        "property float x\nproperty float y\nproperty float z\nproperty uchar valid\n",
        6,
    )
    path = tmp_path / "a.ply"
    path.write_bytes(head + rows.tobytes())
    raw = read_ply(path)
    assert raw.chunks[0].xyz[:, 0].tolist() == [0, 2, 3, 5]
    assert (raw.points_read, raw.points_invalid) == (6, 2)


def test_vertices_with_lists_are_read(tmp_path):
    head = header(
        "binary_little_endian",
        "property float x\nproperty list uchar short ring\nproperty float y\nproperty float z\n",
        2,
    )
    rows = struct.pack("<fB2hff", 1, 2, 9, 9, 2, 3) + struct.pack("<fBff", 4, 0, 5, 6)
    path = tmp_path / "a.ply"
    path.write_bytes(head + rows)
    assert xyz_of(path).tolist() == [[1, 2, 3], [4, 5, 6]]


def test_triangles_before_the_vertices_are_passed_over(tmp_path):
    faces = "element face 1000\nproperty list uchar int vertex_indices\nproperty uchar flag\n"
    triangles = struct.pack("<B3iB", 3, 0, 1, 2, 9) * 1000
    path = tmp_path / "a.ply"
    path.write_bytes(header(BINARY, XYZ, 1, faces) + triangles + struct.pack("<3f", 1, 2, 3))
    assert xyz_of(path).tolist() == [[1, 2, 3]]
    path.write_bytes(header(BINARY, XYZ, 1, faces) + triangles[:-9])
    with pytest.raises(InputError, match="ends within element 'face'"):
        read_ply(path)


def test_windows_line_ends_in_the_header(tmp_path):
    head = header("binary_little_endian", XYZ, 1).replace(b"\n", b"\r\n")
    path = tmp_path / "a.ply"
    path.write_bytes(head + struct.pack("<3f", 1, 2, 3))
    assert xyz_of(path).tolist() == [[1, 2, 3]]


XYZ = "property float x\nproperty float y\nproperty float z\n"
BINARY = "binary_little_endian"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "empty"),
        (b"plyx\n", "first line is not 'ply'"),
        (b"ply\nformat ascii 1.0\nelement vertex 3\n", "no line 'end_header'"),
        (b"ply\nelement vertex 3\nend_header\n", "no line 'format'"),
        (header("middle_endian", XYZ, 3), "unknown 'format'"),
        (header("ascii", "property quaternion x\n", 3), "line 5 is no 'property TYPE NAME'"),
        (header("ascii", XYZ, 3).replace(b"vertex 3", b"vertex many"), "no 'element NAME COUNT'"),
        (header("ascii", XYZ, 3).replace(b"vertex 3", b"vertex -3"), "no 'element NAME COUNT'"),
        (header("ascii", XYZ.replace(" z", " w"), 3), "no property 'z'"),
        (header("ascii", XYZ + "property float x\n", 3), "a property twice"),
        (header("ascii", XYZ, 3).replace(b"vertex", b"point"), "expected one"),
        (header(BINARY, XYZ, 3) + bytes(35), "promises 3 rows, the file holds 2"),
        (header(BINARY, XYZ, 10**12) + bytes(36), "promises 1000000000000 rows, the file holds 3"),
        (header("ascii", XYZ, 10**12) + b"1 2 3\n", "promises 1000000000000 rows"),
        (header("ascii", XYZ, 3) + b"1 2 3\n4 5 6\n", "promises 3 rows, the file holds 2"),
        (header("ascii", XYZ, 2) + b"1 2 3\n4 5\n", "line 10 has 2 columns, expected 3"),
        (header("ascii", XYZ, 2) + b"1 2 3\n4 five 6\n", "line 10 holds no coordinates"),
        (header(BINARY, XYZ, 3, before=FACES) + b"\xff\0\0\0\0", "a list of 255 in 'face'"),
        (header(BINARY, XYZ, 3, before=FACES.replace("2", str(10**12))) + bytes(9), "ends within"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, content, message):
    path = tmp_path / "bad.ply"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"bad\.ply: ") as caught:
        read_ply(path)
    assert message in str(caught.value)
