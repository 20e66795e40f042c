"""A family's quirks, from its profile alone and with a data sheet."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import pytest
from support.drives.lone_drive import Lone, Refused

from drives.bench.simulated import Parameters, SimulatedDrive
from drives.bench.simulated.build import drive
from drives.bench.simulated.data_sheet import EDS
from drives.bench.simulated.families import restrict
from drives.profile import GENERIC, CyclicMode, Profile, Supervision
from drives.settings import NodeSettings


def lone(profile: Profile, bare: bool = False, eds: Path = EDS) -> Lone:
    made = Lone(eds=eds)
    restrict(made.drive, profile, bare)
    return made


def refused(made: Lone, index: int, sub: int, value: int, size: int) -> str:
    with pytest.raises(Refused) as error:
        made.write(index, sub, value, size)
    return str(error.value)


def test_the_generic_profile_takes_nothing_away() -> None:
    made = lone(GENERIC)
    assert made.read(0x1016, 1) == made.read(0x100C) == 0
    made.write(0x6098, 0, 7, 1)


def test_a_guarded_drive_has_no_heartbeat_consumer() -> None:
    made = lone(Profile("guarded", supervision=Supervision.GUARDING))
    made.write(0x100C, 0, 100, 2)
    assert refused(made, 0x1016, 1, 0x7F_0064, 4) == "06020000"


def test_an_unsupervised_drive_has_neither() -> None:
    made = lone(Profile("alone", supervision=Supervision.NONE))
    assert refused(made, 0x1016, 1, 0, 4) == refused(made, 0x100C, 0, 0, 2) == "06020000"


def test_a_drive_without_cyclic_position_interpolates() -> None:
    made = lone(Profile("ip", mode=CyclicMode.IP))
    assert made.read(0x6502) & 0x3FF == 0x65
    assert {refused(made, 0x6060, 0, mode, 1) for mode in (8, 9, 10)} == {"06090030"}
    made.write(0x6060, 0, 7, 1)


def test_without_feed_forward_there_are_no_offsets() -> None:
    made = lone(Profile("plain", takes_feed_forward=False))
    assert {refused(made, index, 0, 0, 4) for index in (0x60B0, 0x60B1)} == {"06020000"}


def test_periods_are_the_familys() -> None:
    made = lone(
        Profile("ms", period_exponents=(-3,), period_step_s=0.001, period_min_s=0.001, period_max_s=0.02)
    )
    assert (made.read(0x60C2, 1), made.read(0x60C2, 2)) == (1, 0xFD)
    made.write(0x60C2, 1, 20, 1)
    assert refused(made, 0x60C2, 1, 21, 1) == refused(made, 0x60C2, 2, -4, 1) == "06090030"


def test_a_unit_must_do_with_the_value_that_is_there() -> None:
    made = lone(Profile("fine", period_exponents=(-3, -4), period_step_s=0.0005, period_min_s=0.0005))
    made.write(0x60C2, 1, 5, 1)
    made.write(0x60C2, 2, -4, 1)
    made.write(0x60C2, 2, -3, 1)
    made.write(0x60C2, 1, 7, 1)
    assert refused(made, 0x60C2, 2, -4, 1) == "06090030"


def test_a_drive_without_option_codes_stops_by_itself() -> None:
    made = lone(Profile("own way", quick_stop_code=None, abort_code=None))
    for index in (0x605A, 0x6007):
        with pytest.raises(Refused, match="06020000"):
            made.read(index)
    made.nmt(0x01)
    made.enable()
    made.nmt(0x80, 0.5)
    assert made.status & 0x4F == 0x40


def test_homing_methods_and_offset_are_the_familys() -> None:
    made = lone(Profile("stops", homing_methods=(-4, -3, 17, 99), home_offset=None))
    assert refused(made, 0x6098, 0, 35, 1) == refused(made, 0x6098, 0, 99, 1) == "06090030"
    made.write(0x6098, 0, -3, 1)
    assert made.drive.axis.home_offset == 0


def test_a_vendors_method_finds_the_end_stop() -> None:
    made = Lone(Parameters(switches=(-20_000, 20_000)))
    restrict(made.drive, Profile("stops", homing_methods=(-3,)))
    for index, sub in ((0x6099, 1), (0x6099, 2)):
        made.write(index, sub, 50_000, 4)
    made.write(0x609A, 0, 1_000_000, 4)
    made.write(0x6098, 0, -3, 1)
    made.write(0x607C, 0, 100, 4)
    made.enable(6)
    made.command(0x1F)
    made.run(1.5)
    assert made.status & 0x3400 == 0x1400
    assert made.drive.axis.sensors.ground().windows[1][0] == 100


def test_following_error_and_slow_feedback_have_limits() -> None:
    made = lone(Profile("narrow", most_following_error=5000, most_feedback_every=4))
    made.write(0x6065, 0, 5000, 4)
    assert refused(made, 0x6065, 0, 5001, 4) == "06090031"
    made.write(0x1801, 2, 4, 1)
    made.write(0x1801, 2, 255, 1)
    assert refused(made, 0x1801, 2, 5, 1) == "06090030"


def test_a_bare_drive_lacks_what_the_profile_calls_optional() -> None:
    profile = replace(GENERIC, optional=(0x60F4, 0x6099))
    lone(profile).read(0x60F4)
    with pytest.raises(Refused, match="06020000"):
        lone(profile, bare=True).read(0x60F4)


def test_its_quirks_survive_a_reset() -> None:
    made = lone(Profile("ms", period_exponents=(-3,), period_step_s=0.002, period_min_s=0.002))
    made.nmt(0x81)
    assert (made.read(0x60C2, 1), made.read(0x60C2, 2)) == (2, 0xFD)


def test_a_node_with_a_profile_gets_such_a_drive() -> None:
    profile = Profile("guarded", supervision=Supervision.GUARDING)
    made = drive(NodeSettings("X", "can", 1, str(EDS), profile=profile), Parameters())
    assert not made.dictionary.has(0x1016, 1)


REAL = {
    "elmo_simpliq.dcf": 0x9A,
    "maxon_epos4_50_5.eds": 0xFB,
    "pilz_prbt.dcf": 0x0,
    "technosoft_ipos.eds": 0x1A3,
}


@pytest.mark.parametrize("name", REAL)
def test_a_drive_by_a_makers_sheet_is_one_of_the_family(name: str) -> None:
    folder = os.environ.get("DIRECTRIX_EDS")
    if folder is None:
        pytest.skip("DIRECTRIX_EDS does not name the folder of real data sheets")
    vendor = REAL[name]
    made = lone(Profile(name, vendor=vendor or None), eds=Path(folder) / name)
    assert made.read(0x1000) & 0xFFFF == 402
    assert isinstance(made.drive, SimulatedDrive)
    if vendor:
        assert made.read(0x1018, 1) == vendor
    for word in (0x06, 0x07, 0x0F):
        made.command(word)
    assert made.status & 0x6F == 0x27
