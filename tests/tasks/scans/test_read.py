"""Reading as a whole: frames, units, guesses, far and bad points, and the record of it all."""

import numpy as np
import pytest
from pydantic import ValidationError

from storage.errors import InputError
from storage.points import from_table, to_table
from tasks.scans import assemble, raw
from tasks.scans.read import ReadParams, read_scan
from tasks.scans.sources import fingerprint


def room(width=10.0, depth=8.0, height=2.6, angle=0.0, n=40_000, at=(0.0, 0.0, 0.0)):
    """Points on the six faces of a room, evenly by area, with a centimetre of noise, metres."""
    rng = np.random.default_rng(0)
    size = np.array([width, depth, height])
    areas = np.repeat([depth * height, width * height, width * depth], 2)
    faces = rng.choice(6, n, p=areas / areas.sum())
    xyz = rng.uniform(size=(n, 3)) * size
    xyz[np.arange(n), faces // 2] = (faces % 2) * size[faces // 2]
    xyz += rng.normal(0, 0.01, (n, 3))
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    xyz[:, :2] = xyz[:, :2] @ turn.T
    return xyz + np.array(at)


def y_up(xyz):
    return np.stack([xyz[:, 0], xyz[:, 2], -xyz[:, 1]], axis=1)


def ply(folder, xyz, type_="<f8"):
    name = {"<f8": "double", "<f4": "float"}[type_]
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(xyz)}\n"
    head += "".join(f"property {name} {axis}\n" for axis in "xyz") + "end_header\n"
    path = folder / "a.ply"
    path.write_bytes(head.encode() + np.asarray(xyz, type_).tobytes())
    return path


def read(path, **params):
    return read_scan(fingerprint(path), ReadParams(**params))


def test_a_room_in_metres_is_read_as_it_is(tmp_path):
    xyz = room().astype(np.float32)
    cloud, snapshots, scan = read(ply(tmp_path, xyz, "<f4"))
    assert np.array_equal(cloud.xyz, xyz)
    assert cloud.xyz.dtype == np.float32
    assert (cloud.snapshot, len(snapshots), scan.notes) == (None, 0, "")
    assert (scan.name, scan.format, scan.points_read, scan.points_kept) == (
        "a", "ply", len(xyz), len(xyz)
    )  # fmt: skip
    assert (scan.up, scan.scale, scan.up_guessed, scan.scale_guessed) == ("z", 1.0, False, False)


@pytest.mark.parametrize(("scale", "unit"), [(0.001, "millimetres"), (0.01, "centimetres")])
@pytest.mark.parametrize("size", [(10, 8, 2.6), (3, 4, 2.4), (36, 2.6, 4)])
def test_units_are_guessed_where_they_are_certain(tmp_path, scale, unit, size):
    xyz = room(*size, angle=0.3)
    cloud, _, scan = read(ply(tmp_path, xyz / scale))
    assert np.allclose(cloud.xyz, xyz, atol=1e-4)
    assert (scan.scale, scan.scale_guessed) == (scale, True)
    assert f"Unit guessed: {unit}" in scan.notes


def test_a_set_scale_is_no_guess(tmp_path):
    cloud, _, scan = read(ply(tmp_path, room() * 1000), scale=0.01)
    assert cloud.xyz[:, 2].max() == pytest.approx(26, abs=1)
    assert (scan.scale, scan.scale_guessed, scan.notes) == (0.01, False, "")


def test_far_points_seen_through_windows_change_no_guess(tmp_path):
    xyz = room(angle=0.4)
    far = np.random.default_rng(1).normal(0, 400, (4000, 3))
    _, _, scan = read(ply(tmp_path, np.concatenate([xyz, far])))
    assert (scan.up, scan.scale, scan.scale_guessed, scan.notes) == ("z", 1.0, False, "")
    _, _, scan = read(ply(tmp_path, np.concatenate([xyz, far[:800]]) * 1000))
    assert (scan.up, scan.scale, scan.scale_guessed) == ("z", 0.001, True)


