"""Modes: every request in every mode, and the reaction to every fault."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import product

import pytest
from support.machines.tick_bench import FakeGroup
from support.suite.cases import each

from controller.commands.table import SWITCHED
from controller.state.modes import (
    ALL_AXES,
    ALWAYS,
    BY_HAND,
    DROPS,
    FAULTS,
    PROGRESS,
    TRANSITIONS,
    Fault,
    Mode,
    Reaction,
    Request,
    follows,
    refusal,
)
from controller.state.stop_times import ENABLE_S
from controller.tick.mode import DRIVE_FAULTS, MAX_OVERRIDE, PHASES, Modes, Phase
from drives.cia402 import State, Wanted
from drives.cyclic.drive import DriveFault


def modes_in(mode: Mode) -> tuple[Modes, FakeGroup]:
    group = FakeGroup([0] * 5)
    modes = Modes(group, 0.002)
    modes.mode = mode
    return modes, group


@each("mode", Mode)
@each("request_", Request)
def test_every_request_in_every_mode_does_what_the_table_says(mode: Mode, request_: Request) -> None:
    modes, _ = modes_in(mode)
    taken = modes.request(request_, 1.0, standing=True)
    if request_ is Request.ESTOP:
        assert modes.mode is Mode.FAULT
        return
    expected = follows(mode, request_)
    assert modes.mode is (mode if expected is None else expected)
    assert taken is (expected is not None)


LOSABLE = (Mode.RUNNING, Mode.HOLD, Mode.JOG)  # modes with a program whose plan can be lost
FAULTED = {  # the fault that may be shown in a mode, beside none
    Mode.HOLD: Fault.DOOR_OPEN,
    Mode.RUNNING: Fault.COOLANT_LOST,
    Mode.FAULT: Fault.PLANNER_GONE,
}
VALUED = (Request.START, Request.OVERRIDE, Request.RAPID_OVERRIDE, *SWITCHED)
INTERLOCKS = (Fault.NONE, Fault.DOOR_OPEN, Fault.ESTOP_INPUT)


def states(mode: Mode) -> Iterator[tuple[Modes, FakeGroup]]:
    """Every state that a mode can be in, by all that is kept beside it."""
    phases = [Phase.STEADY, *(phase for phase in Phase if PHASES.get(phase) is mode)]
    for phase, plan_lost in product(phases, (False, True) if mode in LOSABLE else (False,)):
        for interlock, untrusted in product(INTERLOCKS, (0, 4)):
            modes, group = modes_in(mode)
            modes.phase, modes.plan_lost = phase, plan_lost
            modes.interlock, modes.untrusted = interlock, untrusted
            modes.homed, modes._homing_mask = ALL_AXES & ~untrusted, 4
            faulted = mode is Mode.FAULT or interlock is not Fault.NONE or phase is Phase.ENDING
            if faulted and mode in FAULTED:
                modes.fault = FAULTED[mode]
                modes.reaction = FAULTS[modes.fault].reaction
            yield modes, group


def assert_sound(modes: Modes) -> None:
    """What may stand beside a mode; as the next tick's progress leaves it."""
    assert PHASES.get(modes.phase, modes.mode) is modes.mode, (modes.mode, modes.phase)
    assert not modes.plan_lost or modes.mode in LOSABLE, modes.mode
    assert (modes.fault is Fault.NONE) is (modes.reaction is Reaction.NONE)
    assert modes.fault is Fault.NONE or modes.mode in FAULTED, (modes.mode, modes.fault)


def values_of(modes: Modes) -> dict[str, object]:
    values = {name: getattr(modes, name) for name in dir(modes) if name[:2] != "__" and name != "_group"}
    return {name: value for name, value in values.items() if not callable(value)}


