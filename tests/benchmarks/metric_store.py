"""A store of as many metric rows and files as wanted, as flows would leave it."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from itertools import product
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from flows.params import MapSenseParams
from storage import detections, energy, quality, runs, stages, wall_quality
from storage.artifacts import Place

START = datetime(2026, 1, 1, tzinfo=UTC)
BUILDINGS, STOREYS, VARIANTS, SEEDS = 5, 5, 4, 10
"""Evaluations of each storey: variants and seeds; as often as it takes for the files wanted."""
TEMPLATES = 100
"""Evaluations with rows of their own: the others hold copies."""
CLASSES = ("room", "corner", "wall", "wall_end", "door", "window", "furniture", "table", "chair")
METRICS = {"iou": (0.0, 0.25, 0.5), "distance_m": (0.05, 0.1, 0.2), "links": (0.5,)}
STAGES_OF_RUN, QUERIES, SCANS = 60, 40, 20


@dataclass(frozen=True)
class Size:
    """How much a store holds."""

    evaluations: int
    """a file each of runs, stages, detections and wall quality"""
    detections: int
    """rows of all evaluations"""

    @property
    def rows_each(self) -> int:
        """Detections of one evaluation."""
        return self.detections // self.evaluations


@dataclass(frozen=True)
class Evaluation:
    """One evaluation of a storey."""

    number: int
    building: str
    storey: str
    variant: str
    seed: int

    @property
    def run(self) -> str:
        """Id of the run."""
        return f"run{self.number:06}"


def make_store(store: Path, size: Size) -> None:
    """Write a store: evaluations of every storey, variant and seed in turn; one of its energy."""
    rng = np.random.default_rng(0)
    found = [detections_table(size.rows_each, rng) for _ in range(TEMPLATES)]
    asked = [_asked(number) for number in range(VARIANTS)]
    for evaluation in evaluations(size.evaluations):
        place = _place(store, evaluation.run, evaluation.building, evaluation.storey)
        outputs = [
            put(place, "detections", evaluation.run, found[evaluation.number % TEMPLATES]),
            put(place, "wall_quality", evaluation.run, _wall_quality(evaluation.number)),
        ]
        variant = evaluation.number % VARIANTS
        _record(
            place,
            runs.EVALUATE,
            START + timedelta(minutes=evaluation.number),
            outputs,
            asked[variant],
            (evaluation.variant, evaluation.seed, f"{variant:012x}"),
        )
    for number, (building, storey) in enumerate(_storeys()):
        place = _place(store, f"energy{number:06}", building, storey)
        outputs = [put(place, "energy", place.run, _energy(storey, rng))]
        for scan in range(SCANS):
            there = place.of_scan(f"s{scan:02}")
            outputs.append(put(there, "quality", place.run, _quality(rng)))
        _record(place, runs.ENERGY, START, outputs, asked[0], ("", None, ""))


def evaluations(count: int) -> Iterator[Evaluation]:
    """Yield evaluations: all of one seed first, so that each storey's lie far apart."""
    places = list(_storeys())
    for number in range(count):
        rest, variant = divmod(number, VARIANTS)
        rest, at = divmod(rest, len(places))
        names = ("default", "initial", "coarse", "fine")
        yield Evaluation(number, *places[at], names[variant], rest % SEEDS)