def test_eight_storeys_in_centimetres_are_not_called_one_in_millimetres(tmp_path):
    storeys = [room(40, 20, 2.8, n=9000, at=(0, 0, 3 * i)) for i in range(8)]
    _, _, scan = read(ply(tmp_path, np.concatenate(storeys) * 100))
    assert (scan.scale, scan.scale_guessed) == (1.0, False)
    assert "set 'scale'" in scan.notes


@pytest.mark.parametrize(
    "xyz", [room(14, 9, 2.7), room(angle=0.5), room(5, 4, 2.4, angle=0.6), room(angle=0.2) * 1000]
)
def test_y_up_is_guessed_where_it_is_certain(tmp_path, xyz):
    cloud, _, scan = read(ply(tmp_path, y_up(xyz)))
    assert (scan.up, scan.up_guessed) == ("y", True)
    assert np.allclose(cloud.xyz / cloud.xyz.max(), xyz / xyz.max(), atol=1e-5)
    assert "Up axis guessed: y" in scan.notes


@pytest.mark.parametrize(
    "xyz",
    [
        room(14, 9, 2.7),
        room(20, 1.5, 3),  # a corridor narrower than high, its walls along x
        room(20, 2.2, 4.5),
        room(4, 4, 4),
        room(30, 2, 2.5)[:, [1, 0, 2]],
        room(6, 0.01, 2.5),  # one wall
        room(20, 1.2, 3.9),
        room(20, 2, 2.7)[np.abs(room(20, 2, 2.7)[:, 2] - 1.35) < 1.2],  # no floor, no ceiling
        np.random.default_rng(0).normal(size=(5000, 3)),
        np.random.default_rng(0).uniform(size=(5000, 3)) * [5, 2, 9],
    ],
)
def test_z_is_up_where_y_is_not_certain(tmp_path, xyz):
    _, _, scan = read(ply(tmp_path, xyz))
    assert (scan.up, scan.up_guessed, scan.scale) == ("z", False, 1.0)


@pytest.mark.parametrize("up", ["x", "-x", "y", "-y", "z", "-z", "0.02,-0.89,-0.46"])
def test_a_set_up_axis_becomes_z(tmp_path, up):
    xyz = room(n=2000)
    vector = {"x": [1, 0, 0], "y": [0, 1, 0], "z": [0, 0, 1]}.get(up[-1])
    vector = np.array([float(v) for v in up.split(",")] if "," in up else vector, float)
    vector *= -1 if up in ("-x", "-y", "-z") else 1
    cloud, _, scan = read(ply(tmp_path, xyz), up=up)
    assert np.allclose(cloud.xyz[:, 2], xyz @ vector / np.linalg.norm(vector), atol=1e-5)
    sides = [np.linalg.norm(np.diff(points, axis=0), axis=1) for points in (cloud.xyz, xyz)]
    assert np.allclose(*sides, atol=1e-4)
    assert (scan.up, scan.up_guessed) == (up, False)


def test_a_left_handed_file_is_mirrored(tmp_path):
    xyz = room(n=2000)
    cloud, _, _ = read(ply(tmp_path, xyz), handed="left")
    assert np.allclose(cloud.xyz, xyz * [1, -1, 1], atol=1e-5)


def test_georeferenced_points_keep_the_millimetre(tmp_path):
    xyz = room(at=(512_345.678, 5_412_345.123, 251.5))
    path = tmp_path / "a.xyz"
    np.savetxt(path, xyz, fmt="%.4f")
    for source in (path, ply(tmp_path, xyz)):
        cloud, _, _ = read(source)
        assert np.array_equal(cloud.origin, np.floor(cloud.origin))
        assert np.abs(cloud.xyz).max() < 30
        assert np.abs(cloud.origin + cloud.xyz.astype(float) - xyz).max() < 1e-4
        stored = from_table(to_table(cloud))
        assert np.abs(stored.origin + stored.xyz.astype(float) - xyz).max() < 1e-3


def test_far_points_in_32_bits_are_noted(tmp_path):
    _, _, scan = read(ply(tmp_path, room(at=(512_345, 5_412_345, 0)), "<f4"))
    assert "in steps of 0.5 units" in scan.notes


