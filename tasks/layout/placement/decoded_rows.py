"""What was decoded along each reference line, beside what was observed there."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from storage.layout import LINE_END, Layout
from storage.observations import Observations
from tasks.layout.extraction.model import LineFrame
from tasks.layout.placement.widths import Chain

BESIDE_M = 0.3
"""A room right beside a wall is there, this far from the wall's centre, metres."""
HIDDEN_SIGMA_M = 1.0
"""What the decoder says of a wall nobody saw counts as little as this, metres."""


@dataclass(frozen=True, eq=False)
class DecodedRow:
    """n rooms decoded along one line, in order; m cuts and m + 1 intervals were observed there."""

    frame: LineFrame
    decoded: NDArray[np.int64]
    """(n,), row of each in the layout"""
    chain: Chain
    faces_m: NDArray[np.float64]
    """(n + 1, 2), observed lower and upper face of each boundary's wall, be it a cut or the wall
    that the line ends at; NaN unseen"""
    presence: NDArray[np.float64]
    """(n + 1,), 0 where nothing was seen"""
    cuts: NDArray[np.int64]
    """(n + 1,), cut of the line that each boundary is; HIDDEN or LINE_END"""
    interval_m: NDArray[np.float64]
    """(m + 1, 2), from and to"""
    standing: NDArray[np.int64]
    """(m + 1,), room of the initial model on each interval, -1 none"""
    line_faces_m: NDArray[np.float64]
    """(m, 2), faces of all cuts of the line"""
    line_presence: NDArray[np.float64]
    """(m,)"""
    depth_m: float
    """how deep its rooms usually are, from the line on; infinite where that is not known"""

    @property
    def walled_ends(self) -> NDArray[np.bool_]:
        """(n + 1,), where the line ends at a wall of which a face was seen."""
        return (self.cuts == LINE_END) & ~np.isnan(self.faces_m).all(axis=1)

    @property
    def two_faced(self) -> NDArray[np.bool_]:
        """(n + 1,), which boundaries' walls were seen from both sides."""
        return ~(np.isnan(self.faces_m[:, 0]) | np.isnan(self.faces_m[:, 1]))

    def firm(self, presence: float) -> NDArray[np.bool_]:
        """Return which boundaries were well observed: both faces, and surely a wall, (n + 1,)."""
        return self.two_faced & (self.presence >= presence)

    def room_beside(self, boundary: int, side: int) -> int:
        """Return the initial room before (side 0) or after (1) a boundary's wall, -1 for none."""
        at = self.chain.observed_m[boundary] + (BESIDE_M if side else -BESIDE_M)
        on = np.flatnonzero((self.interval_m[:, 0] <= at) & (at <= self.interval_m[:, 1]))
        return int(self.standing[on[0]]) if len(on) else -1

    def stretch_m(self, room: int) -> NDArray[np.float64]:
        """Return the intervals on which a room stands, (i, 2)."""
        return self.interval_m[self.standing == room]


def decoded_rows(
    observations: Observations, layout: Layout, end_sigma_m: float
) -> list[DecodedRow]:
    """Return the best hypothesis of each line beside its observations; lines without one aside.

    Parameters
    ----------
    end_sigma_m : float
        Standard deviation of where a line ends.
    """
    best = np.flatnonzero(layout.hypotheses == 0)
    rows = []
    for line, name in enumerate(observations.line_ids):
        decoded = best[layout.line_ids[best] == name]
        decoded = decoded[np.argsort(layout.orders[decoded], kind="stable")]
        if len(decoded):
            rows.append(_row(observations, layout, line, decoded, end_sigma_m))
    return rows


def _row(
    observations: Observations,
    layout: Layout,
    line: int,
    decoded: NDArray[np.int64],
    end_sigma_m: float,
) -> DecodedRow:
    of_line = np.flatnonzero(observations.lines == line)
    cuts = np.append(layout.from_cuts[decoded], layout.to_cuts[decoded[-1]])
    position = np.append(layout.from_m[decoded], layout.to_m[decoded[-1]])
    sigma = np.where(cuts == LINE_END, end_sigma_m, HIDDEN_SIGMA_M)
    faces, presence = np.full((len(cuts), 2), np.nan), np.zeros(len(cuts))
    known = ~np.isnan(observations.end_sigma_m[line])
    ends = np.array([0, len(cuts) - 1])[known]
    sigma[ends] = observations.end_sigma_m[line, known]
    faces[ends] = observations.end_faces_m[line, known]
    seen = cuts >= 0
    at = of_line[cuts[seen]]
    position[seen], sigma[seen] = observations.cut_m[at], observations.sigma_m[at]
    faces[seen], presence[seen] = observations.faces_m[at], observations.presence[at]
    intervals = np.flatnonzero(observations.interval_lines == line)
    return DecodedRow(
        frame=LineFrame.between(observations.starts[line], observations.ends[line]),
        decoded=decoded,
        chain=Chain(position, sigma, layout.widths_m[decoded], layout.spreads_m[decoded]),
        faces_m=faces,
        presence=presence,
        cuts=cuts,
        interval_m=np.column_stack([observations.from_m[intervals], observations.to_m[intervals]]),
        standing=observations.rooms[intervals],
        line_faces_m=observations.faces_m[of_line],
        line_presence=observations.presence[of_line],
        depth_m=_usual(observations.depth_m[intervals]),
    )


def _usual(depth_m: NDArray[np.float64]) -> float:
    known = depth_m[~np.isnan(depth_m)]
    return float(np.median(known)) if len(known) else float("inf")


def main_rows(rows: Sequence[DecodedRow], count: int) -> NDArray[np.int64]:
    """Return for each of `count` initial rooms the row it stands on longest, -1 for none.

    A room may stand on two lines. One of them says how it is joined, cut and called; both say
    where its walls are.
    """
    if not len(rows):
        return np.full(count, -1)
    stands = np.zeros((len(rows), count))
    for number, row in enumerate(rows):
        on = row.standing >= 0
        np.add.at(stands[number], row.standing[on], np.diff(row.interval_m, axis=1)[on, 0])
    return np.where(stands.max(axis=0) > 0, stands.argmax(axis=0), -1)
