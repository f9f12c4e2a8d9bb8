"""The space that rules cut into rooms, from plans whose walls are known."""

import numpy as np
import pytest

from grammars.generator.learning import learn
from grammars.generator.params import LearnParams
from grammars.generator.spaces import space_of
from grammars.generator.updating import update
from grammars.model import WallKind

LINE = np.array([[1.0, 2.0], [1.0, 22.0]])
"""Along y: what is to its left lies at smaller x."""
REAR = np.array([(2.0, 5.0), (6.0, 5.0), (10.0, 5.0), (14.0, 5.0), (18.0, 5.0)])


def test_a_row_of_equal_rooms_has_a_rectangle():
    space = space_of(LINE, np.full(5, 0.2), REAR, (0.5, 19.5), (0.0, 0.0))
    assert np.array(space) == pytest.approx(
        np.array([(0.8, 2.5), (0.8, 21.5), (-4.0, 21.5), (-4.0, 2.5)])
    )


def test_oblique_ends_and_a_tapering_rear_are_followed_to_their_corner():
    rear = REAR + np.column_stack([np.zeros(5), 0.01 * REAR[:, 0]])
    space = np.array(space_of(LINE, np.full(5, 0.2), rear, (0.0, 20.0), (-0.5, 0.0)))
    x, y = space[:, 1] - 2.0, 1.0 - space[:, 0]
    assert (x[:2], y[:2]) == (pytest.approx([-0.1, 20.0]), pytest.approx([0.2, 0.2]))
    # both rear corners lie on the rear, one on the oblique end as well
    assert y[2:] == pytest.approx(5.0 + 0.01 * x[2:])
    assert (x[2], x[3]) == (pytest.approx(20.0), pytest.approx(-0.5 * y[3]))


def test_one_deeper_room_is_none_of_the_rear():
    rear = REAR.copy()
    rear[2, 1] = 7.5
    space = np.array(space_of(LINE, np.full(5, 0.2), rear, (0.0, 20.0), (0.0, 0.0)))
    assert space[2:, 0] == pytest.approx(-4.0)


def test_rooms_of_many_depths_have_no_common_rear():
    rear = np.column_stack([REAR[:, 0], [3.0, 6.0, 4.0, 7.0, 5.0]])
    assert space_of(LINE, np.full(5, 0.2), rear, (0.0, 20.0), (0.0, 0.0)) is None


def test_a_grammar_knows_the_space_and_the_walls_of_its_building(make_row):
    plan = make_row([("a", 2.4)] * 5, [("b", 4.0)] * 3, bearing=0.2, outer=0.3, depth=5.0)
    grammar = learn([plan], LearnParams())
    assert grammar.corridor_wall == WallKind(0.2, 0.01)
    assert grammar.outer_wall == WallKind(0.3, 0.01)
    by_side = {line.start[1] > 1: np.array(line.space) for line in grammar.lines}
    # rows end at the faces of the outer walls; the south row is walked westwards
    assert by_side[False] == pytest.approx(
        np.array([(11.7, -0.2), (0.0, -0.2), (0.0, -5.0), (11.7, -5.0)])
    )
    assert by_side[True] == pytest.approx(
        np.array([(0.0, 2.2), (11.7, 2.2), (11.7, 7.0), (0.0, 7.0)])
    )


def test_walls_learn_from_a_further_storey(make_row):
    row = [("a", 2.4)] * 4
    learnt = learn([make_row(row, bearing=0.2)], LearnParams())
    more = update(learnt, make_row(row, bearing=0.3, storey="2"), LearnParams())
    assert more.corridor_wall.thickness_m == pytest.approx(0.25)
    assert more.corridor_wall.spread_m > learnt.corridor_wall.spread_m
    assert more.outer_wall.thickness_m == pytest.approx(0.3)
