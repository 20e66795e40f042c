"""Tool tables of others: what goes out comes in again, and what is no table is refused with its line."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from typing import Any

import pytest

from controller.machine import machine_file, tool_files
from controller.machine.setup_data import tools_of, with_tool

MACHINE = machine_file.load("trunnion")
ROWS = tools_of(MACHINE)


def row(**changes: Any) -> dict[str, Any]:
    return {**ROWS[0], **changes}


def test_a_table_of_linuxcnc_comes_in_as_it_went_out() -> None:
    found = tool_files.read_table(tool_files.table_text(ROWS), "tool.tbl")
    assert [one["number"] for one in found] == [one["number"] for one in ROWS]
    for one, was in zip(found, ROWS, strict=True):
        assert one["name"] == was["name"]
        assert (one["radius_mm"], one["length_mm"]) == pytest.approx(
            (was["radius_mm"], was["length_mm"]), abs=1e-6
        )


def test_json_comes_in_as_it_went_out_and_the_machine_takes_it() -> None:
    rows = [row(corner_mm=1.0, taper_rad=math.radians(3.0))]
    (found,) = tool_files.read_json(tool_files.json_text(rows), "tools.json")
    values = {key: value for key, value in found.items() if key != "number"}
    tool = with_tool(machine_file.load("trunnion"), 9, values).tool(9)
    assert tool is not None
    assert (tool.radius_mm, tool.corner_mm, tool.flute_mm) == (rows[0]["radius_mm"], 1.0, rows[0]["flute_mm"])
    assert math.degrees(tool.taper_rad) == pytest.approx(3.0)


@pytest.mark.parametrize(
    "form", [{"point_rad": math.radians(118.0)}, {"barrel_mm": 90.0}, {"end_mm": 9.0}, {"back_mm": 0.5}]
)
def test_a_cutter_of_another_form_comes_in_as_it_went_out(form: dict[str, float]) -> None:
    (found,) = tool_files.read_json(tool_files.json_text([row(**form)]), "tools.json")
    tool = with_tool(MACHINE, 9, {key: value for key, value in found.items() if key != "number"}).tool(9)
    assert {name: getattr(tool, name) for name in form} == pytest.approx(form)


def test_wear_goes_out_with_the_measures() -> None:
    worn = [row(wear_radius_mm=-0.02, wear_length_mm=-0.1, length_mm=50.0)]
    (found,) = tool_files.read_table(tool_files.table_text(worn), "tool.tbl")
    assert found["radius_mm"] == pytest.approx(worn[0]["radius_mm"] - 0.02)
    assert found["length_mm"] == pytest.approx(49.9)


def test_remarks_blank_lines_and_lower_case_are_read() -> None:
    text = "; my tools\n\nt12 p3 z+51.5 d8. ; drill\n"
    assert tool_files.read_table(text, "tool.tbl") == [
        {"number": 12, "name": "drill", "radius_mm": 4.0, "length_mm": 51.5}
    ]


@pytest.mark.parametrize(
    ("text", "phrase"),
    [
        ("T1 D6\nfoo", "tool.tbl:2: 'foo' is no row"),
        ("P1 D6", "tool.tbl:1: has no number"),
        ("T1.5 D6", "has no number"),
        ("T1 Z5", "T1 has no diameter"),
        ("T1 D6 X0.5", "offset across the tool"),
        ("T1 D6\nT1 D8", "T1 is there twice"),
        ("; none", "has no tool in it"),
    ],
)
def test_what_is_no_table_is_refused(text: str, phrase: str) -> None:
    with pytest.raises(tool_files.TableRefused) as error:
        tool_files.read_table(text, "tool.tbl")
    assert phrase in str(error.value)


@pytest.mark.parametrize(
    ("text", "phrase"),
    [
        ("[]", 'a list "tools"'),
        ('{"tools": 3}', "is no list"),
        ('{"tools": [3]}', "is no object"),
        ('{"tools": [{"number": 1, "DCX": 3}]}', "'DCX' is none of its properties"),
        ('{"tools": [{"number": true, "DC": 3}]}', '"number" is True'),
        ('{"tools": [{"number": 1, "DC": "3"}]}', "DC is '3'"),
        ('{"tools": [{"number": 1}]}', "has no DC"),
    ],
)
def test_what_is_no_such_json_is_refused(text: str, phrase: str) -> None:
    with pytest.raises(tool_files.TableRefused) as error:
        tool_files.read_json(text, "tools.json")
    assert phrase in str(error.value)


def test_the_length_that_cuts_is_never_guessed() -> None:
    rows = tool_files.read_table("T1 D6\nT77 D6", "tool.tbl")
    there = {one["number"]: one for one in ROWS}
    with pytest.raises(tool_files.TableRefused, match="T77: the file does not say"):
        tool_files.completed(rows, there, None)
    first, other = tool_files.completed(rows, there, 12.0)
    assert (first["flute_mm"], other["flute_mm"]) == (there[1]["flute_mm"], 12.0)


@pytest.mark.parametrize(
    "changes",
    [{}, {"corner_mm": 3.0}, {"taper_rad": 0.1}, {"holder": ((20.0, 50.0, 10.0),)}, {"name": "<&>"}],
)
def test_a_picture_is_svg_that_shows_all_of_the_tool(changes: dict[str, Any]) -> None:
    tool = replace(MACHINE.tools[0], length_mm=60.0, **changes)
    (one,) = tools_of(replace(MACHINE, tools=(tool,)))
    made = ElementTree.fromstring(tool_files.picture(one))
    x, y, wide, high = map(float, made.attrib["viewBox"].split())
    most = max([one["radius_mm"], *(half for _, _, half in one["holder"] or ())])
    assert x < -most and x + wide > most and y < -60.0 and y + high > 0.0
    title = made.find("{http://www.w3.org/2000/svg}title")
    assert title is not None and title.text is not None and one["name"] in title.text
    kinds = {path.attrib["class"] for path in made.iter("{http://www.w3.org/2000/svg}path")}
    assert kinds == ({"cutter", "shank", "holder"} if one["holder"] else {"cutter", "shank"})
