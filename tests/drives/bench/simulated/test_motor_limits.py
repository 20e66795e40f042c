"""A motor gives only so much torque and turns only so fast, in every mode and whatever it is told."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.drives.lone_drive import Lone
from support.drives.stepped_drives import PERIOD_S, Bench

from drives.bench.simulated import Parameters, build
from drives.bench.simulated.plant import Plant, PlantParameters
from drives.bench.simulated.servo import Servo
from drives.settings import NodeSettings

LIMITED, FOLLOWS = 1 << 11, 1 << 12
STRONGEST, FASTEST = 1.2e9, 4.8e7


def tuned(servo: Servo, strongest: float = math.inf, fastest: float = math.inf) -> Servo:
    servo.tune(PERIOD_S, 60.0, math.sqrt(0.5), 0.0)
    servo.limit(strongest, fastest)
    return servo


@given(st.lists(st.integers(-600, 600), min_size=20, max_size=80))
@settings(max_examples=50, deadline=None)
def test_within_its_limits_the_motor_moves_as_without_any_to_the_last_bit(changes: list[int]) -> None:
    """Speeds change by so little that the law asks for less than 1.2e9 counts/s^2."""
    free, bound = tuned(Servo()), tuned(Servo(), STRONGEST, FASTEST)
    target = speed = 0
    for change in changes:
        speed = max(-60_000, min(60_000, speed + change))
        target += speed
        free.step(target)
        bound.step(target)
        assert not bound.limited
        assert (free.position, free.velocity) == (bound.position, bound.velocity)


@pytest.mark.parametrize("distance", [1_000, 50_000, 1_000_000, 20_000_000, -7_000_000])
@pytest.mark.parametrize("kind", [Servo, lambda at: Plant(at, PlantParameters(increment=1e-6))])
def test_a_jump_of_the_target_is_followed_as_fast_as_torque_and_speed_allow(kind, distance: int) -> None:  # type: ignore[no-untyped-def]
    servo = tuned(kind(0.0), STRONGEST, FASTEST)
    speeds, ticks = [0.0], 0
    while ticks < 5 or abs(servo.position - distance) > 1.0 or abs(servo.velocity) > 1000.0:
        servo.step(distance)
        speeds.append(servo.velocity)
        assert abs(servo.position) < abs(distance) * 1.02 + 4_000.0, "it does not swing over"
        ticks += 1
        assert ticks < 1000
    assert max(map(abs, speeds)) <= FASTEST * 1.001
    assert max(abs(b - a) for a, b in pairwise(speeds)) <= STRONGEST * PERIOD_S * 1.001
    short = abs(distance) < FASTEST**2 / STRONGEST
    turning_s = 2.0 * math.sqrt(abs(distance) / STRONGEST)
    quickest_s = turning_s if short else abs(distance) / FASTEST + FASTEST / STRONGEST
    assert quickest_s <= ticks * PERIOD_S <= 1.3 * quickest_s + 0.05


def test_a_weak_motor_accelerates_by_its_share_only_and_a_jammed_one_not_at_all() -> None:
    servo = tuned(Servo(), STRONGEST, FASTEST)
    servo.weaken(0.2)
    for _ in range(10):
        servo.step(10_000_000)
    assert servo.velocity == pytest.approx(0.2 * STRONGEST * 9 * PERIOD_S, rel=0.01)
    at = servo.position
    servo.jam(True)
    assert servo.velocity == 0.0
    for _ in range(10):
        servo.step(10_000_000)
    assert (servo.position, servo.velocity) == (at, 0.0)
    servo.jam(False)
    servo.step(10_000_000)
    assert servo.position > at


def moving(bench: Bench, step: int, ticks: int) -> int:
    bench.enable()
    start = bench.actual["X"]
    for k in range(ticks):
        bench.tick(targets=[start + step * k])
    return start + step * (ticks - 1)


def test_setpoints_that_come_again_after_a_gap_make_no_jump() -> None:
    """400 mm/s at 200 000 counts/mm: seen from outside it went at 37 m/s."""
    step = 80_000 * 2
    bench = Bench(parameters=Parameters(fastest_counts_s=1e8))
    bench.write(0x1400, 5, bytes(2))  # no deadline
    bench.tick()
    last = moving(bench, step, 200)
    for _ in range(200):
        bench.tick(rpdo=False)
    before, speeds, words = bench.actual["X"], [], []
    for _k in range(1, 400):
        bench.tick(targets=[last + step * 200])
        speeds.append((bench.actual["X"] - before) / PERIOD_S)
        words.append(bench.statuswords["X"])
        before = bench.actual["X"]
    assert max(speeds) <= 1.0001e8
    assert bench.actual["X"] == last + step * 200
    limited = [k for k, word in enumerate(words) if word & LIMITED]
    assert len(limited) > 100 and not words[-1] & LIMITED


@pytest.mark.parametrize("index", [0x607F, 0x6080])
def test_the_speed_limit_that_a_drive_is_told_holds_for_jumps_too(index: int) -> None:
    bench = Bench()
    bench.write(0x60A9, 0, (0x00B40300).to_bytes(4, "little"))  # 1/s, of one increment
    bench.wait()
    bench.enable()
    bench.write(index, 0, (10_000_000).to_bytes(4, "little"))
    bench.tick()
    at = start = bench.actual["X"]
    fastest = 0.0
    for _ in range(400):
        bench.tick(targets=[start + 5_000_000])
        fastest = max(fastest, (bench.actual["X"] - at) / PERIOD_S)
        at = bench.actual["X"]
    assert at == start + 5_000_000
    assert 0.95e7 < fastest <= 1.001e7


def test_acceleration_limits_of_csp_bring_the_demand_to_its_target_without_swinging() -> None:
    bench = Bench()
    bench.enable()
    for index, value in ((0x60C5, 200_000_000), (0x60C6, 100_000_000), (0x607F, 20_000_000)):
        bench.write(index, 0, value.to_bytes(4, "little"))
        bench.tick()
    start, seen = bench.actual["X"], []
    for _ in range(600):
        bench.tick(targets=[start + 5_000_000])
        seen.append(bench.actual["X"] - start)
    assert max(seen) <= 5_000_000 + 1000
    assert seen[-1] == 5_000_000
    ramps_s = 2e7 / 2e8 / 2 + 2e7 / 1e8 / 2
    reached = next(k for k, at in enumerate(seen) if abs(at - 5_000_000) <= 20)
    assert reached * PERIOD_S == pytest.approx(5_000_000 / 2e7 + ramps_s, abs=0.04)


def test_a_profile_steeper_than_the_motor_is_not_followed_either() -> None:
    lone = Lone(Parameters(strongest_counts_s2=1e7))
    lone.enable(3)
    lone.write(0x60FF, 0, 4_000_000, 4)
    lone.run(0.1)
    assert lone.drive.axis.servo.velocity == pytest.approx(1e7 * 0.1, rel=0.05)
    assert lone.status & LIMITED


def test_a_quick_stop_takes_as_long_as_the_torque_lets_it() -> None:
    lone = Lone(Parameters(strongest_counts_s2=1e7))
    lone.enable(3)
    lone.write(0x60FF, 0, 1_000_000, 4)
    lone.run(0.5)
    lone.write(0x605A, 0, 6, 2)
    lone.command(0x02, wait_s=0.0)
    lone.run(0.05)
    assert lone.drive.axis.servo.velocity == pytest.approx(500_000, rel=0.1)
    lone.run(0.5)
    assert abs(lone.drive.axis.servo.velocity) < 1.0


def test_a_motor_is_sized_for_its_axis_unless_it_has_been_chosen() -> None:
    node = NodeSettings("X", "can", 1, "", velocity_counts_s=4e7, acceleration_counts_s2=4e8)
    sized = build.drive(node, Parameters()).parameters
    assert (sized.strongest_counts_s2, sized.fastest_counts_s) == pytest.approx((1.2e9, 4.2e7))
    chosen = build.drive(node, Parameters(strongest_counts_s2=5e8, fastest_counts_s=4e7)).parameters
    assert (chosen.strongest_counts_s2, chosen.fastest_counts_s) == (5e8, 4e7)