@each("mode", Mode)
@each("request_", Request)
def test_every_request_in_every_state_is_taken_or_refused_as_its_sentence_says(
    mode: Mode, request_: Request
) -> None:
    """What is refused changes nothing of all that is kept beside the mode; what is taken leaves it sound."""
    for standing, away, value in product((True, False), (False, True), (0.0, 1.0, 4.0)):
        for modes, group in states(mode):
            said = refusal(
                mode,
                request_,
                standing=standing or (request_ is Request.RESET and modes.phase is Phase.QUICK_STOPPED),
                homed=modes.homed,
                untrusted=modes.untrusted,
                interlock=modes.interlock,
                away=away,
                axes=("X", "Y", "Z", "A", "C"),
            )
            before, wanted = values_of(modes), group.wanted
            taken = modes.request(request_, value, standing, away)
            sound = value == 1.0 or request_ is not Request.SPINDLE_OVERRIDE
            sound = sound and not (value == 4.0 and request_ in VALUED)
            assert taken is (not said and sound), (said, before)
            if not taken:
                assert values_of(modes) == before and group.wanted is wanted
                continue
            assert modes.mode is (Mode.FAULT if request_ is Request.ESTOP else follows(mode, request_))
            modes.progress(1, standing=False)
            assert_sound(modes)


@each("mode", Mode)
@each("fault", [f for f in Fault if f is not Fault.NONE])
def test_a_fault_in_every_state_leaves_no_odd_one(mode: Mode, fault: Fault) -> None:
    for modes, _ in states(mode):
        modes.fail(fault, 2)
        modes.progress(1, standing=False)
        assert_sound(modes)


@pytest.mark.parametrize("mode", Mode)
def test_what_follows_by_itself_leaves_no_odd_state_and_goes_by_its_table(mode: Mode) -> None:
    for standing in (False, True):
        for modes, group in states(mode):
            for drive in group.drives:
                drive.following = drive.homing_done = standing
            void = modes.progress(1, standing)
            assert_sound(modes)
            assert modes.mode is mode or modes.mode in PROGRESS[mode]
            assert void is (modes.mode is Mode.READY and mode is not Mode.READY)


def test_a_jog_that_is_over_leaves_the_mode_that_it_came_from_as_it_was() -> None:
    for back in (Mode.READY, Mode.HOLD):
        for modes, _ in states(Mode.JOG):
            lost = modes.plan_lost
            modes.leave_jog(back)
            assert_sound(modes)
            assert (modes.mode, modes.phase) == (back, Phase.STEADY)
            assert modes.plan_lost is (lost and back is Mode.HOLD)


def test_what_is_queued_is_void_with_every_request_that_ends_without_a_program() -> None:
    ends = {pair for pair, after in TRANSITIONS.items() if after in (Mode.OFF, Mode.READY)}
    by_hand = {(Mode.READY, request) for request in BY_HAND}  # no matter of the queue
    assert ends - DROPS - by_hand == {(Mode.OFF, Request.ENABLE)} and ends >= DROPS


def test_homing_that_is_stopped_while_the_drives_switch_off_ends_no_homing_after_it() -> None:
    """The next one was told to be over in its first tick, and its axes were not homed."""
    for end in (
        lambda modes: modes.request(Request.STOP, 0.0, True),
        lambda modes: modes.fail(Fault.EMCY, 1),
    ):
        modes, group = modes_in(Mode.OFF)
        modes.request(Request.HOME, 4.0, standing=True)
        group.drives[2].homing_done = True
        for drive in group.drives:
            drive.state = State.OPERATION_ENABLED
        modes.progress(1, standing=True)
        assert modes.mode is Mode.HOMING and modes.homed == 4, "it only switches off"
        end(modes)
        modes.request(Request.RESET, 0.0, standing=True)
        for drive in group.drives:
            drive.state = State.SWITCH_ON_DISABLED
        group.drives[2].homing_done = False
        modes.request(Request.HOME, 4.0, standing=True)
        modes.progress(1, standing=True)
        assert modes.mode is Mode.HOMING


def test_the_table_names_only_requests_that_can_be_refused() -> None:
    assert not any(request in ALWAYS for _, request in TRANSITIONS)


@each("fault", Fault)
def test_every_fault_has_a_text_and_a_remedy_in_whole_sentences(fault: Fault) -> None:
    row = FAULTS[fault]
    assert row.text.endswith(".") and row.remedy.endswith(".")


