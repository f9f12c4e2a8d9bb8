"""The base of every stage's parameters."""

from pydantic import BaseModel, ConfigDict


class Params(BaseModel):
    """Immutable, and an unknown name is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)
