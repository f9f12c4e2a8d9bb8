"""What a run of a storey is asked for: kept in the store, so that it can be asked for again."""

from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field, field_validator

from flows.params import MapSenseParams
from storage.artifacts import Place, check_name
from storage.runs import new_id


class StoreyRequest(BaseModel):
    """Map these scans to this storey."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    store: str
    """Folder of the store."""
    building: str
    """Name of the building."""
    storey: str
    """Name of the storey."""
    scans: tuple[str, ...]
    """Scan files, folders of one scan, or folders of scans."""
    params: MapSenseParams = MapSenseParams()
    """Parameters of the stages."""
    out: str | None = None
    """Folder of the results; None: in the store."""
    verb: str = "map"
    """What asked for the run."""
    run: str = Field(default_factory=new_id)
    """Id of the run."""

    @field_validator("building", "storey")
    @classmethod
    def _is_a_name(cls, value: str) -> str:
        return check_name(value)

    def place(self) -> Place:
        """Return the place of the storey."""
        return Place(store=self.store, run=self.run, building=self.building, storey=self.storey)

    def folder(self) -> Path:
        """Return the folder of the results."""
        default = Path(self.store) / "plans" / self.building / self.storey
        return Path(self.out) if self.out is not None else default
