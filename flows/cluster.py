"""A flow's stages on a Dask cluster, by prefect-dask: what `flows.runner` chooses if it is set.

Three things differ from prefect-dask's own. What a stage made comes back with its state: the record
of it may lie on another machine. Rows that workers write are told to who watches this process, for
progress and logs. And a stage whose workers died ends in a state that says so.
"""

import threading
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import copy_context
from typing import Any
from uuid import UUID, uuid4

from prefect.client.schemas.objects import State
from prefect.context import SettingsContext, SyncClientContext, serialize_context
from prefect.states import Crashed
from prefect.task_engine import run_task_sync
from prefect.utilities.engine import collect_task_run_inputs_sync
from prefect_dask.client import PrefectDaskClient
from prefect_dask.task_runners import DaskTaskRunner, PrefectDaskFuture

from storage.errors import MapSenseError
from storage.stages import reason
from tasks.stage import elsewhere, ledger
from tasks.stage.apart import portable

_kept = threading.local()


class ClusterTaskRunner(DaskTaskRunner):
    """Hands stages to the Dask scheduler at an address."""

    def __init__(self, address: str) -> None:
        super().__init__(address=address)
        self._scheduler = address
        self._runs: set[str] = set()
        self._told = ThreadPoolExecutor(1, thread_name_prefix="rows")

    def duplicate(self) -> "ClusterTaskRunner":
        """Return a runner of the same cluster."""
        return ClusterTaskRunner(self._scheduler)

    def __reduce__(self) -> tuple[Any, ...]:  # each stage is sent with its flow, and that with us
        return ClusterTaskRunner, (self._scheduler,)

    @property
    def client(self) -> PrefectDaskClient:
        """Return the client of the cluster, connected at first use."""
        is_new = self._client is None
        client = super().client
        if is_new:
            # a worker sends its row before it says that the stage has ended: none comes late
            client.subscribe_topic(elsewhere.TOPIC, self._received)
        return client

    def submit(
        self,
        task: Any,
        parameters: dict[str, Any],
        wait_for: Iterable[Any] | None = None,
        dependencies: dict[str, Any] | None = None,
    ) -> Any:
        """Hand a stage to the cluster, which starts it once its inputs are made."""
        self._runs.add(parameters["place"].run)
        task_run = uuid4()
        inputs = {name: collect_task_run_inputs_sync(value) for name, value in parameters.items()}
        future = self.client.submit(
            run_stage,
            task,
            task_run,
            self._optimize_futures(parameters),
            inputs,
            serialize_context(),
            key=f"{task.name}-{task_run}",
            pure=False,
        )
        return ClusterFuture(wrapped_future=future, task_run_id=task_run)

    def _received(self, event: tuple[float, str]) -> None:
        place, row = elsewhere.received(event[1])
        if place.run in self._runs:  # others' flows use the cluster too
            # not in the thread that hears from the cluster: who watches may take their time
            self._told.submit(ledger.tell, place, row)

    def __exit__(self, *args: Any) -> None:
        super().__exit__(*args)
        self._told.shutdown()


def run_stage(
    task: Any,
    task_run: UUID,
    parameters: dict[str, Any],
    inputs: dict[str, Any],
    context: dict[str, Any],
) -> State[Any]:
    """Run a stage in a worker; return the state it ended in, with what it made or its error."""
    settings = context.pop("settings_context")
    with _client(settings):
        state: Any = run_task_sync(
            task,
            task_run_id=task_run,
            parameters=parameters,
            dependencies=inputs,
            context=context,
            return_type="state",
        )
    ended = state.result(raise_on_failure=False)
    if isinstance(ended, Exception):
        ended = portable(ended)
    state.data = ended
    return state


@contextmanager
def _client(settings: dict[str, Any]) -> Iterator[None]:
    """Provide Prefect's settings and a client of its API, made once for each thread of a worker.

    Prefect would make both for each task: most of what a stage then costs beyond its own work.
    """
    if getattr(_kept, "sent", None) != settings:
        _kept.settings = SettingsContext(**settings)
        with _kept.settings.model_copy():
            _kept.client = SyncClientContext()
            copy_context().run(_kept.client.__enter__)  # it stays open
        _kept.sent = settings
    with _kept.settings.model_copy():
        token = SyncClientContext.__var__.set(_kept.client)
        try:
            yield
        finally:
            SyncClientContext.__var__.reset(token)


class ClusterFuture(PrefectDaskFuture[Any]):
    """A stage on the cluster."""

    _final_state: Any

    def wait(self, timeout: float | None = None) -> None:
        """Wait for the stage; one that no worker could end is a crash, and says why."""
        super().wait(timeout)
        if self._final_state is None and self._wrapped_future.done():
            error = _told(self._wrapped_future.exception())
            self._final_state = Crashed(message=str(error), data=error)

    def result(self, timeout: float | None = None, raise_on_failure: bool = True) -> Any:
        """Return what the stage made, or raise why it made nothing."""
        self.wait(timeout)
        return super().result(timeout, raise_on_failure)


def _told(error: BaseException | None) -> Exception:
    """Return why a stage came to no end, as people should read it."""
    if error is None:
        return MapSenseError("the stage was given up by the Dask scheduler; run again")
    if type(error).__name__ == "KilledWorker":
        return MapSenseError(
            "the stage took down every Dask worker that tried it; leave the scan out, give workers "
            "more memory, or set stage_timeout_s and stage_memory_mb"
        )
    return MapSenseError(
        f"the Dask cluster did not end the stage ({reason(error)}); see the logs of its scheduler "
        "and workers, whose packages must be those of this process, then run again"
    )
