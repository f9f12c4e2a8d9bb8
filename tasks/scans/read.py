"""A scan as people have it -> the registered cloud, its snapshots, and a record of the reading."""

from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import field_validator

from storage.errors import InputError
from storage.points import PointCloud
from storage.scans import Scan
from storage.snapshots import Snapshots, none
from storage.sources import Source
from tasks.scans.assemble import Assembled, Frame, assemble, origin_of, sample_of
from tasks.scans.bundle import read_bundle
from tasks.scans.depth import DepthParams, Positive
from tasks.scans.e57 import read_e57
from tasks.scans.formats import format_of
from tasks.scans.guesses import Guess, guess_scale, guess_up
from tasks.scans.las import read_las
from tasks.scans.pcd import read_pcd
from tasks.scans.ply import read_ply
from tasks.scans.poses import AXES, building_from_file, parse_vector, rotations_of_device
from tasks.scans.raw import RawCloud, unreadable
from tasks.scans.sequences import read_seven_scenes, read_tum
from tasks.scans.text import read_text
from tasks.scans.threedtk import read_threedtk

READERS = {
    "ply": read_ply,
    "pcd": read_pcd,
    "xyz": read_text,
    "las": read_las,
    "e57": read_e57,
    "3dtk": read_threedtk,
    "bundle": read_bundle,
}
SEQUENCES = {"tum": read_tum, "7scenes": read_seven_scenes}


class ReadParams(DepthParams):
    """How a scan is read. Not in the paper, whose scans come from one kind of device."""

    up: str = "auto"
    """The file's up: x, -x, y, -y, z, -z, or a vector "0.02,-0.89,-0.46" in its coordinates.
    auto = by the format's standard, else y where the cloud makes it certain, else z. Not in the
    paper."""
    scale: Positive | None = None
    """Metres per unit of the file; None = by the format's standard, else centimetres or
    millimetres where the cloud makes it certain, else metres. Not in the paper."""
    handed: Literal["right", "left"] | None = None
    """Handedness of the file's axes; None = by the format: left for 3DTK, right for all others.
    Not in the paper."""
    crop: tuple[float, float, float, float, float, float] | None = None
    """Box to keep: xmin, ymin, zmin, xmax, ymax, zmax, metres, building frame; None = all. Not in
    the paper."""

    @field_validator("up")
    @classmethod
    def _is_a_direction(cls, value: str) -> str:
        if value != "auto" and value not in AXES:
            parse_vector(value)
        return value

    @field_validator("crop")
    @classmethod
    def _is_a_box(cls, value: tuple[float, ...] | None) -> tuple[float, ...] | None:
        if value is not None and not all(low < high for low, high in zip(value, value[3:])):  # noqa: B905
            raise ValueError("crop: expected xmin,ymin,zmin,xmax,ymax,zmax, each min below its max")
        return value


def read_scan(source: Source, params: ReadParams) -> tuple[PointCloud, Snapshots, Scan]:
    """Return the registered cloud of a scan, its snapshots, and the record of the reading.

    Parameters
    ----------
    source : Source
        The file or folder; its format goes by its suffix or layout.
    params : ReadParams

    Returns
    -------
    tuple
        Points in the building frame (z up, metres), snapshots in the same frame with device
        poses, and what was read, dropped and guessed.

    Raises
    ------
    InputError
        If the scan cannot be read, or holds no points that could be a room.
    """
    path = Path(source.path)
    format_ = format_of(path)
    try:
        if (sequence := SEQUENCES.get(format_)) is not None:
            raw = sequence(path, params)
        else:
            raw = READERS[format_](path)
    except OSError as error:
        raise unreadable(path, error) from error
    return _registered(source, "depth" if format_ in SEQUENCES else format_, raw, params)


def _registered(
    source: Source, format_: str, raw: RawCloud, params: ReadParams
) -> tuple[PointCloud, Snapshots, Scan]:
    path = Path(source.path)
    coarse = _coarse_note(raw)
    sample = sample_of(raw.chunks)
    if len(sample) == 0:
        raise InputError(
            path,
            f"none of its {raw.points_read} points is usable",
            "check the export: it holds no finite coordinates",
        )
    up = _up(raw, params, sample)
    turn = building_from_file(str(up.value), params.handed or raw.convention.handed)
    scale = _scale(raw, params, sample @ turn.T)
    frame = Frame(turn, float(scale.value))
    done = assemble(path, raw, frame, origin_of(frame.apply(sample)), params.crop)
    snapshots = _snapshots(raw, frame, done)
    far = f"{done.too_far} points lie over 2,000 km away: dropped." if done.too_far else ""
    scan = Scan(
        name=source.name,
        format=format_,
        points_read=raw.points_read,
        points_kept=len(done.cloud),
        points_not_finite=raw.points_invalid + done.not_finite + done.too_far,
        points_cropped=done.cropped,
        snapshots=len(snapshots),
        up=str(up.value),
        up_guessed=up.guessed,
        scale=float(scale.value),
        scale_guessed=scale.guessed,
        simulated=raw.simulated,
        notes=" ".join(note for note in (*raw.notes, up.note, scale.note, coarse, far) if note),
    )
    return done.cloud, snapshots, scan


def _up(raw: RawCloud, params: ReadParams, sample: NDArray[np.float64]) -> Guess:
    if params.up != "auto":
        return Guess(params.up, False)
    if raw.convention.up is not None:
        return Guess(raw.convention.up, False)
    if not raw.convention.levelled:
        return Guess("z", False, "Up axis taken as z, but the poses may not be level: set 'up'.")
    return guess_up(sample)


def _scale(raw: RawCloud, params: ReadParams, sample: NDArray[np.float64]) -> Guess:
    if params.scale is not None:
        return Guess(params.scale, False)
    if raw.convention.scale is not None:
        return Guess(raw.convention.scale, False)
    return guess_scale(sample)


def _snapshots(raw: RawCloud, frame: Frame, done: Assembled) -> Snapshots:
    if raw.poses is None:
        return none()
    return Snapshots(
        times=raw.poses.times,
        positions=frame.apply(raw.poses.positions),
        rotations=rotations_of_device(raw.poses, frame.turn),
        points=done.seen if raw.poses.points is None else raw.poses.points,
    )


def _coarse_note(raw: RawCloud) -> str:
    """Return a note if the file's own numbers are too coarse for where the points lie."""
    for chunk in raw.chunks[:1]:
        largest = float(np.abs(chunk.xyz[:1000]).max(initial=0))
        if chunk.xyz.dtype.itemsize == 4 and np.isfinite(largest):
            step = float(np.spacing(np.float32(largest)))
            if step > 1e-3 and largest > 1e4:
                return (
                    f"The file stores coordinates of {largest:.0f} in 32 bits, in steps of "
                    f"{step:.2g} units: export it with 64 bits or relative to a local origin."
                )
    return ""
