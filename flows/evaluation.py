"""Score a mapped storey against its true plan."""

from collections.abc import Iterable
from pathlib import Path

from prefect import flow

from flows import stages
from flows.params import MapSenseParams
from flows.plans import Truth, plan_source, true_plan
from flows.request import OfStorey
from flows.results import UsedScan
from storage.artifacts import Place, Ref
from storage.plan_geojson import read_plan
from storage.runs import COMPLETED, EVALUATE, recorded
from storage.sources import Source


class EvaluationRequest(OfStorey):
    """Compare a plan with the truth."""

    plan: str
    """The mapped plan, GeoJSON."""
    truth: str
    """The true plan: GeoJSON, IFC, or labelled points."""
    truth_storey: str | None = None
    """Its storey of a building model; None: it has one alone."""


@flow(name=EVALUATE, flow_run_name="{request.building}/{request.storey}")
def evaluate_storey(request: EvaluationRequest) -> None:
    """Compare rooms, corners, walls, openings and furniture with the truth; nothing is aligned."""
    # what is no plan is said before anything runs
    read_plan(Path(request.plan))
    truth = true_plan(Path(request.truth), request.store, request.truth_storey)
    with recorded(request.store, request.begun(EVALUATE, request.storey)) as record:
        compare(request.place(), plan_source(Path(request.plan)), truth, request.params)
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
