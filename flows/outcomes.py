"""What came of the repeats of an experiment: their scores by storey and variant."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from statistics import fmean
from typing import Any

import numpy as np
from numpy.typing import NDArray

from storage.detections import IOU, Detections
from storage.errors import MapSenseError
from storage.runs import COMPLETED, FAILED, Run
from tasks.evaluation.scores import scores


@dataclass(frozen=True, eq=False)
class RoomScores:
    """What of a storey's rooms was found; None where there is nothing to be counted."""

    precision: float | None
    recall: float | None
    f1: float | None
    area_errors_m2: NDArray[np.float64]
    """(n,), |found - true| of each matched room, square metres"""


@dataclass(frozen=True, eq=False)
class Outcome:
    """How a run ended, and what was scored."""

    run: Run
    rooms: RoomScores | None
    """None of a run that failed"""


class RepeatsFailed(MapSenseError):
    """Some repeats failed; the others were scored."""

    def __init__(self, outcomes: list[Outcome]) -> None:
        failed = [outcome.run for outcome in outcomes if outcome.rooms is None]
        reasons = "; ".join(f"{_called(run)}: {run.message}" for run in failed)
        super().__init__(f"{len(failed)} of {len(outcomes)} runs failed: {reasons}")
        self.outcomes = outcomes

    def __reduce__(self) -> tuple[type, tuple[list[Outcome]]]:
        return RepeatsFailed, (self.outcomes,)


def title(building: str, storey: str, variant: str, seed: int | None) -> str:
    """Return what people call a repeat."""
    return f"{building}/{storey} {variant} seed {seed}"


def kept_in(building: str, storey: str, variant: str, seed: int | None) -> str:
    """Return the folder a repeat's plans are kept in, relative to the store."""
    return f"evaluations/{building}/{storey}/{variant}/{seed}"


def _called(run: Run) -> str:
    return title(run.building, run.storey, run.variant, run.seed)


def room_scores(detections: Detections) -> RoomScores:
    """Return the scores of rooms: counted at the greatest IoU, areas compared at the least."""
    of_rooms = [s for s in scores(detections) if (s.class_, s.metric) == ("room", IOU)]
    if not of_rooms:
        return RoomScores(None, None, None, np.zeros(0))
    strict = max(of_rooms, key=lambda score: score.threshold)
    loose = min(score.threshold for score in of_rooms)
    rows = (detections.classes == "room") & (detections.metrics == IOU)
    rows &= detections.thresholds == loose
    errors = np.abs(detections.found_m2 - detections.true_m2)[rows]
    return RoomScores(strict.precision, strict.recall, strict.f1, errors[~np.isnan(errors)])


def by_variant(outcomes: Sequence[Outcome]) -> list[dict[str, Any]]:
    """Return one row per storey and variant, in the order they were asked for."""
    groups: dict[tuple[str, str, str], list[Outcome]] = {}
    for outcome in outcomes:
        run = outcome.run
        groups.setdefault((run.building, run.storey, run.variant), []).append(outcome)
    return [_row(*key, group) for key, group in groups.items()]


def _row(building: str, storey: str, variant: str, outcomes: list[Outcome]) -> dict[str, Any]:
    scored = [outcome.rooms for outcome in outcomes if outcome.rooms is not None]
    errors = np.concatenate([np.zeros(0), *(rooms.area_errors_m2 for rooms in scored)])
    return {
        "building": building,
        "storey": storey,
        "variant": variant,
        "seeds": len(scored),
        "failed": len(outcomes) - len(scored),
        "precision": _mean(rooms.precision for rooms in scored),
        "recall": _mean(rooms.recall for rooms in scored),
        "f1": _mean(rooms.f1 for rooms in scored),
        "area_error_m2": round(float(errors.mean()), 4) if len(errors) else None,
        "worst_area_error_m2": round(float(errors.max()), 4) if len(errors) else None,
    }


def _mean(values: Iterable[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return round(fmean(known), 4) if known else None


def runs_of(outcomes: Sequence[Outcome]) -> list[dict[str, Any]]:
    """Return one row per run: how it ended, and where the store keeps what it made."""
    return [
        {
            "building": run.building,
            "storey": run.storey,
            "variant": run.variant,
            "seed": run.seed,
            "state": run.state,
            "message": run.message,
            "parameters": run.parameters,
            "run": run.id,
            "plans": kept_in(run.building, run.storey, run.variant, run.seed),
        }
        for run in (outcome.run for outcome in outcomes)
    ]


def problems(outcomes: Sequence[Outcome]) -> list[str]:
    """Return what a person should know: each failed run, and once per variant what was left out."""
    lines = [
        f"{_called(o.run)}: {o.run.state}: {o.run.message}" for o in outcomes if o.rooms is None
    ]
    partial = [o.run for o in outcomes if o.run.state not in (COMPLETED, FAILED)]
    said = [f"{r.building}/{r.storey} {r.variant}: {r.state}: {r.message}" for r in partial]
    return lines + list(dict.fromkeys(said))