def test_every_fault_of_a_drive_has_its_own_row() -> None:
    assert set(DRIVE_FAULTS) == set(DriveFault)


WANTED = {  # per class: the mode after it, which drives get a quick stop, whether the path goes on
    Reaction.WARN: (Mode.RUNNING, 0, True),
    Reaction.END_OF_BLOCK: (Mode.RUNNING, 0, True),
    Reaction.HOLD: (Mode.HOLD, 0, True),
    Reaction.PATH_STOP: (Mode.FAULT, 0, True),
    Reaction.LOST_DRIVE: (Mode.FAULT, 1, True),
    Reaction.QUICK_STOP: (Mode.FAULT, 5, False),
    Reaction.DISABLE: (Mode.FAULT, 5, False),
}


@each("fault", [f for f in Fault if f is not Fault.NONE])
def test_a_fault_while_running_reacts_by_its_row(fault: Fault) -> None:
    modes, group = modes_in(Mode.RUNNING)
    modes.fail(fault, 2)
    row = FAULTS[fault]
    mode, stopped, on_path = WANTED[row.reaction]
    assert modes.mode is mode and modes.on_path is on_path
    shown, told = (Fault.NONE, fault) if row.reaction is Reaction.WARN else (fault, Fault.NONE)
    assert (modes.fault, modes.warning) == (shown, told)
    wanted = [drive.wanted for drive in group.drives]
    assert wanted.count(Wanted.QUICK_STOP) == stopped
    assert stopped != 1 or wanted[2] is Wanted.QUICK_STOP
    assert (modes.phase is Phase.ENDING) is (row.reaction is Reaction.END_OF_BLOCK)


@each("fault", [f for f in Fault if f is not Fault.NONE])
@each("mode", Mode)
def test_a_fault_that_cannot_be_gone_on_from_stops_every_mode(mode: Mode, fault: Fault) -> None:
    modes, group = modes_in(mode)
    modes.fail(fault, 2)
    hard = FAULTS[fault].reaction
    if hard >= Reaction.PATH_STOP or (hard is Reaction.HOLD and mode is Mode.HOMING):
        assert modes.mode is Mode.FAULT
    elif hard is Reaction.HOLD and mode is Mode.RUNNING:
        assert modes.mode is Mode.HOLD
    else:
        assert modes.mode is mode
    if modes.mode is Mode.FAULT and mode in (Mode.OFF, Mode.HOMING):
        assert group.wanted is Wanted.QUICK_STOP  # there is no path to stop on


@each("fault", [f for f in Fault if f is not Fault.NONE])
def test_axes_that_are_not_trusted_lose_their_homed_mark_and_nothing_starts(fault: Fault) -> None:
    modes, _ = modes_in(Mode.RUNNING)
    modes.homed = 0x1F
    modes.fail(fault, 2)
    row = FAULTS[fault]
    lost = 0 if row.position_trusted else 0x04 if row.reaction is Reaction.LOST_DRIVE else 0x1F
    assert modes.homed == 0x1F & ~lost and modes.untrusted == lost
    if modes.mode is Mode.FAULT:
        modes.request(Request.RESET, 0.0, standing=True)
    modes.mode = Mode.READY
    modes.request(Request.START, 0.0, standing=True)
    assert modes.mode is (Mode.READY if lost else Mode.RUNNING)


def test_a_door_that_opens_holds_and_the_hold_ends_with_resume_once_it_is_closed() -> None:
    modes, _ = modes_in(Mode.RUNNING)
    modes.interlock = Fault.DOOR_OPEN
    modes.fail(Fault.DOOR_OPEN, -1)
    assert not modes.request(Request.RESUME, 0.0, standing=True)
    assert (modes.mode, modes.fault) == (Mode.HOLD, Fault.DOOR_OPEN)
    modes.interlock = Fault.NONE
    modes.request(Request.RESUME, 0.0, standing=True)
    assert (modes.mode, modes.fault) == (Mode.RUNNING, Fault.NONE)


