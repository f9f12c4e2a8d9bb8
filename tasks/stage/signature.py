"""What a stage's function takes and returns, found by its type hints."""

import inspect
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from types import GenericAlias
from typing import Any, get_args, get_origin, get_type_hints

from pydantic import BaseModel

from storage.artifacts import Kind, Ref, kind_of, read
from tasks.params import Params


@dataclass(frozen=True)
class Argument:
    """One argument of a stage: plain, a stored thing, or a list of stored things."""

    name: str
    kind: Kind[Any] | None
    """None: passed as it is"""
    many: bool = False

    def refs(self, value: Any) -> list[Ref]:
        """Return the references an argument arrived as.

        Where a stage before returned several tables, all of them may be handed over: the one of
        the argument's type is taken.
        """
        if self.kind is None:
            return []
        found = [value] if isinstance(value, Ref) else list(value)
        if not self.many:
            found = [ref for ref in found if isinstance(ref, Ref) and ref.table == self.kind.table]
            if len(found) != 1:
                raise TypeError(
                    f"argument '{self.name}': expected one reference to table "
                    f"'{self.kind.table}', got {len(found)}"
                )
        for ref in found:
            if not isinstance(ref, Ref) or ref.table != self.kind.table:
                raise TypeError(
                    f"argument '{self.name}': expected references to table '{self.kind.table}', "
                    f"got {ref!r}"
                )
        return found

    def value(self, given: Any, store: str) -> Any:
        """Return what the function is called with: references checked and read."""
        if self.kind is None:
            return given
        values = [read(self.kind, ref, store) for ref in self.refs(given)]
        return values if self.many else values[0]

    def identity(self, given: Any) -> Any:
        """Return what of an argument decides the result, as JSON."""
        if self.kind is not None:
            return [ref.sha256 for ref in self.refs(given)]
        if isinstance(given, Params):
            return given.model_dump(mode="json")
        return given.sha256


@dataclass(frozen=True)
class StageSignature:
    """The arguments of a stage's function and the kinds of what it returns."""

    arguments: tuple[Argument, ...]
    results: tuple[Kind[Any], ...]
    several: bool
    """whether the function returns a tuple"""

    def refs(self, inputs: dict[str, Any]) -> list[Ref]:
        """Return all references among the inputs."""
        return [ref for argument in self.arguments for ref in argument.refs(inputs[argument.name])]

    def identity(self, inputs: dict[str, Any]) -> dict[str, Any]:
        """Return what of the inputs decides the result: contents, never where they lie."""
        return {a.name: a.identity(inputs[a.name]) for a in self.arguments}


def signature_of(fn: Callable[..., Any], stage: str) -> StageSignature:
    """Return what a function takes and returns, or raise TypeError if it cannot be a stage."""
    hints = get_type_hints(fn)
    returned = hints.pop("return", None)
    several = get_origin(returned) is tuple
    types = get_args(returned) if several else (returned,)
    return StageSignature(
        tuple(_argument(stage, name, hints.get(name)) for name in inspect.signature(fn).parameters),
        tuple(_results(stage, types)),
        several,
    )


def _argument(stage: str, name: str, type_: Any) -> Argument:
    if get_origin(type_) in (list, Sequence) and isinstance(type_, GenericAlias):
        (item,) = get_args(type_)
        if (kind := kind_of(item)) is not None:
            return Argument(name, kind, many=True)
    elif (kind := kind_of(type_)) is not None:
        return Argument(name, kind)
    elif isinstance(type_, type) and (
        issubclass(type_, Params)
        or (issubclass(type_, BaseModel) and "sha256" in type_.model_fields)
    ):
        return Argument(name, None)
    raise TypeError(
        f"stage '{stage}': argument '{name}' is {type_}: expected a stored thing, a list of one, "
        "parameters (Params) or a model with a 'sha256'"
    )


def _results(stage: str, types: tuple[Any, ...]) -> Iterator[Kind[Any]]:
    for type_ in types:
        if (kind := kind_of(type_)) is None:
            raise TypeError(f"stage '{stage}' returns {type_}, which is no stored thing")
        yield kind
