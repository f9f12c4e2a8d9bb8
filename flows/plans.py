"""Plans as inputs of stages, and the truth they are scored against."""

import json
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple

from grammars.library import find_grammar
from grammars.reading import read_grammar
from storage.plan_geojson import to_geojson, write_plan
from storage.remote import share
from storage.sources import Source, file_source
from tasks.evaluation.label_files import is_labels
from tasks.evaluation.truth import read_truth, truth_files

GEOJSON = ".geojson"


def plan_source(path: Path) -> Source:
    """Return a plan's file as a stage's input: named, and known by the hash of its bytes."""
    return file_source(path, "plan")


def grammar_source(name: str) -> Source:
    """Return a grammar as a stage's input, known by the hash of its bytes.

    Raises
    ------
    InputError
        If it is neither a file nor the name of a grammar that comes with MapSense, or is wrong.
    """
    path = find_grammar(name)
    read_grammar(path)  # what is wrong in it is said before anything runs
    return file_source(path, "grammar")


class Truth(NamedTuple):
    """What a storey is scored against."""

    plan: Source
    """the true plan, GeoJSON"""
    labels: Source | None
    """the labelled points it was derived from, if that is all there is"""


def true_plan(path: Path, store: str, storey: str | None = None) -> Truth:
    """Return a truth as inputs of stages: a plan in GeoJSON as it is, or else written as such.

    What is written lies in the store, named by its content: no other truth ever takes its place.

    Parameters
    ----------
    path : a plan, a building model or labelled points, as of `read_truth`
    storey : which storey of a building model; None: it has one alone

    Raises
    ------
    InputError
        If the file holds no true plan, or not of that storey.
    """
    plan = read_truth(path, storey)
    if path.suffix.lower() == GEOJSON:
        return Truth(plan_source(path), None)
    name = sha256(json.dumps(to_geojson(plan)).encode()).hexdigest()[:24]
    kept = Path(store) / "truths" / f"{name}{GEOJSON}"
    write_plan(plan, kept)
    share(store, kept)
    return Truth(plan_source(kept), _labels(path) if is_labels(path) else None)


def _labels(path: Path) -> Source:
    """Return labelled points as a stage's input, known by all of their files."""
    whole, size = sha256(), 0
    for file in truth_files(path):
        data = file.read_bytes()
        whole.update(sha256(data).digest())
        size += len(data)
    return Source(name="labels", path=str(path), sha256=whole.hexdigest(), size_bytes=size)
