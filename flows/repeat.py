"""One repeat of an experiment: a storey mapped with one variant and seed, and what it scores."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from prefect import tags
from pydantic import NonNegativeInt, field_validator

from flows import progress, stages
from flows.evaluation import compare, compare_planes
from flows.outcomes import Outcome, RoomScores, kept_in, room_scores, title
from flows.params import MapSenseParams
from flows.plans import Truth, plan_source
from flows.request import OfStorey, StoreyRequest
from flows.results import FINAL, INITIAL, Skipped, is_corrected, state_of, write_plans
from flows.storey import ending, map_scans
from storage.artifacts import check_name, read
from storage.detections import DETECTIONS
from storage.errors import InputError, MapSenseError
from storage.files import write_whole
from storage.remote import share
from storage.runs import (
    COMPLETED,
    DEFAULT,
    EVALUATE,
    FAILED,
    INITIAL_MODEL,
    Recorder,
    new_id,
    recorded,
)
from storage.sources import Source
from storage.stages import forget, reason


class RepeatRequest(OfStorey):
    """Map a storey with one variant and seed, and score it."""

    experiment: str
    """Id of the experiment."""
    scans: tuple[str, ...]
    """Scan files, folders of one scan, or folders of scans."""
    truth: str
    """The true plan."""
    variant: str
    """Name of the variant."""
    seed: NonNegativeInt
    """Seed that those of all random stages are drawn from."""

    @field_validator("variant")
    @classmethod
    def _variant_is_a_name(cls, value: str) -> str:
        return check_name(value)

    def folder(self) -> Path:
        """Return where the mapped plans are kept."""
        return Path(self.store) / kept_in(self.building, self.storey, self.variant, self.seed)

    def mapping(self) -> StoreyRequest:
        """Return the request to map the storey."""
        return StoreyRequest(
            store=self.store,
            building=self.building,
            storey=self.storey,
            scans=self.scans,
            params=self.params,
            out=str(self.folder()),
            verb=EVALUATE,
            run=self.run,
        )

    def of_initial(self) -> "RepeatRequest":
        """Return the request to score the initial model as a variant of its own."""
        name = initial_of(self.variant)
        return self.model_copy(update={"variant": name, "run": new_id()})


def initial_of(variant: str) -> str:
    """Return the name a variant's initial model is scored under."""
    return INITIAL_MODEL if variant == DEFAULT else f"{variant}.{INITIAL_MODEL}"


@dataclass(frozen=True, eq=False)
class Inputs:
    """What all repeats of a storey have in common: found and hashed once."""

    sources: list[Source]
    errors: list[InputError]
    """of scans that cannot be read"""
    truth: Truth


def repeat(request: RepeatRequest, inputs: Inputs) -> list[Outcome]:
    """Map a storey and score it; its initial model too, where the final one differs from it.

    What goes wrong is recorded and returned, never raised: it stops no other repeat.
    """
    name = title(request.building, request.storey, request.variant, request.seed)
    folder = request.folder()
    progress.expect(request.place(), _stages(inputs, request.params), name)
    with tags(request.variant, f"seed {request.seed}"):
        outcomes = [_recorded(request, partial(_map_and_score, request, inputs))]
        if outcomes[0].rooms is not None and is_corrected(folder / INITIAL, folder / FINAL):
            first = request.of_initial()
            outcomes.append(_recorded(first, partial(_score_initial, request, first, inputs.truth)))
    progress.ended(request.place(), request.experiment)
    return outcomes


def _map_and_score(request: RepeatRequest, inputs: Inputs, record: Recorder) -> RoomScores:
    """Map a storey, keep its plans, and compare the final one with the truth."""
    skipped = [Skipped(error.path, reason(error)) for error in inputs.errors]
    mapped = map_scans(request.mapping(), inputs.sources, skipped) if inputs.sources else None
    message = ending(len(inputs.sources) + len(inputs.errors), skipped, mapped)
    if mapped is None:
        raise MapSenseError(message)
    write_plans(mapped, request.store, request.folder())
    compare_planes(request.place(), mapped.used, inputs.truth, request.params)
    scored = _score(request, inputs.truth)
    record.end(state_of(mapped, skipped), message)
    return scored


def _score_initial(
    request: RepeatRequest, initial: RepeatRequest, truth: Truth, record: Recorder
) -> RoomScores:
    """Compare the initial model with the truth: what the final one has to be better than."""
    plan = (request.folder() / INITIAL).read_bytes()
    for name in (INITIAL, FINAL):
        write_whole(initial.folder() / name, plan, "plan")
        share(request.store, initial.folder() / name)
    scored = _score(initial, truth)
    record.end(COMPLETED, "")
    return scored


def _score(request: RepeatRequest, truth: Truth) -> RoomScores:
    found = plan_source(request.folder() / FINAL)
    ref = compare(request.place(), found, truth, request.params)
    return room_scores(read(DETECTIONS, ref, request.store))


def _recorded(request: RepeatRequest, score: Callable[[Recorder], RoomScores]) -> Outcome:
    """Record a run while it goes on, and how it ended."""
    run = replace(
        request.begun(EVALUATE, request.storey), variant=request.variant, seed=request.seed
    )
    try:
        with recorded(request.store, run) as record:
            rooms = score(record)
        return Outcome(record.run, rooms)
    except Exception as error:
        return Outcome(replace(run, state=FAILED, message=reason(error)), None)
    finally:
        forget(request.place())


def _stages(inputs: Inputs, params: MapSenseParams) -> int:
    scans = len(inputs.sources)
    of_truth = stages.PER_PLAN + scans * stages.PER_TRUE_SCAN + (inputs.truth.labels is not None)
    return stages.of_mapping(scans, params) + of_truth
