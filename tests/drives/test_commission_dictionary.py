"""Data sheets as canopen reads them, and values as it writes them: an independent reader and writer."""

from __future__ import annotations

import io
from pathlib import Path

import canopen
import pytest
from canopen.objectdictionary import ODVariable
from support.drives.makers_sheets import SHEETS, sheet_of

from drives import sheet_text
from drives.commissioning import sheet
from drives.commissioning.dictionary import MisfitError, Value, Variable, variables

SHIPPED = sorted((Path(__file__).parents[2] / "config" / "eds").glob("*.eds"))
NODE = 5
SAID = ("name", "qualname", "data_type", "access_type", "writable", "readable", "pdo_mappable", "min", "max")


def of_canopen(path: Path) -> dict[tuple[int, int], ODVariable]:
    """What canopen reads of the sections that are handed to our own reader."""
    source = io.StringIO(sheet_text.written(sheet.cleaned(path.read_text("latin-1"))))
    source.name = path.name
    found = {}
    for entry in canopen.import_od(source, NODE).indices.values():
        for one in [entry] if isinstance(entry, ODVariable) else entry.subindices.values():
            found[one.index, one.subindex] = one
    return found


def see_same(path: Path) -> None:
    theirs = of_canopen(path)
    ours = {(one.index, one.subindex): one for one in variables(sheet.load(str(path), NODE).dictionary)}
    assert ours.keys() == {place for place in theirs if place[0] >= 0x1000} and len(ours) > 100
    for place, one in ours.items():
        for what in SAID:
            assert getattr(one, what) == getattr(theirs[place], what), (hex(place[0]), place[1], what)
        for what in ("default", "value"):
            if getattr(one, f"{what}_raw") != "$NODEID":  # canopen wants a number beside it
                assert getattr(one, what) == getattr(theirs[place], what), (hex(place[0]), place[1], what)


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_a_shipped_sheet_says_what_canopen_reads(path: Path) -> None:
    see_same(path)


@pytest.mark.parametrize("name", SHEETS)
def test_so_does_a_makers_sheet(name: str) -> None:
    see_same(Path(sheet_of(name)))


def test_a_number_may_be_the_node_id_itself() -> None:
    text = "[1018]\nObjectType=9\n[1018sub4]\nDataType=7\nDefaultValue=$NODEID\n"
    assert sheet.read(text, "x.eds", NODE).default(0x1018, 4) == NODE


@pytest.mark.parametrize(
    ("data_type", "value"),
    [
        (0x01, True),
        *((kind, -3) for kind in (0x02, 0x03, 0x04, 0x10, 0x12, 0x13, 0x14, 0x15)),
        *((kind, 200) for kind in (0x05, 0x06, 0x07, 0x16, 0x18, 0x19, 0x1A, 0x1B)),
        (0x08, 0.5),
        (0x11, -1e300),
        (0x09, "a word"),
        (0x0B, "ein Wört"),
        (0x0A, b"\1\2\3"),
        (0x0F, b"\0" * 20),
    ],
)
def test_a_value_has_the_bytes_that_canopen_gives_it(data_type: int, value: Value) -> None:
    ours, theirs = Variable("x", 0x2000, data_type=data_type), ODVariable("x", 0x2000)
    theirs.data_type = data_type
    data = ours.encoded(value)
    assert data == theirs.encode_raw(value)
    assert ours.decoded(data) == theirs.decode_raw(data) == value


@pytest.mark.parametrize(
    ("data_type", "value"), [(0x05, 256), (0x05, -1), (0x02, 128), (0x07, "x"), (0x09, 1)]
)
def test_what_does_not_go_into_its_type_is_refused(data_type: int, value: Value) -> None:
    with pytest.raises(MisfitError, match="is no value of data type"):
        Variable("x", 0x2000, data_type=data_type).encoded(value)


def test_an_answer_that_is_too_short_is_a_misfit() -> None:
    with pytest.raises(MisfitError, match="2 bytes came, its data size is 4"):
        Variable("x", 0x2000, data_type=0x07).decoded(b"\1\2")
