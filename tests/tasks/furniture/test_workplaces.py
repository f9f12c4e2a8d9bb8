"""Rules of workplaces: what they make likelier, and that they can be left out."""

import numpy as np
import pytest
import shapely

from grammars.workplaces.rules import FILE, read_workplaces
from storage.furniture_segments import FurnitureSegments
from tasks.furniture.workplaces import believed

RULES = read_workplaces(FILE)
ROOM = np.array([shapely.box(0, 0, 6, 5)], object)
LEAST = (0.4, 0.35, 0.5)
TABLE, CHAIR = 0, 1


def segments(*boxes):
    shapes = np.array([shapely.box(*box) for box in boxes], object)
    n = len(shapes)
    heights = np.full(n, 0.5)
    rooms = np.zeros(n, np.int32)
    return FurnitureSegments(
        (), np.empty((n, 0)), shapes, shapes, heights, heights, np.zeros(n), rooms
    )


def after(boxes, chances, weight=1.0):
    return believed(segments(*boxes), np.array(chances, float), ROOM, LEAST, RULES, weight)


DESK = (2.2, 2.0, 3.8, 2.8)
SURE_TABLE, FAINT_CHAIR = (0.9, 0.0, 0.1, 0.0), (0.0, 0.3, 0.1, 0.6)


@pytest.mark.parametrize(
    ("box", "raised"),
    [
        ((2.8, 2.9, 3.3, 3.4), True),  # before the long edge
        ((2.8, 2.6, 3.3, 3.1), True),  # pushed under it
        ((2.8, 4.2, 3.3, 4.7), False),  # a metre and a half away
        ((4.6, 2.2, 5.1, 2.7), False),  # beside the short edge, too far
    ],
)
def test_a_chair_is_likelier_at_a_table_than_away_from_it(box, raised):
    (_, chair) = after([DESK, box], [SURE_TABLE, FAINT_CHAIR])
    odds = next(rule.odds for rule in RULES.rules if rule.places == "chair")
    expected = odds * 0.3 / (odds * 0.3 + 0.7) if raised else 0.3
    assert chair[CHAIR] == pytest.approx(expected)
    assert chair.sum() == pytest.approx(1)
    assert chair[2] / chair[3] == pytest.approx(0.1 / 0.6)


def test_what_is_no_table_makes_no_chair_likelier():
    (_, chair) = after([DESK, (2.8, 2.9, 3.3, 3.4)], [(0.2, 0, 0.8, 0), FAINT_CHAIR])
    assert chair[CHAIR] == 0.3


def test_a_desk_at_a_wall_is_likelier_than_one_in_the_open():
    at_wall, in_open = after(
        [(1.0, 0.02, 2.6, 0.82), (1.0, 2.0, 2.6, 2.8)], [(0.3, 0, 0.2, 0.5)] * 2
    )
    assert at_wall[TABLE] > 0.3 and in_open[TABLE] == pytest.approx(0.3)


def test_an_edge_holds_no_more_chairs_than_fit_and_takes_the_likeliest():
    boxes = [DESK, *((2.3 + 0.28 * i, 2.85, 2.75 + 0.28 * i, 3.3) for i in range(5))]
    faint = [(0.0, 0.1 + 0.05 * i, 0.0, 0.9 - 0.05 * i) for i in range(5)]
    chairs = after(boxes, [SURE_TABLE, *faint])[1:, CHAIR]
    raised = chairs > np.array(faint)[:, CHAIR] + 1e-9
    assert raised.tolist() == [False, False, True, True, True]  # 1.6 m at 0.45 m each


def test_without_weight_all_stays_as_it_was():
    chances = [SURE_TABLE, FAINT_CHAIR]
    boxes = [DESK, (2.8, 2.9, 3.3, 3.4)]
    assert after(boxes, chances, 0.0).tolist() == np.array(chances).tolist()


def test_a_turned_or_reversed_outline_changes_nothing():
    backwards = np.array([shapely.box(0, 0, 6, 5, ccw=False)], object)
    boxes, chances = [(1.0, 0.02, 2.6, 0.82)], np.array([(0.3, 0, 0.2, 0.5)])
    forwards = believed(segments(*boxes), chances, ROOM, LEAST, RULES, 1.0)
    assert believed(segments(*boxes), chances, backwards, LEAST, RULES, 1.0).tolist() == (
        forwards.tolist()
    )
