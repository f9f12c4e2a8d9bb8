"""The parameters of all stages, each as its own stage declares them."""

from collections.abc import Mapping
from difflib import get_close_matches
from typing import Any

from pydantic import BaseModel, ValidationError, model_validator

from flows.forests import KINDS, Kind
from storage.errors import MapSenseError
from tasks.device.codec import CodecParams
from tasks.device.costs import EnergyParams
from tasks.device.quality import QualityParams
from tasks.device.sweep import SweepParams
from tasks.device.targets import TargetParams
from tasks.device.voxels import VoxelParams
from tasks.device.work import WorkParams
from tasks.doors.candidates import CandidateParams
from tasks.doors.openings import OpeningsParams
from tasks.doors.trace import TraceParams
from tasks.evaluation.detections import EvaluationParams
from tasks.evaluation.disturbance import DisturbParams
from tasks.evaluation.planes import PlaneQualityParams
from tasks.evaluation.points import PointQualityParams
from tasks.evaluation.walls import WallQualityParams
from tasks.furniture.classification import FurnitureParams
from tasks.furniture.segments import FurnitureSegmentParams
from tasks.layout.decoding.decode import DecodeParams
from tasks.layout.extraction.observations import ExtractParams
from tasks.layout.placement.params import PlacementParams
from tasks.params import Params
from tasks.scans.read import ReadParams
from tasks.surfaces.filtering import FilterParams
from tasks.surfaces.hough import HoughParams
from tasks.surfaces.intersection import IntersectParams
from tasks.surfaces.label_params import LabelParams
from tasks.surfaces.occupancy import OccupancyParams


class MapSenseParams(Params):
    """Parameters of mapping a storey. A stage is handed its own part only."""

    scans: ReadParams = ReadParams()
    """How scans are read."""
    quality: QualityParams = QualityParams()
    """The quality gate (Eq. 1-4)."""
    voxels: VoxelParams = VoxelParams()
    """The voxel grid (Sec. 3.3)."""
    codec: CodecParams = CodecParams()
    """Octree compression (Sec. 3.3)."""
    hough: HoughParams = HoughParams()
    """Plane detection (Sec. 4.1)."""
    filter: FilterParams = FilterParams()
    """Plane filtering (Eq. 5)."""
    occupancy: OccupancyParams = OccupancyParams()
    """Occupied space: evidence for walls besides planes."""
    label: LabelParams = LabelParams()
    """Plane labelling (Eq. 6, 7)."""
    intersect: IntersectParams = IntersectParams()
    """Plane intersection (Eq. 8)."""
    grammar: str | None = None
    """Grammar that corrects the initial model (Sec. 4.2): the name of one that comes with MapSense,
    or a file; None: the initial model is the final one."""
    extract: ExtractParams = ExtractParams()
    """Knowledge extraction: what stands along the reference lines (Fig. 8)."""
    decode: DecodeParams = DecodeParams()
    """The most probable rooms along each line (Eq. 9-11)."""
    place: PlacementParams = PlacementParams()
    """What of them becomes the final plan."""
    detect: tuple[Kind, ...] = KINDS
    """What is looked for in the final plan besides rooms and walls: doors (and windows),
    furniture."""
    trace: TraceParams = TraceParams()
    """Label and depth images of walls (Fig. 9)."""
    candidates: CandidateParams = CandidateParams()
    """Rectangles in them that may be doors or windows (Sec. 5)."""
    openings: OpeningsParams = OpeningsParams()
    """Which of them are."""
    furniture_segments: FurnitureSegmentParams = FurnitureSegmentParams()
    """Level surfaces that may be furniture (Sec. 6)."""
    furniture: FurnitureParams = FurnitureParams()
    """Which of them are."""
    disturb: DisturbParams = DisturbParams()
    """For experiments: walls of the initial model that go missing, and false ones."""
    work: WorkParams = WorkParams()
    """When the server can use a scan."""
    energy: EnergyParams = EnergyParams()
    """The energy model (Sec. 7.3.2)."""
    sweep: SweepParams = SweepParams()
    """Its sensitivity."""
    targets: TargetParams = TargetParams()
    """The savings wanted."""
    evaluation: EvaluationParams = EvaluationParams()
    """When an object is found (Sec. 7.3)."""
    plane_quality: PlaneQualityParams = PlaneQualityParams()
    """When a plane of a scan is a true one."""
    point_quality: PointQualityParams = PointQualityParams()
    """When a labelled point lies on what was found."""
    wall_quality: WallQualityParams = WallQualityParams()
    """Completeness, correctness and accuracy of walls."""

    @model_validator(mode="after")
    def _asks_for_one_quality(self) -> "MapSenseParams":
        if self.energy.t_q != self.quality.t_q:
            raise ValueError("quality.t_q and energy.t_q differ: set both to what is asked for")
        return self


def parse_params(given: Mapping[str, Any]) -> MapSenseParams:
    """Return the parameters, or raise MapSenseError naming the first one that is wrong."""
    try:
        return MapSenseParams.model_validate(given)
    except ValidationError as error:
        raise MapSenseError(explain(error, MapSenseParams)) from error


def explain(error: ValidationError, model: type[BaseModel]) -> str:
    """Return what is wrong with settings as one sentence, with a suggestion for a wrong name."""
    first = error.errors()[0]
    where = ".".join(str(part) for part in first["loc"])
    if not first["loc"] and "error" in first.get("ctx", {}):
        # several settings do not go together: the text says which
        return f"settings: {first['ctx']['error']}"
    if first["type"] != "extra_forbidden":
        return f"setting '{where}' = {first['input']!r}: {first['msg'].lower()}"
    *parents, name = (str(part) for part in first["loc"])
    known = list(_at(model, parents).model_fields)
    close = get_close_matches(name, known, n=1)
    hint = f"did you mean '{'.'.join([*parents, close[0]])}'" if close else ", ".join(known)
    return f"unknown setting '{where}': {hint if close else 'there are ' + hint}"


def _at(model: type[BaseModel], path: list[str]) -> type[BaseModel]:
    for name in path:
        field = model.model_fields.get(name)
        if field is None or not isinstance(field.annotation, type):
            return model
        model = field.annotation
    return model
