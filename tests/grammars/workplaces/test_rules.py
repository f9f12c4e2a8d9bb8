"""Reading the rules of workplaces."""

import pytest

from grammars.workplaces.rules import FILE, read_workplaces
from storage.errors import InputError


def test_the_rules_that_come_along_place_tables_then_chairs():
    rules = read_workplaces(FILE).rules
    assert [(rule.parent, rule.places) for rule in rules] == [("wall", "table"), ("table", "chair")]


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ("turn_rad = 0.4", "turn_rad = 3.0", "rules.1.turn_rad"),
        ("near_m = [-0.45, 0.35]", "near_m = [0.35, -0.45]", "near_m"),
        ('parent = "wall"', 'parent = "door"', "rules.0.parent"),
        ("odds = 2.5", "odds = 0.5", "rules.1.odds"),
        ("each_m = 1.2", "each = 1.2", "rules.0.each"),
        ('parent = "wall"\nplaces = "table"', 'parent = "table"\nplaces = "table"', "edge"),
        ("[[rules]]", "[[rules", "cannot be read"),
    ],
)
def test_a_wrong_rule_is_named_with_its_file(tmp_path, old, new, named):
    text = FILE.read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / "mine.toml"
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InputError, match=named) as caught:
        read_workplaces(path)
    assert str(path) in str(caught.value)


def test_chairs_before_the_tables_they_stand_at_are_refused(tmp_path):
    head, first, second = FILE.read_text(encoding="utf-8").split("[[rules]]")
    path = tmp_path / "mine.toml"
    path.write_text(f"{head}[[rules]]{second}\n[[rules]]{first}", encoding="utf-8")
    with pytest.raises(InputError, match="before"):
        read_workplaces(path)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match="nowhere"):
        read_workplaces(tmp_path / "nowhere.toml")
