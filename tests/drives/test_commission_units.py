"""Units of the drive: hand-computed numbers, makers' defaults, and what is refused by name."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drives.commissioning.possible import default_problems
from drives.commissioning.sheet import load
from drives.commissioning.units import UnitError, Units, si, units_of
from drives.commissioning.wanted import where
from drives.profile import GENERIC, Encoder
from drives.settings import NodeSettings, SpindleSettings

RPM, MICRO_RPM, MM_S, DEG_S = 0x00B44700, 0xFAB44700, 0xFD010300, 0x00410300
LINEAR = NodeSettings("X", "can", 1, "", counts_per_si=200_000.0 * 1000.0)
ROTARY = NodeSettings("A", "can", 4, "", rotary=True, counts_per_si=200_000.0 * 180.0 / math.pi)
SPINDLE = SpindleSettings("spindle", "can", 10, "", counts_per_rev=-4000.0)

Objects = dict[int, int | tuple[int, int]]


def of(objects: Objects, settings: NodeSettings | SpindleSettings = LINEAR) -> Units:
    def read(index: int, sub: int) -> int | None:
        value = objects.get(index)
        if isinstance(value, tuple):
            return value[sub - 1]
        return value if sub == 0 else None

    return units_of(settings, read)


@pytest.mark.parametrize(
    ("objects", "velocity", "why"),
    [
        ({}, 1.0, "without any of it, position units per second"),
        ({0x607E: 0, 0x608F: (4096, 1), 0x6091: (10, 1), 0x6092: (1, 1)}, 1.0, "counts are counts"),
        ({0x60A9: RPM, 0x608F: (4096, 1)}, 4096 / 60, "1000 1/min of 4096 counts are 68266.67 counts/s"),
        ({0x60A9: MICRO_RPM, 0x608F: (4096, 1)}, 4096 / 60e6, "EPOS4's finest"),
        ({0x60A9: RPM, 0x608F: (4096, 1), 0x6092: (4096, 1)}, 4096 / 60, "the same, said twice"),
        ({0x60A9: RPM, 0x608F: (8192, 2)}, 4096 / 60, "two revolutions are counted together"),
        (
            {0x60A9: RPM, 0x608F: (4096, 1), 0x6091: (10, 1), 0x6092: (5000, 1)},
            500 / 60,
            "5000 position units per turn of the shaft, ten turns of the motor for it",
        ),
        ({0x60A9: RPM, 0x608F: (1, 1), 0x6091: (7, 3), 0x6092: (7000, 1)}, 3000 / 60, "7 turns to 3"),
        ({0x60A9: 0x00B40300, 0x608F: (4096, 1)}, 4096.0, "1/s"),
        ({0x60A9: MM_S}, 200_000.0, "mm/s, by the machine file's counts"),
        ({0x60A9: MM_S, 0x60A8: 0xFB010000, 0x6092: (3, 1)}, 100.0, "mm/s in units of 10 um"),
        ({0x60A9: 0x00010300, 0x60A8: 0xFA010000}, 1e6, "m/s in um"),
        ({0x60A9: 0x00B50300, 0x60A8: 0x00B50000}, 1.0, "increments, and per second"),
        ({0x60A9: 0x00B50300, 0x608F: (4096, 1), 0x6092: (1024, 1)}, 0.25, "four increments are a count"),
        ({0x60A9: 0x03B50300, 0x60A8: 0x00B50000}, 1000.0, "kilo"),
        ({0x60A9: 0x00B50300, 0x60A8: 0x01B50000}, 0.1, "positions in tens of increments"),
        ({0x60A9: 0x00B50300, 0x60A8: 0xFA010000, 0x608F: (4096, 1), 0x6092: (1024, 1)}, 0.25, "and in um"),
        ({0x60A9: 0x00B50300, 0x60A8: 0xFDB40000, 0x608F: (4000, 1)}, 0.25, "and in thousandths of a turn"),
        ({0x60A9: RPM, 0x60A8: 0x01B50000, 0x608F: (4000, 1), 0x6092: (1, 1)}, 400 / 60, "the same, turned"),
        ({0x60A9: RPM, 0x60A8: 0xFDB40000}, 1000 / 60, "a position in milli revolutions"),
        ({0x6096: (600_000, 1_048_576), 0x608F: (1_048_576, 1)}, 1_048_576 / 600_000, "AX8000: 10^-4 1/min"),
        ({0x60A9: 0xFCB44700, 0x6096: (600_000, 1_048_576), 0x608F: (1_048_576, 1)}, 1_048_576 / 6e5, "both"),
        ({0x6090: (5, 1), 0x6093: (1, 1), 0x6094: (1, 1), 0x6096: (0, 0)}, 1.0, "nothing is set"),
    ],
)
def test_a_unit_of_velocity_is_so_many_counts_per_second(objects: Objects, velocity: float, why: str) -> None:
    settings = LINEAR
    if 0x60A8 in objects and si(int(str(objects[0x60A8]))).numerator == 1:
        settings = replace(LINEAR, counts_per_si=10.0 ** -si(int(str(objects[0x60A8]))).exponent)
    found = of(objects, settings)
    assert found.velocity_counts_s == pytest.approx(velocity, rel=1e-12), why


def test_the_makers_example_is_met_by_a_whole_number() -> None:
    """EPOS4: 1000 1/min of an encoder with 4096 increments are 68266.67 increments per second."""
    units = of({0x60A9: RPM, 0x608F: (4096, 1)})
    assert units.velocity(68_266.67, where(0x6099)) == 1000
    assert units.said and units.acceleration_counts_s2 == units.velocity_counts_s


@pytest.mark.parametrize(
    ("objects", "acceleration", "why"),
    [
        ({}, 1.0, "position units per second squared"),
        ({0x60A9: RPM, 0x608F: (4096, 1)}, 4096 / 60, "velocity units per second"),
        ({0x60A9: RPM, 0x608F: (4096, 1), 0x60AA: 0x00C00300}, 4096 / 60, "(1/min)/s, as EPOS4 says it"),
        ({0x60A9: MICRO_RPM, 0x608F: (4096, 1), 0x60AA: 0x00C00300}, 4096 / 60, "and with another prefix"),
        ({0x60A9: RPM, 0x608F: (4096, 1), 0x60AA: 0x00B45700}, 4096.0, "revolutions per second squared"),
        ({0x60A9: MM_S, 0x60AA: 0x00015700}, 200_000_000.0, "m/s2"),
        ({0x6097: (1, 100)}, 100.0, "the factor alone"),
        ({0x60AA: 0x00C00300, 0x608F: (4096, 1)}, 4096 / 60, "60AAh without 60A9h"),
        ({0x60AA: 0x00015700, 0x6096: (7, 3)}, 200_000_000.0, "and beside a factor of velocity"),
    ],
)
def test_a_unit_of_acceleration(objects: Objects, acceleration: float, why: str) -> None:
    assert of(objects).acceleration_counts_s2 == pytest.approx(acceleration, rel=1e-12), why


def test_degrees_and_radians_of_a_rotary_are_the_machine_files() -> None:
    assert of({0x60A9: DEG_S}, ROTARY).velocity_counts_s == pytest.approx(200_000.0)
    assert of({0x60A9: 0xFD100300}, ROTARY).velocity_counts_s == pytest.approx(200 * 180 / math.pi)
    assert of({0x60A9: DEG_S, 0x60A8: 0xFD410000}, replace(ROTARY, counts_per_si=1000 * 180 / math.pi))


def test_a_makers_own_object_tells_the_counts_of_a_revolution() -> None:
    own = replace(GENERIC, encoder_resolution=(Encoder(0x3000, 5), Encoder(0x3010, 1, 4)))
    axis = replace(LINEAR, profile=own)
    read = {(0x60A9, 0): RPM, (0x3000, 5): 0, (0x3010, 1): 500}
    assert units_of(axis, lambda i, s: read.get((i, s))).velocity_counts_s == pytest.approx(2000 / 60)
    read[0x3000, 5] = 4096
    assert units_of(axis, lambda i, s: read.get((i, s))).velocity_counts_s == pytest.approx(4096 / 60)


def test_a_family_may_speak_of_the_shaft_behind_the_gear() -> None:
    of_shaft = replace(LINEAR, profile=replace(GENERIC, revolution="shaft"))
    geared: Objects = {0x60A9: RPM, 0x608F: (4096, 1), 0x6091: (10, 1), 0x6092: (5000, 1)}
    assert of(geared, of_shaft).velocity_counts_s == pytest.approx(5000 / 60)
    del geared[0x6092]
    assert of(geared, of_shaft).velocity_counts_s == pytest.approx(40960 / 60)


def test_a_family_without_the_object_has_its_own_unit() -> None:
    """Technosoft: 1/65536 count per slow loop of a millisecond."""
    family = replace(GENERIC, velocity_unit_counts_s=1000 / 65536, acceleration_unit_counts_s2=1e6 / 65536)
    found = of({0x60A9: 0}, replace(LINEAR, profile=family))
    assert found.velocity(1000.0, where(0x6099)) == 65536 and found.acceleration(1e6, where(0x609A)) == 65536
    assert of({0x60A9: MM_S}, replace(LINEAR, profile=family)).velocity_counts_s == 200_000.0


def test_the_machine_file_knows_what_the_drive_does_not_say() -> None:
    axis = replace(LINEAR, velocity_unit_counts_s=68.25)
    assert of({}, axis).velocity_counts_s == 68.25
    assert of({0x60A9: RPM}, axis).acceleration_counts_s2 == 68.25, "a revolution that nobody explains"
    both = replace(axis, acceleration_unit_counts_s2=2.0)
    assert of({0x60A9: 0x00FF0300}, both).acceleration_counts_s2 == 2.0


def test_a_spindle_without_an_encoder_resolution_has_the_machine_files_revolution() -> None:
    assert of({0x60A9: RPM}, SPINDLE).velocity_counts_s == pytest.approx(4000 / 60)
    assert of({0x60A9: RPM, 0x608F: (1024, 1)}, SPINDLE).velocity_counts_s == pytest.approx(1024 / 60)


@pytest.mark.parametrize(
    ("objects", "axis", "sentence"),
    [
        ({0x60A9: RPM}, LINEAR, r"60A9h is 00B44700h, in revolutions.*6092h not set.*into 6092h"),
        ({0x60A9: RPM, 0x608F: (1, 1), 0x6092: (1, 1)}, LINEAR, "60A9h .* how many counts"),
        ({0x60A9: RPM, 0x608F: (4096, 1), 0x6092: (1, 1)}, LINEAR, r"608Fh:01 4096.*6092h 1\.0"),
        ({0x60A9: 0x00FF0300}, LINEAR, "60A9h is 00FF0300h, a unit that is not understood"),
        ({0x60A9: 0x00B4FF00, 0x608F: (4096, 1)}, LINEAR, "60A9h is 00B4FF00h"),
        ({0x60A9: DEG_S}, LINEAR, "60A9h is 00410300h"),
        ({0x60A9: MM_S}, ROTARY, "60A9h is FD010300h"),
        ({0x60A9: RPM, 0x608F: (4096, 1), 0x60AA: 0x00B50300}, LINEAR, "60AAh is 00B50300h"),
        ({0x60A8: 0xFA010000}, LINEAR, r"60A8h is FA010000h, which is counts_per_mm = 1000; .* 200000"),
        ({0x60A8: 0xFD410000}, ROTARY, r"60A8h .* counts_per_deg = 1000; .* 200000"),
        ({0x60A9: RPM, 0x608F: (4096, 0)}, LINEAR, r"608Fh is 4096 / 0; write a ratio"),
        ({0x6093: (4096, 1)}, LINEAR, "6093h is 4096, a factor of the old CiA 402"),
        ({0x6094: (1, 60)}, LINEAR, "6094h is 0.0166667"),
        ({0x60A9: RPM, 0x608F: (4096, 1), 0x6096: (3, 2)}, LINEAR, "6096h is 1.5, .* 60A9h makes it"),
        ({0x60A9: RPM, 0x608F: (4096, 1), 0x6097: (3, 2)}, LINEAR, "6097h is 1.5, .* 60AAh makes it"),
        ({0x60A9: RPM, 0x608F: (4096, 1)}, replace(LINEAR, velocity_unit_counts_s=70.0), "60A9h.* says vel"),
        ({0x60AA: 0x00B55700, 0x6092: (1000, 1)}, LINEAR, "60AAh is 00B55700h, in increments, and nothing"),
        ({0x60AA: 0x00FF5700}, LINEAR, "60AAh is 00FF5700h, a unit that is not understood.*00B55700h"),
        ({0x60A8: 0xFD410000, 0x60A9: RPM}, ROTARY, "60A8h .* correct one of the two .* 60A9h is 00B44700h"),
        (
            {0x60A8: 0x00B50000, 0x608F: (4000, 1), 0x6092: (500, 1)},
            LINEAR,
            "60A8h .* 4000 .* 6092h makes it 500",
        ),
        ({0x607E: 0x80}, LINEAR, "607Eh is 80h, which inverts position alone"),
        ({0x607E: 0x40}, LINEAR, "607Eh is 40h, which inverts velocity alone"),
    ],
)
def test_what_contradicts_itself_or_is_not_known_is_refused_with_the_object(
    objects: Objects, axis: NodeSettings, sentence: str
) -> None:
    with pytest.raises(UnitError, match=sentence):
        of(objects, axis)


@pytest.mark.parametrize(("polarity", "inverted"), [(0, False), (0xC0, True), (0x3F, False), (0xFF, True)])
def test_polarity_that_agrees_is_taken_as_it_is(polarity: int, inverted: bool) -> None:
    assert of({0x607E: polarity}).inverted is inverted


def test_a_spindles_velocity_may_be_inverted_alone() -> None:
    assert of({0x607E: 0x40}, SPINDLE).inverted


@given(
    feed=st.integers(2, 10**6),
    motor=st.integers(1, 100),
    shaft=st.integers(1, 100),
    increments=st.integers(1, 2**24),
    exponent=st.integers(-6, 3),
)
def test_a_gear_is_as_the_standards_formula_has_it(
    feed: int, motor: int, shaft: int, increments: int, exponent: int
) -> None:
    """position = increments x feed / (resolution x gear): one turn of the motor, in exact fractions."""
    turn = Fraction(increments) * feed / (Fraction(increments) * Fraction(motor, shaft))
    if Fraction(feed) == 1:
        return
    word = (exponent & 0xFF) << 24 | RPM
    found = of({0x60A9: word, 0x608F: (increments, 1), 0x6091: (motor, shaft), 0x6092: (feed, 1)})
    assert found.velocity_counts_s == pytest.approx(float(turn * Fraction(10) ** exponent / 60), rel=1e-9)


# ---- rounding -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("wanted", "told"),
    [(100.0, 10), (104.0, 10), (95.1, 10), (10.0, 1), (9.0, 1), (15.5, 1), (16.0, 2), (24.9, 2)],
)
def test_a_value_is_told_by_the_nearest_unit_that_is_not_much_more(wanted: float, told: int) -> None:
    units = Units(10.0, 10.0)
    assert units.velocity(wanted, where(0x6099, 1)) == told == units.acceleration(wanted, where(0x609A))


@pytest.mark.parametrize("wanted", [0.1, 4.9, 7.0])
def test_nothing_is_rounded_to_zero_or_far_up(wanted: float) -> None:
    with pytest.raises(UnitError, match=r"object 6099h:02: .* counts/s are wanted, .* unit is 10 counts/s"):
        Units(10.0).velocity(wanted, where(0x6099, 2))


def test_a_speed_that_no_integer_takes_is_refused() -> None:
    Units(1.0).see_fits(2e9, where(0x60FF))
    with pytest.raises(UnitError, match=r"object 60FFh:00: .* INTEGER32 .* coarser"):
        Units(1e-3).see_fits(4e6, where(0x60FF))


def test_a_unit_too_coarse_for_the_speed_of_homing_is_refused_on_paper() -> None:
    """As commissioning would; a shipped sheet tells no unit, so the machine file's counts."""
    node = replace(
        LINEAR,
        eds="config/eds/simulated_drive.eds",
        homing_method=24,
        velocity_unit_counts_s=6000.0,
        homing_fast_counts_s=20_000.0,
    )
    sheet = load(node.eds, node.node)
    assert not [*default_problems(replace(node, homing_slow_counts_s=6000.0), sheet)]
    (problem,) = default_problems(replace(node, homing_slow_counts_s=2000.0), sheet)
    said = problem["values"]["problem"]
    assert said["key"] == "unit.too_coarse" and said["values"]["where"] == where(0x6099, 2)
