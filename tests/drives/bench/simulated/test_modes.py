"""Modes of operation: profiles, interpolation, cyclic velocity, their status bits and limits."""

from __future__ import annotations

from itertools import pairwise

import pytest
from support.drives.lone_drive import PERIOD_S, START, Lone, Refused

from drives.bench.simulated import Parameters

REACHED, BIT_12, FOLLOWING_ERROR = 0x400, 0x1000, 0x2000
SPEED, UP, DOWN = 1_000_000, 20_000_000, 10_000_000


def set_up(mode: int) -> Lone:
    """Enabled; profile 1e6 counts/s, 2e7 up and 1e7 counts/s^2 down; 2 ms."""
    lone = Lone()
    lone.write(0x60C2, 1, 2, 1)
    for index, value in ((0x6081, SPEED), (0x6083, UP), (0x6084, DOWN)):
        lone.write(index, 0, value, 4)
    lone.enable(mode)
    return lone


def go(lone: Lone, target: int, word: int = 0x1F) -> None:
    lone.write(0x607A, 0, target, 4)
    lone.write(0x6040, 0, word, 2)


def demands(lone: Lone, periods: int) -> list[float]:
    """The position demand, period by period."""
    seen = []
    for _ in range(periods):
        lone.wait(PERIOD_S)
        seen.append(lone.drive.axis.servo.start)
    return seen


def test_the_supported_modes_are_those_of_6502_and_no_others() -> None:
    lone = Lone()
    supported = lone.read(0x6502)
    for mode in range(1, 12):
        if supported & 1 << mode - 1:
            lone.write(0x6060, 0, mode, 1)
            lone.wait(0.01)
            assert lone.read(0x6061) == mode
        else:
            with pytest.raises(Refused, match="06090030"):
                lone.write(0x6060, 0, mode, 1)


# -- profile position


@pytest.mark.parametrize("target", [5, -7, 3000, -40_000, 300_000])
def test_pp_reaches_its_target_within_speed_and_acceleration_without_overshoot(target: int) -> None:
    lone = set_up(1)
    go(lone, target)
    path = [0.0, *demands(lone, 300)]
    sign = 1 if target > 0 else -1
    assert path[-1] == target
    assert all(b * sign >= a * sign - 1e-6 for a, b in pairwise(path))
    speeds = [(b - a) / PERIOD_S * sign for a, b in pairwise(path)]
    assert max(speeds) <= SPEED + 1e-6
    changes = [(b - a) / PERIOD_S for a, b in pairwise(speeds)]
    assert max(changes) <= UP * 1.01
    assert min(changes) >= -DOWN - 1.0 / PERIOD_S**2 - max(speeds[-5:])
    assert lone.drive.axis.actual() == target


def test_pp_acknowledges_a_target_and_says_when_it_is_reached() -> None:
    lone = set_up(1)
    go(lone, 50_000)
    assert lone.status & (BIT_12 | REACHED) == BIT_12
    lone.write(0x6040, 0, 0x0F, 2)
    assert not lone.status & BIT_12
    lone.wait(0.5)
    assert lone.status & (BIT_12 | REACHED) == REACHED


def test_pp_keeps_one_target_for_later_and_refuses_a_third() -> None:
    lone = set_up(1)
    go(lone, 20_000)
    lone.write(0x6040, 0, 0x0F, 2)
    go(lone, 40_000)
    lone.write(0x6040, 0, 0x0F, 2)
    assert lone.status & BIT_12, "the place for the next one is taken"
    go(lone, 60_000)
    lone.write(0x6040, 0, 0x0F, 2)
    path = demands(lone, 400)
    assert 20_000.0 in path, "the first target was not left out"
    assert path[-1] == 40_000.0
    assert not lone.status & BIT_12


def test_pp_changes_at_once_when_asked_to() -> None:
    lone = set_up(1)
    go(lone, 100_000)
    lone.wait(0.05)
    lone.write(0x6040, 0, 0x2F, 2)
    go(lone, -5_000, 0x3F)
    path = demands(lone, 500)
    assert max(path) < 90_000
    assert path[-1] == -5_000.0


