"""What a file or folder is, by its name, its layout and, for text, its first lines."""

from pathlib import Path

import numpy as np

from storage.errors import InputError
from tasks.scans.bundle import POINTS_FILE, SNAPSHOTS_FILE
from tasks.scans.raw import unreadable
from tasks.scans.rows import with_spaces, without_comments
from tasks.scans.sequences import (
    INTRINSICS,
    frame_images,
    pose_file,
    seven_scenes_places,
    timed_images,
)
from tasks.scans.text import layout_of
from tasks.scans.threedtk import pose_of, scans_of
from tasks.scans.trajectories import looks_like_trajectory

SUFFIXES = {
    ".ply": "ply",
    ".pcd": "pcd",
    ".xyz": "xyz",
    ".txt": "xyz",
    ".csv": "xyz",
    ".asc": "xyz",
    ".pts": "xyz",
    ".las": "las",
    ".laz": "las",
    ".e57": "e57",
    ".3d": "3dtk",
}
KNOWN = ", ".join(SUFFIXES)

_AMBIGUOUS = (".txt", ".csv", ".asc")  # many a text file is no cloud
_MATRIX_ROWS = 4
_SAMPLE = 1 << 14  # bytes


def format_of(path: Path) -> str:
    """Return the format of an explicitly named scan, or raise InputError.

    One of ply, pcd, xyz, las, e57, 3dtk, bundle, tum, 7scenes.
    """
    try:
        path.stat()
    except OSError as error:
        raise unreadable(path, error) from error
    found = folder_format(path) if path.is_dir() else SUFFIXES.get(path.suffix.lower())
    if found is None and path.is_dir():
        raise InputError(
            path,
            "is no folder of one scan",
            f"expected a depth sequence with a trajectory, or {POINTS_FILE} + {SNAPSHOTS_FILE}",
        )
    if found is None:
        raise InputError(path, f"unknown format {path.suffix!r}", f"use one of {KNOWN}")
    return found


def folder_format(folder: Path) -> str | None:
    """Return the format of a folder that is one scan, None if it is none."""
    if (folder / POINTS_FILE).is_file() or folder.suffix == ".scan":
        return "bundle"
    if (images := frame_images(folder)) and any(pose_file(image).is_file() for image in images):
        return "7scenes"
    if (folder / "depth.txt").is_file() or any(folder.glob("depth/*.png")):
        return "tum"
    if _is_threedtk(folder):
        return "3dtk"
    return None


def is_scan_file(path: Path) -> bool:
    """Return whether a file found in a folder is a scan: text has to look like a cloud."""
    suffix = path.suffix.lower()
    if not path.is_file() or suffix not in SUFFIXES:
        return False
    return suffix not in _AMBIGUOUS or _looks_like_cloud(path)


def files_of(path: Path) -> list[Path]:
    """Return the files a scan is read from, sorted by name."""
    if not path.is_dir():
        pose = pose_of(path)
        return [path, pose] if path.suffix.lower() == ".3d" and pose.is_file() else [path]
    format_ = format_of(path)
    if format_ == "bundle":
        found = [path / POINTS_FILE, path / SNAPSHOTS_FILE]
    elif format_ == "3dtk":
        found = [file for scan in scans_of(path) for file in (scan, pose_of(scan))]
    else:
        found = _sequence_files(path, format_)
    return sorted(set(found))


def _sequence_files(path: Path, format_: str) -> list[Path]:
    """Return the images of a depth sequence and all that any setting may make it read."""
    if format_ == "tum":
        images, places = [image for _, image in timed_images(path)], [path]
        beside = [*path.glob("*.txt")]
    else:
        images, places = frame_images(path), seven_scenes_places(path)
        poses = [pose_file(image) for image in images]
        beside = [*path.glob("*.txt"), *(pose for pose in poses if pose.is_file())]
    intrinsics = [place / name for place in places for name in INTRINSICS]
    return [*images, *beside, *(file for file in intrinsics if file.is_file())]


def _is_threedtk(folder: Path) -> bool:
    """Return whether a folder holds several `.3d` scans with poses, and no other scans."""
    scans = scans_of(folder)
    if len(scans) < 2 or not all(pose_of(scan).is_file() for scan in scans):
        return False
    return all(file in scans or not is_scan_file(file) for file in folder.iterdir())


def _looks_like_cloud(path: Path) -> bool:
    """Return whether a text file holds points: no matrix, no trajectory, no other table."""
    try:
        layout = layout_of(path)
        with open(path, "rb") as file:
            head = file.read(_SAMPLE + 1)
    except (InputError, OSError):
        return False
    lines = without_comments(head).split(b"\n")[layout.skip :]
    if len(head) > _SAMPLE:
        lines = lines[:-1]  # the last one is cut
    rows = [with_spaces(line, layout.decimal_commas).split() for line in lines if line.strip()]
    if len(rows) <= _MATRIX_ROWS or {len(row) for row in rows} != {layout.n_columns}:
        return False
    try:
        numbers = np.array([[float(row[column]) for column in layout.wanted] for row in rows])
        all_numbers = np.array(rows, dtype=float) if layout.n_columns == 8 else numbers
    except ValueError:
        return False
    return bool(np.isfinite(numbers).any()) and not looks_like_trajectory(all_numbers)
