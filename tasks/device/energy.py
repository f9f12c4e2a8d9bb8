"""The energy of a campaign under three methods, simulated (Sec. 7.3.2, Fig. 19)."""

from collections.abc import Iterator
from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from storage.energy import BASELINES, MAPSENSE, METHODS, QUERIES, STOREY, Energy
from storage.savings import Savings
from storage.scan_work import ScanWork
from tasks.device.costs import EnergyParams, scan_costs
from tasks.device.queries import Answers, answer, draw_recordings, rooms_of

CONFIDENCE = 0.95


def simulate_energy(work: ScanWork, params: EnergyParams) -> Energy:
    """Return the energy devices take to answer sensing queries, summed over the queries.

    Parameters
    ----------
    work : ScanWork
        The campaign's recordings; what it lacks, a repeated query cannot draw.

    Returns
    -------
    Energy
        For each storey, method and seed the first n queries (Fig. 19a), and one query for each of
        the storey's rooms (Fig. 19b).

    Notes
    -----
    E = E_capture + E_process + E_transmit per scan made. A scan the device rejects is made again
    without an upload, one the server finds unusable costs a full cycle again (`queries`).
    """
    costs = scan_costs(work, params)
    rows: list[dict[str, str | float]] = []
    for storey in np.unique(work.storeys).tolist():
        n_rooms = len(rooms_of(work, storey))
        most = max((n_rooms, *params.n_queries))
        for seed in params.seeds:
            draws = draw_recordings(work, storey, seed, most, params.attempts_max)
            for method in METHODS:
                sums = _sums(answer(draws, costs[method], work.usable))
                place = {"storeys": storey, "methods": method, "seeds": seed}
                for n in params.n_queries:
                    rows.append({"series": QUERIES, **place, **_after(sums, n)})
                rows.append({"series": STOREY, **place, **_after(sums, n_rooms)})
    rows.sort(key=lambda row: (row["series"], row["storeys"], row["methods"], row["n_queries"]))
    return Energy(
        **{f.name: _column([row[f.name] for row in rows], f.name) for f in fields(Energy)}
    )


def savings(energy: Energy) -> Savings:
    """Return what MapSense saves against each baseline: the mean over the seeds, its interval.

    Notes
    -----
    The interval is Student's, of the mean of the savings per seed.
    """
    rows = [
        (*key, baseline, *_interval(saving(ours[0], theirs[0])), ours[1].mean(), theirs[1].mean())
        for key, baseline, ours, theirs in _pairs(energy)
    ]
    columns = list(zip(*rows, strict=True)) or [()] * len(fields(Savings))
    types = (np.str_, np.str_, np.int64, np.str_, np.int64, *[np.float64] * 5)
    return Savings(*(np.array(c, type_) for c, type_ in zip(columns, types, strict=True)))


def saving(mapsense_j: NDArray[np.float64], baseline_j: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the share of the baseline's joules that MapSense saves; NaN where that takes none."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(baseline_j > 0, 1 - mapsense_j / baseline_j, np.nan)


def _interval(values: NDArray[np.float64]) -> tuple[int, float, float, float]:
    """Return the number of values, their mean, and the ends of its interval (NaN for one value)."""
    n, mean = len(values), values.mean()
    half = np.nan
    if n > 1:
        half = student.ppf((1 + CONFIDENCE) / 2, n - 1) * values.std(ddof=1) / np.sqrt(n)
    return n, mean, mean - half, mean + half


PerSeed = tuple[NDArray[np.float64], NDArray[np.float64]]
"""The joules and the unanswered queries of each seed."""


def _pairs(
    energy: Energy,
) -> Iterator[tuple[tuple[str, str, int], str, PerSeed, PerSeed]]:
    """Yield (series, storey, n_queries), a baseline, MapSense's figures and the baseline's."""
    keys = list(
        zip(energy.series.tolist(), energy.storeys.tolist(), energy.n_queries.tolist(), strict=True)
    )
    rows: dict[tuple[tuple[str, str, int], str], list[int]] = {}
    for row, (key, method) in enumerate(zip(keys, energy.methods.tolist(), strict=True)):
        rows.setdefault((key, method), []).append(row)

    def per_seed(key: tuple[str, str, int], method: str) -> PerSeed:
        of_method = np.array(rows[key, method])
        of_method = of_method[np.argsort(energy.seeds[of_method], kind="stable")]
        return energy.total_j[of_method], energy.unanswered[of_method].astype(np.float64)

    for key in dict.fromkeys(keys):
        ours = per_seed(key, MAPSENSE)
        for baseline in BASELINES:
            yield key, baseline, ours, per_seed(key, baseline)


def _sums(answers: Answers) -> dict[str, NDArray[np.float64] | NDArray[np.int64]]:
    """Return each quantity accumulated over the queries."""
    quantities = {f.name: getattr(answers, f.name) for f in fields(answers)}
    sums = {name: np.cumsum(each) for name, each in quantities.items()}
    sums["uploads"] = sums["captures"] - sums["rejected"]
    sums["total_j"] = sums["capture_j"] + sums["process_j"] + sums["transmit_j"]
    return sums


def _after(
    sums: dict[str, NDArray[np.float64] | NDArray[np.int64]], n: int
) -> dict[str, str | float]:
    return {"n_queries": n, **{name: each[n - 1].item() for name, each in sums.items()}}


def _column(values: list[str | float], name: str) -> NDArray[Any]:
    if name in ("series", "storeys", "methods"):
        return np.array(values, np.str_)
    return np.array(values, float if name.endswith("_j") else np.int64)
