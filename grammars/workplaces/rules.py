"""Split rules of workplaces: what stands along the edges of rooms and tables (Sec. 7.4)."""

import tomllib
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from storage.errors import InputError

FILE = Path(__file__).with_name("workplaces.toml")
"""The rules that come with MapSense."""
REMEDY = "correct the rule, or leave the file out for the one that comes with MapSense"


class WorkplaceRule(BaseModel):
    """One thing placed along an edge of another."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    name: str
    """What the rule is called."""
    parent: Literal["wall", "table"]
    """What has the edge: a room, or a table."""
    places: Literal["table", "chair"]
    """What is placed along it."""
    near_m: tuple[float, float]
    """Least and greatest distance from the edge, metres; negative: beyond it."""
    turn_rad: Annotated[float, Field(gt=0, le=0.8)]
    """Greatest angle to the edge, radians."""
    odds: Annotated[float, Field(ge=1, le=1000)]
    """How much likelier such a thing is there than anywhere else."""
    each_m: Annotated[float, Field(gt=0)]
    """Length of the edge one thing takes up, metres."""

    @model_validator(mode="after")
    def _is_a_range(self) -> "WorkplaceRule":
        if self.near_m[0] >= self.near_m[1]:
            raise ValueError("near_m: expected the least distance before the greatest")
        if self.parent == self.places:
            raise ValueError("places: a table's edge holds chairs only")
        return self


class WorkplaceGrammar(BaseModel):
    """Rules in the order in which they split: those of walls before those of tables."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    rules: tuple[WorkplaceRule, ...]
    """Tables come before the chairs at them."""

    @model_validator(mode="after")
    def _are_in_order(self) -> "WorkplaceGrammar":
        parents = [rule.parent for rule in self.rules]
        if parents != sorted(parents, key=("wall", "table").index):
            raise ValueError("rules of walls come before those of tables")
        return self


def read_workplaces(path: Path) -> WorkplaceGrammar:
    """Read the rules of workplaces.

    Raises
    ------
    InputError
        Naming the file, the rule and the field that is wrong.
    """
    try:
        return WorkplaceGrammar.model_validate(tomllib.loads(path.read_text(encoding="utf-8")))
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "rules"
        raise InputError(path, f"{where}: {first['msg'].lower()}", REMEDY) from error
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(path, f"cannot be read ({error})", REMEDY) from error
