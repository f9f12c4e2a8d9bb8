"""Compare variants of the method: campaigns x variants x seeds, each run scored (Sec. 7.3)."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextvars import copy_context
from pathlib import Path
from typing import Annotated, Any

from prefect import flow
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, NonNegativeInt

from flows import progress
from flows.disjoint import Learnt, ScoredStorey, check_disjoint, learnt_by, learnt_by_forest
from flows.forests import used
from flows.outcomes import Outcome, RepeatsFailed
from flows.params import MapSenseParams
from flows.plans import true_plan
from flows.repeat import Inputs, RepeatRequest, repeat
from flows.runner import threads
from flows.seeds import seeded
from flows.settings import default_jobs
from storage.runs import new_id
from tasks.scans.sources import find_sources

SEEDS = tuple(range(10))
"""Repeats of the paper."""
EXPERIMENT = "experiment"


def _are_different(seeds: tuple[int, ...]) -> tuple[int, ...]:
    if len(set(seeds)) < len(seeds):
        raise ValueError("a seed is named twice")
    return seeds


Seeds = Annotated[tuple[NonNegativeInt, ...], Field(min_length=1), AfterValidator(_are_different)]


class ExperimentRequest(BaseModel):
    """Map and score each storey with each variant and seed."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    name: str
    """What people call it."""
    store: str
    """Folder of the store."""
    storeys: Annotated[tuple[ScoredStorey, ...], Field(min_length=1)]
    """Storeys to be mapped and scored."""
    variants: Annotated[dict[str, MapSenseParams], Field(min_length=1)]
    """Parameters of the stages by the name of the variant; seeds in them are not used."""
    seeds: Seeds = SEEDS
    """One repeat each: what all random stages of it are seeded by."""
    learnt: tuple[Learnt, ...] = ()
    """Storeys that something was learnt from: none may be scored."""
    id: str = Field(default_factory=new_id)
    """Id of the experiment."""

    def repeats(self) -> list[RepeatRequest]:
        """Return every run there is: of each storey, variant and seed."""
        return [
            RepeatRequest(
                store=self.store,
                experiment=self.id,
                building=storey.building,
                storey=storey.storey,
                scans=storey.scans,
                truth=storey.truth,
                variant=variant,
                seed=seed,
                params=seeded(_of_storey(params, storey), seed),
                run=new_id(),
            )
            for storey in self.storeys
            for variant, params in self.variants.items()
            for seed in self.seeds
        ]

    def learnt_for(self, storey: ScoredStorey) -> list[Learnt]:
        """Return what was learnt from by anything that maps a storey."""
        named = (_of_storey(params, storey).grammar for params in self.variants.values())
        grammars = sorted({grammar for grammar in named if grammar is not None})
        taught = [each for name in grammars for each in learnt_by(name)]
        trained = [each for path in used() for each in learnt_by_forest(path)]
        return [*self.learnt, *taught, *trained]


def _of_storey(params: MapSenseParams, storey: ScoredStorey) -> MapSenseParams:
    """Return the parameters with the storey's own grammar, where its file is named after it."""
    if params.grammar is None:
        return params
    own = params.grammar.replace("{building}", storey.building).replace("{storey}", storey.storey)
    return params.model_copy(update={"grammar": own})


@flow(name=EXPERIMENT, flow_run_name="{request.name}", task_runner=threads())
def run_experiment(request: ExperimentRequest, jobs: int | None = None) -> Any:
    """Map and score each storey with each variant and seed; return the outcomes in that order.

    Parameters
    ----------
    jobs : int, optional
        Repeats under way at once; None: one per processor. Their stages share the workers of the
        flow's task runner, however many repeats there are.

    Raises
    ------
    InputError
        If something was learnt from a storey that would be scored, before anything is computed.
    RepeatsFailed
        If a repeat failed, after all the others are done; it holds all outcomes.
    """
    check_disjoint((storey, request.learnt_for(storey)) for storey in request.storeys)
    inputs = {(s.building, s.storey): _inputs(s, request.store) for s in request.storeys}
    repeats = [_with_truth(asked, inputs) for asked in request.repeats()]
    progress.gather(request.id, request.name, len(repeats))
    made: dict[str, list[Outcome]] = {}
    for wave in _waves(request, repeats):
        made |= _side_by_side(wave, inputs, jobs or default_jobs())
    outcomes = [outcome for asked in repeats for outcome in made[asked.run]]
    if any(outcome.rooms is None for outcome in outcomes):
        raise RepeatsFailed(outcomes)
    return outcomes


def _inputs(storey: ScoredStorey, store: str) -> Inputs:
    """Find and hash a storey's scans and truth, once for all its repeats."""
    sources, errors = find_sources([Path(path) for path in storey.scans])
    return Inputs(sources, errors, true_plan(Path(storey.truth), store, storey.truth_storey))


def _with_truth(asked: RepeatRequest, inputs: dict[tuple[str, str], Inputs]) -> RepeatRequest:
    """Return a request that names the truth as it is compared: a plan in GeoJSON."""
    truth = inputs[asked.building, asked.storey].truth
    return asked.model_copy(update={"truth": truth.plan.path})


def _waves(
    request: ExperimentRequest, repeats: list[RepeatRequest]
) -> Iterator[list[RepeatRequest]]:
    """Yield repeats that may run side by side.

    What the seeds of a variant share is computed by the first of them, and what variants share by
    the first variant: at once, one would wait with an idle worker for what the other computes.
    """
    first = request.seeds[0]
    for variant in request.variants:
        yield [r for r in repeats if r.variant == variant and r.seed == first]
    yield [r for r in repeats if r.seed != first]


def _side_by_side(
    wave: list[RepeatRequest], inputs: dict[tuple[str, str], Inputs], at_once: int
) -> dict[str, list[Outcome]]:
    """Run repeats in threads of their own, which only wait: the task runner's do the work."""
    pool = ThreadPoolExecutor(max_workers=at_once, thread_name_prefix="repeat")
    try:
        futures = {
            # in the flow's context: its stages go to the flow's task runner
            asked.run: pool.submit(
                copy_context().run, repeat, asked, inputs[asked.building, asked.storey]
            )
            for asked in wave
        }
        return {run: future.result() for run, future in futures.items()}
    finally:
        # after an interruption nobody waits for repeats under way: the flow's end stops them
        pool.shutdown(wait=False, cancel_futures=True)
