"""The repeat loop: sensing queries, the scans that answer them, and what that takes.

A query asks for one room. Its first scan is one of the campaign's recordings of that room, drawn
at random; every repeat is another of them, whoever made it, and when all are used up a recording of
any room of the storey stands in for one more scan. Which recordings come, and in which order, is
the same for every method, so that methods differ by what they do, not by luck.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from storage.scan_work import ScanWork
from tasks.device.costs import Costs

Draws = NDArray[np.int64]
"""(..., q, a): the recording made at the i-th attempt at each query"""


@dataclass(frozen=True, eq=False)
class Answers:
    """What (..., q) queries took, repeats included."""

    captures: NDArray[np.int64]
    """scans made"""
    rejected: NDArray[np.int64]
    """scans kept back by the device"""
    unanswered: NDArray[np.int64]
    """1 if no usable scan came"""
    capture_j: NDArray[np.float64]
    """joules of scanning"""
    process_j: NDArray[np.float64]
    """joules of computing"""
    transmit_j: NDArray[np.float64]
    """joules of uploading"""

    @property
    def total_j(self) -> NDArray[np.float64]:
        """Joules of all three."""
        return self.capture_j + self.process_j + self.transmit_j


def rooms_of(work: ScanWork, storey: str) -> NDArray[np.str_]:
    """Return the rooms of a storey that have a recording, sorted."""
    return np.unique(work.rooms[work.storeys == storey])


def draw_recordings(
    work: ScanWork, storey: str, seed: int, n_queries: int, attempts_max: int
) -> Draws:
    """Return the recordings that come, attempt after attempt, for each query about a storey.

    Returns
    -------
    (q, a) int
        Rows of `work`. The rooms come in random order, none twice before all came once. Fewer
        queries or attempts give the first of the same ones.
    """
    name = list(storey.encode())
    of_storey = np.flatnonzero(work.storeys == storey)
    rooms = rooms_of(work, storey)
    recordings = [of_storey[work.rooms[of_storey] == room] for room in rooms]
    order = np.random.default_rng([seed, *name])
    cycles = [order.permutation(len(rooms)) for _ in range(-(-n_queries // len(rooms)))]
    draws = np.empty((n_queries, attempts_max), np.int64)
    for query, room in enumerate(np.concatenate(cycles)[:n_queries]):
        rng = np.random.default_rng([seed, query, *name])
        own = rng.permutation(recordings[room])[:attempts_max]
        others = rng.choice(of_storey, attempts_max)[: attempts_max - len(own)]
        draws[query] = np.concatenate([own, others])
    return draws


def answer(draws: Draws, costs: Costs, usable: NDArray[np.bool_]) -> Answers:
    """Return what each query takes under one method.

    Parameters
    ----------
    draws : (..., q, a) int
    costs : what each recording costs under the method
    usable : (s,) bool
        Whether the server takes it; if not, it asks again.
    """
    rejected = costs.rejected[draws]
    taken = usable[draws] & ~rejected
    taken_before: NDArray[np.int64] = np.cumsum(taken, axis=-1) - taken
    made = taken_before == 0
    sent = made & ~rejected

    def total(joules: NDArray[np.float64], which: NDArray[np.bool_]) -> NDArray[np.float64]:
        return np.where(which, joules[draws], 0.0).sum(axis=-1)

    return Answers(
        captures=made.sum(axis=-1),
        rejected=(made & rejected).sum(axis=-1),
        unanswered=np.all(~taken, axis=-1).astype(np.int64),
        capture_j=total(costs.capture_j, made),
        process_j=total(costs.gate_j, made) + total(costs.process_j, sent),
        transmit_j=total(costs.transmit_j, sent),
    )
