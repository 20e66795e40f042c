"""The power drive system's states: sixteen transitions, option codes, halt, STO, brake."""

from __future__ import annotations

import pytest
from support.drives.lone_drive import PERIOD_S, Lone

from drives.bench.simulated import Parameters
from drives.bench.simulated.machine402 import Power

SHUTDOWN, SWITCH_ON, ENABLE, QUICK_STOP, NOTHING, RESET = 0x06, 0x07, 0x0F, 0x02, 0x00, 0x80
WAYS: dict[int, tuple[list[int], int, Power]] = {
    2: ([], SHUTDOWN, Power.READY),
    3: ([SHUTDOWN], SWITCH_ON, Power.SWITCHED_ON),
    4: ([SHUTDOWN, SWITCH_ON], ENABLE, Power.ENABLED),
    5: ([SHUTDOWN, SWITCH_ON, ENABLE], SWITCH_ON, Power.SWITCHED_ON),
    6: ([SHUTDOWN, SWITCH_ON], SHUTDOWN, Power.READY),
    7: ([SHUTDOWN], NOTHING, Power.DISABLED),
    8: ([SHUTDOWN, SWITCH_ON, ENABLE], SHUTDOWN, Power.READY),
    9: ([SHUTDOWN, SWITCH_ON, ENABLE], NOTHING, Power.DISABLED),
    10: ([SHUTDOWN, SWITCH_ON], NOTHING, Power.DISABLED),
    11: ([SHUTDOWN, SWITCH_ON, ENABLE], QUICK_STOP, Power.QUICK_STOP),
    12: ([SHUTDOWN, SWITCH_ON, ENABLE, QUICK_STOP], NOTHING, Power.DISABLED),
    16: ([SHUTDOWN, SWITCH_ON, ENABLE, QUICK_STOP], ENABLE, Power.ENABLED),
}


@pytest.mark.parametrize("number", list(WAYS))
def test_a_commanded_transition(number: int) -> None:
    way, word, state = WAYS[number]
    lone = Lone()
    lone.write(0x605A, 0, 6, 2)
    for before in way:
        lone.command(before)
    lone.command(word)
    assert lone.drive.axis.power is state


def test_the_transitions_by_itself_and_the_reset() -> None:
    """0, 1: power-on and boot; 13, 14: an error; 15: reset."""
    lone = Lone(Parameters(boot_s=0.1))
    assert lone.drive.axis.power is Power.NOT_READY
    lone.wait(0.1)
    assert lone.drive.axis.power is Power.DISABLED
    moving(lone)
    lone.drive.inject(0x2310, lone.bus.now_s)
    assert lone.drive.axis.power is Power.FAULT_REACTION
    lone.wait(0.1)
    assert lone.drive.axis.power is Power.FAULT
    lone.command(NOTHING)
    lone.command(RESET)
    assert lone.drive.axis.power is Power.DISABLED


def test_the_quick_stops_in_between_pass_through_quick_stop_active_by_605a() -> None:
    lone = Lone()
    moving(lone)
    lone.command(QUICK_STOP, 0.0)
    assert lone.drive.axis.power is Power.QUICK_STOP
    lone.wait(0.1)
    assert lone.drive.axis.power is Power.DISABLED, "option 2"
    lone.command(SHUTDOWN)
    lone.command(QUICK_STOP)
    assert lone.drive.axis.power is Power.DISABLED, "7 by the quick stop command"


def moving(lone: Lone, speed: int = 2_000_000) -> None:
    """Enabled in profile velocity mode at a steady speed; slow 2e7, quick 8e7 counts/s^2."""
    lone.write(0x6084, 0, 20_000_000, 4)
    lone.write(0x6085, 0, 80_000_000, 4)
    lone.enable(3)
    lone.write(0x60FF, 0, speed, 4)
    lone.wait(0.15)
    assert lone.drive.axis.servo.velocity == pytest.approx(speed, rel=0.01)


def stopping_s(lone: Lone) -> float:
    """Time until the demand stands."""
    begun_s = lone.bus.now_s
    while lone.drive.axis.powered and lone.drive.axis.servo.end != lone.drive.axis.servo.start:
        lone.wait(0.001)
        assert lone.bus.now_s < begun_s + 1.0
    return lone.bus.now_s - begun_s