@pytest.mark.parametrize(
    ("interlock", "request_", "granted", "reason"),
    [
        (Fault.DOOR_OPEN, Request.START, False, "nothing moves with the door open"),
        (Fault.DOOR_OPEN, Request.HOME, False, "homing moves too"),
        (Fault.DOOR_OPEN, Request.ENABLE, True, "drives may hold their axes"),
        (Fault.ESTOP_INPUT, Request.ENABLE, False, "no torque in an emergency stop"),
        (Fault.DOOR_OPEN, Request.DISABLE, True, "to switch off is always good"),
    ],
)
def test_an_interlock_forbids_motion(interlock: Fault, request_: Request, granted: bool, reason: str) -> None:
    modes, _ = modes_in(Mode.READY if request_ in (Request.START, Request.DISABLE) else Mode.OFF)
    modes.interlock = interlock
    assert modes.request(request_, 1.0, standing=True) is granted, reason


def test_a_harder_fault_takes_the_place_of_a_hold() -> None:
    modes, group = modes_in(Mode.RUNNING)
    modes.fail(Fault.DOOR_OPEN, -1)
    modes.fail(Fault.BUS_OFF, 0)
    assert (modes.mode, modes.fault) == (Mode.FAULT, Fault.BUS_OFF)
    assert group.wanted is Wanted.QUICK_STOP
    modes.fail(Fault.DOOR_OPEN, -1)
    assert modes.fault is Fault.BUS_OFF


def test_a_hold_at_the_end_of_the_block_ends_in_hold_or_with_the_program() -> None:
    modes, _ = modes_in(Mode.RUNNING)
    modes.fail(Fault.COOLANT_LOST, -1)
    modes.path_stops()
    modes.progress(1, standing=True)
    assert modes.phase is Phase.STEADY and modes.fault is Fault.COOLANT_LOST
    modes.request(Request.RESUME, 0.0, standing=True)
    assert modes.mode is Mode.RUNNING and modes.fault is Fault.NONE
    modes.fail(Fault.COOLANT_LOST, -1)
    modes.path_ends()
    modes.progress(1, standing=True)
    assert (modes.fault, modes.warning) == (Fault.NONE, Fault.COOLANT_LOST)


def test_an_emergency_stop_circuit_takes_the_torque_once_the_ramps_are_over() -> None:
    group = FakeGroup([0] * 5)
    modes = Modes(group, 0.002, path_stop_s=1.0, quick_stop_s=0.1)
    modes.mode = Mode.RUNNING
    modes.fail(Fault.ESTOP_INPUT, -1)
    for _ in range(50):
        modes.progress(1, standing=False)
        assert group.wanted is Wanted.QUICK_STOP
    modes.progress(1, standing=False)
    assert group.wanted is Wanted.OFF


def test_a_longer_ramp_that_the_drives_were_read_to_have_keeps_the_torque_longer() -> None:
    group = FakeGroup([0] * 5)
    modes = Modes(group, 0.002, path_stop_s=1.0, quick_stop_s=0.1)
    modes.quick_stop_takes(0.3)
    modes.mode = Mode.RUNNING
    modes.fail(Fault.ESTOP_INPUT, -1)
    for _ in range(150):
        modes.progress(1, standing=False)
        assert group.wanted is Wanted.QUICK_STOP
    modes.progress(1, standing=False)
    assert group.wanted is Wanted.OFF


@pytest.mark.parametrize("fault", [Fault.PLANNER_GONE, Fault.STATE_LOST])
def test_a_coordinated_stop_that_takes_too_long_is_broken_off(fault: Fault) -> None:
    group = FakeGroup([0] * 5)
    modes = Modes(group, 0.002, path_stop_s=0.5, quick_stop_s=0.1)
    modes.mode = Mode.RUNNING
    modes.fail(fault, 1)
    for _ in range(250):
        modes.progress(1, standing=False)
        assert group.wanted is not Wanted.QUICK_STOP
    modes.progress(1, standing=False)
    assert group.wanted is Wanted.QUICK_STOP and modes.fault is fault


