import itertools

import pytest

from drives import cia402
from drives.cia402 import State, Wanted

# Statuswords as drives send them: state bits, voltage, remote and some of the rest.
REPORTED = [
    (0x0000, State.NOT_READY_TO_SWITCH_ON, "power-on"),
    (0x0250, State.SWITCH_ON_DISABLED, "voltage on, remote"),
    (0x0270, State.SWITCH_ON_DISABLED, "bit 5 means nothing here"),
    (0x0231, State.READY_TO_SWITCH_ON, "with voltage"),
    (0x0233, State.SWITCHED_ON, "with voltage"),
    (0x1637, State.OPERATION_ENABLED, "follows, target reached"),
    (0x12B7, State.OPERATION_ENABLED, "with a warning"),
    (0x0617, State.QUICK_STOP_ACTIVE, "stands"),
    (0x021F, State.FAULT_REACTION_ACTIVE, "still braking"),
    (0x0218, State.FAULT, "with voltage"),
    (0x0238, State.FAULT, "bit 5 means nothing here"),
    (0x0201, State.UNKNOWN, "not defined by the profile"),
    (0x0222, State.UNKNOWN, "not defined by the profile"),
]


@pytest.mark.parametrize(("statusword", "state", "reason"), REPORTED)
def test_a_statusword_names_its_state(statusword, state, reason):
    assert cia402.state(statusword) is state, reason


def test_no_statusword_fits_two_states():
    for word in range(128):
        assert sum(word & mask == value for mask, value, _ in cia402.STATUSWORDS) <= 1


def test_every_state_has_an_answer_to_every_wish():
    for wanted, state in itertools.product(Wanted, State):
        assert 0 <= cia402.CONTROLWORDS[wanted][state] <= 0xFF


# What a device does with a controlword (CiA 402-2, transitions 2..12, 15).
DEVICE = {
    (State.SWITCH_ON_DISABLED, 0x06): State.READY_TO_SWITCH_ON,
    (State.READY_TO_SWITCH_ON, 0x07): State.SWITCHED_ON,
    (State.READY_TO_SWITCH_ON, 0x00): State.SWITCH_ON_DISABLED,
    (State.READY_TO_SWITCH_ON, 0x02): State.SWITCH_ON_DISABLED,
    (State.SWITCHED_ON, 0x0F): State.OPERATION_ENABLED,
    (State.SWITCHED_ON, 0x06): State.READY_TO_SWITCH_ON,
    (State.SWITCHED_ON, 0x02): State.SWITCH_ON_DISABLED,
    (State.OPERATION_ENABLED, 0x07): State.SWITCHED_ON,
    (State.OPERATION_ENABLED, 0x02): State.QUICK_STOP_ACTIVE,
    (State.FAULT, 0x80): State.SWITCH_ON_DISABLED,
}
WORDS = {state: value for _, value, state in cia402.STATUSWORDS}


def walk(state: State, wanted: Wanted) -> list[State]:
    path = [state]
    for _ in range(10):
        word = WORDS[state] | cia402.TARGET_REACHED
        answer = cia402.controlword(word, wanted)
        if state is State.QUICK_STOP_ACTIVE and answer == 0:
            state = State.SWITCH_ON_DISABLED
        state = DEVICE.get((state, answer), state)
        if state is path[-1]:
            break
        path.append(state)
    return path


ENDS = [
    (Wanted.ENABLED, State.SWITCH_ON_DISABLED, State.OPERATION_ENABLED, 3),
    (Wanted.ENABLED, State.QUICK_STOP_ACTIVE, State.OPERATION_ENABLED, 4),
    (Wanted.ENABLED, State.FAULT, State.FAULT, 0),  # a fault is never reset on the way
    (Wanted.OFF, State.OPERATION_ENABLED, State.SWITCH_ON_DISABLED, 3),  # by way of "disable operation"
    (Wanted.OFF, State.FAULT, State.FAULT, 0),
    (Wanted.QUICK_STOP, State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE, 1),
    (Wanted.QUICK_STOP, State.SWITCHED_ON, State.SWITCH_ON_DISABLED, 1),
    (Wanted.RESET, State.FAULT, State.SWITCH_ON_DISABLED, 1),
]


@pytest.mark.parametrize(("wanted", "start", "end", "steps"), ENDS)
def test_each_wish_ends_where_it_should_one_step_per_statusword(wanted, start, end, steps):
    path = walk(start, wanted)
    assert path[-1] is end
    assert len(path) == steps + 1


@pytest.mark.parametrize("wanted", list(Wanted))
def test_a_moving_axis_in_quick_stop_is_never_left_to_coast(wanted):
    still_moving = WORDS[State.QUICK_STOP_ACTIVE]
    assert cia402.controlword(still_moving, wanted) == cia402.QUICK_STOP