def test_pp_relative_targets_add_up() -> None:
    lone = set_up(1)
    for _ in range(3):
        go(lone, 1_000, 0x5F)
        lone.write(0x6040, 0, 0x4F, 2)
        lone.wait(0.2)
    assert lone.drive.axis.actual() == 3_000


def test_pp_says_target_reached_only_after_6068_within_6067() -> None:
    lone = set_up(1)
    lone.write(0x6067, 0, 5, 4)
    lone.write(0x6068, 0, 100, 2)
    go(lone, 2_000)
    lone.wait(0.1)
    assert lone.drive.axis.actual() == 2_000
    assert not lone.status & REACHED
    lone.wait(0.1)
    assert lone.status & REACHED


def test_pp_target_is_held_at_the_software_limit() -> None:
    lone = set_up(1)
    lone.write(0x607D, 2, 10_000, 4)
    go(lone, 20_000)
    lone.wait(0.5)
    assert lone.drive.axis.actual() == 10_000
    assert lone.status & 0x800


# -- profile velocity


def test_pv_ramps_to_its_speed_and_says_so() -> None:
    lone = set_up(3)
    assert lone.status & BIT_12 or lone.drive.axis.servo.velocity == 0.0
    lone.write(0x60FF, 0, 500_000, 4)
    path = demands(lone, 200)
    speeds = [(b - a) / PERIOD_S for a, b in pairwise(path)]
    assert speeds[-1] == pytest.approx(500_000)
    assert max(b - a for a, b in pairwise(speeds)) <= UP * PERIOD_S * 1.001
    assert lone.status & (REACHED | BIT_12) == REACHED
    lone.write(0x60FF, 0, 0, 4)
    lone.wait(0.3)
    assert lone.status & (REACHED | BIT_12) == REACHED | BIT_12


def test_607f_bounds_the_speed() -> None:
    lone = set_up(3)
    lone.write(0x607F, 0, 300_000, 4)
    lone.write(0x60FF, 0, 500_000, 4)
    lone.wait(0.3)
    assert lone.drive.axis.servo.velocity == pytest.approx(300_000, rel=1e-3)


def test_60c5_bounds_the_acceleration_of_profiles() -> None:
    lone = set_up(3)
    lone.write(0x60C5, 0, 1_000_000, 4)
    lone.write(0x60FF, 0, 500_000, 4)
    path = demands(lone, 50)
    speeds = [(b - a) / PERIOD_S for a, b in pairwise(path)]
    assert max(b - a for a, b in pairwise(speeds)) <= 1_000_000 * PERIOD_S * 1.001


# -- with every SYNC


def cyclic(mode: int, entry: int) -> Lone:
    """RPDO 2 = controlword and one more object, latched by SYNC."""
    lone = set_up(mode)
    lone.map(0x1401, 0x1601, [0x6040_0010, entry], 1, 0x305)
    lone.nmt(START)
    lone.run(0.01)
    return lone


def put(lone: Lone, word: int, value: int) -> None:
    lone.put(0x305, word.to_bytes(2, "little") + value.to_bytes(4, "little", signed=True), 0.0005)
    lone.sync(wait_s=PERIOD_S - 0.0005)


def test_ip_follows_its_positions_while_it_is_switched_on() -> None:
    lone = cyclic(7, 0x60C1_0120)
    for k in range(20):
        put(lone, 0x0F, 100 * k)
    assert lone.drive.axis.actual() == 0
    assert not lone.status & BIT_12
    for k in range(100):
        put(lone, 0x1F, 100 * k)
    assert lone.status & BIT_12
    assert lone.drive.axis.servo.start == 100 * 98
    put(lone, 0x0F, 0)
    assert not lone.status & BIT_12


def test_csv_integrates_its_speeds() -> None:
    lone = cyclic(9, 0x60FF_0020)
    for _ in range(100):
        put(lone, 0x0F, 50_000)
    assert lone.status & BIT_12
    assert lone.drive.axis.servo.velocity == pytest.approx(50_000, rel=1e-3)
    assert lone.drive.axis.servo.start == pytest.approx(50_000 * PERIOD_S * 99, abs=200)


def csp() -> Lone:
    return cyclic(8, 0x607A_0020)


