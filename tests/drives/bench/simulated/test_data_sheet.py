"""Data sheets of all kinds, and a drive that answers by another drive's."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from support.drives.lone_drive import Lone, Refused
from support.drives.stepped_drives import nodes

from drives import commission, pdo
from drives.bench.simulated import rig
from drives.bench.simulated.data_sheet import EDS, defaults, key, number
from drives.settings import BusSettings, MasterSettings

BUSES = [BusSettings("can", "virtual", "", 1_000_000)]


@pytest.mark.parametrize(
    ("text", "value"),
    [("0x80", 128), ("-5", -5), ("$NODEID+0x200", 0x207), ("$NODEID + 0x80", 0x87), ("0x180+$NODEID", 0x187)],
)
def test_a_number_may_be_relative_to_the_node_in_every_spelling(text: str, value: int) -> None:
    assert number(text, 7) == value


def another(folder: Path) -> Path:
    """A drive without node guarding and manufacturer objects, and with a configured file's values."""
    text = EDS.read_text(encoding="latin-1")
    for section in ("100C", "100D", "2000", "2001", "2002", "2003(?:sub.)?"):
        text = re.sub(rf"\[{section}\]\n(?:[^\[\n].*\n|\n)*", "", text)
    text = text.replace("VendorNumber=0x00000D1E", "VendorNumber=0xABC")
    text = re.sub(r"(\[1018sub1\]\n(?:[^\[].*\n)*?)DefaultValue=.*\n", r"\1", text)
    text = re.sub(r"(\[6085\]\n(?:[^\[].*\n)*?)DefaultValue=.*\n", r"\1ParameterValue=4711\n", text)
    made = folder / "another.dcf"
    made.write_text(text, encoding="latin-1")
    return made


def test_a_drive_answers_by_the_sheet_it_is_given(tmp_path: Path) -> None:
    lone = Lone(eds=another(tmp_path))
    assert lone.read(0x1018, 1) == 0xABC, "the sheet's head says who it is"
    assert lone.read(0x6085) == 4711, "a configured value goes before the default"
    with pytest.raises(Refused, match="06020000"):
        lone.read(0x2002)
    lone.enable()


def test_what_a_sheet_leaves_open_has_the_own_sheets_value(tmp_path: Path) -> None:
    sheet = another(tmp_path)
    text = sheet.read_text(encoding="latin-1")
    sheet.write_text(re.sub(r"(\[6502\]\n(?:[^\[].*\n)*?)DefaultValue=.*\n", r"\1", text), encoding="latin-1")
    assert defaults(sheet, 5)[key(0x6502)] == defaults(EDS, 5)[key(0x6502)]


def test_a_rigs_drives_have_the_sheets_of_their_nodes(tmp_path: Path) -> None:
    made = nodes("XY", eds=str(another(tmp_path)))
    stepped = rig(made, BUSES)
    network = commission.Network(stepped.port(pdo.SERVICE_FILTERS), commission.stepped_pump(stepped))
    commission.commission(network, made, MasterSettings())
    assert all(drive.nmt == pdo.NMT_OPERATIONAL for drive in stepped.drives.values())
