"""G76 and G87: the moves of Fanuc's manuals, written by hand, and what the machine must have for them."""

from __future__ import annotations

from dataclasses import replace

import pytest
from support.machines.spindle_machine import SPINDLE, mill, text
from support.oracles import reference_interpreter

from controller.geometry.vectors import Frame
from controller.machine import machine_file
from controller.machine.model import Io, Machine, Orient
from controller.plan.report import explained
from controller.program import blocks
from controller.program.position import homed
from controller.program.program import Action, Await, ProgramError

START = "G21 G90 G0 X0. Y0. Z10.\nF60. S100 M3\n"


def machine(shift: str = "X+", dialect: str = "fanuc") -> Machine:
    orient = Orient("orient", "oriented", 0.0, 5.0, shift)
    io = Io("can0", 9, "", (("oriented", 0),), (("orient", 0),), orient=orient)
    return reference_interpreter.machine(dialect, without_point="unit", io=io)


def told(program: str, on: Machine) -> list[str]:
    """Behind START: r, f with the place of each motion, d with seconds, s with the speed, o for the angle."""
    made, here = [], ""
    for step in explained.steps(blocks.stream((START + program).encode(), on, "p"), on, "p", homed(on)):
        place = " ".join(f"{step.axes[name]:g}" for name in "XYZ")
        if step.kind in ("rapid", *explained.LINES):
            if place != here:
                made.append(f"{'r' if step.kind == 'rapid' else 'f'} {place}")
            here = place
        elif step.kind == "dwell":
            made.append(f"d {step.facts['seconds']:g}")
        elif step.kind == "spindle":
            made.append(f"s {step.facts['rev_min']:g}")
        elif step.kind == "wait":
            made.append("o")
    return made[2:]


FINE = "r 3 4 10, r 3 4 2, f 3 4 -5, s 0, o, {}, s 100"
BACK = (
    "r 3 4 10, s 0, o, r 3.5 4 10, r 3.5 4 -20, r 3 4 -20, s 100, "
    "f 3 4 -12, s 0, o, r 3.5 4 -12, r 3.5 4 10, r 3 4 10, s 100"
)


@pytest.mark.parametrize(
    ("program", "shift", "moves"),
    [
        ("G99 G76 X3. Y4. Z-5. R2. Q.5", "X+", FINE.format("r 3.5 4 -5, r 3.5 4 2, r 3 4 2")),
        ("G98 G76 X3. Y4. Z-5. R2. Q.5", "X-", FINE.format("r 2.5 4 -5, r 2.5 4 10, r 3 4 10")),
        ("G99 G76 X3. Y4. Z-5. R2. Q.5", "Y-", FINE.format("r 3 3.5 -5, r 3 3.5 2, r 3 4 2")),
        ("G99 G76 X3. Y4. Z-5. R2. I.3 J-.4", "", FINE.format("r 3.3 3.6 -5, r 3.3 3.6 2, r 3 4 2")),
        (
            "G99 G76 X3. Y4. Z-5. R2. Q.5 P500",
            "X+",
            "r 3 4 10, r 3 4 2, f 3 4 -5, d 0.5, s 0, o, r 3.5 4 -5, r 3.5 4 2, r 3 4 2, s 100",
        ),
        ("G98 G87 X3. Y4. Z-12. R-20. Q.5", "X+", BACK),
        ("G91 G98 G87 X3. Y4. Z8. R-30. Q.5", "X+", BACK),
    ],
)
def test_the_moves(program: str, shift: str, moves: str) -> None:
    assert told(program, machine(shift)) == moves.split(", ")


def test_the_shift_stays_from_hole_to_hole_and_the_spindle_turns_on_behind() -> None:
    text_of_two = "G99 G76 X3. Y4. Z-5. R2. Q.5\nX10.\nG80\nG1 X20. F100."
    made = told(text_of_two, machine())
    assert made.count("o") == 2 and "r 10.5 4 -5" in made
    read = list(blocks.stream((START + text_of_two).encode(), machine(), "p"))
    assert read[-1].modal.spindle_rev_min == 100.0
    waits = [block for block in read if isinstance(block, Await)]
    assert all(wait.modal.outputs.on & 1 and wait.modal.spindle_rev_min == 0.0 for wait in waits)
    assert not read[-1].modal.outputs.on & 1  # the drive is free again
    assert sum(isinstance(block, Action) for block in read) == 1 + 2 * 4


def test_q_goes_along_the_machine_where_the_part_lies_turned() -> None:
    on = replace(machine(), offsets=(Frame((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0)),) * 9)
    made = told("G99 G76 X3. Y4. Z-5. R2. Q.5", on)
    assert "r -4 3 10" in made and "r -3.5 3 -5" in made


@pytest.mark.parametrize(
    ("program", "shift", "sentence"),
    [
        ("G76 X3. Z-5. R2.", "X+", "G76 has no Q"),
        ("G83 X3. Z-5. R2. Q1.\nG76 X4.", "X+", "G76 has no Q"),
        ("G76 X3. Z-5. R2. Q0", "X+", "goes aside by nothing"),
        ("G76 X3. Z-5. R2. Q-1.", "X+", "Q-1. is negative"),
        ("G76 X3. Z-5. R2. Q.5", "", "shift in orient of [io]"),
        ("M5\nG76 X3. Z-5. R2. Q.5", "X+", "while the spindle stands"),
        ("G99 G87 X3. Z-5. R-20. Q.5", "X+", "under G99"),
        ("G87 X3. Z-20. R-5. Q.5", "X+", "G87 cuts upwards"),
        ("G18 G76 X3. Y-5. R2. Q.5", "X+", "done in G17 alone"),
    ],
)
def test_what_is_refused_says_why(program: str, shift: str, sentence: str) -> None:
    with pytest.raises(ProgramError) as error:
        told(program, machine(shift))
    assert sentence in error.value.sentence


@pytest.mark.parametrize(("code", "instead"), [("G76", "G85, G86 or G89"), ("G87", "a cutter from below")])
def test_a_machine_that_cannot_bring_its_spindle_to_an_angle_says_so(code: str, instead: str) -> None:
    with pytest.raises(ProgramError) as error:
        told(f"{code} X3. Z-5. R2. Q.5", replace(machine(), io=None))
    assert "no orient in [io]" in error.value.sentence and instead in error.value.sentence


@pytest.mark.parametrize(
    ("line", "what"),
    [
        ("G76 P0.05 Z-1. I-.075 J.008 K.045", "threading"),
        ("G87 X1. Y1. Z-1. R1. I.5 J.5 K-2.", "back boring"),
    ],
)
def test_rs274_has_neither(line: str, what: str) -> None:
    with pytest.raises(ProgramError, match=f"{what}.* is not done here"):
        told(line, machine(dialect="rs274"))


IO = """
[io]
bus = "can1"
node = 11
inputs = { estop = 0, oriented = 2 }
outputs = { coolant = 0, orient = 4 }
orient = { output = "orient", input = "oriented", within_s = 2.0, shift = "Y+" }
"""


def test_the_machine_file_says_which_way_leads_off_the_wall() -> None:
    io = mill(SPINDLE, IO, "").io
    assert io is not None and io.orient is not None and io.orient.shift == "Y+"
    with pytest.raises(machine_file.ConfigError, match="shift"):
        machine_file.read(text(SPINDLE, IO.replace("Y+", "Z+"), ""), "mill.toml")
