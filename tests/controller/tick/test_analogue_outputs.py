"""M67, M68 and M19 on the stepped clock: counts at the node's terminals, and a spindle at its angle."""

from __future__ import annotations

import itertools
import re
from dataclasses import replace

import pytest
from support.machines.spindle_machine import SPINDLE, Mill, mill, text

from controller.machine import machine_file
from controller.machine.model import Machine
from controller.program import blocks
from controller.program.program import ProgramError
from controller.runtime.events import Event
from controller.state.modes import Fault, Mode, Request

ORIENT = 4  # bit of the node
WITH = """
[io]
bus = "can1"
node = 11
inputs = { estop = 0, door = 1, oriented = 2 }
outputs = { coolant = 0, mist = 1, orient = 4, air = 5 }
digital_out = ["air"]
orient = { output = "orient", input = "oriented", angle_deg = 90.0, within_s = 2.0 }

[io.analogue_out]
laser = { channel = 2, high = 100.0 }
pressure = { channel = 1, low = 4.0, high = 20.0, low_counts = -32768, high_counts = 32767 }
"""
POWER = "G21 G90 G54 G61\nG1 X10. F3000\nM67 E0 Q40\nG1 X20.\nM67 E0 Q100\nG1 X30.\nM30\n"


def machine() -> Machine:
    return mill(SPINDLE, WITH, "")


def changes(made: Mill, output: int) -> list[int]:
    """Ticks at which an analogue output is told another value."""
    levels = [now.analogue[output] for now in made.seen]
    return [i for i, (a, b) in enumerate(itertools.pairwise(levels), 1) if a != b]


def test_a_synchronous_level_changes_where_its_motion_begins_and_nothing_stops() -> None:
    made = Mill(machine())
    assert made.run(POWER).result == "completed"
    begins = [next(i for i, now in enumerate(made.seen) if now.line == line) for line in (4, 6)]
    found = changes(made, 0)
    assert [tick - begin for tick, begin in zip(found, begins, strict=False)] == [1, 1]
    speeds = [abs(b.joints[0] - a.joints[0]) for a, b in itertools.pairwise(made.seen)]
    assert min(speeds[found[0] - 5 : found[1] + 5]) > 0.9 * max(speeds)


def test_the_nodes_terminals_have_the_counts_and_go_to_rest_at_the_end() -> None:
    made = Mill(machine())
    assert (made.io.analogue(1), made.io.analogue(2)) == (-32768, 0)  # 4 mA, nothing
    told: list[tuple[int, int]] = []
    tick = made.bench.tick

    def noting() -> None:
        tick()
        told.append((made.io.analogue(1), made.io.analogue(2)))

    made.bench.tick = noting  # type: ignore[method-assign]
    made.run(POWER.replace("G1 X20.", "M68 E1 Q12\nG1 X20."))
    made.ticks(20)
    assert {laser for _, laser in told} == {0, round(0.4 * 32767), 32767}
    assert {pressure for pressure, _ in told} == {-32768, 0}
    assert told[-1] == (-32768, 0)


def test_an_immediate_level_changes_at_rest_and_stays_through_a_hold() -> None:
    made = Mill(machine())
    program = "G21 G90 G54\nG1 X10. F2000\nM68 E0 Q50\nG1 X40.\nM30\n"
    plain = Mill(machine())
    plain.run(program)
    (on_at, _) = changes(plain, 0)
    assert plain.seen[on_at].joints == plain.seen[on_at - 1].joints
    events = (Event(on_at + 60, Request.HOLD), Event(on_at + 500, Request.RESUME))
    assert made.run(program, *events).result == "completed"
    held = [now.analogue[0] for now in made.seen if now.mode is Mode.HOLD]
    assert held and set(held) == {50.0}


def test_a_fault_takes_it_to_rest() -> None:
    made = Mill(machine())
    made.run("G21 G90 G54\nM68 E0 Q50\nG1 X60. F2000\nM30\n", Event(400, Request.ESTOP))
    assert made.seen[395].analogue[0] == 50.0
    made.ticks(300)
    assert made.seen[-1].analogue[0] == 0.0 and made.io.analogue(2) == 0


def test_a_controller_that_falls_silent_leaves_no_level_behind() -> None:
    made = Mill(machine())
    made.run("G21 G90 G54\nM68 E0 Q50\nG1 X60. F2000\nM0\nM30\n")
    node = made.io
    node._lose_connection(made.bench.rig.now_s)
    assert (node.analogue(1), node.analogue(2)) == (-32768, 0)


# ---- M19 ---------------------------------------------------------------------------

STOPS = "G21 G90 G54\nS3000 M3\nG1 X10. F3000\nM19{}\nG1 X20.\nM3\nG1 X30.\nM30\n"


