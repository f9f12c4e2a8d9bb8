"""From paths to sources: what is a scan, what it is called, and what its hash covers."""

import os
import shutil

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from storage.artifacts import check_name
from storage.errors import InputError
from storage.points import PointCloud
from storage.snapshots import none
from tasks.scans.bundle import write_bundle
from tasks.scans.sources import find_sources, fingerprint

CLOUD = "".join(f"{i} {i * i} 1\n" for i in range(9))


def write(path, text=CLOUD):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def storey(folder):
    """A folder as people have it: scans, scan folders, and things that are neither."""
    for name in ("scan10.xyz", "scan2.txt", "Room A (1).csv", "b.PLY", ".hidden.xyz"):
        write(folder / name)
    write(folder / "sequence" / "depth" / "1.0.png")
    write(folder / "kitchen" / "frames" / "frame-000000.depth.png")
    write(folder / "kitchen" / "frames" / "frame-000000.pose.txt")
    write(folder / "hall" / "s0.3d")
    write(folder / "hall" / "s0.pose", "0 0 0 0 0 0")
    write(folder / "hall" / "s1.3d")
    write(folder / "hall" / "s1.pose", "0 0 0 0 0 0")
    cloud = PointCloud(np.zeros((1, 3), np.float32), np.zeros(3))
    write_bundle(folder / "sim.scan", cloud, none())
    write(folder / "readme.md")
    write(folder / "truth.json", "{}")
    write(folder / "preview.png")
    write(folder / "matrix.txt", "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n")
    write(folder / "trajectory.txt", "1 2 3 4 0 0 0 1\n" * 20)
    write(folder / "prices.csv", "id,name,width\n" + "1,chair,40\n" * 20)
    write(folder / "notes.txt", "Remember the milk.\n" * 20)
    write(folder / "pictures" / "a.png")
    return folder


def test_a_storey_s_scans_are_found_and_nothing_else(tmp_path):
    sources, errors = find_sources([storey(tmp_path / "storey")])
    names = [source.name for source in sources]
    assert names == [
        "b", "hall", "kitchen", "Room_A_1_", "scan2", "scan10", "sequence", "sim"
    ]  # fmt: skip
    assert errors == []


def test_bad_paths_do_not_stop_the_others(tmp_path):
    good = write(tmp_path / "a.xyz")
    (tmp_path / "empty").mkdir()
    bad = [tmp_path / "missing.ply", write(tmp_path / "a.docx"), tmp_path / "empty"]
    sources, errors = find_sources([bad[0], good, *bad[1:]])
    assert [source.path for source in sources] == [str(good)]
    assert [error.path for error in errors] == [str(path) for path in bad]
    for error, words in zip(errors, ("cannot be read", "unknown format", "no scan"), strict=True):
        assert words in str(error)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_a_file_that_may_not_be_read_is_named(tmp_path):
    path = write(tmp_path / "a.xyz")
    path.chmod(0)
    assert "cannot be read" in str(find_sources([path])[1][0])


def test_a_link_to_nowhere_is_named(tmp_path):
    (tmp_path / "a.ply").symlink_to(tmp_path / "gone.ply")
    assert "a.ply: cannot be read" in str(find_sources([tmp_path / "a.ply"])[1][0])


def test_names_are_unique_whatever_the_order_and_case(tmp_path):
    paths = [write(tmp_path / d / n) for d in "ab" for n in ("Room.xyz", "room.csv")]
    named = [
        {source.path: source.name for source in find_sources(order)[0]}
        for order in (paths, paths[::-1])
    ]
    assert named[0] == named[1]
    assert sorted(named[0].values()) == ["Room", "Room_2", "room_2", "room_3"] or len(
        {name.casefold() for name in named[0].values()}
    ) == len(paths)


def test_a_path_named_twice_is_one_source(tmp_path):
    path = write(tmp_path / "a.xyz")
    assert len(find_sources([path, tmp_path, path])[0]) == 1


@settings(max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.text(st.characters(exclude_characters="/\0", codec="utf-8"), min_size=1, max_size=60))
def test_any_file_name_gives_a_usable_name(tmp_path, stem):
    path = write(tmp_path / f"{stem}.xyz")
    source = fingerprint(path)
    path.unlink()
    assert check_name(source.name) == source.name


def test_the_hash_is_of_content_and_names_within(tmp_path):
    path = write(tmp_path / "a.xyz")
    source = fingerprint(path)
    assert source.size_bytes == len(CLOUD)
    renamed = fingerprint(shutil.copy(path, tmp_path / "b.xyz") and tmp_path / "b.xyz")
    assert renamed.sha256 == source.sha256
    assert fingerprint(write(path, CLOUD + "1 2 3\n")).sha256 != source.sha256


def test_a_3dtk_scan_is_hashed_with_its_pose(tmp_path):
    path = write(tmp_path / "s.3d")
    without = fingerprint(path).sha256
    write(tmp_path / "s.pose", "0 0 0 0 0 0")
    first = fingerprint(path).sha256
    write(tmp_path / "s.pose", "0 0 1 0 0 0")
    assert len({without, first, fingerprint(path).sha256}) == 3


def test_a_sequence_s_hash_covers_what_is_read(tmp_path):
    folder = tmp_path / "a"
    write(folder / "depth" / "1.0.png", "one")
    write(folder / "groundtruth.txt", "poses")
    before = fingerprint(folder).sha256
    write(folder / "rgb" / "1.0.png", "colour")
    assert fingerprint(folder).sha256 == before
    write(folder / "groundtruth.txt", "other")
    assert fingerprint(folder).sha256 != before


def test_listed_images_and_intrinsics_beside_the_frames_count(tmp_path):
    tum, frames = tmp_path / "a", tmp_path / "b" / "frames"
    write(tum / "raw" / "one.png", "one")
    write(tum / "depth.txt", "1.0 raw/one.png\n")
    write(frames / "frame-000000.depth.png")
    write(frames / "frame-000000.pose.txt")
    write(frames.parent / "camera-intrinsics.txt", "1")
    before = [fingerprint(folder).sha256 for folder in (tum, frames)]
    write(tum / "raw" / "one.png", "two")
    write(frames.parent / "camera-intrinsics.txt", "2")
    after = [fingerprint(folder).sha256 for folder in (tum, frames)]
    assert before[0] != after[0] and before[1] != after[1]
    (tum / "raw" / "one.png").unlink()
    with pytest.raises(InputError, match=r"one\.png: cannot be read"):
        fingerprint(tum)


def test_a_link_to_itself_is_named(tmp_path):
    (tmp_path / "a.ply").symlink_to(tmp_path / "a.ply")
    assert "a.ply: cannot be read" in str(find_sources([tmp_path / "a.ply"])[1][0])


def test_errors_are_input_errors(tmp_path):
    with pytest.raises(InputError, match="no folder of one scan"):
        fingerprint(tmp_path)
