"""Depth sequences: the folder layouts of TUM RGB-D and of 7-Scenes."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from storage.errors import InputError
from tasks.scans.depth import DepthParams, Frames, back_project, read_depth
from tasks.scans.raw import Convention, RawCloud, size_of
from tasks.scans.trajectories import (
    Trajectory,
    nearest_poses,
    read_matrix,
    read_pose,
    read_trajectory,
)

TUM_FACTOR, MILLIMETRES = 5000.0, 1000.0
"""Depth image units per metre, as the two data sets publish them."""
TUM_DEFAULT = (525.0, 525.0, 319.5, 239.5)
"""fx, fy, cx, cy for 640 x 480 images that the TUM benchmark gives for uncalibrated use."""
INTRINSICS = ("camera-intrinsics.txt", "intrinsics.txt", "intrinsics.json")

_FRAME = re.compile(r"frame-(\d+)\.depth\.png")


def read_tum(folder: Path, params: DepthParams) -> RawCloud:
    """Return the points of a TUM sequence: depth images named by time, and a trajectory."""
    times, images, notes = _in_order(folder)
    trajectory = read_trajectory(_trajectory_file(folder, params))
    frames, gaps = _associate(folder, images, times, trajectory, params)
    intrinsics, source = _intrinsics(folder, [folder], images[0], params)
    return back_project(
        frames,
        intrinsics,
        params.depth_factor or TUM_FACTOR,
        params,
        (*notes, *trajectory.notes, *gaps, *source),
    )


def read_seven_scenes(folder: Path, params: DepthParams) -> RawCloud:
    """Return the points of a 7-Scenes sequence: numbered depth images with a 4x4 pose each."""
    images = frame_images(folder)
    times = np.array([_number(path) for path in images]) / params.frame_rate_hz
    if params.trajectory is not None:
        trajectory = read_trajectory(_trajectory_file(folder, params))
        frames, notes = _associate(folder, images, times, trajectory, params)
        notes = trajectory.notes + notes
    else:
        frames, notes = _own_poses(folder, images, times)
    intrinsics, source = _intrinsics(folder, seven_scenes_places(folder), images[0], params)
    factor = params.depth_factor or MILLIMETRES
    # the data set's own world is the frame of the first camera, however that was held
    world = Convention(levelled=params.trajectory is not None)
    return back_project(frames, intrinsics, factor, params, (*notes, *source), world)


def frame_images(folder: Path) -> list[Path]:
    """Return the depth images of a 7-Scenes folder, or of its folder `frames`, by number."""
    for place in (folder, folder / "frames"):
        found = [path for path in place.glob("frame-*.depth.png") if _FRAME.fullmatch(path.name)]
        if found:
            return sorted(found, key=_number)
    return []


def seven_scenes_places(folder: Path) -> list[Path]:
    """Return the folders in which intrinsics of a 7-Scenes sequence may lie."""
    return [folder, folder / "frames", folder.absolute().parent]


def pose_file(image: Path) -> Path:
    """Return where the pose of a 7-Scenes depth image lies."""
    return image.with_name(image.name.replace(".depth.png", ".pose.txt"))


def _number(image: Path) -> int:
    match = _FRAME.fullmatch(image.name)
    assert match is not None
    return int(match[1])


def _in_order(folder: Path) -> tuple[NDArray[np.float64], list[Path], list[str]]:
    """Return the times and files of a TUM sequence's images, by time."""
    found = timed_images(folder)
    if not found:
        raise InputError(folder, "holds no depth image", "expected depth/TIMESTAMP.png files")
    notes = []
    if [time for time, _ in found] != sorted(time for time, _ in found):
        notes.append("depth.txt is not in order of time: sorted.")
    unique = dict(sorted(found, key=lambda pair: pair[0], reverse=True))
    for time, image in found[::-1]:
        unique[time] = image  # of images with the same time the first one stays
    if len(unique) < len(found):
        notes.append(f"{len(found) - len(unique)} depth images repeat a time: left out.")
    times = sorted(unique)
    return np.array(times), [unique[time] for time in times], notes


def timed_images(folder: Path) -> list[tuple[float, Path]]:
    """Return the times and files of a TUM sequence's images as its index or folder has them."""
    index = folder / "depth.txt"
    return _listed(index) if index.is_file() else _named_by_time(folder / "depth")


def _listed(index: Path) -> list[tuple[float, Path]]:
    found = []
    for number, line in enumerate(index.read_text("utf-8", "replace").splitlines(), 1):
        fields = line.partition("#")[0].split()
        if not fields:
            continue
        time = _time(fields[0])
        if len(fields) != 2 or time is None:
            raise InputError(
                index, f"line {number} is {line[:60]!r}", "expected 'TIMESTAMP depth/FILE.png'"
            )
        found.append((time, index.parent / fields[1]))
    return found


def _named_by_time(folder: Path) -> list[tuple[float, Path]]:
    found = []
    for path in sorted(folder.glob("*.png")):
        time = _time(path.stem)
        if time is None:
            raise InputError(
                path, "the file name is no time", "name images TIMESTAMP.png, or add depth.txt"
            )
        found.append((time, path))
    return sorted(found)


