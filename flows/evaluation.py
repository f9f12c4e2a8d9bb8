"""Score a mapped storey against its true plan."""

from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path

from prefect import flow
from pydantic import BaseModel, ConfigDict, Field, field_validator

from flows import stages
from flows.params import MapSenseParams
from flows.plans import Truth, plan_source, true_plan
from flows.results import UsedScan
from storage.artifacts import Place, Ref, check_name
from storage.plan_geojson import read_plan
from storage.runs import COMPLETED, EVALUATE, Run, new_id, parameter_set, recorded
from storage.sources import Source


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
    """The true plan: GeoJSON, IFC, or labelled points."""
    truth_storey: str | None = None
    """Its storey of a building model; None: it has one alone."""
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
    # what is no plan is said before anything runs
    read_plan(Path(request.plan))
    truth = true_plan(Path(request.truth), request.store, request.truth_storey)
    run = Run(
        id=request.run,
        verb=EVALUATE,
        building=request.building,
        storey=request.storey,
        asked=request.model_dump_json(),
        started_at=datetime.now(UTC),
        parameters=parameter_set(request.params.model_dump(mode="json")),
    )
    with recorded(request.store, run) as record:
        compare(place, plan_source(Path(request.plan)), truth, request.params)
        record.end(COMPLETED, "")


def compare(place: Place, found: Source, truth: Truth, params: MapSenseParams) -> Ref:
    """Compare a plan with the truth in every way there is; return its detections."""
    plan, labels = truth
    detections = stages.detections.submit(place, found, plan, params.evaluation)
    others = [stages.wall_quality.submit(place, found, plan, params.wall_quality)]
    if labels is not None:
        others += [stages.point_quality.submit(place, found, labels, params.point_quality)]
    for other in others:
        other.result()
    made: Ref = detections.result()
    return made


def compare_planes(
    place: Place, scans: Iterable[UsedScan], truth: Truth, params: MapSenseParams
) -> None:
    """Compare what the Hough transform found in each scan with the surfaces the truth has there."""
    compared = [
        stages.plane_detections.submit(
            place.of_scan(scan.name), scan.points, scan.segments, truth.plan, params.plane_quality
        )
        for scan in scans
    ]
    for detections in compared:
        detections.result()
