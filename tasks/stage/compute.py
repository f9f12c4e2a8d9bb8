"""What a stage does, wherever it does it: read the inputs, compute, write the results."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from storage.artifacts import Place, Ref, write
from storage.errors import InputError
from storage.remote import replicate
from storage.sources import Source
from tasks.stage.signature import StageSignature


def compute(
    fn: Callable[..., Any], signature: StageSignature, inputs: Mapping[str, Any]
) -> list[Ref]:
    """Return references to what a function makes of its inputs.

    Parameters
    ----------
    inputs : the place, and an argument of the function by each name: references for stored things
    """
    place: Place = inputs["place"]
    for given in inputs.values():
        if isinstance(given, Source):
            _at_hand(given, place.store)
    values = {a.name: a.value(inputs[a.name], place.store) for a in signature.arguments}
    result = fn(**values)
    results = result if signature.several else (result,)
    return [
        write(kind, value, place) for kind, value in zip(signature.results, results, strict=True)
    ]


def _at_hand(source: Source, store: str) -> None:
    """Fetch a source that another machine copied into its store, as it is there now.

    Raises
    ------
    InputError
        If it is not to be had on this machine.
    """
    path = Path(source.path)
    if path.is_relative_to(store):
        replicate(store, path)
    if not path.exists():
        remedy = "give every machine that runs stages the same files under the same path"
        raise InputError(path, "is not on the machine that runs the stage", remedy)
