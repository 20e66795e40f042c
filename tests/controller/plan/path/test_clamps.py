"""Which clamps are open along a path, and where they are told."""

from __future__ import annotations

from dataclasses import replace

from support.machines.spindle_machine import mill
from support.machines.stepped_runs import program as shipped_program

from controller.machine import machine_file
from controller.machine.kinematics import kinematics_of
from controller.plan.path import clamps, path
from controller.plan.segment import ContinuousPath, Pause
from controller.program import blocks
from controller.program.program import Act

MACHINE = mill()
HOME = (0.0, 0.0, 260.0, 0.0, 0.0)
A, C = 1 << 3, 1 << 4


def walk(text: str) -> list[tuple[str, int]]:
    """(what, clamps open with it) along a path; chains show the clamps that are open as they run."""
    program = blocks.read(text.encode(), MACHINE, "part.ngc")
    found, is_open = [], 0
    for item in path.trace(program, MACHINE, kinematics_of(MACHINE), HOME).items:
        if isinstance(item, Pause):
            is_open = item.open_clamps
            found.append((item.act.name if item.act else "dwell", is_open))
        else:
            assert isinstance(item, ContinuousPath)
            found.append(("move", is_open))
    return found


def test_a_linear_move_opens_no_clamp() -> None:
    assert walk("G21 G90 G53 G0 X10\nG53 G0 Y10\n") == [("move", 0), ("move", 0)]


def test_a_clamp_opens_before_its_axis_moves_and_closes_before_the_next_that_does_not() -> None:
    assert walk("G53 G0 C10\nG53 G0 C20\nG53 G0 X5\n") == [
        ("CLAMP", C),
        ("move", C),
        ("move", C),
        ("CLAMP", 0),
        ("move", 0),
    ]


def test_each_axis_has_its_own_clamp() -> None:
    assert walk("G53 G0 A10\nG53 G0 C20\nG53 G0 A0 C0\n") == [
        ("CLAMP", A),
        ("move", A),
        ("CLAMP", C),
        ("move", C),
        ("CLAMP", A | C),
        ("move", A | C),
    ]


def test_a_stop_closes_the_clamps_before_it_and_other_words_leave_them() -> None:
    assert walk("G53 G0 C10\nS100 M3\nG4 P1\nM0\nG53 G0 C20\nM30\n") == [
        ("CLAMP", C),
        ("move", C),
        ("SPINDLE", C),
        ("dwell", C),
        ("CLAMP", 0),
        ("STOP", 0),
        ("CLAMP", C),
        ("move", C),
        ("CLAMP", 0),
        ("END", 0),
    ]


def test_a_pause_for_a_clamp_keeps_spindle_and_coolant_as_the_program_has_them() -> None:
    program = blocks.read(b"S500 M4 M8\nG53 G0 C10\n", MACHINE, "part.ngc")
    items = path.trace(program, MACHINE, kinematics_of(MACHINE), HOME).items
    pause = next(item for item in items if isinstance(item, Pause) and item.act is Act.CLAMP)
    assert (pause.modal.spindle_rev_min, pause.modal.coolant) == (-500.0, 2)


def test_a_cut_opens_the_clamps_of_the_rotaries_that_it_turns() -> None:
    """A cone keeps its tilt, so only C turns; the ruled surfaces turn both."""
    cone = walk(machine_file.shipped_program("example1_ready").read_text())
    ruled = walk(shipped_program("example2_ready"))
    opened = [bits for name, bits in cone if name == "CLAMP" and bits]
    assert opened == [A | C, C], "to the place where the lead begins, and for all of the cut"
    assert ("CLAMP", A | C) in ruled and ruled[-1] == ("END", 0)


def test_a_row_of_lines_that_goes_on_unseen_opens_all_clamps() -> None:
    program = blocks.read(b"G53 G0 X10\nG53 G0 X20\n", MACHINE, "part.ngc")
    items = path.trace(program, MACHINE, kinematics_of(MACHINE), HOME).items
    parts = [replace(item, runs_on=not i) for i, item in enumerate(items) if isinstance(item, ContinuousPath)]
    pauses = [
        item for item in clamps.opened(parts, MACHINE, kinematics_of(MACHINE)) if isinstance(item, Pause)
    ]
    assert [pause.open_clamps for pause in pauses] == [A | C], "and what goes on is not asked again"
