"""A drive whose setpoints stop, with SYNC or without: it stops as its maker says, and never at once."""

from __future__ import annotations

from itertools import pairwise

import pytest
from support.drives.stepped_drives import PERIOD_S, Bench

from drives.bench.simulated import LostSync, Parameters
from drives.bench.simulated.machine402 import Power

STEP = 40_000  # counts per tick: 100 mm/s of 200 000 counts/mm
SPEED = STEP / PERIOD_S
STRONGEST = 4e8
DECELERATION = 200_000_000


def running(**nature: object) -> tuple[Bench, int]:
    kind = nature.pop("lost_sync", LostSync.HOLD)
    bench = Bench(lost_sync=kind, parameters=Parameters(strongest_counts_s2=STRONGEST, **nature))  # type: ignore[arg-type]
    bench.enable()
    for where in (0x6085, 0x6084):
        bench.write(where, 0, DECELERATION.to_bytes(4, "little"))
        bench.tick()
    last = bench.actual["X"]
    for k in range(100):
        last += STEP * min(k, 50) // 50
        bench.tick(targets=[last])
    return bench, last


def stop(bench: Bench, ticks: int = 200, sync: bool = True) -> list[float]:
    """Speeds of the motor, period by period, with SYNC but without setpoints, or without either."""
    motor, speeds = bench.drive.axis.servo, []
    for _ in range(ticks):
        if sync:
            bench.tick(rpdo=False)
        else:
            bench.wait(1)
        speeds.append(motor.velocity)
    return speeds


@pytest.mark.parametrize("sync", [True, False])
def test_a_holding_drive_goes_back_to_its_last_target_within_its_torque(sync: bool) -> None:
    bench, last = running()
    speeds = stop(bench, 70, sync)
    assert max(abs(b - a) for a, b in pairwise(speeds)) <= STRONGEST * PERIOD_S * (1.001 if sync else 6)
    assert speeds[8] > 0.5 * SPEED, "it cannot stand at once"
    assert bench.drive.axis.power is Power.ENABLED
    latched = last if sync else last - STEP  # the last one waits for its SYNC
    assert bench.drive.axis.servo.position == pytest.approx(latched, abs=100.0)


def test_an_extrapolating_drive_goes_on_as_long_as_it_is_told_and_then_holds() -> None:
    bench, last = running(lost_sync=LostSync.EXTRAPOLATE, extrapolated_periods=10)
    stop(bench, 120)
    assert bench.drive.axis.servo.position == pytest.approx(last + 10 * STEP, abs=2.0)


@pytest.mark.parametrize("sync", [True, False])
@pytest.mark.parametrize(
    ("kind", "state", "then"),
    [(LostSync.FAULT, Power.FAULT_REACTION, Power.FAULT),
     (LostSync.QUICK_STOP, Power.QUICK_STOP, Power.DISABLED)],
)  # fmt: skip
def test_an_interpolation_time_out_stops_by_the_quick_stop_ramp(
    kind: LostSync, state: Power, then: Power, sync: bool
) -> None:
    bench, _ = running(lost_sync=kind)
    before = bench.drive.axis.servo.position
    stop(bench, 6, sync)
    assert bench.drive.axis.power is state
    assert (1, 0x8700) in bench.emergencies
    stop(bench, 100, sync)
    assert bench.drive.axis.power is then
    way = bench.drive.axis.servo.position - before
    assert way == pytest.approx(SPEED**2 / 2 / DECELERATION, rel=0.3)


def test_a_time_out_may_come_after_extrapolating() -> None:
    bench, _ = running(lost_sync=LostSync.FAULT, extrapolated_periods=20)
    stop(bench, 20)
    assert bench.drive.axis.power is Power.ENABLED
    stop(bench, 6)
    assert bench.drive.axis.power is Power.FAULT_REACTION


@pytest.mark.parametrize("more", range(5))
def test_the_time_out_counts_from_the_last_sync_however_unevenly_they_came(more: int) -> None:
    bench, last = running(lost_sync=LostSync.FAULT)
    for k in range(more):
        bench.tick(targets=[last + k * STEP])
    bench.ticks += 0.3  # type: ignore[assignment]
    bench.tick(targets=[last + more * STEP])
    bench.ticks -= 0.3  # type: ignore[assignment]
    bench.tick(targets=[last + more * STEP + STEP])
    bench.wait(2.4)
    assert bench.drive.axis.power is Power.ENABLED
    bench.wait(0.2)
    assert bench.drive.axis.power is Power.FAULT_REACTION


def test_a_drive_that_has_had_no_target_yet_does_not_wait_for_one() -> None:
    bench = Bench(lost_sync=LostSync.FAULT)
    bench.enable()
    stop(bench, 2)
    bench.drive.axis.stand()
    stop(bench, 50)
    assert bench.drive.axis.power is Power.ENABLED


def with_deadline(milliseconds: int, reaction: int) -> Bench:
    bench, _ = running()
    for where, sub, value, size in ((0x6007, 0, reaction, 2), (0x1400, 5, milliseconds, 2)):
        bench.write(where, sub, value.to_bytes(size, "little"))
        bench.tick()
    return bench


@pytest.mark.parametrize(
    ("reaction", "then"),
    [(0, Power.ENABLED), (1, Power.FAULT), (2, Power.DISABLED), (3, Power.DISABLED)],
)
def test_the_deadline_of_the_rpdo_ends_in_8250_and_what_6007_says(reaction: int, then: Power) -> None:
    bench = with_deadline(20, reaction)
    for _ in range(50):
        bench.tick()
    assert bench.emergencies == [], "in time, nothing happens"
    stop(bench, 8)
    assert bench.emergencies == []
    stop(bench, 4)
    assert (1, 0x8250) in bench.emergencies
    stop(bench, 200)
    assert bench.drive.axis.power is then


def test_a_deadline_that_is_changed_counts_from_then_on() -> None:
    bench = with_deadline(500, 1)
    for milliseconds, trips in ((20, True), (0, False)):
        bench.write(0x1400, 5, milliseconds.to_bytes(2, "little"))
        bench.tick()
        bench.tick()
        bench.tick()
        before = bench.emergencies.count((1, 0x8250))
        stop(bench, 40)
        assert (bench.emergencies.count((1, 0x8250)) > before) is trips


def test_a_deadline_does_not_change_the_motion() -> None:
    positions = []
    for milliseconds in (0, 20):
        bench = Bench()
        bench.enable()
        bench.write(0x1400, 5, milliseconds.to_bytes(2, "little"))
        bench.tick()
        for k in range(60):
            bench.tick(targets=[k * k])
        positions.append(bench.drive.axis.servo.position)
    assert positions[0] == positions[1]


def test_setpoints_that_come_again_take_the_deadline_s_error_back() -> None:
    bench = with_deadline(20, 0)
    bench.tick()
    stop(bench, 20)
    assert bench.emergencies[-1] == (1, 0x8250)
    bench.tick()
    bench.tick()
    assert bench.emergencies[-1] == (1, 0)
    assert bench.statuswords["X"] & 0x6F == 0x27