def test_a_warning_of_a_drive_is_told_and_stops_nothing() -> None:
    modes, group = modes_in(Mode.RUNNING)
    group.drives[3].statusword = 1 << 7
    for _ in range(5):
        modes.watch(0.0)
    assert (modes.mode, modes.fault, modes.warning) == (Mode.RUNNING, Fault.NONE, Fault.DRIVE_WARNING)


def test_a_lost_drive_quick_stops_the_group_once_the_others_stand() -> None:
    modes, group = modes_in(Mode.RUNNING)
    modes.fail(Fault.STATE_LOST, 1)
    modes.progress(1, standing=False)
    assert group.wanted is not Wanted.QUICK_STOP
    modes.progress(1, standing=True)
    assert group.wanted is Wanted.QUICK_STOP


def test_the_first_fault_stays_shown_and_a_harder_reaction_still_acts() -> None:
    modes, group = modes_in(Mode.RUNNING)
    modes.fail(Fault.PLANNER_GONE, -1)
    modes.fail(Fault.BUS_ERROR, 0)
    assert modes.fault is Fault.PLANNER_GONE and group.wanted is Wanted.QUICK_STOP


def test_reset_waits_for_standstill() -> None:
    modes, group = modes_in(Mode.RUNNING)
    modes.fail(Fault.PLANNER_GONE, -1)
    assert not modes.request(Request.RESET, 0.0, standing=False) and modes.mode is Mode.FAULT
    modes.request(Request.RESET, 0.0, standing=True)
    assert modes.mode is Mode.OFF and modes.fault is Fault.NONE and group.wanted is Wanted.RESET


@pytest.mark.parametrize("value", (-0.1, 2.5, float("nan"), float("inf")))
def test_an_override_out_of_range_changes_nothing(value: float) -> None:
    modes, _ = modes_in(Mode.RUNNING)
    assert not modes.request(Request.OVERRIDE, value, standing=False) and modes.override == 1.0


def test_a_drive_that_does_not_enable_in_time_is_named() -> None:
    modes, group = modes_in(Mode.OFF)
    modes.request(Request.ENABLE, 0.0, standing=True)
    for i in (0, 1, 2, 4):
        group.drives[i].following = True
    for _ in range(2600):
        modes.progress(1, standing=True)
    assert (modes.fault, modes.fault_axis) == (Fault.ENABLE_TIMEOUT, 3)


def test_a_drive_that_starts_anew_after_a_fault_is_no_longer_trusted_though_its_fault_stays_shown() -> None:
    modes, group = modes_in(Mode.RUNNING)
    group.failure = DriveFault.TORQUE_OFF, 2
    modes.watch(0.0)
    assert (modes.fault, modes.untrusted) == (Fault.TORQUE_OFF, 0)
    group.unseen = {2: DriveFault.NODE_RESET}
    modes.watch(0.1)
    assert (modes.fault, modes.warning, modes.untrusted) == (Fault.TORQUE_OFF, Fault.NODE_RESET, 0x04)


def test_a_drive_that_gets_no_torque_for_its_homing_is_named_after_the_time_for_enabling() -> None:
    modes, group = modes_in(Mode.OFF)
    modes.request(Request.HOME, 4.0, standing=True)
    for drive in group.drives:
        drive.state = State.OPERATION_ENABLED
    group.drives[2].state = State.SWITCH_ON_DISABLED  # it lost its supply
    modes.progress(round(ENABLE_S / 0.002), standing=True)
    assert modes.mode is Mode.HOMING and modes.fault is Fault.NONE
    modes.progress(1, standing=True)
    assert (modes.mode, modes.fault, modes.fault_axis) == (Mode.FAULT, Fault.ENABLE_TIMEOUT, 2)
    assert modes.untrusted == 4


def test_homing_that_takes_long_with_torque_is_no_fault() -> None:
    modes, group = modes_in(Mode.OFF)
    modes.request(Request.HOME, 4.0, standing=True)
    for drive in group.drives:
        drive.state = State.OPERATION_ENABLED
    modes.progress(round(ENABLE_S / 0.002) + 1, standing=True)
    assert (modes.mode, modes.fault) == (Mode.HOMING, Fault.NONE)


