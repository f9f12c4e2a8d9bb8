"""A pure function made a cached, timed Prefect task by one declaration.

    planes = stage(detect_planes, name="planes")
    ref = planes(place, points_ref, HoughParams())

What the function needs to know of all this: nothing.
"""

import inspect
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

from prefect import Task
from prefect.client.schemas.objects import State, TaskRun
from prefect.context import TaskRunContext
from prefect.futures import PrefectFuture

from storage.artifacts import Place, Ref, check_name
from tasks.stage import ledger, records
from tasks.stage.apart import compute_apart
from tasks.stage.compute import compute
from tasks.stage.limits import Limits, limits
from tasks.stage.meter import Cost, metered
from tasks.stage.policy import policy_for
from tasks.stage.signature import signature_of

Made = Ref | list[Ref]
"""What a stage returns: a reference, or a list of them where its function returns a tuple."""


class Stage:
    """A stage of the pipeline: called with a place, references and parameters, it makes references.

    Parameters
    ----------
    fn : callable
        Pure function of stored things and parameters, its types in its hints.
    name : str
        Name of the stage in keys, rows and runs.
    """

    def __init__(self, fn: Callable[..., Any], name: str) -> None:
        self.fn, self.name = fn, check_name(name)
        self.signature = signature_of(fn, name)
        self._task = cache(self._new_task)

    def __reduce__(self) -> tuple[Any, ...]:
        """Say where another process finds the stage: by its function's module, and its name."""
        if "<locals>" in self.fn.__qualname__ or self.fn.__module__ == "__main__":
            raise TypeError(
                f"stage '{self.name}': other processes run functions that a module defines"
            )
        return _found, (self.fn, self.name)

    def __call__(self, place: Place, *args: Any, **kwargs: Any) -> Any:
        """Run the stage here and now, or take its result from the cache."""
        return self._task(place.store)(place, *args, **kwargs)

    def submit(self, place: Place, *args: Any, **kwargs: Any) -> PrefectFuture[Any]:
        """Hand the stage to the flow's task runner."""
        return self._task(place.store).submit(place, *args, **kwargs)

    def _new_task(self, store: str, asked: Limits | None = None) -> "StageTask":
        """Return the stage's task in a store.

        Parameters
        ----------
        asked : limits of the process that asks for it, if that is another
        """
        return StageTask(
            self,
            store,
            self._body(asked),
            name=self.name,
            cache_policy=policy_for(store, self.name, self.fn, self.signature),
            persist_result=True,
            result_storage=records.folder(store),
            result_serializer="json",
            cache_result_in_memory=False,  # what lies in the store counts, not what did
            on_completion=[_completed],
            on_failure=[_ended],
        )

    def _body(self, asked: Limits | None) -> Callable[..., Made]:
        """Return the function Prefect runs, of the place and the function's own arguments."""
        of_stage = inspect.signature(self.fn)
        own = of_stage.parameters.values()
        place = inspect.Parameter("place", inspect.Parameter.POSITIONAL_OR_KEYWORD)
        bound = inspect.Signature([place, *(p.replace(annotation=p.empty) for p in own)])

        def body(*args: Any, **kwargs: Any) -> Made:
            given = bound.bind(*args, **kwargs)
            given.apply_defaults()
            return self._run(given.arguments, asked)

        body.__name__, body.__doc__ = self.name, self.fn.__doc__
        body.__signature__ = bound  # type: ignore[attr-defined]
        return body

    def _run(self, inputs: dict[str, Any], limited: Limits | None) -> Made:
        """Read the inputs, compute, write the results and the row of the stage."""
        context = TaskRunContext.get()
        if context is None or context.task_run is None:
            raise RuntimeError(f"stage '{self.name}' runs as a task only")
        task_run = str(context.task_run.id)
        asked = ledger.recall(task_run)
        try:
            with metered() as cost:
                if asked.error is not None:
                    raise asked.error
                refs, apart = self._compute(inputs, limited)
        except BaseException as error:
            ledger.failed(task_run, asked, cost, error)
            raise
        if apart is not None:
            cost = replace(apart, wall_s=cost.wall_s)
        # before Prefect commits the cache record: a kill in between loses no row
        ledger.computed(task_run, asked, cost, refs)
        return refs if self.signature.several else refs[0]

    def _compute(
        self, inputs: dict[str, Any], limited: Limits | None
    ) -> tuple[list[Ref], Cost | None]:
        """Return what is made, and what it cost if another process made it."""
        if not (allowed := limits(limited)):
            return compute(self.fn, self.signature, inputs), None
        return compute_apart(self.fn, self.name, inputs, allowed)


class StageTask(Task[..., Any]):
    """The task of a stage in a store: another process makes it anew, of its own code."""

    def __init__(self, stage: Stage, store: str, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.stage, self.store = stage, store

    def __reduce__(self) -> tuple[Any, ...]:
        return _task_of, (self.stage, self.store, limits())


def stage(fn: Callable[..., Any], name: str) -> Stage:
    """Make a pure function a stage; TypeError if its hints do not say how."""
    return Stage(fn, name)


@cache
def _found(fn: Callable[..., Any], name: str) -> Stage:
    """Return the stage of a function and a name, the same one each time."""
    return Stage(fn, name)


def _task_of(stage: Stage, store: str, asked: Limits) -> StageTask:
    """Return the task of a stage that another process asks for."""
    return stage._task(store, asked)


def _completed(task: Any, task_run: TaskRun, state: State[Any]) -> None:
    """Write the row of a hit: Prefect does not call the function for it."""
    asked = ledger.forget(str(task_run.id))
    if state.name == "Cached" and asked is not None:
        made = state.result()
        ledger.cached(str(task_run.id), asked, made if isinstance(made, list) else [made])


def _ended(task: Any, task_run: TaskRun, state: State[Any]) -> None:
    ledger.forget(str(task_run.id))
