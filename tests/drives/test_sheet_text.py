"""Lines of data sheets against Python's own reader of such files."""

from __future__ import annotations

import configparser
from pathlib import Path

import pytest

from drives import sheet_text

SHEETS = sorted((Path(__file__).parents[2] / "config" / "eds").glob("*.eds"))
ODD = """; a remark
# another
[1000]  behind it
ParameterName = Device; type ; a remark
  DataType=0x0007
AccessType=ro=x
nothing
DefaultValue=
[Tools]
[1000]
DataType=0x0006
"""


def by_python(text: str) -> sheet_text.Sections:
    parser = configparser.RawConfigParser(
        strict=False, inline_comment_prefixes=(";",), allow_no_value=True, delimiters=("=",)
    )
    parser.optionxform = str  # type: ignore[assignment,method-assign]
    parser.read_string(text)
    return {
        section: {name: value for name, value in parser.items(section) if value is not None}
        for section in parser.sections()
    }


@pytest.mark.parametrize(
    "text", [*(path.read_text(encoding="latin-1") for path in SHEETS), ODD.replace("  DataType", "DataType")]
)
def test_a_sheet_is_read_as_python_reads_it(text: str) -> None:
    found = sheet_text.sections(text)
    assert found and found == by_python(text)
    assert sheet_text.sections(sheet_text.written(found)) == found


def test_a_key_that_stands_further_in_is_a_key_and_not_the_rest_of_a_value() -> None:
    assert sheet_text.sections(ODD)["1000"]["ParameterName"] == "Device; type"
    assert sheet_text.sections(ODD)["1000"]["DataType"] == "0x0006"


def test_what_stands_before_the_first_section_is_refused() -> None:
    with pytest.raises(ValueError, match="line 2 stands before the first section"):
        sheet_text.sections("; a remark\nDataType=7\n[1000]\n")
