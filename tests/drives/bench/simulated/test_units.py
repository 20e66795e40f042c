"""A drive in units of its own moves as CiA 402-2 says: judged by where its motor is, in increments."""

from __future__ import annotations

import math

import pytest
from support.drives.lone_drive import Lone, Refused
from support.drives.stepped_drives import PERIOD_S, Bench

from drives.bench.simulated import Parameters
from drives.bench.simulated.machine402 import Power

REV_MIN, REV_MIN_S, INCREMENTS = 0x00B44700, 0x00C00300, 0x00B50000
REV_S, INCREMENTS_S, MICRO_REV_MIN, MILLI_REV_MIN = 0x00B40300, 0x00B50300, 0xFAB44700, 0xFDB44700
MILLI_REV = 0xFDB40000
PER_REV = 4096


def ratio(index: int, above: int, below: int = 1) -> list[tuple[int, int, int]]:
    return [(index, 1, above), (index, 2, below)]


def lone(*writes: tuple[int, int, int], **nature: object) -> Lone:
    made = Lone(Parameters(**nature))  # type: ignore[arg-type]
    for index, sub, value in writes:
        made.write(index, sub, value, 1 if index == 0x607E else 4)
    return made


ENCODER = ratio(0x608F, PER_REV)
# what is set, increments per unit of position, increments/s per unit of velocity, and of acceleration
UNITS = [
    ([], 1.0, 1.0, 1.0),
    ([*ENCODER, (0x60A9, 0, REV_MIN)], 1.0, PER_REV / 60, PER_REV / 60),
    ([*ENCODER, (0x60A9, 0, REV_MIN), (0x60AA, 0, REV_MIN_S)], 1.0, PER_REV / 60, PER_REV / 60),
    ([*ENCODER, (0x60A9, 0, MILLI_REV_MIN)], 1.0, PER_REV / 60e3, PER_REV / 60e3),
    ([*ENCODER, (0x60A9, 0, REV_S)], 1.0, PER_REV, PER_REV),
    ([*ENCODER, (0x60A9, 0, INCREMENTS_S)], 1.0, 1.0, 1.0),
    ([*ENCODER, (0x60A8, 0, MILLI_REV), (0x60A9, 0, REV_MIN)], PER_REV / 1e3, PER_REV / 60, PER_REV / 60),
    # a feed of 3600 units per revolution of the shaft, behind a gear of 3 : 1
    ([*ENCODER, *ratio(0x6091, 3), *ratio(0x6092, 3600)],
     PER_REV * 3 / 3600, PER_REV * 3 / 3600, PER_REV * 3 / 3600),
    ([*ENCODER, *ratio(0x6091, 3), *ratio(0x6092, 3600), (0x60A9, 0, REV_MIN)],
     PER_REV * 3 / 3600, PER_REV / 60, PER_REV / 60),
    ([*ratio(0x6096, 60, PER_REV), *ratio(0x6097, 6, PER_REV)], 1.0, PER_REV / 60, PER_REV / 6),
]  # fmt: skip


@pytest.mark.parametrize(("writes", "position", "velocity", "acceleration"), UNITS)
@pytest.mark.parametrize("sign", [1, -1])
def test_a_profile_goes_as_far_and_as_fast_as_its_units_say(
    writes: list[tuple[int, int, int]], position: float, velocity: float, acceleration: float, sign: int
) -> None:
    polarity = [(0x607E, 0, 0xC0 if sign < 0 else 0)]
    made = lone(*writes, *polarity)
    way, speed, rate = 400_000.0, 800_000.0, 8_000_000.0  # increments
    for index, wanted, unit in (
        (0x6081, speed, velocity), (0x6083, rate, acceleration), (0x6084, rate, acceleration)
    ):  # fmt: skip
        made.write(index, 0, round(wanted / unit), 4)
    made.enable(1)
    made.write(0x607A, 0, round(way / position), 4)
    made.put(0x605, bytes.fromhex("2B4060001F000000"))
    fastest, ticks = 0.0, 0
    while not made.status & 1 << 10 and ticks < 1000:
        made.sync()
        fastest = max(fastest, abs(made.drive.motor_counts_s))
        ticks += 1
    assert made.drive.motor_counts == pytest.approx(sign * way, rel=1e-3)
    assert fastest == pytest.approx(speed, rel=0.03)
    assert ticks * PERIOD_S == pytest.approx(way / speed + speed / rate, abs=0.05)
    made.run(0.1)
    assert made.read(0x6064, signed=True) == pytest.approx(way / position, abs=max(1.0, 2.0 / position))


@pytest.mark.parametrize(("writes", "position", "velocity", "acceleration"), UNITS)
def test_a_quick_stop_takes_the_time_that_6085_says_in_its_unit(
    writes: list[tuple[int, int, int]], position: float, velocity: float, acceleration: float
) -> None:
    made = lone(*writes)
    rate, speed = 4_000_000.0, 1_000_000.0
    made.write(0x6085, 0, round(rate / acceleration), 4)
    made.write(0x605A, 0, 6, 2)
    made.enable(3)
    made.write(0x60FF, 0, round(speed / velocity), 4)
    made.run(1.0)
    assert made.drive.motor_counts_s == pytest.approx(speed, rel=0.02)
    assert made.read(0x606C, signed=True) == pytest.approx(speed / velocity, rel=0.02, abs=1.0)
    before = made.drive.motor_counts
    made.command(0x02, wait_s=0.0)
    made.run(0.6)
    assert made.drive.motor_counts - before == pytest.approx(speed**2 / 2 / rate, rel=0.1)
    assert made.drive.axis.power is Power.QUICK_STOP


