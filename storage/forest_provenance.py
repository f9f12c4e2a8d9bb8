"""Where a trained forest comes from, and how good it is: what its file says besides its trees."""

from pydantic import BaseModel, ConfigDict, JsonValue


class ClassScore(BaseModel):
    """How well one class is told from the others on examples held back from training."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    class_: str
    """The class."""
    examples: int
    """Examples that truly are of the class."""
    predicted: int
    """Examples that were said to be."""
    right: int
    """Examples that were, and were said to be."""

    @property
    def precision(self) -> float | None:
        """Share of those said to be of the class that are; None if none was."""
        return self.right / self.predicted if self.predicted else None

    @property
    def recall(self) -> float | None:
        """Share of those of the class that were said to be; None if there are none."""
        return self.right / self.examples if self.examples else None


class TrainedStorey(BaseModel):
    """A storey whose objects a forest was trained on."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    building: str
    """Name of the building."""
    storey: str
    """Name of the storey."""
    digest: str
    """What its plan is known by (storage.plan_digest)."""


class Provenance(BaseModel):
    """Where a forest comes from. No time of day: the same training makes the same file."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    parameters: dict[str, JsonValue]
    """Parameters of the forest, its seed among them."""
    versions: dict[str, str]
    """Versions of the libraries that grew it."""
    examples: dict[str, int] = {}
    """Examples by the group they came from: a storey, or a table of dimensions."""
    storeys: tuple[TrainedStorey, ...] = ()
    """The storeys among the groups: none of them may be scored."""
    training: dict[str, JsonValue] = {}
    """How the examples were made: seeds and parameters of the simulation and of the stages."""
    simulated: bool = False
    """Whether the examples come from simulated scans."""
    scores: dict[str, tuple[ClassScore, ...]] = {}
    """Figures by classifier, groups held back in turn; compared ones stand beside."""
