"""Data sheets as makers write them: what canopen cannot read is mended, nothing is made up."""

from __future__ import annotations

import contextlib
import random
from pathlib import Path

import pytest

from drives.commissioning import possible, sheet
from drives.settings import MasterSettings, NodeSettings

EDS = Path(__file__).parents[2] / "config" / "eds" / "simulated_drive.eds"
OBJECT = "[1000]\nParameterName=Device type\nObjectType=0x7\nDataType=0x0007\nAccessType=ro\n"


@pytest.mark.parametrize("more", ["DataType=0x0FFF\nAccessType=rw\n", "DataType=0x0005\nAccessType=rw\n"])
def test_what_canopen_logs_of_a_sheet_is_shown_to_nobody(
    more: str, capfd: pytest.CaptureFixture[str]
) -> None:
    """A line of its own, without a file or what to do, came between the sentences."""
    found = read(f"{OBJECT}[2000]\nParameterName=odd\nObjectType=0x7\n{more}LowLimit=1\nHighLimit=2\n")
    with contextlib.suppress(KeyError, ValueError, TypeError):
        found.dictionary[0x2000].encode_raw(7)
    shown = capfd.readouterr()
    assert not shown.err and not shown.out


def read(text: str) -> sheet.Sheet:
    return sheet.read(text, "drive.eds", 3)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("[DeviceInfo]\nVendorNumber=\nProductNumber = \n" + OBJECT, "empty numbers"),
        (OBJECT.replace("DataType", "datatype").replace("AccessType", "ACCESSTYPE"), "keys in another case"),
        ("[DeviceInfo]\nVendorNumber=see manual\nBaudRate_1000=yes\n" + OBJECT, "numbers that are none"),
        ("[DummyUsage]\nDummy0001=0\n" + OBJECT, "not all dummies named"),
        ("[Comments]\nLines=7\nLine1=only one\n" + OBJECT, "fewer comment lines than said"),
        (OBJECT + OBJECT, "a section twice"),
        (OBJECT + "DataType=0x0007\n", "a key twice"),
        (OBJECT + "[1001]\nParameterName=Error register\nObjectType=0x7\n", "no data type"),
        (OBJECT + "[1018sub1]\nParameterName=Vendor\nDataType=0x0007\n", "a sub without its object"),
        (OBJECT + "PDOMapping=\nLowLimit=\nHighLimit=\nDefaultValue=\n", "empty limits and default"),
        (OBJECT + "[2000]\nParameterName=\nDataType=0x0005\nAccessType=rw\n", "no name"),
        ("\xef\xbb\xbf" + OBJECT + "; a remark\n[Tools]\nItems=0\n", "a byte order mark, a remark"),
        (OBJECT.replace("\n", "\r\n"), "the other line ends"),
        (OBJECT.replace("ParameterName=Device type", "ParameterName=Ger\xe4tetyp"), "umlauts"),
        (OBJECT + "[DeviceComissioning]\nNodeID=\nBaudrate=\n", "nothing commissioned"),
    ],
)
def test_a_makers_slip_does_not_stop_the_reading(text: str, reason: str) -> None:
    assert read(text).has(0x1000), reason


@pytest.mark.parametrize(
    "text", ["", "no section\n", "[DeviceInfo]\nVendorName=x\n", "\0\1\2", "[1000\nx=1\n"]
)
def test_what_is_no_data_sheet_is_refused_with_a_sentence(text: str) -> None:
    with pytest.raises(sheet.SheetError, match=r"data sheet drive\.eds cannot be read as EDS or DCF"):
        read(text)


def test_a_missing_file_is_refused_with_its_path(tmp_path: Path) -> None:
    with pytest.raises(sheet.SheetError, match=r"nothing\.eds cannot be read: No such file.*maker's EDS"):
        sheet.load(str(tmp_path / "nothing.eds"), 1)


def test_numbers_relative_to_the_node_id_are_of_this_node() -> None:
    assert sheet.load(str(EDS), 5).default(0x1400, 1) == 0x205


def test_only_members_that_the_sheet_names_are_there() -> None:
    array = "[1016]\nParameterName=Consumer\nObjectType=0x8\nSubNumber=2\n"
    array += "[1016Sub0]\nDataType=0x0005\nAccessType=ro\nDefaultValue=1\n"
    array += "[1016sub1]\nDataType=0x0007\nAccessType=rw\n"
    found = read(OBJECT + array)
    assert found.subs(0x1016) == [1]
    assert found.has(0x1016, 1)
    assert not found.has(0x1016, 2)
    assert not found.has(0x1000, 1), "a single object has no sub-index 1"


def test_a_compact_object_has_as_many_members_as_it_says() -> None:
    text = "[1600]\nParameterName=Mapping\nObjectType=0x8\nDataType=0x0007\nAccessType=rw\nCompactSubObj=8\n"
    found = read(OBJECT + text)
    assert found.subs(0x1600) == list(range(1, 9))
    assert found.writable(0x1600, 8)
    assert found.default(0x1600, 0) == 8


def test_the_identity_is_in_the_head_or_in_the_object() -> None:
    head = "[DeviceInfo]\nVendorNumber=0xFB\n" + OBJECT
    assert read(head).identity(1) == 0xFB
    body = "[1018]\nParameterName=Identity\nObjectType=0x9\n[1018sub1]\nDataType=0x7\nDefaultValue=0x9A\n"
    assert read(OBJECT + body).identity(1) == 0x9A
    assert read(OBJECT).identity(1) is None


def test_a_negative_default_may_be_written_as_the_hexadecimal_of_its_bits() -> None:
    text = "[607D]\nParameterName=Limit\nObjectType=0x7\nDataType=0x0004\nAccessType=rw\n"
    assert read(OBJECT + text + "DefaultValue=0xFFFFFFFE\n").default(0x607D) == -2
    assert read(OBJECT + text + "DefaultValue=-2\n").default(0x607D) == -2


def test_whatever_a_file_holds_reading_it_ends_with_a_sheet_or_a_sentence() -> None:
    text = EDS.read_text(encoding="latin-1")
    draw = random.Random(4711)
    for _ in range(150):
        lines = text.splitlines()[: draw.randrange(40, 400)]
        for _ in range(draw.randrange(1, 30)):
            place = draw.randrange(len(lines))
            damage = draw.choice(["", "x", "[", "]", "=", "0x", ";", "\0", "[1018sub1]", "DataType=", "-1"])
            at = draw.randrange(len(lines[place]) + 1)
            lines[place] = draw.choice([damage, lines[place][:at] + damage + lines[place][at:]])
        with contextlib.suppress(sheet.SheetError):
            found = read("\n".join(lines))
            possible.problems(NodeSettings("X", "can", 3, ""), MasterSettings(), found, 1_000_000)