def test_a_machine_that_has_just_begun_is_off_and_nothing_of_it_is_chosen() -> None:
    modes = Modes(FakeGroup([0] * 5), 0.002, absolute=0x08)
    assert (modes.mode, modes.phase, modes.fault, modes.fault_axis) == (
        Mode.OFF,
        Phase.STEADY,
        Fault.NONE,
        -1,
    )
    assert (modes.reaction, modes.warning, modes.interlock) == (Reaction.NONE, Fault.NONE, Fault.NONE)
    assert (modes.override, modes.rapid_override, modes.spindle_override) == (1.0, 1.0, 1.0)
    chosen = modes.single_block, modes.optional_stop, modes.adaptive_feed, modes.plan_lost
    assert chosen == (False,) * 4
    assert (modes.homed, modes.untrusted) == (0x08, 0)


def test_an_emergency_stop_is_of_no_axis_and_a_resume_shows_none() -> None:
    modes, _ = modes_in(Mode.RUNNING)
    modes.request(Request.ESTOP, 0.0, standing=False)
    assert (modes.fault, modes.fault_axis) == (Fault.EMERGENCY_STOP, -1)
    modes, _ = modes_in(Mode.HOLD)
    modes.fail(Fault.DOOR_OPEN, 2)
    modes.request(Request.RESUME, 0.0, standing=True)
    assert (modes.mode, modes.fault, modes.fault_axis) == (Mode.RUNNING, Fault.NONE, -1)


def test_the_largest_and_the_least_override_are_taken_and_the_next_number_is_not() -> None:
    for request in (Request.OVERRIDE, Request.RAPID_OVERRIDE):
        modes, _ = modes_in(Mode.RUNNING)
        for value in (0.0, MAX_OVERRIDE):
            assert modes.request(request, value, standing=False)
            assert not modes.request(request, math.nextafter(value, math.copysign(9.0, value - 1.0)), False)
            assert value == (modes.override if request is Request.OVERRIDE else modes.rapid_override)


def test_the_time_for_enabling_is_over_with_the_tick_after_it() -> None:
    modes, group = modes_in(Mode.OFF)
    modes.request(Request.ENABLE, 0.0, standing=True)
    group.drives[0].following = True
    for _ in range(round(ENABLE_S / 0.002)):
        modes.progress(1, standing=True)
        assert modes.fault is Fault.NONE
    modes.progress(1, standing=True)
    assert (modes.fault, modes.fault_axis) == (Fault.ENABLE_TIMEOUT, 1)


def test_a_reset_gives_encoders_that_know_where_they_are_their_zero_back_and_no_other_axis() -> None:
    modes = Modes(FakeGroup([0] * 5), 0.002, absolute=0x08)
    modes.mode, modes.homed = Mode.RUNNING, 0x1F
    modes.fail(Fault.NODE_RESET, 1)
    modes.fail(Fault.NODE_RESET, 3)
    assert (modes.homed, modes.untrusted) == (0x15, 0x0A)
    modes.request(Request.RESET, 0.0, standing=True)
    assert (modes.homed, modes.untrusted) == (0x1D, 0x02)


def test_a_softer_reason_does_not_take_the_place_of_a_hold() -> None:
    modes, _ = modes_in(Mode.RUNNING)
    modes.fail(Fault.DOOR_OPEN, -1)
    modes.fail(Fault.COOLANT_LOST, -1)
    assert (modes.mode, modes.fault, modes.reaction) == (Mode.HOLD, Fault.DOOR_OPEN, Reaction.HOLD)


@pytest.mark.parametrize(("axis", "shown"), [(2, Fault.TORQUE_OFF), (1, Fault.FEEDBACK_LOST)])
def test_a_cause_takes_the_place_of_its_effect_on_the_same_axis_only(axis: int, shown: Fault) -> None:
    modes, _ = modes_in(Mode.RUNNING)
    modes.fail(Fault.FEEDBACK_LOST, 2)
    modes.fail(Fault.TORQUE_OFF, axis)
    assert (modes.fault, modes.fault_axis) == (shown, 2)


