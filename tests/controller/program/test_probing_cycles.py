"""Probing cycles by name: the lines that run one, and what is refused."""

from __future__ import annotations

import re
from typing import Any

import pytest
from support.machines import probing_machine

from controller import messages
from controller.machine import machine_file
from controller.program import blocks, probing_cycles
from controller.program.linked import SHIPPED, parts
from controller.program.probing_cycles import CHOICES, CYCLES, LENGTHS, CycleRefused, program
from controller.program.program import JointLine, ProgramError, Setting
from controller.service.probed import result_of


def lines(cycle: str, values: dict[str, Any], offset: str = "none") -> str:
    return bytes(parts(program(cycle, values, offset))[0]).decode()


@pytest.mark.parametrize("dialect", ["rs274", "fanuc"])
@pytest.mark.parametrize("cycle", CYCLES)
def test_each_is_read_whole_under_both_dialects(cycle: str, dialect: str) -> None:
    """As a check does: a probing move is taken to touch at its end."""
    machine = probing_machine.machine(**{"[machine]\n": f'[machine]\ndialect = "{dialect}"\n'})
    on_setter = cycle in probing_cycles.ON_SETTER
    offset = "none" if cycle in probing_cycles.SET_NONE else "G59.3"
    values = {"keep": "yes"} if "keep" in CYCLES[cycle] else {}
    text = program(cycle, values, offset, machine.unset, tool=2 if on_setter else 99)
    read = blocks.read(text, machine, "p.ngc", start=(-80.0, -40.0, 200.0, 0.0, 0.0))
    probed = [one for one in read.blocks if isinstance(one, JointLine) and one.probe is not None]
    assert {one.modal.tool for one in probed} == {2 if on_setter else 99}, "as it was put in by hand"
    sets = sum(isinstance(one, Setting) for one in read.blocks)
    assert len(probed) >= 3
    # What a check takes for touches is no measure of the probe: it sets nothing then.
    assert sets == (cycle not in ("tool_check", *probing_cycles.OF_PROBE))


@pytest.mark.parametrize("cycle", [one for one in CYCLES if one not in probing_cycles.ON_SETTER])
def test_no_tool_but_the_probe_is_led_to_the_part(cycle: str) -> None:
    """The machine has a setter, which would be listened to while a mill goes into the part."""
    text = b"T1 M6\n" + program(cycle, {}, "none")
    moved = []
    with pytest.raises(ProgramError) as refused:
        for block in blocks.stream(
            text, probing_machine.machine(), "p.ngc", start=(0.0, 0.0, 200.0, 0.0, 0.0)
        ):
            moved += [block] if isinstance(block, JointLine) else []
    assert "T1 in the spindle is no probe: its probe is T99" in refused.value.sentence and not moved


@pytest.mark.parametrize(
    ("where", "name", "says"),
    [
        ("G53 G0 X-70 Y-40", "_setter_z", "does not stand above it: it is 10.000 mm beside"),
        ("G53 G0 X-80 Y-40 A1", "_setter_z", "(here 1.000 degrees at most)"),
        ("G53 G0 X-80 Y-40", "_setter_height", "has no value"),
    ],
)
def test_the_face_of_the_setter_is_there_only_below_the_tool(where: str, name: str, says: str) -> None:
    with pytest.raises(ProgramError) as refused:
        blocks.read(f"{where}\n#1=#<{name}>\n".encode(), probing_machine.machine(), "p.ngc")
    assert says in refused.value.sentence
    with pytest.raises(ProgramError, match=r"add \[setter\]"):
        blocks.read(b"#1=#<_setter_radius>\n", machine_file.load("trunnion"), "p.ngc")
    good = b"G53 G0 X-80 Y-40\nG0 Z#<_setter_z>\nG0 X#<_setter_radius>\n"
    assert len(blocks.read(good, probing_machine.machine(), "p.ngc").blocks) == 3


def test_what_is_said_and_what_is_usual() -> None:
    assert lines("edge", {"towards": "X-", "most": 7.5}, "G55") == (
        "G21 G90 G94 G40 G55 G43\no<probe_edge> call [-1] [0] [7.5] [2]\n"
    )
    assert (
        lines("corner", {"corner": "X-Y+"}).splitlines()[1] == "o<probe_corner> call [-1] [1] [20] [20] [0]"
    )
    assert lines("web", {"axis": "Y", "half": 9, "down": 3}, "G59.3").splitlines()[1] == (
        "o<probe_web> call [0] [1] [9] [3] [20] [9]"
    )


