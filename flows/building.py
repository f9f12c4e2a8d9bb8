"""Map every storey of a building; one broken storey stops no other."""

from typing import Any

from prefect import flow
from prefect.states import Failed

from flows.hooks import publish, tell
from flows.request import StoreyRequest
from flows.runner import task_runner
from flows.server import is_own
from flows.storey import map_storey


@flow(name="building", flow_run_name="{building}")
def map_building(building: str, storeys: list[StoreyRequest], jobs: int | None = None) -> Any:
    """Map the storeys one after the other; failed if any of them did.

    Parameters
    ----------
    jobs : int, optional
        Stages that run at once in threads; None: one per processor.
    """
    mapping = with_jobs(jobs)
    states = {request.storey: mapping(request, return_state=True) for request in storeys}
    failed = {storey: s.message for storey, s in states.items() if not s.is_completed()}
    if failed:
        reasons = "; ".join(f"{storey}: {message}" for storey, message in failed.items())
        return Failed(message=f"{len(failed)} of {len(states)} storeys failed: {reasons}")
    return {storey: state.result() for storey, state in states.items()}


def with_jobs(jobs: int | None) -> Any:
    """Return the storey's flow with what its stages run in, see `flows.runner`.

    How a run ended is shown on the pages of Prefect's server, unless nobody ever sees these.
    """
    hooks: list[Any] = [tell] if is_own() else [tell, publish]
    return map_storey.with_options(
        task_runner=task_runner(jobs), on_completion=hooks, on_failure=hooks
    )
