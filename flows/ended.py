"""How submitted stages ended, where one that fails is to stop nothing else."""

from collections.abc import Iterable
from typing import Any

from prefect.futures import PrefectFuture

from storage.artifacts import Ref
from storage.stages import reason


def made_by(futures: Iterable[PrefectFuture[Any]]) -> tuple[list[Ref], str]:
    """Wait for stages, each of which needs those before it.

    Returns
    -------
    made : list of Ref
        What they made; nothing unless all of them ended well.
    why : str
        Why the first one that failed did so; '' if none has.
    """
    made: list[Ref] = []
    for future in futures:
        future.wait()
        if not future.state.is_completed():
            return [], why_ended(future)
        result = future.result()
        made += [result] if isinstance(result, Ref) else result
    return made, ""


def why_ended(future: PrefectFuture[Any]) -> str:
    """Return in a sentence why a stage that has ended did not complete."""
    error = future.state.result(raise_on_failure=False)
    told = reason(error) if isinstance(error, BaseException) else future.state.message
    return str(told or future.state.name or "unknown")
