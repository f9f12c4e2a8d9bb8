"""Fig. 15: which plans were compared with which truth, read and drawn."""

import json
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path

from flows.outcomes import kept_in
from flows.report.data import Answers, Row, grouped, is_initial, variant_name, variant_order
from flows.results import FINAL, INITIAL, is_corrected
from storage.errors import InputError
from storage.plan import Plan
from storage.plan_geojson import read_plan
from storage.remote import obtain
from tasks.evaluation.truth import read_truth
from tasks.exports.figures.canvas import Picture
from tasks.exports.figures.plans import Panel, draw_plans
from tasks.exports.report import Section

MOST_STOREYS = 12
"""Storeys drawn: a page of more is not read any more."""
SAME = "The final plan has the initial one's rooms: no grammar was applied."


def plan_section(answers: Answers, store: Path) -> Section:
    """Return the plans of each storey that was evaluated, beside their truth."""
    pictures: list[Picture] = []
    files: list[Picture] = []
    told: set[str] = set()
    missing: list[str] = []
    storeys = grouped(answers.rows["plans"], lambda row: (row["building"], row["storey"]))
    for (building, storey), rows in list(storeys.items())[:MOST_STOREYS]:
        drawn = _storey(store, f"{building} / {storey}", rows)
        # a page lays the panels out by itself: beside each other, or beneath on a phone
        files += drawn.pictures[:1]
        pictures += drawn.pictures[1:]
        missing += drawn.missing
        told |= drawn.told
    if not storeys:
        missing.append("No plan was compared with a truth: `mapsense evaluate` does so.")
    if len(storeys) > MOST_STOREYS:
        missing.append(f"{MOST_STOREYS} of {len(storeys)} storeys are drawn.")
    return Section(
        key="figure-15",
        title="Fig. 15: initial, final and true plans",
        text=(
            "Plans of one storey at one scale, each where it lies: nothing was aligned. True "
            "rooms are outlined in orange over what was mapped. Of several seeds the lowest is "
            "drawn.",
        ),
        badges=tuple(sorted(told)),
        pictures=tuple(pictures),
        files=tuple(files),
        wide=True,
        missing=tuple(missing),
        queries=answers.quoted("plans", "Which plan was compared with which truth:"),
    )


@dataclass(frozen=True)
class _Drawn:
    """The pictures of one storey."""

    pictures: list[Picture]
    """all panels in one, and each"""
    missing: list[str]
    told: set[str]
    """where the plans come from"""


def _storey(store: Path, name: str, rows: list[Row]) -> _Drawn:
    """Read and draw the plans of one storey."""
    variants = grouped(rows, lambda row: row["variant"])
    missing: list[str] = []
    panels: dict[str, Panel] = {}
    truths: dict[str, Plan] = {}
    for variant in sorted(variants, key=variant_order):
        row = variants[variant][0]
        path, truth = _paths(store, row)
        try:
            for title, each in _models(variant, path):
                # plans of the same bytes are one panel
                panels.setdefault(_digest(each), Panel(title, read_plan(each)))
            if _is_same(path) and not is_initial(variant):
                missing.append(f"{name}, {variant_name(variant)}: {SAME}")
        except (InputError, OSError) as error:
            missing.append(f"{name}, {variant_name(variant)}: not drawn ({error}).")
        try:
            truths[str(truth)] = read_truth(truth)
        except (InputError, OSError) as error:
            missing.append(f"{name}: its truth is not drawn ({error}).")
    if len(truths) > 1:
        missing.append(f"{name}: compared with {len(truths)} truths, of which the first is drawn.")
    true = next(iter(truths.values()), None)
    shown = [*panels.values(), *([Panel("truth", true)] if true is not None else [])]
    missing = list(dict.fromkeys(missing))
    if not shown:
        return _Drawn([], missing, set())
    pictures = draw_plans(f"figure_15_{name.replace(' / ', '_')}", shown, true)
    simulated = any(panel.plan.simulated for panel in shown)
    told = {"simulated data" if simulated else "real scans"}
    return _Drawn([replace(p, caption=name) for p in pictures], missing, told)


def _paths(store: Path, row: Row) -> tuple[Path, Path]:
    """Return the plan and the truth a run compared; those in the store move with it."""
    asked = json.loads(row["asked"])
    kept = store / kept_in(row["building"], row["storey"], row["variant"], row["seed"]) / FINAL
    plan, truth = (Path(asked.get(key) or "") for key in ("plan", "truth"))
    before = Path(asked.get("store") or store)
    if truth.is_relative_to(before):
        truth = store / truth.relative_to(before)
        obtain(store, truth.relative_to(store).as_posix())
    if asked.get("plan"):
        return plan, truth
    obtain(store, kept.relative_to(store).as_posix())
    return kept, truth


def _models(variant: str, path: Path) -> list[tuple[str, Path]]:
    """Return the initial model, if it is kept beside the plan, and the plan."""
    title = f"{variant_name(variant)} model" if variant else "final model"
    initial = path.with_name(INITIAL)
    if is_initial(variant) or initial == path or not initial.is_file():
        return [(title, path)]
    if _is_same(path):
        return [(f"initial and {title}", path)]
    return [("initial model", initial), (title, path)]


def _is_same(path: Path) -> bool:
    """Return whether a plan has the rooms and walls of the initial one kept beside it."""
    initial = path.with_name(INITIAL)
    if initial == path or not initial.is_file() or not path.is_file():
        return False
    return not is_corrected(initial, path)


def _digest(path: Path) -> str:
    try:
        return sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        told = f"cannot be read ({error.strerror})"
        raise InputError(path, told, "evaluate again") from error
