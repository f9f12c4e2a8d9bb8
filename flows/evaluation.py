"""Score a mapped storey against its true plan."""

from datetime import UTC, datetime
from pathlib import Path

from prefect import flow
from pydantic import BaseModel, ConfigDict, Field, field_validator

from flows import stages
from flows.params import MapSenseParams
from flows.plans import plan_source
from storage.artifacts import Place, check_name
from storage.plan_geojson import read_plan
from storage.runs import COMPLETED, EVALUATE, Run, new_id, recorded


class EvaluationRequest(BaseModel):
    """Compare a plan with the truth."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    store: str
    """Folder of the store."""
    building: str
    """Name of the building."""
    storey: str
    """Name of the storey."""
    plan: str
    """The mapped plan, GeoJSON."""
    truth: str
    """The true plan, GeoJSON."""
    params: MapSenseParams = MapSenseParams()
    """Parameters of the stages."""
    run: str = Field(default_factory=new_id)
    """Id of the run."""

    @field_validator("building", "storey")
    @classmethod
    def _is_a_name(cls, value: str) -> str:
        return check_name(value)


@flow(name=EVALUATE, flow_run_name="{request.building}/{request.storey}")
def evaluate_storey(request: EvaluationRequest) -> None:
    """Compare rooms, corners, walls, openings and furniture with the truth; nothing is aligned."""
    place = Place(
        store=request.store, run=request.run, building=request.building, storey=request.storey
    )
    paths = [Path(request.plan), Path(request.truth)]
    for path in paths:
        read_plan(path)  # what is no plan is said before anything runs
    found, truth = (plan_source(path) for path in paths)
    run = Run(
        id=request.run,
        verb=EVALUATE,
        building=request.building,
        storey=request.storey,
        asked=request.model_dump_json(),
        started_at=datetime.now(UTC),
    )
    with recorded(request.store, run) as record:
        stages.detections(place, found, truth, request.params.evaluation)
        stages.wall_quality(place, found, truth, request.params.wall_quality)
        record.end(COMPLETED, "")