SLOW_S, QUICK_S, HARD_S = 0.1, 0.025, 0.0125
STOPS = [
    ("605A", 0x605A, QUICK_STOP, 0, 0.0, Power.DISABLED),
    ("605A", 0x605A, QUICK_STOP, 1, SLOW_S, Power.DISABLED),
    ("605A", 0x605A, QUICK_STOP, 2, QUICK_S, Power.DISABLED),
    ("605A", 0x605A, QUICK_STOP, 3, HARD_S, Power.DISABLED),
    ("605A", 0x605A, QUICK_STOP, 4, HARD_S, Power.DISABLED),
    ("605A", 0x605A, QUICK_STOP, 5, SLOW_S, Power.QUICK_STOP),
    ("605A", 0x605A, QUICK_STOP, 6, QUICK_S, Power.QUICK_STOP),
    ("605A", 0x605A, QUICK_STOP, 7, HARD_S, Power.QUICK_STOP),
    ("605A", 0x605A, QUICK_STOP, 8, HARD_S, Power.QUICK_STOP),
    ("605B", 0x605B, SHUTDOWN, 0, 0.0, Power.READY),
    ("605B", 0x605B, SHUTDOWN, 1, SLOW_S, Power.READY),
    ("605C", 0x605C, SWITCH_ON, 0, 0.0, Power.SWITCHED_ON),
    ("605C", 0x605C, SWITCH_ON, 1, SLOW_S, Power.SWITCHED_ON),
    ("605D", 0x605D, 0x10F, 1, SLOW_S, Power.ENABLED),
    ("605D", 0x605D, 0x10F, 2, QUICK_S, Power.ENABLED),
    ("605D", 0x605D, 0x10F, 3, HARD_S, Power.ENABLED),
    ("605D", 0x605D, 0x10F, 4, HARD_S, Power.ENABLED),
]


@pytest.mark.parametrize(
    ("name", "index", "word", "option", "takes_s", "state"), STOPS, ids=[f"{r[0]} = {r[3]}" for r in STOPS]
)
def test_an_option_code_says_how_a_moving_axis_stops_and_where_that_ends(
    name: str, index: int, word: int, option: int, takes_s: float, state: Power
) -> None:
    lone = Lone()
    lone.write(index, 0, option, 2)
    moving(lone)
    lone.command(word, 0.0)
    assert stopping_s(lone) == pytest.approx(takes_s, abs=2 * PERIOD_S + 0.004), name
    lone.wait(0.1)
    assert lone.drive.axis.power is state, name
    assert lone.drive.axis.servo.velocity == pytest.approx(0.0, abs=1.0)


@pytest.mark.parametrize(
    ("option", "takes_s"), [(0, 0.0), (1, SLOW_S), (2, QUICK_S), (3, HARD_S), (4, HARD_S)]
)
def test_605e_says_how_a_faulty_axis_stops(option: int, takes_s: float) -> None:
    lone = Lone()
    lone.write(0x605E, 0, option, 2)
    moving(lone)
    lone.drive.inject(0x7305, lone.bus.now_s)
    assert stopping_s(lone) == pytest.approx(takes_s, abs=2 * PERIOD_S + 0.004)
    lone.wait(0.1)
    assert lone.drive.axis.power is Power.FAULT


def test_a_halt_ends_where_it_began_when_it_is_taken_back() -> None:
    lone = Lone()
    moving(lone)
    assert lone.command(0x10F, 0.3) & 0x400, "standing is the target of a halt"
    lone.command(0x0F, 0.3)
    assert lone.drive.axis.servo.velocity == pytest.approx(2_000_000, rel=0.01)


def test_disable_operation_taken_back_on_the_ramp_goes_on() -> None:
    lone = Lone()
    lone.write(0x605C, 0, 1, 2)
    moving(lone)
    lone.command(SWITCH_ON, 0.05)
    assert lone.drive.axis.power is Power.ENABLED
    lone.command(ENABLE, 0.3)
    assert lone.drive.axis.servo.velocity == pytest.approx(2_000_000, rel=0.01)


# -- STO, local control, quick-stop input