def test_a_value_is_written_with_all_its_decimals_and_no_exponent() -> None:
    values = {"along": -0.00001, "most": 123.45678}
    assert (
        lines("corner", values).splitlines()[1] == "o<probe_corner> call [1] [1] [-0.00001] [123.45678] [0]"
    )


@pytest.mark.parametrize("cycle", CYCLES)
def test_the_program_of_a_cycle_is_called_with_as_many_values_as_it_says(cycle: str) -> None:
    head = (SHIPPED / f"probe_{cycle}.ngc").read_text()
    said = re.search(rf"o<probe_{cycle}> call (.*?\[(?:P|keep|within)\])", head)
    assert said is not None
    assert lines(cycle, {}).count("[") == said[1].count("[")
    files = parts(program(cycle, {}, "none"))[1]
    assert {f"probe_{cycle}", "probe_touch"} <= set(files)


def results(cycle: str) -> list[str]:
    """What its program says that it has found."""
    (told,) = re.findall(r"\(LOG, (.*)\)", (SHIPPED / f"probe_{cycle}.ngc").read_text())
    result = result_of(re.sub(r"#(<\w+>|\d+)", "1.5", told))
    assert result is not None and result["cycle"] == cycle
    return [name.rpartition("_")[0] or name for name in result["values"]]


def test_all_that_ship_are_there_and_each_has_its_words_in_every_language() -> None:
    files = {file.stem.removeprefix("probe_") for file in SHIPPED.glob("probe_*.ngc")}
    assert files == {*CYCLES, "touch"}
    wanted = {f"probing.cycle.{cycle}" for cycle in CYCLES} | {
        f"probing.keep.{one}" for one in CHOICES["keep"]
    }
    wanted |= {f"probing.value.{name}" for values in CYCLES.values() for name in values}
    assert {name for values in CYCLES.values() for name in values} == {*CHOICES, *LENGTHS}
    wanted |= {f"probing.found.{name}" for cycle in CYCLES for name in results(cycle)}
    for language in messages.LANGUAGES:
        assert wanted <= set(messages.of(language).page), language


@pytest.mark.parametrize(
    ("cycle", "values", "offset", "says"),
    [
        ("edges", {}, "none", "no such probing cycle; allowed are top, edge"),
        (None, {}, "none", "no such probing cycle"),
        ("edge", {"half": 3}, "none", "edge has no such value; allowed are towards, most"),
        ("edge", {"towards": "Z-"}, "none", "allowed are X+, X-, Y+, Y-"),
        ("edge", {"towards": 1}, "none", "allowed are X+, X-, Y+, Y-"),
        ("bore", {"most": 0}, "none", "must be 0.1 to 500 mm"),
        ("tool_length", {"turning": -1}, "none", "must be 0 to 5000 1/min"),
        ("tool_length", {}, "G54", "allowed are none"),
        ("bore", {"most": True}, "none", "must be 0.1 to 500 mm"),
        ("bore", {"most": float("nan")}, "none", "must be 0.1 to 500 mm"),
        ("plane", {"beside_x": 0.0}, "none", "must be -500 to 500 mm and not 0"),
        ("bore", {}, "G54.1 P3", "no offset that a cycle sets; allowed are none, G54"),
        ("bore", {}, None, "no offset that a cycle sets"),
    ],
)
def test_what_cannot_be_is_refused_in_a_sentence(cycle: Any, values: Any, offset: Any, says: str) -> None:
    with pytest.raises(CycleRefused) as refused:
        program(cycle, values, offset)
    assert says in messages.text(refused.value.said)
    assert messages.text(refused.value.said, "de") != messages.text(refused.value.said)


def test_the_list_has_every_value_with_what_is_usual() -> None:
    for cycle in probing_cycles.listed():
        usual = {value["name"]: value["usual"] for value in cycle["values"]}
        assert program(cycle["name"], usual, "none") == program(cycle["name"], {}, "none")
