"""Nothing is scored that something was learnt from: checked before anything is computed."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from pydantic import BaseModel, ConfigDict

from grammars.library import find_grammar
from grammars.reading import read_grammar
from storage.errors import InputError
from storage.forest import open_forest
from storage.plan_digest import plan_digest
from tasks.evaluation.truth import read_truth


class Learnt(BaseModel):
    """A storey that something was learnt from."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    building: str
    """Name of the building."""
    storey: str
    """Name of the storey."""
    source: str
    """The file that says so: the plan itself, or what names it."""
    digest: str | None = None
    """What its plan is known by; None where there are no rooms to know it by."""


class ScoredStorey(BaseModel):
    """A storey to be mapped and scored."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    building: str
    """Name its results are kept under."""
    storey: str
    """Name of the storey."""
    scans: tuple[str, ...]
    """Scan files, folders of one scan, or folders of scans."""
    truth: str
    """The true plan: GeoJSON, IFC, or labelled points."""
    truth_storey: str | None = None
    """Its storey of a building model; None: it has one alone."""


def learnt_from(path: Path) -> Learnt:
    """Return a plan's file as something that was learnt from."""
    plan = read_truth(path)
    digest = plan_digest(plan) if plan.rooms else None
    return Learnt(building=plan.building, storey=plan.storey, source=str(path), digest=digest)


def learnt_by(grammar: str) -> list[Learnt]:
    """Return the storeys a grammar was learnt from, as it says itself."""
    path = find_grammar(grammar)
    return [
        Learnt(building=o.building, storey=o.storey, source=str(path), digest=o.digest)
        for o in read_grammar(path).learnt_from
    ]


def learnt_by_forest(path: Path) -> list[Learnt]:
    """Return the storeys a forest was trained on, as its provenance says."""
    return [
        Learnt(building=s.building, storey=s.storey, source=str(path), digest=s.digest)
        for s in open_forest(path).provenance.storeys
    ]


def check_disjoint(scored: Iterable[tuple[ScoredStorey, Sequence[Learnt]]]) -> None:
    """Raise InputError if a storey is scored twice, or is one that was learnt from.

    Parameters
    ----------
    scored : each storey with what was learnt from by all that it is mapped with

    Storeys are the same if they are called the same, by the experiment or by their plans, or if
    their plans have the same rooms, whatever they are called.
    """
    seen: set[tuple[str, str]] = set()
    for storey, learnt in scored:
        name = (storey.building, storey.storey)
        if name in seen:
            problem = f"there are two storeys '{storey.building}/{storey.storey}' to be scored"
            raise InputError(storey.truth, problem, "give one another building's name")
        seen.add(name)
        _check(storey, learnt)


def _check(storey: ScoredStorey, learnt: Sequence[Learnt]) -> None:
    plan = read_truth(
        Path(storey.truth), storey.truth_storey
    )  # what is no plan is said before anything runs
    names = {(storey.building, storey.storey), (plan.building, plan.storey)}
    digest = plan_digest(plan) if plan.rooms else None
    for each in learnt:
        called = f"'{each.building}/{each.storey}'"
        if digest is not None and each.digest == digest:
            why = f"has the rooms of {called}, learnt from by {each.source}"
        elif (each.building, each.storey) in names:
            why = f"is of storey {called}, as is {each.source}, which was learnt from"
        else:
            continue
        remedy = "score a storey that nothing was learnt from, or name them apart if they are two"
        raise InputError(storey.truth, why, remedy)
