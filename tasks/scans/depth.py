"""Depth images with a pose each: one snapshot per image."""

import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Self

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PositiveInt, model_validator

from storage.errors import InputError
from tasks.params import Params
from tasks.scans.raw import CAMERA, Chunk, Convention, Poses, RawCloud, size_of, unreadable
from tasks.scans.registration import register

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]

NOTHING = (0, 65535)
"""Values of a 16-bit depth image that stand for 'nothing seen'."""

_SIGNATURE = b"\x89PNG\r\n\x1a\n"


class DepthParams(Params):
    """How depth sequences are read."""

    depth_factor: Positive | None = None
    """Depth image units per metre; None = by the layout: 5000 for TUM, 1000 (millimetres) for
    7-Scenes. Not in the paper."""
    depth_min: Annotated[float, Field(ge=0)] = 0.3
    """Least depth taken, metres: nearer is inside the sensor's blind range. Not in the paper."""
    depth_max: Positive = 4.5
    """Greatest depth taken, metres: a structured-light sensor's noise grows with its square.
    Not in the paper."""
    depth_stride: PositiveInt = 2
    """Every how many-th pixel of a row and of a column is taken: at 3 m and 2 the spacing is
    1 cm, below the voxel edge. Not in the paper."""
    pose_gap_s: Positive = 0.02
    """Greatest time between an image and its pose, seconds; an image without a pose is dropped.
    The default of the TUM benchmark's own association. Not in the paper."""
    frame_rate_hz: Positive = 30.0
    """Images a second where frames are only numbered (7-Scenes: 30). Not in the paper."""
    intrinsics: tuple[Positive, Positive, float, float] | None = None
    """fx, fy, cx, cy of the depth camera, pixels; None = by the scan's intrinsics file.
    Not in the paper."""
    trajectory: Annotated[str, Field(pattern=r"^[^/\\]+\.txt$")] | None = None
    """Name of the trajectory file (.txt) in the scan's folder, if not the one of its layout. Not
    in the paper."""

    @model_validator(mode="after")
    def _limits_are_in_order(self) -> Self:
        if self.depth_min >= self.depth_max:
            raise ValueError(f"depth_min: expected less than depth_max, got {self.depth_min}")
        return self


@dataclass(frozen=True, eq=False)
class Frames:
    """k depth images, each with its pose, by time."""

    images: list[Path]
    times: NDArray[np.float64]
    """(k,), seconds"""
    positions: NDArray[np.float64]
    """(k, 3), file unit"""
    rotations: NDArray[np.float64]
    """(k, 3, 3), camera frame -> file frame"""


def back_project(
    frames: Frames,
    intrinsics: tuple[float, float, float, float],
    factor: float,
    params: DepthParams,
    notes: tuple[str, ...] = (),
    convention: Convention = Convention(),  # noqa: B008  (frozen)
) -> RawCloud:
    """Return the points all images saw, in the frame of the poses.

    Parameters
    ----------
    frames : Frames
    intrinsics : (4,) float
        fx, fy, cx, cy, pixels.
    factor : float
        Depth image units per metre.
    params : DepthParams
        Stride and limits of depth.
    notes : tuple of str
    convention : Convention
        Passed on, as the notes are.
    """
    poses = Poses(frames.times, frames.positions, frames.rotations, CAMERA)
    chunks: list[Chunk] = []
    read = 0
    for index, path in enumerate(frames.images):
        depth = read_depth(path)[:: params.depth_stride, :: params.depth_stride]
        seen = _in_camera(depth, intrinsics, factor, params)
        chunks.append(Chunk(register(seen, index, poses), index))
        read += depth.size
    kept = sum(len(chunk.xyz) for chunk in chunks)
    return RawCloud(chunks, read, read - kept, poses, convention, notes)


def read_depth(path: Path) -> NDArray[np.uint16]:
    """Return a 16-bit, one-channel PNG image, or raise InputError."""
    size_of(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise unreadable(path, error) from error
    if not _is_whole(data):
        raise InputError(path, "is no whole PNG image", "it is damaged or cut: copy it again")
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise InputError(path, "cannot be read as a PNG image", "it is damaged: copy it again")
    if image.dtype != np.uint16 or image.ndim != 2:
        channels = 1 if image.ndim == 2 else image.shape[2]
        raise InputError(
            path,
            f"is an image of {8 * image.itemsize} bits and {channels} channels",
            "expected depth as 16 bits and one channel",
        )
    depth: NDArray[np.uint16] = image
    return depth


def _in_camera(
    depth: NDArray[np.uint16],
    intrinsics: tuple[float, float, float, float],
    factor: float,
    params: DepthParams,
) -> NDArray[np.float64]:
    """Return (m, 3) points in the camera frame, metres."""
    fx, fy, cx, cy = intrinsics
    metres = depth / factor
    seen = (metres >= params.depth_min) & (metres <= params.depth_max)
    for value in NOTHING:
        seen &= depth != value
    rows, columns = np.nonzero(seen)
    z = metres[rows, columns]
    x = (columns * params.depth_stride - cx) / fx * z
    y = (rows * params.depth_stride - cy) / fy * z
    return np.stack([x, y, z], axis=1)


def _is_whole(data: bytes) -> bool:
    """Return whether all of a PNG's chunks are there: OpenCV fills a cut image with zeros."""
    if not data.startswith(_SIGNATURE):
        return False
    at = len(_SIGNATURE)
    while at + 12 <= len(data):
        end = at + 8 + int.from_bytes(data[at : at + 4], "big")
        if zlib.crc32(data[at + 4 : end]) != int.from_bytes(data[end : end + 4], "big"):
            return False
        if data[at + 4 : at + 8] == b"IEND":
            return True
        at = end + 4
    return False
