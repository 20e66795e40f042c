"""System variables of Fanuc's macros: numbers and meanings as the builders' manuals have them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from support.machines.traced_programs import mill

from controller.geometry.vectors import Frame
from controller.machine.equipment import Io
from controller.machine.model import KEPT_OFFSETS, Machine
from controller.program import blocks, modal
from controller.program.program import (
    Action,
    Await,
    JointLine,
    Level,
    OperatorMessage,
    ProgramError,
    Remark,
    Setting,
)


def machine(**fields: Any) -> Machine:
    made = mill(unset=())
    offsets = tuple(Frame((0.0, 0.0, 0.0)) for _ in KEPT_OFFSETS)
    tools = tuple(
        replace(tool, length_mm=length, wear_length_mm=0.1)
        for tool, length in zip(made.tools, (50.0, 60.0), strict=False)
    )
    on = {"dialect": "fanuc", "without_point": "unit", "offsets": offsets, "tools": tools, **fields}
    return replace(made, **on)


def value(text: str, number: str, **fields: Any) -> float:
    """What a variable is behind some lines: the X that it is given to."""
    made = blocks.read(
        f"{text}\n#100={number}\nG40\nG90 G53 G0 X#100\n".encode(), machine(**fields), "p"
    ).blocks
    x = [block for block in made if isinstance(block, JointLine)][-1].targets[0]
    assert x is not None
    return x


@pytest.mark.parametrize(
    ("text", "number", "expected"),
    [
        ("G0 X1.", "#4001", 0.0),
        ("G1 X1. F100.", "#4001", 1.0),
        ("G18", "#4002", 18.0),
        ("G91", "#4003", 91.0),
        ("G95", "#4005", 95.0),
        ("G93", "#4005", 93.0),
        ("G41 D1", "#4007", 41.0),
        ("G43 H1", "#4008", 43.0),
        ("G43.4 H1", "#4008", 43.4),
        ("G49", "#4008", 49.0),
        ("G0 X1.", "#4009", 80.0),
        ("G81 X1. Z-1. R1. F100.", "#4009", 81.0),
        ("G1 X1. F100.\nG81 X1. Z-1. R1. F100.", "#4001", 1.0),
        ("G99", "#4010", 99.0),
        ("G0", "#4012", 67.0),
        ("G56", "#4014", 56.0),
        ("G54.1 P7", "#4014", 54.1),
        ("G54.1 P7", "#4130", 7.0),
        ("G55", "#4130", 0.0),
        ("G64", "#4015", 64.0),
        ("G68 X0. Y0. R10.", "#4016", 68.0),
        ("G41 D2", "#4107", 2.0),
        ("F250.", "#4109", 250.0),
        ("G43 H2", "#4111", 2.0),
        ("S1500", "#4119", 1500.0),
        ("T2", "#4120", 2.0),
        ("G91", "#4203", 91.0),
        ("G0 X7. Y8. Z9.", "#5001", 7.0),
        ("G0 X7. Y8. Z9.", "#5002", 8.0),
        ("G0 X7. Y8. Z9. A10. C20.", "#5004", 10.0),
        ("G0 X7. Y8. Z9. A10. C20.", "#5005", 20.0),
        ("#5222=3.\nG0 X7. Y8. Z9.", "#5022", 11.0),
        ("#5222=3.\nG0 X7. Y8. Z9.", "#5042", 8.0),
        ("G43 H1 G0 Z9.", "#5083", 50.1),
        ("G0 Z9.", "#5083", 0.0),
        ("G10 L2 P3 X4. A5. C6.", "#5261", 4.0),
        ("G10 L2 P3 X4. A5. C6.", "#5264", 5.0),
        ("G10 L2 P3 X4. A5. C6.", "#5265", 6.0),
        ("G10 L20 P2 Y4.", "#7022", 4.0),
        ("G10 L20 P2 Y4.", "#14022", 4.0),
        ("G10 L21 P2 Z4. C30.", "#5543", 4.0),
        ("G10 L21 P2 Z4. C30.", "#5545", 30.0),
        ("G54.2 P2", "#5500", 2.0),
        ("G0", "#5201", 0.0),
        ("G0", "#10002", 0.1),
        ("G0", "#11002", 60.0),
        ("G0", "#13001", 3.0),
        ("#3901=#3901+1", "#3901", 1.0),
    ],
)
def test_a_variable_is_what_the_manuals_say(text: str, number: str, expected: float) -> None:
    wanted = machine().tools[0].radius_mm if number == "#13001" else expected
    assert value(text, number) == pytest.approx(wanted)


def test_lengths_are_in_the_active_unit() -> None:
    assert value("G20\n#5221=2.\nG21", "#5221") == pytest.approx(50.8)
    assert value("G10 L2 P1 X25.4\nG20\n#101=#5221\nG21", "#101") == pytest.approx(1.0)
    assert value("G20\n#11001=1.\nG21", "#11001") == pytest.approx(25.4)


def test_g66_is_told() -> None:
    text = "G66 P9000\n#100=#4012\nG67\nG53 G0 X#100\nM30\nO9000\nM99\n"
    made = blocks.read(text.encode(), machine(), "p").blocks
    assert [block.targets[0] for block in made if isinstance(block, JointLine)] == [66.0]


@pytest.mark.parametrize(
    ("who", "number", "expected"),
    [
        *(("fanuc", "#2002", 0.1), ("fanuc", "#2202", 60.0)),
        *(("haas", "#2002", 60.0), ("haas", "#2202", 0.1)),
    ],
)
def test_tool_offsets_from_2001_on_are_those_of_the_builder(who: str, number: str, expected: float) -> None:
    assert value("G0", number, macro_variables=who) == pytest.approx(expected)
    with pytest.raises(ProgramError, match="macro_variables"):
        value("G0", number)


def test_the_work_offset_is_group_12_of_haas() -> None:
    assert value("G56", "#4012", macro_variables="haas") == 56.0
    assert value("G56", "#4012", macro_variables="fanuc") == 67.0
    with pytest.raises(ProgramError, match="#4014"):
        value("G56", "#4014", macro_variables="haas")


def test_diameters_of_haas() -> None:
    on = machine()
    assert value("G0", "#2401", macro_variables="haas") == pytest.approx(2.0 * on.tools[0].radius_mm)
    assert value("#2401=8.", "#13001", macro_variables="haas") == pytest.approx(4.0)


def test_what_is_written_counts_from_the_next_line_on_and_for_good() -> None:
    text = "G54 G0 X1. Y1. Z1.\n#5221=10. #5223=-2.\nG0 X1. Y1. Z1.\n#7001=5.\nG54.1 P1 X1.\n"
    text += "#11001=70.\nG43 H1 Z1."
    made = blocks.read(text.encode(), machine(), "p").blocks
    moves = [block for block in made if isinstance(block, JointLine)]
    frames = [block.modal.frame(machine()).origin for block in moves]
    assert frames == [(0.0, 0.0, 0.0), (10.0, 0.0, -2.0), (5.0, 0.0, 0.0), (5.0, 0.0, 0.0)]
    assert moves[-1].modal.length_mm == pytest.approx(70.1)
    kinds = [(change.kind, change.key) for one in made if isinstance(one, Setting) for change in one.changes]
    assert kinds == [("offsets", "G54"), ("offsets", "G54"), ("offsets", "G54.1 P1"), ("tools", "1")]


def test_an_alarm_ends_the_program_where_it_stands_and_where_its_condition_holds() -> None:
    text = "#1=1\nIF [#1 EQ 2] THEN #3000=3 (NOT THIS)\nG0 X1.\nN5 #3000=146 (NO PART  THERE)\nG0 X2.\n"
    with pytest.raises(ProgramError) as refused:
        blocks.read(text.encode(), machine(), "p")
    assert refused.value.sentence == "the program ends itself with alarm 146: NO PART THERE"
    assert (refused.value.line, refused.value.column) == (4, 4)


def test_a_stop_with_a_message_stops_there() -> None:
    made = blocks.read(b"G0 X1.\n#3006=1 (TURN THE PART)\nG0 X2.\n", machine(), "p").blocks
    kinds = [type(block) for block in made]
    assert kinds == [JointLine, OperatorMessage, Action, JointLine]
    assert isinstance(made[1], OperatorMessage) and made[1].text == "TURN THE PART"


@pytest.mark.parametrize("number", [3003, 3004, 3901])
def test_what_does_nothing_here_is_told(number: int) -> None:
    made = blocks.read(f"#{number}=1\nG0 X1.\n".encode(), machine(), "p").blocks
    assert [block.sentence.split()[0] for block in made if isinstance(block, Remark)] == [f"#{number}"]


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ("#100=#1000", "value.system_inputs"),
        ("#1100=1", "value.system_outputs"),
        ("#100=#3001", "value.system_clocks"),
        ("#3001=0", "value.system_clocks"),
        ("#100=#3011", "value.system_clocks"),
        ("#100=#4114", "value.system_lines"),
        ("#100=#3000", "value.only_written"),
        ("#4001=1", "value.system_read"),
        ("#5041=1", "value.system_read"),
        ("#5101=1", "value.system_read"),
        ("#100=#5101", "value.system_following"),
        ("#5201=1.", "value.system_external"),
        ("#11099=5.", "value.system_no_tool"),
        ("#10001=5.", "value.system_wear"),
        ("#13001=0", "value.system_radius"),
        ("#100=#6000", "value.system"),
        ("#100=#99999", "value.system"),
        ("#100=#100000", "value.no_parameter"),
    ],
)
def test_what_has_no_value_here_is_refused_with_what_to_write(text: str, key: str) -> None:
    with pytest.raises(ProgramError) as refused:
        blocks.read(f"G0 X1.\n{text}\n".encode(), machine(), "p")
    assert (refused.value.said["key"], refused.value.line) == (key, 2)


def test_an_offset_is_not_written_beside_a_contour() -> None:
    with pytest.raises(ProgramError, match="write G40"):
        blocks.read(b"G41 D1\nG1 X20. F100.\n#5221=1.\nG1 Y20.\n", machine(), "p")


def test_numbers_that_the_machine_keeps_for_programs_are_theirs() -> None:
    assert value("#1005=4", "#1005", kept=((1000, 1099),)) == 4.0


def test_a_skip_that_a_line_by_hand_has_left_is_read_by_the_next() -> None:
    left = modal.begun(machine())._replace(parameters=(("5061", 7.0),))
    made = list(blocks.stream(b"G53 G0 X#5061\n", machine(), "p", begin=left))
    assert isinstance(made[0], JointLine) and made[0].targets[0] == 7.0


def test_under_the_other_dialect_the_numbers_are_parameters() -> None:
    assert value("#3000=4", "#3000", dialect="rs274") == 4.0


IO = Io(
    "can0",
    9,
    "",
    (("low", 0), ("ready", 1)),
    (("air", 0), ("lamp", 1)),
    digital_in=("low", "ready", "other"),
    digital_out=("air", "lamp"),
    read_on=("ready",),
    read_off=("low",),
)


@pytest.mark.parametrize(
    "text",
    [
        "#5=#1001+#1000*2\nG0 X#5",
        "#5=#[1000+1]\nN1 G0 X#5",
        "IF[#1001EQ1]GOTO1\nG0 X9.\nN1 G0 X1.",
        "WHILE[#1001EQ0]DO1\nG4 X0.5\nEND1\nG0 X1.",
        "IF[#1001EQ1]THEN#5=1\nG0 X#5",
    ],
)
def test_an_input_is_read_as_the_machine_file_says_and_waited_for(text: str) -> None:
    made = blocks.read(f"G0 X7.\n{text}\n".encode(), machine(io=IO), "p").blocks
    first, *waits, last = [block for block in made if isinstance(block, JointLine | Await)]
    assert isinstance(first, JointLine) and isinstance(last, JointLine) and last.targets[0] == 1.0
    found = {wait.number: wait.level for wait in waits if isinstance(wait, Await)}
    assert found.pop(0, Level.LOW) is Level.LOW and found == {1: Level.HIGH} and len(waits) <= 2


def test_outputs_are_switched_by_their_numbers() -> None:
    made = blocks.read(b"G0 X1.\n#1101=1\nG0 X2.\n#1101=0\nG0 X3.\n", machine(io=IO), "p").blocks
    other = blocks.read(b"G0 X1.\nM64 P1\nG0 X2.\nM65 P1\nG0 X3.\n", machine(io=IO), "p").blocks
    states = lambda made: [(type(one), one.modal.outputs) for one in made]  # noqa: E731
    assert states(made) == states(other) and len(made) == 5


@pytest.mark.parametrize("text", ["G0 X#1002", "G0 X#1003", "#1001=1", "#1102=1", "G0 X#1101"])
def test_other_inputs_and_outputs_are_refused_with_what_to_write(text: str) -> None:
    with pytest.raises(ProgramError) as refused:
        blocks.read(f"{text}\n".encode(), machine(io=IO), "p")
    assert "M66 P" in refused.value.sentence or "M62" in refused.value.sentence