def test_the_spindle_stands_at_its_angle_before_motion_goes_on_and_is_free_before_it_turns() -> None:
    made = Mill(machine())
    assert made.run(STOPS.format(" R90")).result == "completed"
    on = [bool(now.outputs >> ORIENT & 1) for now in made.seen]
    begins = [i for i, (a, b) in enumerate(itertools.pairwise(on), 1) if a != b]
    assert len(begins) == 2
    first = begins[0]
    assert abs(made.seen[first].spindle_actual_rev_min) < 10.0
    moves = [i for i, (a, b) in enumerate(itertools.pairwise(made.seen), 1) if a.joints != b.joints]
    assert not [i for i in moves if first <= i < first + 450]  # a second of the drive's own way
    assert all(now.spindle_rev_min == 0.0 for now, told in zip(made.seen, on, strict=True) if told)
    assert made.seen[moves[-1]].spindle_rev_min == 3000.0


def test_a_spindle_that_does_not_come_to_its_angle_holds_the_program() -> None:
    made = Mill(machine())  # its drive takes a second
    run = made.run(STOPS.format(" Q0.5"), *(Event(at, Request.RESUME) for at in (2000, 2600)))
    assert run.result == "completed"
    held = [now for now in made.seen if now.mode is Mode.HOLD]
    assert held and {now.fault for now in held} == {Fault.INPUT_MISSING}


def test_fine_boring_leads_the_tip_off_the_wall_while_the_spindle_stands() -> None:
    file = WITH.replace("within_s = 2.0", 'within_s = 2.0, shift = "Y-"')
    made = Mill(replace(mill(SPINDLE, file, ""), dialect="fanuc", without_point="unit"))
    bore = "G98 G76 X20. Y5. Z-2. R2. Q0.5 F3000."
    assert made.run(f"G21 G90 G54\nS3000 M3\nG0 Z20.\n{bore}\nG80\nM30\n").result == "completed"
    stood = [now for now in made.seen if now.outputs >> ORIENT & 1]
    assert {now.spindle_rev_min for now in stood} == {0.0}
    xs, ys, zs = ([now.joints[axis] for now in stood] for axis in range(3))
    assert max(xs) - min(xs) < 1e-9 and max(ys) - min(ys) == pytest.approx(0.5, abs=1e-6)
    assert zs[-1] - zs[0] == pytest.approx(22.0, abs=1e-6)
    up = [now.joints[1] for now in stood if zs[0] + 0.01 < now.joints[2] < zs[-1] - 0.01]
    assert up and max(up) == pytest.approx(max(ys) - 0.5, abs=1e-6)  # off the wall all the way


# ---- refused -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("M67 E2 Q1", "E2 names no analogue output: write E and its number; there are E0 laser, E1 pressure"),
        ("M67 Q1", "M67 names no analogue output"),
        ("M68 E1 Q3", "pressure takes Q from 4 to 20"),
        ("M68 E0", "laser takes Q from 0 to 100"),
        ("M19 R45", "R45 is not where this spindle stops: its drive brings it to 90 degrees alone"),
        ("M19 P1", "P1 chooses a direction"),
        ("M19 Q0", "Q0 is no time"),
    ],
)
def test_what_the_machine_cannot_do_is_refused(line: str, why: str) -> None:
    with pytest.raises(ProgramError) as error:
        blocks.read(f"{line}\nG0 X1\n".encode(), machine(), "p.ngc")
    assert why in error.value.sentence


@pytest.mark.parametrize(
    ("line", "key"), [("M67 E0 Q1", "analogue_out"), ("M68 E0 Q1", "analogue_out"), ("M19", "orient")]
)
def test_a_machine_without_them_says_what_its_file_lacks(line: str, key: str) -> None:
    with pytest.raises(ProgramError, match=f"no {key} in .io."):
        blocks.read(f"{line}\nG0 X1\n".encode(), mill(SPINDLE, "", ""), "p.ngc")


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("channel = 2", "channel = 1", "laser has this channel, too"),
        ("high = 100.0", "high = 0.0", "is not above low"),
        ('input = "oriented"', 'input = "door"', "oriented = 2: this key is not known"),
        ('input = "oriented"', 'input = "power"', "oriented = 2: this key is not known"),
        ('digital_out = ["air"]', 'digital_out = ["air", "orient"]', "is no output that programs may have"),
    ],
)
def test_a_machine_file_that_errs_is_refused(old: str, new: str, why: str) -> None:
    assert old in WITH
    with pytest.raises(machine_file.ConfigError, match=re.escape(why)):
        machine_file.read(text(SPINDLE, WITH.replace(old, new), ""), "mill.toml")