@pytest.mark.parametrize("axes", [3, 4, 5])
def test_each_drive_s_warning_is_seen_within_as_many_ticks_as_there_are_drives(axes: int) -> None:
    for warns in range(axes):
        group = FakeGroup([0] * axes)
        modes = Modes(group, 0.002)
        group.drives[warns].statusword = 1 << 7
        for _ in range(axes):
            modes.watch(0.0)
        assert modes.warning is Fault.DRIVE_WARNING


def test_what_has_been_homed_is_trusted_and_other_axes_are_what_they_were() -> None:
    modes, group = modes_in(Mode.OFF)
    modes.homed, modes.untrusted = 0x01, 0x06
    other = group.drives[0]
    other.homing = lambda start: pytest.fail("the homing of an axis that was not asked for")  # type: ignore[method-assign]
    modes.request(Request.HOME, 4.0, standing=True)
    group.drives[2].homing_done = True
    modes.progress(1, standing=True)
    assert (modes.mode, modes.phase, group.wanted) == (Mode.HOMING, Phase.SWITCHING_OFF, Wanted.OFF)
    assert (modes.homed, modes.untrusted) == (0x05, 0x02)


def test_a_drive_that_nobody_sees_switch_off_after_homing_is_a_fault_in_time() -> None:
    """It has started anew meanwhile, or its bus is off: HOMING had no end."""
    modes, group = modes_in(Mode.OFF)
    modes.request(Request.HOME, 4.0, standing=True)
    group.drives[2].homing_done, group.drives[2].state = True, State.OPERATION_ENABLED
    modes.progress(1, standing=True)
    modes.progress(round(ENABLE_S / 0.002), standing=True)
    assert modes.mode is Mode.HOMING
    modes.progress(1, standing=True)
    assert (modes.mode, modes.fault, modes.fault_axis) == (Mode.FAULT, Fault.HOMING_FAILED, 2)


def watched(modes: Modes, ticks: int = 5) -> tuple[Fault, int]:
    """What is warned of after so many ticks, and its axis."""
    for n in range(ticks):
        modes.watch(0.002 * n)
    assert (modes.mode, modes.fault) == (Mode.RUNNING, Fault.NONE)
    return modes.warning, modes.warning_axis


def test_a_drive_that_is_ahead_of_sync_is_warned_of_once_with_its_axis_until_it_is_enabled_anew() -> None:
    modes, group = modes_in(Mode.RUNNING)
    assert watched(modes) == (Fault.NONE, -1)
    group.drives[3].following_error.early = True
    assert watched(modes) == (Fault.SETPOINTS_EARLY, 3)
    group.drives[1].statusword = 1 << 7
    assert watched(modes, 10) == (Fault.DRIVE_WARNING, 1)
    group.drives[1].statusword = 0
    modes._warn(Fault.NONE)
    assert watched(modes) == (Fault.NONE, -1)
    modes.mode = Mode.OFF
    assert modes.request(Request.ENABLE, 0.0, True)
    modes._enter(Mode.RUNNING)
    assert watched(modes) == (Fault.SETPOINTS_EARLY, 3)


def test_who_sends_too_much_is_warned_of_once_and_again_after_it_was_forgotten() -> None:
    modes, group = modes_in(Mode.RUNNING)
    group.chatter.can_id = 0x083
    assert watched(modes) == (Fault.NODE_CHATTERS, -1)
    modes._warn(Fault.NONE)
    assert watched(modes) == (Fault.NONE, -1)
    group.chatter.forget()
    assert watched(modes) == (Fault.NONE, -1)
    group.chatter.can_id = 0x083
    assert watched(modes) == (Fault.NODE_CHATTERS, -1)


def test_who_leaves_others_no_room_is_the_fault_and_no_warning_beside_it() -> None:
    modes, group = modes_in(Mode.RUNNING)
    group.chatter.can_id, group.failure = 0x083, (DriveFault.BUS_FLOODED, -1)
    for n in range(5):
        modes.watch(0.002 * n)
    assert (modes.fault, modes.fault_axis, modes.warning) == (Fault.BUS_FLOODED, -1, Fault.NONE)
    assert modes.untrusted == (1 << len(group.drives)) - 1