def test_points_not_finite_or_out_of_reach_are_dropped_and_counted(tmp_path):
    xyz = room(n=1000)
    bad = np.array([[np.nan, 0, 0], [0, np.inf, 0], [0, 0, -np.inf], [3e9, 0, 0], [0, 0, -2.1e6]])
    both = np.insert(xyz, [0, 10, 500, 900, 1000], bad, axis=0)
    cloud, _, scan = read(ply(tmp_path, both))
    assert np.allclose(cloud.xyz, xyz, atol=1e-6)
    assert (scan.points_read, scan.points_kept, scan.points_not_finite) == (1005, 1000, 5)
    assert scan.notes == "2 points lie over 2,000 km away: dropped."


@pytest.mark.parametrize("mark", [-1e10, 3.4e38, -1e300])
def test_marks_for_nothing_seen_move_no_origin(tmp_path, mark):
    xyz = room(n=70_000)
    xyz[::3] = mark
    cloud, _, scan = read(ply(tmp_path, xyz))
    assert cloud.origin.tolist() == [0, 0, 0]
    assert (scan.points_kept, scan.scale, scan.up) == (46_666, 1.0, "z")


def test_a_few_finite_points_among_many_are_found(tmp_path):
    xyz = np.full((200_000, 3), np.nan)
    xyz[70_001:70_021] = room(n=20)
    assert len(read(ply(tmp_path, xyz))[0]) == 20


def test_the_crop_box_is_in_the_building_frame(tmp_path):
    xyz = room(n=5000)
    box = (1.0, 1.0, -1.0, 6.0, 5.0, 1.5)
    inside = ((xyz >= box[:3]) & (xyz <= box[3:])).all(axis=1)
    cloud, _, scan = read(ply(tmp_path, y_up(xyz)), up="y", crop=box)
    assert np.allclose(cloud.xyz, xyz[inside], atol=1e-6)
    assert scan.points_cropped == 5000 - inside.sum()
    with pytest.raises(InputError, match="0 usable points inside the crop box"):
        read(ply(tmp_path, xyz), crop=(50, 50, 50, 60, 60, 60))


def test_small_chunks_give_the_same_cloud(tmp_path, monkeypatch):
    xyz = np.insert(room(n=3000), 17, np.nan, axis=0)
    whole, _, _ = read(ply(tmp_path, xyz))
    for module in (raw, assemble):
        monkeypatch.setattr(module, "ROWS", 100)
    parts, _, _ = read(ply(tmp_path, xyz))
    assert np.array_equal(whole.xyz, parts.xyz)


@pytest.mark.parametrize(
    ("xyz", "message"),
    [
        (np.zeros((0, 3)), "none of its 0 points is usable"),
        (np.full((9, 3), np.nan), "none of its 9 points is usable"),
        (room(n=2), "holds 2 usable points, expected 4 at least"),
        (np.ones((100, 3)), "its 100 points are all the same"),
        (np.arange(100)[:, None] * [0.1, 0.2, 0.3], "its 100 points all lie on one line"),
    ],
)
def test_clouds_that_are_no_room_are_named(tmp_path, xyz, message):
    with pytest.raises(InputError, match=r"a\.ply: ") as caught:
        read(ply(tmp_path, xyz))
    assert message in str(caught.value)


def test_one_flat_wall_is_a_cloud(tmp_path):
    assert len(read(ply(tmp_path, room(n=900) * [1, 0, 1]))[0]) == 900


@pytest.mark.parametrize(
    ("setting", "value"),
    [
        ("up", "w"), ("up", "1,2"), ("up", "0,0,0"), ("up", "nan,0,1"), ("scale", 0),
        ("scale", -1), ("handed", "both"), ("crop", (0, 0, 0, 1, 1, 0)), ("crop", (0, 0, 0)),
        ("depth_stride", 0), ("depth_min", 9.0), ("trajectory", "../a.txt"),
        ("pose_gap_s", 0), ("depth_factor", 0), ("stride", 2),
    ],
)  # fmt: skip
def test_settings_without_a_sense_are_refused(setting, value):
    with pytest.raises(ValidationError, match=setting):
        ReadParams(**{setting: value})