def test_sto_takes_the_current_at_once_and_lets_nobody_switch_on() -> None:
    lone = Lone()
    moving(lone)
    lone.drive.axis.set_sto(True, lone.bus.now_s)
    assert lone.drive.axis.power is Power.DISABLED
    assert not lone.status & 0x10, "no voltage"
    assert lone.read(0x60FD) & 8
    assert lone.command(SHUTDOWN) & 0x6F == 0x40
    lone.drive.axis.set_sto(False, lone.bus.now_s)
    assert lone.command(SHUTDOWN) & 0x7F == 0x31
    assert lone.emergencies() == [0x9000, 0]


def test_a_quick_stop_input_stops_as_605a_says() -> None:
    lone = Lone()
    moving(lone)
    lone.drive.axis.quick_stop_input(lone.bus.now_s)
    assert stopping_s(lone) == pytest.approx(QUICK_S, abs=0.006)


def test_local_control_shows_in_the_statusword() -> None:
    lone = Lone()
    assert lone.status & 0x200
    lone.drive.take_local_control(True)
    assert not lone.status & 0x200


# -- brake


def test_operation_is_enabled_when_the_brake_is_open() -> None:
    lone = Lone(Parameters(enable_delay_s=0.1))
    lone.command(SHUTDOWN)
    lone.command(SWITCH_ON)
    assert lone.read(0x60FE, 1) & 1
    assert lone.command(ENABLE, 0.05) & 0x6F == 0x23
    lone.wait(0.06)
    assert lone.status & 0x6F == 0x27
    assert not lone.read(0x60FE, 1) & 1
    assert lone.read(0x2003, 1) == 100


@pytest.mark.parametrize(("word", "state"), [(SWITCH_ON, Power.SWITCHED_ON), (SHUTDOWN, Power.READY)])
def test_an_orderly_way_out_keeps_the_current_until_the_brake_holds(word: int, state: Power) -> None:
    lone = Lone(Parameters(brake_close_s=0.05, gravity=-2e6))
    lone.enable()
    before = lone.drive.axis.actual()
    lone.command(word, 0.04)
    assert lone.drive.axis.power is Power.ENABLED
    lone.wait(0.02)
    assert lone.drive.axis.power is state
    lone.wait(0.2)
    assert lone.drive.axis.actual() == before


def test_voltage_off_lets_a_heavy_axis_fall_until_the_brake_holds() -> None:
    lone = Lone(Parameters(brake_close_s=0.05, gravity=-2e6))
    lone.enable()
    lone.command(NOTHING, 0.2)
    fallen = lone.drive.axis.actual()
    assert fallen == pytest.approx(-0.5 * 2e6 * 0.05**2, rel=0.1)
    lone.wait(0.2)
    assert lone.drive.axis.actual() == fallen


def test_a_brake_set_by_hand_holds_the_enabled_motor_and_the_drive_notices() -> None:
    lone = Lone()
    lone.write(0x6065, 0, 10_000, 4)
    lone.enable(3)
    lone.write(0x60FE, 2, 1, 4)
    lone.write(0x60FE, 1, 1, 4)
    lone.write(0x60FF, 0, 500_000, 4)
    lone.wait(0.3)
    assert lone.emergencies() == [0x8611]
    assert abs(lone.drive.axis.actual()) < 100


# -- limits


def test_a_limit_switch_trips_a_drive_that_is_made_so_and_lets_it_back() -> None:
    lone = Lone(Parameters(limit_fault=True, switches=(-150_000, 150_000)))
    moving(lone, 500_000)
    lone.wait(0.3)
    assert lone.emergencies() == [0x8612]
    assert lone.read(0x60FD) & 2
    lone.write(0x60FF, 0, -200_000 & 0xFFFF_FFFF, 4)
    lone.command(NOTHING)
    lone.command(RESET)
    for word in (SHUTDOWN, SWITCH_ON, ENABLE):
        lone.command(word)
    lone.wait(0.1)
    assert lone.emergencies() == [0x8612, 0]
    assert not lone.read(0x60FD) & 2


def test_the_software_limit_bounds_every_mode() -> None:
    lone = Lone()
    lone.write(0x607D, 2, 150_000, 4)
    moving(lone, 500_000)
    lone.wait(0.3)
    assert lone.drive.axis.actual() == pytest.approx(150_000, abs=2)
    assert lone.status & 0x800
