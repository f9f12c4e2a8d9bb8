"""The verbs of grammars: learn one from plans, show it, check it."""

from collections.abc import Sequence
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError

from flows.assignments import assigned
from flows.params import explain
from grammars.describing import describe
from grammars.generator.learning import learn
from grammars.generator.params import LearnParams
from grammars.generator.updating import update
from grammars.library import find_grammar
from grammars.reading import read_grammar
from grammars.writing import write_grammar
from storage.errors import MapSenseError
from storage.plan import Plan
from storage.plan_geojson import read_plan
from storage.plan_ifc import ifc_storeys, read_ifc_storey


class _Learning(BaseModel):
    """What may be set: `learn.spread_floor_m` and so on."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    learn: LearnParams = LearnParams()


def learn_grammar(
    plans: Sequence[Path],
    out: Path,
    storey: str | None,
    name: str,
    building_type: str,
    assignments: list[str],
) -> int:
    """Learn a grammar from plans, into a file."""
    if not plans:
        raise MapSenseError("no plan named: mapsense grammar learn PLAN... --out FILE")
    try:
        params = _Learning.model_validate(assigned(assignments)).learn
    except ValidationError as error:
        raise MapSenseError(explain(error, _Learning)) from error
    known = [plan for path in plans for plan in _plans(path, storey)]
    grammar = learn(known, params, name, building_type)
    write_grammar(grammar, out)
    rooms = sum(len(plan.rooms) for plan in known)
    print(f"{out}: {len(grammar.rules)} rules from {rooms} rooms of {len(known)} storeys")
    return 0


def update_grammar(name: str, plans: Sequence[Path], out: Path, weight: float) -> int:
    """Update a grammar by plans that were accepted (Fig. 8, line 26), into a file."""
    if not plans:
        raise MapSenseError("no plan named: mapsense grammar update GRAMMAR PLAN... --out FILE")
    if not weight > 0:
        raise MapSenseError(f"--weight {weight}: expected more than 0")
    grammar = read_grammar(find_grammar(name))
    for plan in (plan for path in plans for plan in _plans(path, None)):
        grammar = update(grammar, plan, LearnParams(), weight)
    write_grammar(grammar, out)
    print(f"{out}: {len(grammar.rules)} rules, learnt from {len(grammar.learnt_from)} storeys")
    return 0


def show_grammar(name: str, out: Path | None) -> int:
    """Show a grammar as text, and draw it into a folder if there is one."""
    path = find_grammar(name)
    grammar = read_grammar(path)
    print(describe(grammar))
    if out is not None:
        from tasks.exports.grammar_drawing import draw_grammar

        drawn = out / f"{path.stem}.svg", out / f"{path.stem}.png"
        draw_grammar(grammar, *drawn)
        print("\n".join(str(file) for file in drawn))
    return 0


def check_grammars(names: Sequence[str]) -> int:
    """Check grammars; the first thing that is wrong in one is raised."""
    if not names:
        raise MapSenseError("no grammar named: mapsense grammar check FILE...")
    for name in names:
        path = find_grammar(name)
        grammar = read_grammar(path)
        print(f"{path}: {len(grammar.rules)} rules, {len(grammar.classes)} classes, sound")
    return 0


def _plans(path: Path, storey: str | None) -> list[Plan]:
    """Return the storeys of a plan's file: one of GeoJSON, all or the one named of IFC."""
    if path.suffix.lower() != ".ifc":
        return [read_plan(path)]
    names = [storey] if storey is not None else list(ifc_storeys(path))
    return [read_ifc_storey(path, name) for name in names]