def detections_table(rows: int, rng: np.random.Generator) -> pa.Table:
    """Return matches, misses and false finds of all classes, the thresholds in turn."""
    kinds = [(c, m, t) for c in CLASSES for m, limits in METRICS.items() for t in limits]
    kind = np.arange(rows) % len(kinds)
    ids = [f"{i:04}" for i in range(rows)]
    outcome = rng.random(rows)
    missed, false = outcome < 0.1, outcome > 0.92
    rooms = np.array([kinds[k][0] == "room" for k in kind])
    true_m2 = rng.uniform(8, 40, rows)
    classes = np.array(["office", "lab", "kitchen"])
    return pa.table(
        {
            "simulated": np.ones(rows, bool),
            "class": [kinds[k][0] for k in kind],
            "metric": [kinds[k][1] for k in kind],
            "threshold": [kinds[k][2] for k in kind],
            "true_id": pa.array(ids, mask=false),
            "found_id": pa.array(ids, mask=missed),
            "value": pa.array(rng.random(rows), mask=missed | false),
            "true_class": pa.array(list(classes[rng.integers(0, 3, rows)]), mask=~rooms | false),
            "found_class": pa.array(list(classes[rng.integers(0, 3, rows)]), mask=~rooms | missed),
            "true_m2": pa.array(true_m2, mask=~rooms | false),
            "found_m2": pa.array(true_m2 + rng.normal(0, 1, rows), mask=~rooms | missed),
            "width_error_m": pa.array(rng.normal(0, 0.1, rows), mask=rooms),
        },
        schema=detections.SCHEMA,
    )


def put(place: Place, table: str, name: str, rows: pa.Table) -> str:
    """Write a file of a table; return its name relative to the store."""
    uri = f"{place.folder(table)}/{name}.parquet"
    path = Path(place.store) / uri
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(rows, path, compression="zstd")
    return uri


def _record(
    place: Place,
    verb: str,
    start: datetime,
    outputs: list[str],
    asked: str,
    about: tuple[str, int | None, str],
) -> None:
    variant, seed, parameters = about
    run = {
        "id": place.run, "verb": verb, "asked": asked, "started_at": start,
        "ended_at": start + timedelta(minutes=1), "state": runs.COMPLETED, "message": "",
        "variant": variant, "seed": seed, "parameters": parameters,
    }  # fmt: skip
    put(place, "runs", place.run, pa.Table.from_pylist([run], runs.SCHEMA))
    rows = [
        stages.StageRow(
            id=f"{place.run}-{i}", run=place.run, scan=None, stage=f"stage{i % 20:02}", key="",
            outcome="computed" if i % 3 else "cached", wall_s=0.1 + i % 7, cpu_s=0.1,
            peak_memory_mb=100.0, rows_in=10, rows_out=10, points_in=1000 * i, points_out=0,
            error=None, started_at=start, outputs=tuple(outputs) if i == 0 else (),
        )
        for i in range(STAGES_OF_RUN)
    ]  # fmt: skip
    put(place, "stages", f"{place.run}-1", stages.to_table(rows))


def _wall_quality(number: int) -> pa.Table:
    values: NDArray[np.float64] = np.array([0.8 + number % 10 / 100])
    row = [
        np.array([True]),
        np.array([0.1]),
        values * 100,
        values * 90,
        values,
        values,
        values / 50,
    ]
    return pa.table(row, schema=wall_quality.SCHEMA)


def _quality(rng: np.random.Generator) -> pa.Table:
    p = float(rng.random())
    return quality.to_table(
        quality.Quality(90, 9, p, p, p, p, 0.5, p < 0.5, "" if p < 0.5 else "x")
    )


def _energy(storey: str, rng: np.random.Generator) -> pa.Table:
    of = list(product(energy.METHODS, range(1, QUERIES + 1), range(SEEDS)))
    n = len(of)
    whole = {name: np.arange(n) for name in ("captures", "rejected", "uploads", "unanswered")}
    joules = {f"{name}_j": rng.random(n) for name in ("capture", "process", "transmit", "total")}
    columns = {
        "series": [energy.QUERIES] * n,
        "storey": [storey] * n,
        "method": [method for method, _, _ in of],
        "n_queries": [queries for _, queries, _ in of],
        "seed": [seed for _, _, seed in of],
    }
    return pa.table(columns | whole | joules, schema=energy.SCHEMA)


def _asked(variant: int) -> str:
    params = MapSenseParams().model_dump(mode="json")
    params["hough"]["gamma_cell"] = 20 + variant
    return json.dumps({"params": params})


def _storeys() -> Iterator[tuple[str, str]]:
    return ((f"b{b}", f"{s}") for b in range(BUILDINGS) for s in range(STOREYS))


def _place(store: Path, run: str, building: str, storey: str) -> Place:
    return Place(store=str(store), run=run, building=building, storey=storey)
