"""What is asked of a flow: kept with its run, and enough to run it again."""

from datetime import UTC, datetime
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field, field_validator

from flows.params import MapSenseParams
from flows.summaries import results_folder
from storage.artifacts import Place, check_name
from storage.runs import Run, new_id, parameter_set


class Request(BaseModel):
    """Something asked of a building."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    store: str
    """Folder of the store."""
    building: str
    """Name of the building its results are kept under."""
    params: MapSenseParams = MapSenseParams()
    """Parameters of the stages."""
    run: str = Field(default_factory=new_id)
    """Id of the run."""

    @field_validator("building", "storey", check_fields=False)
    @classmethod
    def _is_a_name(cls, value: str) -> str:
        return check_name(value)

    def place_of(self, storey: str) -> Place:
        """Return the place of a storey."""
        return Place(store=self.store, run=self.run, building=self.building, storey=storey)

    def begun(self, verb: str, storey: str) -> Run:
        """Return the record of the run that begins now."""
        return Run(
            id=self.run,
            verb=verb,
            building=self.building,
            storey=storey,
            asked=self.model_dump_json(),
            started_at=datetime.now(UTC),
            parameters=parameter_set(self.params.model_dump(mode="json")),
        )


class OfStorey(Request):
    """Something asked of one storey."""

    storey: str
    """Name of the storey."""

    def place(self) -> Place:
        """Return the place of the storey."""
        return self.place_of(self.storey)


class StoreyRequest(OfStorey):
    """Map these scans to this storey."""

    scans: tuple[str, ...]
    """Scan files, folders of one scan, or folders of scans."""
    out: str | None = None
    """Folder of the results; None: in the store."""
    verb: str = "map"
    """What asked for the run."""

    def folder(self) -> Path:
        """Return the folder of the results."""
        return results_folder(self.store, self.building, self.storey, self.out)
