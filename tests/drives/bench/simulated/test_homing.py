"""Homing methods on one axis with all its switches: where each one ends, from every start."""

from __future__ import annotations

import pytest
from support.drives.lone_drive import Lone, Refused

from drives.bench.simulated import Parameters
from drives.bench.simulated.homing import KNOWN

LEFT, RIGHT = -20_000.0, 30_000.0  # edges of the home switch
LOW, HIGH = -100_000.0, 100_000.0  # limit switches
INDEX, OFFSET = 4_000.0, 1_500.0
HOME_OFFSET = 777


def below(position: float) -> float:
    """The next index pulse in negative direction; the edges lie on none."""
    return (position - OFFSET) // INDEX * INDEX + OFFSET


def above(position: float) -> float:
    return below(position) + INDEX


# method -> homed point in power-on counting; 3 .. 6 and 19 .. 22 have a switch that is pressed
# to the end of the travel, so that one of its edges is all they see.
POINTS = {
    1: above(LOW),
    2: below(HIGH),
    3: below(LEFT),
    4: above(LEFT),
    5: above(RIGHT),
    6: below(RIGHT),
    7: below(LEFT),
    8: above(LEFT),
    9: below(RIGHT),
    10: above(RIGHT),
    11: above(RIGHT),
    12: below(RIGHT),
    13: above(LEFT),
    14: below(LEFT),
    17: LOW,
    18: HIGH,
    **dict.fromkeys((19, 20, 23, 24, 29, 30), LEFT),
    **dict.fromkeys((21, 22, 25, 26, 27, 28), RIGHT),
}
STARTS = (-70_000, 5_000, 60_000)


def home(method: int, start: int, wait_s: float = 4.0, **nature: object) -> Lone:
    given: dict[str, object] = {
        "position_counts": start,
        "switches": (LOW, HIGH),
        "home_switch": (LEFT, RIGHT),
        "index_counts": INDEX,
        "index_offset": OFFSET,
    }
    if method in (3, 4, 19, 20):
        given["home_switch"] = (LEFT, 1e9)
    if method in (5, 6, 21, 22):
        given["home_switch"] = (-1e9, RIGHT)
    lone = Lone(Parameters(**{**given, **nature}))  # type: ignore[arg-type]
    for index, sub, value, size in (
        (0x60C2, 1, 2, 1),
        (0x6098, 0, method, 1),
        (0x607C, 0, HOME_OFFSET, 4),
        (0x6099, 1, 400_000, 4),
        (0x6099, 2, 80_000, 4),
        (0x609A, 0, 8_000_000, 4),
    ):
        lone.write(index, sub, value, size)
    lone.enable(6)
    lone.write(0x6040, 0, 0x1F, 2)
    lone.wait(wait_s)
    return lone


@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize("method", sorted(POINTS))
def test_a_method_ends_at_its_point_from_every_side(method: int, start: int) -> None:
    lone = home(method, start)
    assert lone.status & 0x3400 == 0x1400
    assert lone.drive.axis.sensors.moved == HOME_OFFSET - POINTS[method]
    assert lone.drive.axis.servo.velocity == pytest.approx(0.0, abs=1.0)


@pytest.mark.parametrize(("method", "point"), [(33, below(5_000.0)), (34, above(5_000.0))])
def test_the_next_index_is_enough_for_33_and_34(method: int, point: float) -> None:
    lone = home(method, 5_000)
    assert lone.drive.axis.sensors.moved == HOME_OFFSET - point


@pytest.mark.parametrize("method", [35, 37])
def test_here_and_now(method: int) -> None:
    assert home(method, 12_345, 0.01).drive.axis.actual() == HOME_OFFSET


def test_an_axis_without_the_switch_ends_with_a_homing_error() -> None:
    lone = home(24, 5_000, home_switch=(5e8, 6e8))
    assert lone.status & 0x3400 == 0x2400


def test_the_search_turns_round_at_a_limit_switch() -> None:
    lone = home(24, 60_000, wait_s=0.25)
    assert lone.drive.axis.servo.position > 90_000
    lone.wait(3.0)
    assert lone.status & 0x3400 == 0x1400


def test_taking_the_start_bit_back_breaks_homing_off() -> None:
    lone = home(17, 5_000, 0.05)
    assert lone.status & 0x3400 == 0
    lone.command(0x0F)
    assert lone.status & 0x3400 == 0x400
    lone.wait(0.1)  # 400 000 counts/s at 609Ah = 8 000 000 counts/s^2 take 50 ms
    assert abs(lone.drive.axis.servo.velocity) < 1.0
    assert lone.drive.axis.sensors.moved == 0.0


def test_homing_needs_no_sync_and_a_second_run_gives_the_same_point() -> None:
    lone = home(7, 5_000)
    first = lone.drive.axis.sensors.moved
    lone.command(0x0F)
    lone.write(0x6040, 0, 0x1F, 2)
    lone.wait(4.0)
    assert lone.drive.axis.sensors.moved == first


def test_the_data_sheet_lists_exactly_the_methods_the_drive_knows() -> None:
    lone = Lone()
    listed = [lone.read(0x60E3, sub) for sub in range(1, lone.read(0x60E3) + 1)]
    assert set(listed) == KNOWN
    for method in range(-10, 40):
        if method in KNOWN:
            lone.write(0x6098, 0, method, 1)
        else:
            with pytest.raises(Refused, match="06090030"):
                lone.write(0x6098, 0, method, 1)