def test_cyclic_positions_are_followed_in_their_unit_and_inverted() -> None:
    bench = Bench()
    for writes in ([(0x607E, 0, 0x80)], ENCODER, ratio(0x6092, 1000)):
        for index, sub, value in writes:
            bench.write(index, sub, value.to_bytes(1 if index == 0x607E else 4, "little"))
            bench.wait()
    bench.enable()
    for k in range(200):
        bench.tick(targets=[min(k, 100) * 10])
    assert bench.drive.motor_counts == pytest.approx(-1000 * PER_REV / 1000, abs=1.0)
    assert bench.actual["X"] == 1000


def test_limits_and_windows_are_in_the_drive_s_units() -> None:
    made = lone(*ENCODER, *ratio(0x6092, 1000), (0x607E, 0, 0x80), (0x607D, 1, -500), (0x607D, 2, 2000))
    axis = made.drive.axis
    assert (axis.low, axis.high) == pytest.approx((-2000 * 4.096, 500 * 4.096))


def test_a_speed_limit_is_in_the_drive_s_unit() -> None:
    made = lone(*ENCODER, (0x60A9, 0, MICRO_REV_MIN), (0x6080, 0, 1_500_000_000))
    made.write(0x6083, 0, 4_000_000_000, 4)
    made.enable(3)
    made.write(0x60FF, 0, 2_000_000_000, 4)
    made.run(1.0)
    assert made.drive.motor_counts_s == pytest.approx(1500 / 60 * PER_REV, rel=0.02)


def test_homing_is_in_the_drive_s_units_and_direction() -> None:
    made = lone(
        *ENCODER, *ratio(0x6092, 1000), (0x607E, 0, 0xC0), (0x60A9, 0, REV_MIN),
        switches=(-50_000.0, 90_000.0),
    )  # fmt: skip
    made.write(0x6098, 0, 17, 1)
    made.write(0x6099, 1, 600, 4)
    made.write(0x6099, 2, 60, 4)
    made.write(0x609A, 0, 60_000, 4)
    made.write(0x607C, 0, 250, 4)
    made.enable(6)
    made.put(0x605, bytes.fromhex("2B4060001F000000"))
    fastest = 0.0
    for _ in range(3000):
        made.sync()
        fastest = max(fastest, made.drive.motor_counts_s)
    assert made.status & 0x3400 == 0x1400
    assert fastest == pytest.approx(600 / 60 * PER_REV, rel=0.06), (
        "its negative end is the motor's positive one"
    )
    drive = made.drive
    edge = drive.motor_counts - drive.origin_counts - 90_000
    assert -4096 < edge < 0, "just off the switch"
    assert made.read(0x6064, signed=True) == pytest.approx(250 - edge / 4.096, abs=2)


def test_the_motor_is_as_strong_in_the_drive_s_units_as_it_is_said_to_be() -> None:
    made = lone(*ENCODER, *ratio(0x6092, 1000), strongest_counts_s2=1e6, coast_counts_s2=2e5, brake=False)
    made.enable(3)
    made.write(0x60FF, 0, 500_000, 4)
    made.run(0.2)
    assert made.drive.motor_counts_s == pytest.approx(1e6 * 0.2 * 4.096, rel=0.05)
    before = made.drive.motor_counts_s
    made.drive.torque_off(True, made.bus.now_s)
    made.wait(0.1)
    assert before - made.drive.motor_counts_s == pytest.approx(2e5 * 0.1 * 4.096, rel=0.1)


def test_units_do_not_change_under_a_motor_with_current() -> None:
    made = lone()
    made.enable()
    with pytest.raises(Refused, match="08000022"):
        made.write(0x60A9, 0, REV_MIN, 4)


def test_nothing_set_changes_no_bit() -> None:
    positions = []
    for writes in ([], [(0x60A9, 0, INCREMENTS_S), (0x60A8, 0, INCREMENTS)]):
        made = lone(*writes)
        made.enable(3)
        made.write(0x60FF, 0, 1_234_567, 4)
        made.run(0.1)
        positions.append(made.drive.motor_counts)
    assert math.isclose(*positions, rel_tol=0.0, abs_tol=0.0)


@pytest.mark.parametrize(("word", "per_unit"), [(REV_MIN, 250.0), (MILLI_REV_MIN, 0.25), (INCREMENTS_S, 1.0)])
def test_a_revolution_that_no_object_sizes_is_the_one_that_was_made_known(word: int, per_unit: float) -> None:
    """A sheet that speaks of revolutions alone, and a machine file that says what one unit of it is."""
    drive = lone((0x60A9, 0, word)).drive
    drive.axis.units.set_own(per_unit)
    drive.axis.units.configure()
    assert 1.0 / drive.axis.units.velocity == pytest.approx(per_unit)