def test_csp_follows_every_setpoint_exactly_without_limits() -> None:
    lone = csp()
    for k in range(50):
        put(lone, 0x0F, 5_000 * k)
    assert lone.drive.axis.servo.end == 5_000 * 49


def test_csp_steps_beyond_607f_are_spread_and_shown() -> None:
    lone = csp()
    lone.write(0x607F, 0, 100_000, 4)
    put(lone, 0x0F, 1_000)
    assert lone.status & 0x800
    seen = [lone.drive.axis.servo.end]
    for _ in range(8):
        put(lone, 0x0F, 1_000)
        seen.append(lone.drive.axis.servo.end)
    assert max(b - a for a, b in pairwise(seen)) <= 200.0
    assert seen[-1] == 1_000.0
    assert not lone.status & 0x800


def test_csp_acceleration_is_bounded_by_60c5() -> None:
    lone = csp()
    lone.write(0x60C5, 0, 5_000_000, 4)
    seen = [0.0, 0.0]
    for k in range(40):
        put(lone, 0x0F, 200 * k)
        seen.append(lone.drive.axis.servo.end)
    speeds = [(b - a) / PERIOD_S for a, b in pairwise(seen)]
    assert max(b - a for a, b in pairwise(speeds)) <= 5_000_000 * PERIOD_S * 1.001


def test_csp_adds_the_position_offset() -> None:
    lone = csp()
    lone.write(0x60B0, 0, 700, 4)
    for _ in range(50):
        put(lone, 0x0F, 1_000)
    assert lone.drive.axis.actual() == 1_700


@pytest.mark.parametrize(("offset", "share"), [(0, 0.0), (50_000, 0.5), (100_000, 1.0)])
def test_a_velocity_offset_takes_its_share_of_the_lag_away(offset: int, share: float) -> None:
    lags = []
    for told in (0, offset):
        lone = csp()
        lone.write(0x60B1, 0, told, 4)
        for k in range(200):
            put(lone, 0x0F, 200 * k)
        servo = lone.drive.axis.servo
        lags.append(servo.start - servo.position)
    assert lags[1] == pytest.approx(lags[0] * (1.0 - share), abs=0.5)


def test_a_mode_is_shown_with_a_delay_and_leaves_the_axis_standing() -> None:
    lone = set_up(3)
    lone.write(0x60FF, 0, 300_000, 4)
    lone.wait(0.2)
    lone.write(0x6060, 0, 8, 1)
    assert lone.read(0x6061) == 3
    lone.wait(0.01)
    assert lone.read(0x6061) == 8
    lone.run(0.1)
    assert lone.drive.axis.servo.velocity == pytest.approx(0.0, abs=1.0)


def test_periods_without_sync_are_lost_syncs_in_cyclic_modes_only() -> None:
    lone = set_up(1)
    go(lone, 1_000)
    lone.wait(0.2)
    assert lone.drive.lost_syncs == 0


@pytest.mark.parametrize(("index", "size"), [(0x607F, 4), (0x6080, 4)])
def test_speed_is_limited_by_profile_and_motor(index: int, size: int) -> None:
    lone = Lone()
    lone.write(0x60A9, 0, 0x00B40300, 4)  # 1/s, and a turn is an increment: 6080h has it, too
    lone.write(index, 0, 50_000, size)
    lone.write(0x60FF, 0, 200_000, 4)
    lone.enable(3)
    lone.run(0.5)
    assert lone.read(0x606C, signed=True) == pytest.approx(50_000, rel=0.001)


def test_max_torque_limits_the_acceleration_and_the_actual_torque_shows_it() -> None:
    lone = Lone(Parameters(torque_counts_s2=1000.0))
    lone.write(0x6072, 0, 500, 2)
    lone.write(0x60FF, 0, 1_000_000, 4)
    lone.enable(3)
    lone.run(0.4)
    assert lone.read(0x606C, signed=True) == pytest.approx(500 * 1000.0 * 0.4, rel=0.05)
    assert lone.read(0x6077, signed=True) == pytest.approx(500, rel=0.05)
    lone.command(0)
    assert lone.read(0x6077, signed=True) == 0
