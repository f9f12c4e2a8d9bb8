"""Rooms of rules as states: units are chains, and every row of transitions is a distribution."""

import numpy as np
import pytest

from grammars.model import Grammar, Part, Rule
from tasks.layout.decoding.states import Unexplained, make_states

OFFICE, STAFF = Part("office", 3.0, 0.2, 5.0, 0.3), Part("staff", 6.0, 0.4)
P_R = np.array([[0.6, 0.4], [0.7, 0.3]])


def grammar():
    rules = (Rule("r1", (OFFICE,), 0.8), Rule("u2", (STAFF, OFFICE, STAFF), 0.2))
    return Grammar(
        name="g", building_type="office", about="", learnt_from=(), simulated=True,
        classes=("office", "staff"), rules=rules, p_relation=P_R, partition_m=0.1,
        partition_spread_m=0.01,
    )  # fmt: skip


def test_a_unit_is_a_chain_that_is_entered_at_its_first_room_and_left_at_its_last():
    states = make_states(grammar(), P_R, "kept", None)
    assert states.rules == ("r1", "u2", "u2", "u2")
    assert states.parts.tolist() == [0, 0, 1, 2]
    assert np.exp(states.log_initial).tolist() == pytest.approx([0.8, 0.2, 0, 0])
    assert states.may_end.tolist() == [True, False, False, True]
    assert np.exp(states.log_transitions) == pytest.approx(
        np.array([[0.6, 0.4, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1], [0.7, 0.3, 0, 0]])
    )


def test_states_carry_what_their_rooms_are():
    states = make_states(grammar(), P_R, "kept", Unexplained(0.1, 0.5))
    assert states.classes == ("office", "staff", "office", "staff", "")
    assert states.rules[-1] == "" and states.explained == 4
    np.testing.assert_array_equal(states.widths, [3, 6, 3, 6, np.nan])
    np.testing.assert_array_equal(states.spreads, [0.2, 0.4, 0.2, 0.4, np.nan])
    np.testing.assert_array_equal(states.depths, [5, np.nan, 5, np.nan, np.nan])
    np.testing.assert_array_equal(states.depth_spreads, [0.3, np.nan, 0.3, np.nan, np.nan])


@pytest.mark.parametrize("units", ["kept", "split"])
@pytest.mark.parametrize("unexplained", [None, Unexplained(0.1, 0.5)])
def test_what_a_line_begins_with_and_what_follows_sums_to_one(units, unexplained):
    states = make_states(grammar(), P_R, units, unexplained)
    assert np.exp(states.log_initial).sum() == pytest.approx(1)
    assert np.exp(states.log_transitions).sum(axis=1) == pytest.approx(np.ones(len(states)))


def test_split_units_leave_their_rooms_free():
    states = make_states(grammar(), P_R, "split", None)
    assert states.may_end.all() and np.isfinite(states.log_transitions).all()
    # a unit of three comes three times as often, room by room
    assert np.exp(states.log_initial) == pytest.approx(np.array([0.8, 0.2, 0.2, 0.2]) / 1.4)
    assert np.exp(states.log_transitions[2]) == pytest.approx([0.7, 0.1, 0.1, 0.1])


def test_unexplained_rooms_come_as_often_at_the_start_as_anywhere():
    states = make_states(grammar(), P_R, "split", Unexplained(0.1, 0.5))
    onward = np.exp(states.log_transitions)
    anywhere = np.linalg.matrix_power(onward, 200)[0]
    assert anywhere[-1] == pytest.approx(np.exp(states.log_initial[-1]))
