"""What a stage does, wherever it does it: read the inputs, compute, write the results."""

from collections.abc import Callable, Mapping
from typing import Any

from storage.artifacts import Place, Ref, write
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
    values = {a.name: a.value(inputs[a.name], place.store) for a in signature.arguments}
    result = fn(**values)
    results = result if signature.several else (result,)
    return [
        write(kind, value, place) for kind, value in zip(signature.results, results, strict=True)
    ]
