"""Statusword bit 12 in csp says whether targets are followed, and the state machine's short ways."""

from __future__ import annotations

import itertools

import pytest
from support.drives.lone_drive import Lone
from support.drives.stepped_drives import PERIOD_S, Bench

from drives.bench.simulated.machine402 import Power

FOLLOWS, LIMITED = 1 << 12, 1 << 11
STEP = 20_000


@pytest.mark.parametrize("mode", [1, 3, 8])
def test_from_ready_one_controlword_leads_through_switched_on_to_enabled(mode: int) -> None:
    """CiA 402-2: transitions 3 and 4 in one go, by SDO as well, where no word comes twice."""
    lone = Lone()
    lone.write(0x6060, 0, mode, 1)
    lone.command(0x06)
    seen = []
    lone.write(0x6040, 0, 0x0F, 2)
    for _ in range(30):
        seen.append(lone.status & 0x6F)
        lone.wait(0.001)
    assert seen[0] == 0x23 and seen[-1] == 0x27


def test_a_word_taken_back_before_the_brake_is_open_does_not_enable() -> None:
    lone = Lone()
    lone.command(0x06)
    lone.command(0x0F, wait_s=0.001)
    lone.command(0x07)
    assert lone.status & 0x6F == 0x23


def moving() -> Bench:
    bench = Bench()
    bench.enable()
    for k in range(60):
        bench.tick(targets=[STEP * min(k, 30) * k // 60])
    assert bench.statuswords["X"] & FOLLOWS
    return bench


@pytest.mark.parametrize("mode", [1, 3, 6, 7, 0])
def test_a_stranger_s_mode_ends_following_and_nails_no_motor(mode: int) -> None:
    bench = moving()
    servo = bench.drive.axis.servo
    speeds = [servo.velocity]
    bench.write(0x6060, 0, bytes([mode]))
    for k in range(40):
        bench.tick(targets=[10_000_000 + STEP * k])
        speeds.append(servo.velocity)
    assert bench.drive.dictionary.get(0x6061) == mode
    assert bench.statuswords["X"] & 0x6F == 0x27
    if mode not in (3, 6):  # there bit 12 means "speed is zero", "homed"
        assert not bench.statuswords["X"] & FOLLOWS
    assert max(abs(b - a) for a, b in itertools.pairwise(speeds)) <= 2e9 * PERIOD_S * 1.001
    assert abs(servo.position) < 9_000_000, "its targets are not followed"


def test_a_target_beyond_the_limits_is_not_followed_and_bit_12_says_so() -> None:
    bench = Bench(counts_min=-1000, counts_max=1000)
    bench.enable()
    for _ in range(5):
        bench.tick(targets=[5000])
    assert bench.statuswords["X"] & LIMITED and not bench.statuswords["X"] & FOLLOWS
    for _ in range(5):
        bench.tick(targets=[500])
    assert bench.statuswords["X"] & FOLLOWS and not bench.statuswords["X"] & LIMITED


def test_in_a_fault_s_stop_nothing_is_followed() -> None:
    bench = moving()
    bench.drive.inject(0x2310, bench.rig.now_s)
    bench.tick()
    bench.tick()
    assert bench.drive.axis.power is Power.FAULT_REACTION
    assert not bench.statuswords["X"] & FOLLOWS


def test_homing_that_is_broken_off_stops_by_its_acceleration() -> None:
    lone = Lone()
    lone.write(0x6098, 0, 17, 1)
    lone.write(0x6099, 1, 1_000_000, 4)
    lone.write(0x609A, 0, 5_000_000, 4)
    lone.enable(6)
    lone.command(0x1F, wait_s=0.0)
    lone.run(0.4)
    assert lone.drive.motor_counts_s == pytest.approx(-1e6, rel=0.01)
    before = lone.drive.motor_counts
    lone.command(0x0F, wait_s=0.0)
    lone.run(0.4)
    assert lone.drive.motor_counts - before == pytest.approx(-1e12 / 2 / 5e6, rel=0.1)
    assert abs(lone.drive.motor_counts_s) < 1.0 and lone.status & 0x3400 == 0x0400
