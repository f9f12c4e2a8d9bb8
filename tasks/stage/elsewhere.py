"""Rows of stages that ran in a Dask worker, told to the process of their flow.

A worker writes its rows into the store, as any process does. Who watches a run is elsewhere: each
row is also sent through the cluster, as JSON, under a topic the flow's process listens to.
"""

import json
import sys

from pydantic import TypeAdapter

from storage.artifacts import Place
from storage.stages import StageRow

TOPIC = "mapsense-stages"
_ROW = TypeAdapter(StageRow)


def send(place: Place, row: StageRow) -> None:
    """Send a row to who listens, if this thread runs a stage for a Dask cluster."""
    distributed = sys.modules.get("distributed")
    if distributed is None:
        return
    try:
        worker = distributed.get_worker()
    except ValueError:  # no thread of a worker
        return
    worker.log_event(TOPIC, json.dumps([place.model_dump(), _ROW.dump_python(row, mode="json")]))


def received(message: str) -> tuple[Place, StageRow]:
    """Return what was sent."""
    place, row = json.loads(message)
    return Place.model_validate(place), _ROW.validate_python(row)
