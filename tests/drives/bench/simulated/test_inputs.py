"""What the terminals of a drive do: limit switches, safe torque off, emergency stop, probes."""

from __future__ import annotations

import pytest
from support.drives.lone_drive import Lone, Refused

from drives.bench.simulated import Parameters
from drives.bench.simulated.inputs import EMERGENCY_STOP, HOME, NEGATIVE_LIMIT, POSITIVE_LIMIT, STO

FAULT, DISABLED, ENABLED = 0x08, 0x40, 0x27


def moving(speed: int = 100_000, **nature: object) -> Lone:
    """A drive that turns in profile velocity mode."""
    lone = Lone(Parameters(**nature))  # type: ignore[arg-type]
    lone.enable(3)
    lone.write(0x6083, 0, 10_000_000, 4)
    lone.write(0x60FF, 0, speed, 4)
    lone.run(0.1)
    assert lone.read(0x606C, signed=True) == pytest.approx(speed, rel=0.01)
    return lone


def test_digital_inputs_show_the_terminals() -> None:
    lone = Lone()
    for word in (NEGATIVE_LIMIT, POSITIVE_LIMIT, HOME, STO, EMERGENCY_STOP, 1 << 16, 1 << 17):
        lone.write(0x2004, 0, word, 4)
        away_from_the_home_switch = ~HOME if word != HOME else -1
        assert lone.read(0x60FD) & away_from_the_home_switch == word


def test_a_terminal_that_is_not_there_is_refused() -> None:
    with pytest.raises(Refused, match="06090030"):
        Lone().write(0x2004, 0, 1 << 8, 4)


def test_further_onto_a_limit_switch_is_a_fault_where_the_drive_is_told_so() -> None:
    lone = moving(limit_fault=True)
    lone.write(0x2004, 0, POSITIVE_LIMIT, 4)
    lone.run(0.3)
    assert lone.status & 0x4F == FAULT and lone.emergencies() == [0x8612]


def test_away_from_a_limit_switch_the_axis_may_move() -> None:
    lone = moving(-100_000, limit_fault=True)
    lone.write(0x2004, 0, POSITIVE_LIMIT, 4)
    lone.run(0.1)
    assert lone.status & 0x6F == ENABLED


def test_without_a_fault_a_limit_switch_makes_a_quick_stop() -> None:
    lone = moving()
    lone.write(0x605A, 0, 6, 2)
    lone.write(0x2004, 0, POSITIVE_LIMIT, 4)
    lone.run(0.3)
    assert lone.status & 0x6F == 0x07 and lone.read(0x606C) == 0
    assert lone.status & 1 << 11


def test_safe_torque_off_comes_by_its_terminal() -> None:
    lone = moving()
    lone.write(0x2004, 0, STO, 4)
    assert lone.status & 0x4F == DISABLED
    assert not lone.status & 1 << 4


def test_an_emergency_stop_brakes_first_and_then_takes_the_torque_away() -> None:
    lone = moving(estop_delay_s=0.4)
    lone.write(0x605A, 0, 6, 2)
    lone.write(0x6085, 0, 1_000_000, 4)
    lone.write(0x2004, 0, EMERGENCY_STOP, 4)
    assert lone.status & 0x6F == 0x07, "a quick stop, under power"
    lone.run(0.3)
    assert lone.status & 0x6F == 0x07 and abs(lone.drive.axis.servo.velocity) < 1.0
    lone.run(0.2)
    assert lone.status & 0x4F == DISABLED and lone.drive.axis.sto
    lone.write(0x2004, 0, 0, 4)
    assert not lone.drive.axis.sto


def test_an_emergency_stop_that_is_over_in_time_leaves_the_torque() -> None:
    lone = moving(estop_delay_s=0.4)
    lone.write(0x605A, 0, 6, 2)
    lone.write(0x2004, 0, EMERGENCY_STOP, 4)
    lone.write(0x2004, 0, 0, 4)
    lone.run(0.6)
    assert lone.status & 0x6F == 0x07 and not lone.drive.axis.sto


def test_without_current_and_brake_the_motor_coasts_as_far_as_friction_lets_it() -> None:
    lone = moving(brake=False, coast_counts_s2=500_000.0)
    before = lone.drive.axis.servo.position
    lone.write(0x2004, 0, STO, 4)
    lone.run(0.1)
    assert lone.read(0x606C, signed=True) == pytest.approx(50_000, rel=0.05), "half its speed is left"
    lone.run(0.2)
    run_on = lone.drive.axis.servo.position - before
    assert run_on == pytest.approx(100_000**2 / 2 / 500_000, rel=0.05)
    assert lone.drive.axis.servo.velocity == 0.0
    assert lone.read(0x6064, signed=True) == round(lone.drive.axis.servo.position)


def test_the_brake_ends_the_coasting_when_it_has_closed() -> None:
    lone = moving(brake_close_s=0.05, coast_counts_s2=1.0)
    before = lone.drive.axis.servo.position
    lone.write(0x2004, 0, STO, 4)
    lone.run(0.2)
    assert lone.drive.axis.servo.position - before == pytest.approx(100_000 * 0.05, rel=0.1)


def test_a_coasting_motor_is_caught_by_current() -> None:
    lone = moving(brake=False, coast_counts_s2=1000.0, enable_delay_s=0.001)
    lone.write(0x2004, 0, STO, 4)
    lone.write(0x60FF, 0, 0, 4)
    lone.write(0x2004, 0, 0, 4)
    for word in (0x06, 0x07):
        lone.command(word, wait_s=0.002)
    assert lone.drive.axis.servo.velocity > 50_000
    at = lone.drive.axis.servo.position
    lone.command(0x0F, wait_s=0.0)
    lone.run(0.3)
    assert abs(lone.drive.axis.servo.velocity) < 1.0
    assert 10 < lone.drive.axis.servo.position - at < 1000, "it ran on while it was braked"
