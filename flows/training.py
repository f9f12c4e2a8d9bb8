"""Train a classifier on simulated storeys: scanned, mapped, its candidates compared with truth.

The storeys are simulated for training alone (tasks.simulation.training). The forest's file names
them by their plans' digests, and an experiment that would score one of them is refused
(flows.disjoint).
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from prefect import flow
from pydantic import BaseModel, ConfigDict, Field, JsonValue, PositiveInt

from flows import progress
from flows.forests import Kind
from flows.learners import LEARNERS, Learner
from flows.params import MapSenseParams
from flows.settings import default_jobs
from flows.training_storeys import MappedStorey, mapped, scanned, simulation_code
from storage.errors import MapSenseError
from storage.forest import Forest, write_forest
from storage.forest_provenance import ClassScore, TrainedStorey
from storage.plan_digest import plan_digest
from storage.runs import COMPLETED, new_id, recorded
from storage.stages import forget
from tasks.forest import Examples, fit, joined
from tasks.held_out import cross_validated
from tasks.simulation.training import FurnishedStorey, furnished_storeys

TRAIN = "train"


class TrainRequest(BaseModel):
    """Train the classifier of a kind of thing."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    kind: Kind
    """What it tells apart."""
    work: str
    """Folder of the simulated scans and of what was made of them: taken from there again."""
    out: str
    """File of the forest."""
    params: MapSenseParams = MapSenseParams()
    """Parameters of the stages."""
    jobs: PositiveInt = Field(default_factory=default_jobs)
    """Stages that run at once."""
    run: str = Field(default_factory=new_id)
    """Id of the run."""


@flow(name=TRAIN, flow_run_name="{request.kind}")
def train(request: TrainRequest) -> dict[str, Any]:
    """Train on all training storeys, write the forest, and return what came of it.

    What an earlier training simulated and computed, of whichever kind, is taken from the work
    folder; after an interruption too.

    Raises
    ------
    MapSenseError
        If a storey cannot be mapped or too few examples are found; no file is written then.
    """
    learner = LEARNERS[request.kind]
    storeys = furnished_storeys()
    campaigns = _scanned(storeys, request)
    progress.gather(request.run, f"map for {request.kind}", len(storeys))
    made, found = [], []
    for storey, campaign in zip(storeys, campaigns, strict=True):
        made.append(mapped(storey, campaign, Path(request.work), request.params, request.jobs))
        found.append(_examples(learner, made[-1], request))
        progress.ended(made[-1].mapping, request.run)
    forest = _grown(learner, joined(found), request, storeys, made)
    write_forest(forest, Path(request.out))
    return _summary(forest, request)


def _scanned(storeys: Sequence[FurnishedStorey], request: TrainRequest) -> list[Path]:
    """Simulate all scans that are not there yet; return each storey's folder."""
    progress.gather(request.run + TRAIN, "simulate storeys", len(storeys))
    folders = []
    for storey in storeys:
        folders.append(scanned(storey, Path(request.work), lambda _: None))
        progress.advance(request.run + TRAIN, storey.building)
    return folders


def _examples(learner: Learner, made: MappedStorey, request: TrainRequest) -> Examples:
    """Return what is learnt of a storey: the component's own stages, up to its candidates."""
    asked = made.request
    with recorded(asked.store, asked.begun(TRAIN, asked.storey)) as record:
        examples = learner.examples(made, request.params)
        record.end(COMPLETED, "")
    forget(asked.place())
    return examples


def _grown(
    learner: Learner,
    examples: Examples,
    request: TrainRequest,
    storeys: Sequence[FurnishedStorey],
    made: Sequence[MappedStorey],
) -> Forest:
    """Return the forest of all examples, with where it comes from and how good it is."""
    for number, name in enumerate(learner.classes):
        if not (examples.labels == number).any():
            raise MapSenseError(
                f"training of {request.kind}: no example of class '{name}' was found on "
                f"{len(storeys)} storeys; nothing is written"
            )
    params, every = learner.forest, joined([examples, learner.more(examples)])
    forest = fit(every, learner.features, learner.classes, params)
    provenance = forest.provenance.model_copy(
        update={
            "storeys": tuple(
                TrainedStorey(
                    building=each.truth.building,
                    storey=each.truth.storey,
                    digest=plan_digest(each.truth),
                )
                for each in made
            ),
            "training": _training(storeys, request.params),
            "simulated": True,
            "scores": cross_validated(examples, learner.classes, params, learner.more),
        }
    )
    return replace(forest, provenance=provenance)


def _training(storeys: Sequence[FurnishedStorey], params: MapSenseParams) -> dict[str, JsonValue]:
    """Return how the examples were made: what differs from the defaults of the code."""
    return {
        "storeys": {
            f"{s.building}/{s.storey}": {
                "storey": s.params.model_dump(mode="json", exclude_defaults=True),
                "campaign": s.campaign.model_dump(mode="json", exclude_defaults=True),
                "scans_per_room": s.scans_per_room,
            }
            for s in storeys
        },
        "simulation_code": simulation_code(),
        "stages": params.model_dump(mode="json", exclude_defaults=True),
    }


def _summary(forest: Forest, request: TrainRequest) -> dict[str, Any]:
    """Return what a person or a program is told of a training."""
    provenance = forest.provenance
    return {
        "kind": request.kind,
        "out": request.out,
        "work": request.work,
        "simulated": True,
        "trees": len(forest),
        "storeys": len(provenance.storeys),
        "examples": provenance.examples,
        "scores": [
            _score(name, score) for name, scores in provenance.scores.items() for score in scores
        ],
    }


def _score(classifier: str, score: ClassScore) -> dict[str, Any]:
    return {
        "classifier": classifier,
        "class": score.class_,
        "examples": score.examples,
        "predicted": score.predicted,
        "right": score.right,
        "precision": _rounded(score.precision),
        "recall": _rounded(score.recall),
    }


def _rounded(share: float | None) -> float | None:
    return None if share is None else round(share, 4)
