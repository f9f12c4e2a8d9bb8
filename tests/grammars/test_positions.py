"""Lines of keys: against where the keys stand in the text."""

import tomllib

from hypothesis import given, settings
from hypothesis import strategies as st

from grammars.positions import line_numbers

TEXT = '''\
# a comment with [brackets] = "and quotes
title = "a # that is no comment"   # and one that is
about = """
[not] = 'a table'
\\""" nor the end"""
"quoted.key".inner = 1
list = [  # numbers
    1, [2,
    3],
    { x = 1, y = [
      5 ] },
]
literal = 'C:\\'
long = \'\'\'
a\'\'\'
day = 1979-05-27 07:32:00

[table.of]
key = true
[[rows]]
a = 1
[rows.sub]
b = 2
[[rows]]
a = 3
  [[rows.more]]
  c = 4
'''


def test_every_key_and_element_has_its_line():
    tomllib.loads(TEXT)
    assert line_numbers(TEXT) == {
        (): 1,
        ("title",): 2,
        ("about",): 3,
        ("quoted.key",): 6,
        ("quoted.key", "inner"): 6,
        ("list",): 7,
        ("list", 0): 8,
        ("list", 1): 8,
        ("list", 1, 0): 8,
        ("list", 1, 1): 9,
        ("list", 2): 10,
        ("list", 2, "x"): 10,
        ("list", 2, "y"): 10,
        ("list", 2, "y", 0): 11,
        ("literal",): 13,
        ("long",): 14,
        ("day",): 16,
        ("table",): 18,
        ("table", "of"): 18,
        ("table", "of", "key"): 19,
        ("rows",): 20,
        ("rows", 0): 20,
        ("rows", 0, "a"): 21,
        ("rows", 0, "sub"): 22,
        ("rows", 0, "sub", "b"): 23,
        ("rows", 1): 24,
        ("rows", 1, "a"): 25,
        ("rows", 1, "more"): 26,
        ("rows", 1, "more", 0): 26,
        ("rows", 1, "more", 0, "c"): 27,
    }


def test_windows_line_ends_count_as_one():
    assert line_numbers("a = 1\r\nb = 2\r\n") == {(): 1, ("a",): 1, ("b",): 2}


ONE_LINE = ("1", "-0.5e3", "true", '"te#xt"', "'[lit]'", "[1, 2]", "[]", '{a = "}", b = []}')
OTHER = ('"""\nx\n"y" """', "[\n1,\n# no\n[2]\n]", "'''it's'''", '"\\u00e9\\"\\\\"', '""""q""""')
values = st.sampled_from((*ONE_LINE, *OTHER))


@settings(max_examples=200, deadline=None)
@given(st.lists(st.tuples(st.booleans(), values, st.sampled_from(["", " # c", "\n\n# [c]"]))))
def test_marked_keys_are_found_on_the_line_that_bears_the_mark(items):
    text = "".join(
        f"[table{i}]\nmark{i} = {value}{comment}\n" if header else f"mark{i} = {value}{comment}\n"
        for i, (header, value, comment) in enumerate(items)
    )
    tomllib.loads(text)
    found = {place[-1]: line for place, line in line_numbers(text).items() if place}
    for i in range(len(items)):
        assert text.splitlines()[found[f"mark{i}"] - 1].startswith(f"mark{i} = ")
