"""Grammars that come with MapSense: readable, and what learning gives again."""

import json
from pathlib import Path

import pytest
from shapely import LineString, Polygon

from grammars.library import RECIPES, find_grammar, learn_library, library
from grammars.reading import read_grammar
from grammars.writing import to_toml
from storage.errors import InputError
from storage.plan import Plan, PlanOpening, PlanRoom
from storage.plan_digest import plan_digest
from tasks.simulation.presets import preset
from tasks.simulation.training import FIRST_SEEDS, training_storeys

DATA = Path(__file__).parents[2].parent / "shared" / "data" / "westport_house"
CORRIDORS = (0, 12, 15, 24)
"""The main corridors of storey 3; the rooms of the published map have no names."""


def westport() -> Plan:
    """Storey 3 of Westport House."""
    found = json.loads((DATA / "floor_3_metric.json").read_text())
    rooms = tuple(
        PlanRoom(
            f"r{room['id']}",
            Polygon(room["polygon"], room["holes"]),
            "corridor" if room["id"] in CORRIDORS else None,
        )
        for room in found["rooms"]
    )
    doors = tuple(PlanOpening(f"d{d['id']}", LineString(d["polygon"][:2])) for d in found["doors"])
    return Plan("Westport House, Dundee", "3", rooms, doors=doors)


@pytest.mark.parametrize("kind", FIRST_SEEDS)
def test_the_grammar_of_simulated_storeys_is_learnt_again(kind):
    grammar = learn_library(kind, training_storeys(kind))
    assert to_toml(grammar) == library()[kind].read_text()


@pytest.mark.skipif(not DATA.is_dir(), reason="the shared data is not there")
def test_the_grammar_of_a_real_storey_is_learnt_again():
    assert to_toml(learn_library("residence", [westport()])) == library()["residence"].read_text()


@pytest.mark.parametrize("name", ["office", "institute", "hospital", "residence"])
def test_every_grammar_says_what_it_was_learnt_from(name):
    grammar = read_grammar(library()[name])
    assert grammar.name == name and grammar.building_type
    assert bool(grammar.learnt_from) == (name in RECIPES)
    assert "earnt from" in grammar.about and grammar.evidence > 0
    assert grammar.simulated == (name in FIRST_SEEDS)


def test_no_preset_taught_a_grammar():
    digests = {o.digest for path in library().values() for o in read_grammar(path).learnt_from}
    assert len(digests) == 33
    assert not digests & {plan_digest(preset(name)) for name in ("ring", "wing")}


def test_the_simulated_grammars_hold_both_rules_of_table_1():
    for name in FIRST_SEEDS:
        rules = read_grammar(library()[name]).rules
        small = [r for r in rules if [p.class_ for p in r.parts] == ["office"] and r.width_m < 3]
        unit = [r for r in rules if [p.class_ for p in r.parts] == UNIT]
        assert small[0].width_m == pytest.approx(2.4, abs=0.05)
        assert unit[0].width_m == pytest.approx(19.2, abs=0.2)


UNIT = ["executive", "assistant", "executive"]


def test_a_grammar_is_found_by_name_and_by_path(tmp_path):
    assert read_grammar(find_grammar("hospital")).name == "hospital"
    copy = tmp_path / "mine.toml"
    copy.write_bytes(find_grammar("hospital").read_bytes())
    assert find_grammar(str(copy)) == copy
    with pytest.raises(InputError, match=r"hospitl: is no grammar; .*hospital, institute, office"):
        find_grammar("hospitl")
