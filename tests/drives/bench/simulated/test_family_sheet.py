"""Data sheets made for simulated families, and a script that moves one drive of each."""

from __future__ import annotations

import os
from pathlib import Path

import canopen
import pytest

from controller.machine import drive_profiles
from drives.bench.simulated import SimulatedDrive, families, family_sheet
from drives.bench.virtual.virtual_bus import Port, SteppedBus
from drives.commission import CommissionError, Pump, stepped_pump
from drives.one_axis import OneAxis
from drives.profile import CyclicMode, Profile, Supervision
from drives.settings import BusSettings

FAMILIES = drive_profiles.shipped()
MAKERS = {
    "elmo": "elmo_simpliq.dcf",
    "maxon_epos4": "maxon_epos4_50_5.eds",
    "pilz_prbt": "pilz_prbt.dcf",
    "technosoft_ipos": "technosoft_ipos.eds",
}


class Clock:
    """Stepped time, with a drive of a family on the bus."""

    def __init__(self, sheet: Path, profile: Profile, bare: bool) -> None:
        self.bus = SteppedBus()
        self.bus.attach(families.restrict(SimulatedDrive(1, eds=sheet), profile, bare))

    def open(self, settings: BusSettings, filters: object) -> Port:
        return self.bus.port(filters)  # type: ignore[arg-type]

    def pump(self, port: object) -> Pump:
        return stepped_pump(self.bus)

    def wait(self, until_s: float) -> float:
        self.bus.advance(max(self.bus.now_s, until_s))
        return self.bus.now_s


def move(sheet: Path, profile: Profile, bare: bool = False) -> int:
    """Commission, enable, move to 5000, disable; where it stood."""
    clock = Clock(sheet, profile, bare)
    with OneAxis(
        "virtual", "", node=1, eds=str(sheet), quick_stop=400_000_000, profile=profile, clock=clock
    ) as axis:
        axis.enable()
        axis.move_to(5000, speed=40_000, acceleration=400_000)
        return axis.position


@pytest.mark.parametrize("bare", [False, True], ids=["whole", "bare"])
@pytest.mark.parametrize("name", FAMILIES)
def test_a_drive_of_every_family_is_commissioned_and_moves(name: str, bare: bool, tmp_path: Path) -> None:
    profile = drive_profiles.load(name)
    sheet = family_sheet.write(tmp_path / f"{name}.eds", profile, bare)
    assert abs(move(sheet, profile, bare) - 5000) <= 2


@pytest.mark.parametrize("name", MAKERS)
def test_so_is_one_by_its_makers_sheet(name: str) -> None:
    folder = os.environ.get("DIRECTRIX_EDS")
    if folder is None:
        pytest.skip("DIRECTRIX_EDS does not name the folder of real data sheets")
    sheet, profile = Path(folder) / MAKERS[name], drive_profiles.load(name)
    if name == "pilz_prbt":  # without 6085h nobody knows how a script's drive stops
        with pytest.raises(CommissionError, match="no object 6085h"):
            move(sheet, profile)
        return
    assert abs(move(sheet, profile) - 5000) <= 2


def sheet(profile: Profile, folder: Path, bare: bool = False) -> canopen.ObjectDictionary:
    return canopen.import_od(str(family_sheet.write(folder / "family.eds", profile, bare)), 1)


def test_the_sheet_says_who_the_drive_is(tmp_path: Path) -> None:
    made = sheet(Profile("fam", vendor=0x1A3, product=77), tmp_path)
    assert (made.device_information.vendor_number, made[0x1018][1].default) == (0x1A3, 0x1A3)
    assert (made.device_information.product_number, made[0x1018][2].default) == (77, 77)


def test_what_the_family_lacks_is_not_in_it(tmp_path: Path) -> None:
    profile = Profile("fam", mode=CyclicMode.IP, takes_feed_forward=False, supervision=Supervision.NONE)
    made = sheet(profile, tmp_path)
    assert not {0x1016, 0x100C, 0x100D, 0x60B0, 0x60B1, 0x60B2} & set(made)
    assert made[0x6502].default & 0x380 == 0 and made[0x6502].default & 0x40


def test_the_home_offset_may_be_another_object(tmp_path: Path) -> None:
    made = sheet(Profile("fam", home_offset=0x30B0), tmp_path)
    assert 0x30B0 in made and 0x607C not in made


def test_a_bare_sheet_lacks_the_optional_objects_too(tmp_path: Path) -> None:
    profile = Profile("fam", optional=(0x60F4,))
    assert 0x60F4 in sheet(profile, tmp_path) and 0x60F4 not in sheet(profile, tmp_path, bare=True)


def test_its_lists_name_every_object_once(tmp_path: Path) -> None:
    text = family_sheet.write(tmp_path / "x.eds", Profile("fam", home_offset=0x30B0)).read_text()
    listed = [line.split("=0x")[1] for line in text.splitlines() if "=0x" in line and line[0].isdigit()]
    sections = {line[1:5] for line in text.splitlines() if line.startswith("[") and len(line) == 6}
    assert sorted(listed) == sorted(sections)
