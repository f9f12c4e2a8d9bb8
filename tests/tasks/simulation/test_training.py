"""The furnished training storeys: all different, and none of those that are scored."""

import importlib
import sys
from collections import Counter
from pathlib import Path

import pytest

from storage.plan_digest import plan_digest
from tasks.simulation.plan import LAYOUTS, make_storey
from tasks.simulation.presets import PRESETS, preset
from tasks.simulation.training import BARE, FIRST_SEEDS, STOREYS, furnished_storeys

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"


@pytest.fixture(scope="module")
def storeys():
    return furnished_storeys()


@pytest.fixture(scope="module")
def plans(storeys):
    return [storey.plan() for storey in storeys]


@pytest.fixture(scope="module")
def scored():
    """The parameters of storeys a benchmark scores, and of their siblings, hardly furnished."""
    name = "correction.storeys"
    with pytest.MonkeyPatch.context() as patched:
        patched.syspath_prepend(str(BENCHMARKS))
        module = importlib.import_module(name)
        every = [params for each in module.STOREYS for params in (each.params, each.sibling)]
    for loaded in [m for m in sys.modules if m == "commands" or m.startswith("correction")]:
        del sys.modules[loaded]
    # rooms are drawn before furniture, and a plan is known by its rooms
    return [params.model_copy(update={"furnishing": BARE}) for params in every]


def test_no_training_storey_is_a_scored_one(plans, scored):
    ours = {plan_digest(plan) for plan in plans}
    theirs = {plan_digest(make_storey(params, "scored", "1")) for params in scored}
    presets = {plan_digest(preset(name)) for name in PRESETS}
    assert len(ours) == len(plans)
    assert len(theirs) == len(scored) and presets <= theirs
    assert ours.isdisjoint(theirs)


def test_no_seed_is_used_for_anything_else(storeys, scored):
    seeds = {storey.params.seed for storey in storeys}
    assert len(seeds) == len(storeys)
    assert seeds.isdisjoint(params.seed for params in scored)
    assert all(seeds.isdisjoint(range(first, first + STOREYS)) for first in FIRST_SEEDS.values())


def test_names_are_folders_and_differ(storeys):
    names = [storey.building for storey in storeys]
    assert len(set(names)) == len(names) and all(name.isalnum() for name in names)


def test_storeys_are_small_and_of_differing_kinds(storeys, plans):
    assert all(9 <= len(plan.rooms) <= 24 for plan in plans)
    assert {storey.params.layout for storey in storeys} == set(LAYOUTS)
    for name in ("doors_m", "door_head_m", "p_state", "window_m", "sill_m"):
        assert len({getattr(storey.params.openings, name) for storey in storeys}) > 1
    assert len({storey.params.ceiling_m for storey in storeys}) > 5


def test_everything_to_be_learnt_is_there_often_enough(plans):
    states = Counter(door.state for plan in plans for door in plan.doors)
    classes = Counter(piece.class_ for plan in plans for piece in plan.furniture)
    assert min(states[state] for state in ("open", "ajar", "shut")) >= 50
    assert states["shut"] >= 120
    assert sum(len(plan.windows) for plan in plans) >= 600
    assert min(classes[class_] for class_ in ("table", "chair", "other")) >= 300


def test_windows_are_below_the_ceiling_and_doors_too(storeys):
    for storey in storeys:
        openings = storey.params.openings
        assert openings.sill_m < openings.window_head_m < storey.params.ceiling_m
        assert openings.door_head_m < storey.params.ceiling_m


def test_the_same_storeys_are_made_each_time(storeys, plans):
    assert furnished_storeys() == storeys
    assert plan_digest(storeys[3].plan()) == plan_digest(plans[3])
