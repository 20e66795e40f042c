"""Spindle, coolant, clamps and inputs on the tick's bench, with devices that do as the test says."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest
from support.machines.shipped_kinds import machine as make_machine
from support.machines.tick_bench import Bench, s_curve, straight

from controller.ipc.handoff import COLUMN, Jog, Outcome, Piece, dwell, send_jog, send_request
from controller.machine.model import Clamp, Io, Joints, Machine, Spindle
from controller.state.modes import Fault, Mode, Request

HERE: Joints = (0.0, 0.0, 0.0, 0.0, 0.0)
THERE: Joints = (40.0, 0.0, 0.0, 0.0, 0.0)
ESTOP, DOOR, TOOL, POWER, FLOW, CLOSED = (1 << bit for bit in range(6))
COOLANT, MIST, OPEN = (1 << bit for bit in range(3))
ALL_WELL = ESTOP | DOOR | TOOL | POWER | FLOW | CLOSED
INPUTS = ("estop", "door", "tool_clamped", "power", "coolant_flow", "a_closed")
OUTPUTS = ("coolant", "mist", "a_open")


class FakeSpindle:
    """Is at speed ``slow`` ticks after it was told another."""

    def __init__(self) -> None:
        self.rev_min = 0.0
        self.at_speed = True

    def want_speed(self, rev_min: float) -> None:
        if rev_min != self.rev_min:
            self.rev_min, self.at_speed = rev_min, False


class FakeNode:
    """Inputs as the test says; the clamp of A reports at once."""

    def __init__(self) -> None:
        self.inputs, self.outputs = ALL_WELL, 0
        self.heard = self.obeys = True

    def fresh(self, now_s: float, consumer_s: float) -> bool:
        return self.heard

    def write(self, outputs: int) -> None:
        self.outputs = outputs
        if self.obeys:
            self.inputs = self.inputs & ~CLOSED if outputs & OPEN else self.inputs | CLOSED


def equipped(**changes: Any) -> Machine:
    built = make_machine()
    axes = tuple(
        replace(axis, clamp=Clamp("a_open", "a_closed", 0.1)) if axis.name == "A" else axis
        for axis in built.axes
    )
    io = Io("main", 11, "", _bits(INPUTS), _bits(OUTPUTS))
    spindle = Spindle(24000.0, "drive", bus="main", node=10, counts_per_rev=4096.0, spin_up_s=0.2)
    return replace(built, **{"axes": axes, "io": io, "spindle": spindle, **changes})


def _bits(names: tuple[str, ...]) -> tuple[tuple[str, int], ...]:
    return tuple((name, bit) for bit, name in enumerate(names))


class Shop(Bench):
    """A bench with a spindle and a node."""

    def __init__(self, machine: Machine | None = None) -> None:
        self.spindle, self.node = FakeSpindle(), FakeNode()
        super().__init__(machine or equipped(), spindle=self.spindle, io=(self.node,))

    def cut(
        self, rev_min: float = 6000.0, coolant: int = 2, clamps: int = 0, max_rev_min: float = math.inf
    ) -> None:
        """Started: it is told, and then moves; the tick in which it is told is over."""
        self.enable()
        piece, move = straight(HERE, THERE, lambda n: s_curve(n, 100.0, 1900.0, 48000.0))
        told = Piece(-1, 1, dwell(0.0).law, 0.0, sets=True)
        told = told._replace(spindle_rev_min=rev_min, coolant=coolant, open_clamps=clamps)
        told = told._replace(max_rev_min=max_rev_min)
        self.send([told, piece, dwell(0.0, end=True)], {0: move})
        self.tick()
        self.ask(Request.START)
        self.tick(8)

    @property
    def stands(self) -> bool:
        return self.cycle.follow.joints == HERE


def test_motion_waits_until_the_spindle_is_at_speed() -> None:
    shop = Shop()
    shop.cut()
    shop.tick(50)
    assert shop.stands and shop.snapshot.waiting and shop.spindle.rev_min == 6000.0
    shop.spindle.at_speed = True
    shop.tick(20)
    assert not shop.stands and not shop.snapshot.waiting
    shop.close()


def test_a_spindle_too_slow_holds_and_resume_waits_anew() -> None:
    shop = Shop()
    shop.cut()
    shop.tick(105)
    assert (shop.snapshot.mode, shop.snapshot.fault) == (Mode.HOLD, Fault.SPINDLE_NOT_AT_SPEED)
    assert shop.stands
    shop.spindle.at_speed = True
    shop.ask(Request.RESUME)
    shop.tick(30)
    assert shop.snapshot.mode is Mode.RUNNING and not shop.stands
    shop.close()


def test_a_spindle_that_loses_its_speed_in_the_cut_holds_on_the_path() -> None:
    shop = Shop()
    shop.cut()
    shop.cycle.peripherals._sag_ticks = 20
    shop.spindle.at_speed = True
    shop.tick(5)
    shop.spindle.at_speed = False
    shop.tick(20)
    assert shop.snapshot.mode is Mode.RUNNING, "it may sag for a moment"
    shop.tick()
    assert (shop.snapshot.mode, shop.snapshot.fault) == (Mode.HOLD, Fault.SPINDLE_NOT_AT_SPEED)
    assert not shop.stands
    shop.close()


@pytest.mark.parametrize(("coolant", "wanted"), ((0, 0), (1, MIST), (2, COOLANT), (3, MIST | COOLANT)))
def test_coolant_words_switch_their_outputs_and_the_end_switches_them_off(coolant: int, wanted: int) -> None:
    shop = Shop()
    shop.cut(coolant=coolant)
    shop.spindle.at_speed = True
    shop.tick(10)
    assert shop.node.outputs == wanted and shop.snapshot.coolant == coolant
    shop.until(Mode.READY)
    shop.tick(2)
    assert shop.node.outputs == 0 and shop.spindle.rev_min == 0.0
    shop.close()


@pytest.mark.parametrize(
    ("missing", "mode", "fault"),
    (
        (ESTOP, Mode.FAULT, Fault.ESTOP_INPUT),
        (POWER, Mode.FAULT, Fault.POWER_LOST),
        (TOOL, Mode.FAULT, Fault.CLAMP),
        (DOOR, Mode.HOLD, Fault.DOOR_OPEN),
    ),
)
def test_an_input_that_opens_in_motion_stops_it(missing: int, mode: Mode, fault: Fault) -> None:
    shop = Shop()
    shop.cut()
    shop.spindle.at_speed = True
    shop.tick(20)
    shop.node.inputs &= ~missing
    shop.tick()
    assert (shop.snapshot.mode, shop.snapshot.fault, shop.snapshot.interlock) == (mode, fault, fault)
    shop.until_rest()
    shop.tick(5)
    assert shop.spindle.rev_min == 0.0 and not shop.node.outputs & COOLANT
    shop.close()


def test_an_emergency_circuit_is_judged_in_every_mode_and_a_reset_does_not_pass_it() -> None:
    shop = Shop()
    shop.node.inputs &= ~ESTOP
    shop.tick()
    assert (shop.snapshot.mode, shop.snapshot.fault) == (Mode.FAULT, Fault.ESTOP_INPUT)
    shop.ask(Request.RESET)
    shop.tick(3)
    assert shop.snapshot.mode is Mode.FAULT
    shop.node.inputs |= ESTOP
    shop.tick()
    shop.ask(Request.RESET)
    shop.tick()
    assert shop.snapshot.mode is Mode.OFF
    shop.close()


@pytest.mark.parametrize("hidden", (False, True))
def test_a_door_that_is_open_or_not_heard_of_allows_no_start(hidden: bool) -> None:
    shop = Shop()
    shop.enable()
    shop.node.inputs &= ~(0 if hidden else DOOR)
    shop.node.heard = not hidden
    shop.tick()
    shop.ask(Request.START)
    shop.tick(3)
    assert shop.snapshot.mode is Mode.READY and shop.refused
    assert shop.snapshot.interlock is (Fault.IO_LOST if hidden else Fault.DOOR_OPEN)
    shop.close()


def test_coolant_that_does_not_flow_holds_at_the_end_of_the_block() -> None:
    shop = Shop()
    peripherals = shop.cycle.peripherals
    shop.cut()
    shop.spindle.at_speed = True
    shop.node.inputs &= ~FLOW
    peripherals._flow_ticks = 20
    shop.tick(25)
    assert shop.snapshot.fault is Fault.COOLANT_LOST and shop.snapshot.mode is Mode.RUNNING
    shop.close()


def test_an_inverted_input_and_output_are_on_when_their_wires_are_off() -> None:
    plain = equipped()
    assert plain.io is not None
    shop = Shop(equipped(io=replace(plain.io, inverted=("door", "coolant"))))
    shop.node.inputs &= ~DOOR
    shop.cut()
    assert shop.snapshot.interlock is Fault.NONE and shop.snapshot.inputs & DOOR
    assert shop.snapshot.coolant == 2 and not shop.node.outputs & COOLANT
    shop.close()


# ---- clamps ------------------------------------------------------------------------

A = 1 << 3


def test_motion_waits_for_a_clamp_to_open_and_names_the_axis_of_one_that_does_not() -> None:
    shop = Shop()
    shop.node.obeys = False
    shop.cut(rev_min=0.0, clamps=A)
    assert shop.node.outputs & OPEN and shop.stands and shop.snapshot.waiting
    shop.tick(60)
    assert (shop.snapshot.fault, shop.snapshot.fault_axis) == (Fault.CLAMP, 3)
    assert shop.stands
    shop.close()


def test_a_clamp_closes_only_on_an_axis_that_stands() -> None:
    shop = Shop()
    shop.cut(rev_min=0.0, clamps=A)
    shop.tick(20)
    assert shop.node.outputs & OPEN
    shop.ask(Request.ESTOP)
    drive = shop.group.drives[3]
    for _ in range(100):
        drive.position += 20_000  # by its own ramp
        shop.tick()
    assert shop.node.outputs & OPEN
    shop.tick(30)
    assert not shop.node.outputs & OPEN
    shop.close()


def test_homing_begins_when_the_clamp_is_open_and_the_clamp_closes_after_it() -> None:
    shop = Shop()
    shop.node.obeys = False
    shop.ask(Request.HOME, A)
    shop.tick(10)
    assert shop.snapshot.mode is Mode.OFF and shop.node.outputs & OPEN
    shop.node.obeys = True
    shop.until(Mode.HOMING, 5)
    shop.until(Mode.OFF, 20)
    assert shop.snapshot.homed == A
    shop.tick(40)
    assert not shop.node.outputs & OPEN
    shop.close()


TURN_A = Jog((0.0, 0.0, 0.0, 1.0, 0.0), 0.5)


def test_a_jog_of_a_clamped_axis_waits_until_it_is_open_and_closes_it_after() -> None:
    shop = Shop()
    shop.enable()
    shop.cycle.modes.homed = 0x1F
    shop.node.obeys = False
    for _ in range(3):
        send_jog(shop.requests, TURN_A)
        shop.tick(10)
    assert shop.snapshot.mode is Mode.JOG and shop.node.outputs & OPEN and shop.stands
    shop.node.obeys = True
    send_jog(shop.requests, TURN_A)
    shop.tick(20)
    assert not shop.stands
    shop.until(Mode.READY, 300)
    shop.tick(60)
    assert not shop.node.outputs & OPEN and shop.snapshot.fault is Fault.NONE
    shop.jog(Jog((1.0, 0.0, 0.0, 0.0, 0.0), 5.0))
    shop.tick(30)
    assert shop.snapshot.mode is Mode.JOG and not shop.node.outputs & OPEN  # X has no clamp
    shop.close()


def test_a_clamp_that_does_not_open_for_a_jog_is_named() -> None:
    shop = Shop()
    shop.enable()
    shop.cycle.modes.homed = 0x1F
    shop.node.obeys = False
    send_jog(shop.requests, TURN_A._replace(length=0.1))
    shop.tick(200)
    assert (shop.snapshot.fault, shop.snapshot.fault_axis) == (Fault.CLAMP, 3)
    assert shop.stands
    shop.close()


def test_a_jog_out_of_a_hold_leaves_the_spindle_as_the_program_wants_it() -> None:
    shop = Shop()
    shop.cut()
    shop.spindle.at_speed = True
    shop.tick(100)
    shop.ask(Request.HOLD)
    shop.until_rest()
    shop.tick(3)
    shop.cycle.modes.homed = 0x1F
    shop.jog(Jog((0.0, 0.0, 1.0, 0.0, 0.0), 20.0, 2.0))
    shop.tick(2)
    assert shop.snapshot.mode is Mode.JOG and shop.spindle.rev_min == 6000.0
    shop.until(Mode.HOLD, 500)
    assert shop.spindle.rev_min == 6000.0 and shop.snapshot.away
    shop.close()


def test_a_jog_out_of_ready_starts_no_spindle() -> None:
    shop = Shop()
    shop.enable()
    shop.jog(Jog((0.0, 0.0, 1.0, 0.0, 0.0), 20.0, 2.0))
    shop.tick(20)
    assert shop.snapshot.mode is Mode.JOG and shop.spindle.rev_min == 0.0 and shop.snapshot.coolant == 0
    shop.close()


def test_a_door_opened_in_a_jog_stops_it() -> None:
    shop = Shop()
    shop.enable()
    for n in range(30):
        shop.jog(Jog((0.0, 0.0, 1.0, 0.0, 0.0), 20.0))
        shop.tick(10)
        if n == 10:
            shop.node.inputs &= ~DOOR
    assert shop.snapshot.mode is Mode.READY and shop.cycle.follow.at_rest
    assert shop.snapshot.warning is Fault.DOOR_OPEN and shop.refused
    shop.close()


def test_a_machine_without_any_of_it_never_waits() -> None:
    bench = Bench()
    bench.enable()
    bench.start_line(HERE, THERE)
    bench.tick(3)
    assert bench.cycle.follow.joints != HERE and not bench.snapshot.waiting
    assert bench.snapshot.spindle_at_speed and bench.snapshot.outputs == 0
    bench.close()


# -- what came of a request


def came_of(shop: Shop, request: Request, value: float = 0.0) -> tuple[Outcome, Fault]:
    """After the tick that takes it."""
    shop.ask(request, value)
    shop.tick()
    return shop.snapshot.came_of(shop.asked)


def test_a_refusal_belongs_to_the_request_that_was_refused() -> None:
    shop = Shop()
    shop.tick()
    shop.node.inputs &= ~ESTOP
    shop.tick()
    shop.node.inputs |= ESTOP
    shop.tick()
    assert came_of(shop, Request.RESET) == (Outcome.DONE, Fault.NONE)
    shop.node.inputs &= ~POWER
    shop.cycle.modes.fault = Fault.NONE
    shop.cycle.modes.mode = Mode.OFF
    shop.cycle.modes.interlock = Fault.POWER_LOST
    assert came_of(shop, Request.ENABLE) == (Outcome.REFUSED, Fault.POWER_LOST)
    shop.node.inputs |= POWER
    shop.tick(3)
    came_of(shop, Request.RESET)
    assert came_of(shop, Request.ENABLE) == (Outcome.DONE, Fault.NONE)
    shop.close()


def test_an_open_door_is_why_a_start_is_refused_and_a_mode_is_no_interlock() -> None:
    shop = Shop()
    shop.enable()
    shop.node.inputs &= ~DOOR
    shop.tick()
    assert came_of(shop, Request.START) == (Outcome.REFUSED, Fault.DOOR_OPEN)
    assert came_of(shop, Request.HOLD) == (Outcome.REFUSED, Fault.NONE)
    assert came_of(shop, Request.OVERRIDE, 0.5) == (Outcome.DONE, Fault.NONE)
    assert came_of(shop, Request.OVERRIDE, 5.0) == (Outcome.REFUSED, Fault.NONE)
    shop.close()


def test_homing_is_answered_when_it_begins_or_another_request_takes_its_place() -> None:
    shop = Shop()
    shop.tick()
    shop.node.obeys = False
    send_request(shop.requests, Request.HOME, 8.0, 1)
    shop.tick(3)
    assert shop.snapshot.came_of(1) == (Outcome.NONE, Fault.NONE), "its clamp is not open yet"
    send_request(shop.requests, Request.DISABLE, 0.0, 2)
    shop.tick()
    assert shop.snapshot.came_of(1) == (Outcome.SUPERSEDED, Fault.NONE)
    assert shop.snapshot.came_of(2) == (Outcome.DONE, Fault.NONE)
    shop.node.obeys = True
    send_request(shop.requests, Request.HOME, 8.0, 3)
    shop.tick(10)
    assert shop.snapshot.came_of(3) == (Outcome.DONE, Fault.NONE)
    shop.close()


def test_requests_of_one_tick_are_answered_one_by_one_and_the_row_has_the_last() -> None:
    shop = Shop()
    shop.enable()
    shop.rows()
    for number, request in enumerate((Request.HOLD, Request.SINGLE_BLOCK, Request.RESUME), 11):
        send_request(shop.requests, request, 1.0, number)
    shop.tick()
    came = [shop.snapshot.came_of(number)[0] for number in (11, 12, 13)]
    assert came == [Outcome.REFUSED, Outcome.DONE, Outcome.REFUSED]
    assert shop.rows()[:, COLUMN["request"]].tolist() == [13.0]
    shop.close()


def test_an_override_turns_the_spindle_and_motion_goes_on_meanwhile() -> None:
    shop = Shop()
    shop.cut()
    shop.spindle.at_speed = True
    shop.tick(20)
    shop.ask(Request.SPINDLE_OVERRIDE, 1.2)
    shop.tick()
    assert shop.spindle.rev_min == 7200.0 and not shop.spindle.at_speed
    before = shop.cycle.follow.joints
    shop.tick(60)
    assert shop.snapshot.mode is Mode.RUNNING and shop.cycle.follow.joints > before
    shop.spindle.at_speed = True
    shop.tick(3)
    for refused_share in (0.49, 1.51, float("nan")):
        assert came_of(shop, Request.SPINDLE_OVERRIDE, refused_share)[0] is Outcome.REFUSED
    assert came_of(shop, Request.SPINDLE_OVERRIDE, 0.5)[0] is Outcome.DONE
    shop.tick()
    assert shop.spindle.rev_min == 3000.0


def test_an_override_leads_the_spindle_to_its_end_and_no_further() -> None:
    shop = Shop()
    shop.cut(rev_min=-23000.0)
    shop.spindle.at_speed = True
    shop.ask(Request.SPINDLE_OVERRIDE, 1.5)
    shop.tick(2)
    assert shop.spindle.rev_min == -24000.0


def test_an_override_leads_the_spindle_no_faster_than_its_tool_bears() -> None:
    shop = Shop()
    shop.cut(rev_min=-5000.0, max_rev_min=6000.0)
    shop.spindle.at_speed = True
    shop.ask(Request.SPINDLE_OVERRIDE, 1.1)
    shop.tick(2)
    assert shop.spindle.rev_min == pytest.approx(-5500.0)
    shop.ask(Request.SPINDLE_OVERRIDE, 1.5)
    shop.tick(2)
    assert shop.spindle.rev_min == -6000.0


def test_by_hand_an_override_slows_the_spindle_and_leads_it_no_faster_than_was_asked() -> None:
    shop = Shop()
    shop.enable()
    shop.ask(Request.SPINDLE, 800.0)
    for share, found in ((1.5, 800.0), (0.5, 400.0)):
        shop.ask(Request.SPINDLE_OVERRIDE, share)
        shop.tick(2)
        assert shop.spindle.rev_min == found


def test_a_spindle_that_does_not_come_to_its_overridden_speed_is_told() -> None:
    shop = Shop()
    shop.cut()
    shop.spindle.at_speed = True
    shop.cycle.peripherals._sag_ticks = 20
    shop.tick(5)
    shop.ask(Request.SPINDLE_OVERRIDE, 1.1)
    shop.tick(110)
    assert shop.snapshot.mode is Mode.RUNNING, "it has its time to come there"
    shop.tick(20)
    assert (shop.snapshot.mode, shop.snapshot.fault) == (Mode.HOLD, Fault.SPINDLE_NOT_AT_SPEED)


def test_by_hand_spindle_and_coolant_stay_until_a_program_starts() -> None:
    shop = Shop()
    shop.enable()
    assert came_of(shop, Request.SPINDLE, 24001.0)[0] is Outcome.REFUSED
    assert came_of(shop, Request.SPINDLE, -800.0)[0] is Outcome.DONE
    assert came_of(shop, Request.COOLANT, 3.0)[0] is Outcome.DONE
    assert came_of(shop, Request.CLAMPS, 8.0)[0] is Outcome.DONE
    shop.tick(50)
    assert shop.spindle.rev_min == -800.0
    assert shop.node.outputs == COOLANT | MIST | OPEN
    shop.cut(rev_min=6000.0, coolant=0)
    assert shop.spindle.rev_min == 0.0 and shop.snapshot.waiting, "until it stands"
    shop.spindle.at_speed = True
    shop.tick(30)
    assert shop.spindle.rev_min == 6000.0 and shop.node.outputs == 0


def test_a_program_that_ends_leaves_nothing_on_for_the_hand_that_comes_next() -> None:
    shop = Shop()
    shop.cut()
    shop.spindle.at_speed = True
    shop.tick(4)
    shop.ask(Request.STOP)
    shop.until(Mode.READY)
    assert came_of(shop, Request.COOLANT, 1.0)[0] is Outcome.DONE
    shop.tick(3)
    assert shop.spindle.rev_min == 0.0 and shop.node.outputs == MIST


def test_a_door_that_opens_ends_what_was_told_by_hand_and_it_does_not_come_back() -> None:
    shop = Shop()
    shop.enable()
    shop.ask(Request.SPINDLE, 800.0)
    shop.tick(3)
    shop.node.inputs &= ~DOOR
    shop.tick(3)
    assert shop.spindle.rev_min == 0.0
    assert came_of(shop, Request.SPINDLE, 800.0) == (Outcome.REFUSED, Fault.DOOR_OPEN)
    shop.node.inputs |= DOOR
    shop.tick(3)
    assert shop.spindle.rev_min == 0.0


def test_coolant_of_a_program_is_told_by_hand_until_it_says_otherwise() -> None:
    shop = Shop()
    shop.cut(coolant=2)
    assert shop.node.outputs & COOLANT
    assert came_of(shop, Request.COOLANT, 0.0)[0] is Outcome.DONE
    assert came_of(shop, Request.SPINDLE, 0.0)[0] is Outcome.REFUSED
    shop.tick(3)
    assert not shop.node.outputs & COOLANT and shop.spindle.rev_min == 6000.0


@pytest.mark.parametrize(
    ("request_", "value"),
    [(Request.COOLANT, 4.0), (Request.COOLANT, 0.5), (Request.CLAMPS, 1.0), (Request.CLAMPS, -8.0)],
)
def test_by_hand_only_what_is_there_can_be_told(request_: Request, value: float) -> None:
    shop = Shop()
    shop.enable()
    assert came_of(shop, request_, value)[0] is Outcome.REFUSED
