"""The record of one scan: what was read, what was dropped, what was guessed."""

from dataclasses import dataclass, fields

import pyarrow as pa

from storage.artifacts import Kind, column, register, schema


@dataclass(frozen=True)
class Scan:
    """One scan as it was read."""

    name: str
    format: str
    """ply, pcd, xyz, las, e57, depth, 3dtk or bundle"""
    points_read: int
    """points in the file"""
    points_kept: int
    """points that became the cloud"""
    points_not_finite: int
    """points dropped: a coordinate was NaN or infinite, or stood for 'nothing seen'"""
    points_cropped: int
    """points dropped: outside the crop box"""
    snapshots: int
    """snapshots with a pose; 0 if the file has none"""
    up: str
    """the file's up axis: x, y or z, with its sign"""
    up_guessed: bool
    scale: float
    """metres per unit of the file"""
    scale_guessed: bool
    simulated: bool
    """whether the bundle says that nobody ever made the scan"""
    notes: str
    """what a person should know: guesses and their reasons, gaps in the poses; '' if nothing"""


SCHEMA = schema(
    "scans",
    [
        column("name", pa.string(), "name of the scan"),
        column("format", pa.string(), "ply, pcd, xyz, las, e57, depth or bundle"),
        column("points_read", pa.int64(), "points in the file"),
        column("points_kept", pa.int64(), "points that became the cloud"),
        column("points_not_finite", pa.int64(), "dropped: NaN, infinite or 'nothing seen'"),
        column("points_cropped", pa.int64(), "dropped: outside the crop box"),
        column("snapshots", pa.int64(), "snapshots with a pose"),
        column("up", pa.string(), "the file's up axis with its sign"),
        column("up_guessed", pa.bool_(), "the up axis was not set but certain from the cloud"),
        column("scale", pa.float64(), "metres per unit of the file"),
        column("scale_guessed", pa.bool_(), "the unit was not set but certain from the cloud"),
        column("simulated", pa.bool_(), "the bundle says that it was simulated"),
        column("notes", pa.string(), "guesses and their reasons, gaps in the poses"),
    ],
)


def to_table(scan: Scan) -> pa.Table:
    """Return the one-row table of a scan."""
    return pa.Table.from_pylist([{f.name: getattr(scan, f.name) for f in fields(scan)}], SCHEMA)


def from_table(table: pa.Table) -> Scan:
    """Return the scan a one-row table holds."""
    return Scan(**table.to_pylist()[0])


SCANS = register(Kind("scans", Scan, SCHEMA, to_table, from_table))