def _time(text: str) -> float | None:
    try:
        time = float(text)
    except ValueError:
        return None
    return time if np.isfinite(time) else None


def _trajectory_file(folder: Path, params: DepthParams) -> Path:
    if params.trajectory is not None:
        return folder / params.trajectory
    if (folder / "groundtruth.txt").is_file():
        return folder / "groundtruth.txt"
    found = sorted(folder.glob("trajectory*.txt"))
    if len(found) != 1:
        names = ", ".join(path.name for path in found) or "none"
        raise InputError(
            folder,
            f"expected groundtruth.txt or one trajectory*.txt, found {names}",
            "add the poses, or choose a file with the setting 'trajectory'",
        )
    return found[0]


def _associate(
    folder: Path,
    images: list[Path],
    times: NDArray[np.float64],
    trajectory: Trajectory,
    params: DepthParams,
) -> tuple[Frames, tuple[str, ...]]:
    """Return the images that have a pose near in time, and a note on those that have none."""
    pose = nearest_poses(times, trajectory, params.pose_gap_s)
    kept = np.flatnonzero(pose >= 0)
    _check_any(folder, len(kept), f"within {params.pose_gap_s} s", len(images))
    pose = pose[kept]
    frames = Frames(
        [images[i] for i in kept], times[kept], trajectory.positions[pose],
        trajectory.rotations[pose],
    )  # fmt: skip
    gap = f"within {params.pose_gap_s} s"
    return frames, _dropped(len(images) - len(kept), len(images), gap)


def _own_poses(
    folder: Path, images: list[Path], times: NDArray[np.float64]
) -> tuple[Frames, tuple[str, ...]]:
    """Return the images whose pose file is there and holds a pose, and a note on the others."""
    poses = [read_pose(pose_file(path)) if pose_file(path).is_file() else None for path in images]
    kept = [i for i, pose in enumerate(poses) if pose is not None]
    _check_any(folder, len(kept), "in its .pose.txt file", len(images))
    matrices = np.array([poses[i] for i in kept])
    frames = Frames([images[i] for i in kept], times[kept], matrices[:, :3, 3], matrices[:, :3, :3])
    return frames, _dropped(len(images) - len(kept), len(images), "in its .pose.txt file")


def _check_any(folder: Path, n: int, where: str, of: int) -> None:
    if n == 0:
        raise InputError(
            folder,
            f"none of {of} depth images has a pose {where}",
            "check that images and poses belong together and share a clock",
        )


def _dropped(n: int, of: int, where: str) -> tuple[str, ...]:
    return (f"{n} of {of} depth images have no pose {where}: left out.",) if n else ()


def _intrinsics(
    folder: Path, places: list[Path], image: Path, params: DepthParams
) -> tuple[tuple[float, float, float, float], tuple[str, ...]]:
    """Return fx, fy, cx, cy and a note if they are the benchmark's default."""
    if params.intrinsics is not None:
        return params.intrinsics, ()
    for path in (place / name for place in places for name in INTRINSICS):
        if path.is_file():
            return (_from_json if path.suffix == ".json" else _from_text)(path), ()
    if read_depth(image).shape != (480, 640):
        raise InputError(
            folder,
            f"no intrinsics file, and the images are not 640 x 480 but {read_depth(image).shape}",
            f"add {INTRINSICS[0]} (a 3x3 matrix) or set 'intrinsics'",
        )
    fx, fy, cx, cy = TUM_DEFAULT
    return TUM_DEFAULT, (
        f"No intrinsics file: taken as fx = {fx}, fy = {fy}, cx = {cx}, cy = {cy} (a Kinect's).",
    )


def _from_text(path: Path) -> tuple[float, float, float, float]:
    return _checked(path, read_matrix(path, (3, 3)))


def _from_json(path: Path) -> tuple[float, float, float, float]:
    """Return intrinsics of {"fx", "fy", "cx", "cy"} or {"intrinsic_matrix": 9 by columns}."""
    size_of(path)
    try:
        values: Any = json.loads(path.read_text("utf-8"))
        if "intrinsic_matrix" in values:  # as Open3D writes it
            return _checked(path, np.array(values["intrinsic_matrix"], float).reshape(3, 3).T)
        fx, fy, cx, cy = (float(values[name]) for name in ("fx", "fy", "cx", "cy"))
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(
            path, "holds no camera intrinsics", "expected the numbers fx, fy, cx and cy"
        ) from error
    return _checked(path, np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]))


def _checked(path: Path, K: NDArray[np.float64]) -> tuple[float, float, float, float]:
    if not (np.isfinite(K).all() and K[0, 0] > 0 and K[1, 1] > 0):
        raise InputError(
            path, f"focal lengths are {K[0, 0]:g} and {K[1, 1]:g}", "expected positive pixels"
        )
    return float(K[0, 0]), float(K[1, 1]), float(K[0, 2]), float(K[1, 2])
