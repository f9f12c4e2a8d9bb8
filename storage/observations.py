"""What a storey's initial model says along its reference lines: walls seen, rooms between them."""

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from storage.artifacts import Kind, column, register, schema


@dataclass(frozen=True, eq=False)
class Observations:
    """l lines with n cuts between n + l intervals; entry i is one of them in every array.

    A cut is an observed wall across a line, an interval is what lies between two cuts that follow
    each other, or between a cut and an end of the line. Both run line after line, from start to
    end. Building frame; positions are metres along the line from its start.
    """

    line_ids: NDArray[np.str_]
    """(l,)"""
    starts: NDArray[np.float64]
    """(l, 2), where each line starts: rooms lie to the left of one who walks to its end"""
    ends: NDArray[np.float64]
    """(l, 2)"""
    end_sigma_m: NDArray[np.float64]
    """(l, 2), standard deviations of the centres of the walls that each line starts and ends at;
    NaN where it starts or ends at none"""
    end_faces_m: NDArray[np.float64]
    """(l, 2, 2), these walls' lower and upper faces along the line; NaN where not seen"""
    lines: NDArray[np.int64]
    """(n,), line of each cut, never falling"""
    cut_m: NDArray[np.float64]
    """(n,), centre of the wall; rises within a line, strictly between 0 and its length"""
    sigma_m: NDArray[np.float64]
    """(n,), standard deviation of `cut_m`"""
    faces_m: NDArray[np.float64]
    """(n, 2), the wall's lower and upper face; NaN where not seen"""
    scans: NDArray[np.int64]
    """(n,), scans that saw it"""
    presence: NDArray[np.float64]
    """(n,), probability that it is a wall that divides rooms"""
    interval_lines: NDArray[np.int64]
    """(n + l,), line of each interval, never falling"""
    from_m: NDArray[np.float64]
    """(n + l,)"""
    to_m: NDArray[np.float64]
    """(n + l,)"""
    rooms: NDArray[np.int64]
    """(n + l,), room of the initial model that stands there, -1 none"""
    depth_m: NDArray[np.float64]
    """(n + l,), from the line to the opposite wall's face; NaN unknown"""
    outliers: tuple[tuple[int, ...], ...] = ()
    """of each cut the scans, by place in the storey's list, whose wall lies off what the others
    agree on; () as a whole where scans were not compared"""

    def __len__(self) -> int:
        return len(self.line_ids)

    @property
    def lengths_m(self) -> NDArray[np.float64]:
        """(l,), length of each line."""
        return np.linalg.norm(self.ends - self.starts, axis=1)


_LINE = ("start_x_m", "start_y_m", "end_x_m", "end_y_m")
_ENDS = tuple(
    f"{end}_{name}_m" for end in ("start", "end") for name in ("sigma", "lower_face", "upper_face")
)
_CUT = ("cut_m", "cut_sigma_m", "lower_face_m", "upper_face_m", "presence")
SCHEMA = schema(
    "observations",
    [
        column("line", pa.string(), "reference line"),
        *(column(name, pa.float64(), "of the reference line, building frame") for name in _LINE),
        *(column(n, pa.float64(), "of the wall the line has there", nullable=True) for n in _ENDS),
        column("from_m", pa.float64(), "start of the interval along the line"),
        column("to_m", pa.float64(), "end of the interval along the line"),
        column("room", pa.int64(), "initial model's room there", nullable=True),
        column("depth_m", pa.float64(), "to the opposite wall's face", nullable=True),
        column("cut_m", pa.float64(), "wall at the interval's end", nullable=True),
        column("cut_sigma_m", pa.float64(), "its standard deviation", nullable=True),
        column("lower_face_m", pa.float64(), "its face on this interval's side", nullable=True),
        column("upper_face_m", pa.float64(), "its face on the next one's side", nullable=True),
        column("presence", pa.float64(), "probability that it divides rooms", nullable=True),
        column("scans", pa.int64(), "scans that saw it", nullable=True),
        column("outliers", pa.list_(pa.int64()), "scans that disagree on it", nullable=True),
    ],
)


def to_table(found: Observations) -> pa.Table:
    """Return one row per interval, with the wall at its end; a line's last one has none."""
    lines = found.interval_lines
    last = np.append(np.diff(lines) > 0, True)[: len(lines)]
    cuts = np.full((len(lines), len(_CUT)), np.nan)
    cuts[~last] = np.column_stack([found.cut_m, found.sigma_m, found.faces_m, found.presence])
    scans = np.zeros(len(lines), np.int64)
    scans[~last] = found.scans
    compared = iter(found.outliers)
    outliers = [None if end or not found.outliers else list(next(compared)) for end in last]
    of_line = np.hstack([found.starts, found.ends]).reshape(-1, 4)[lines]
    at_ends = np.concatenate([found.end_sigma_m[..., None], found.end_faces_m], axis=-1)
    at_ends = at_ends.reshape(-1, len(_ENDS))[lines]
    columns = [
        pa.array([str(found.line_ids[i]) for i in lines], pa.string()),
        *(pa.array(of_line[:, i]) for i in range(len(_LINE))),
        *(pa.array(at_ends[:, i], from_pandas=True) for i in range(len(_ENDS))),
        pa.array(found.from_m),
        pa.array(found.to_m),
        pa.array(found.rooms, mask=found.rooms < 0),
        pa.array(found.depth_m, from_pandas=True),
        *(pa.array(cuts[:, i], from_pandas=True) for i in range(len(_CUT))),
        pa.array(scans, mask=last),
        pa.array(outliers, pa.list_(pa.int64())),
    ]
    return pa.table(columns, schema=SCHEMA)


def from_table(table: pa.Table) -> Observations:
    """Return the observations a table holds."""
    ids = table["line"].to_pylist()
    line_ids = list(dict.fromkeys(ids))
    lines = np.array([line_ids.index(i) for i in ids], np.int64)
    first = np.append(True, np.diff(lines) > 0)[: len(lines)]
    not_last = np.append(~first[1:], False)[: len(lines)]
    number = {name: table[name].to_numpy().astype(float) for name in (*_LINE, *_ENDS, *_CUT)}
    at_ends = np.column_stack([number[n] for n in _ENDS])[first].reshape(-1, 2, 3)
    outliers = table["outliers"].to_pylist()
    compared = [tuple(o) for o in outliers if o is not None]
    return Observations(
        line_ids=np.array(line_ids, np.str_),
        starts=np.column_stack([number[n] for n in _LINE[:2]])[first],
        ends=np.column_stack([number[n] for n in _LINE[2:]])[first],
        end_sigma_m=at_ends[..., 0],
        end_faces_m=at_ends[..., 1:],
        lines=lines[not_last],
        cut_m=number["cut_m"][not_last],
        sigma_m=number["cut_sigma_m"][not_last],
        faces_m=np.column_stack([number[n] for n in _CUT[2:4]])[not_last],
        scans=table["scans"].fill_null(0).to_numpy()[not_last],
        presence=number["presence"][not_last],
        interval_lines=lines,
        from_m=table["from_m"].to_numpy(),
        to_m=table["to_m"].to_numpy(),
        rooms=table["room"].fill_null(-1).to_numpy(),
        depth_m=table["depth_m"].to_numpy().astype(float),
        outliers=tuple(compared),
    )


OBSERVATIONS = register(Kind("observations", Observations, SCHEMA, to_table, from_table))
