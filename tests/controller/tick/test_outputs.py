"""Outputs of programs on the stepped clock: at their place in the path, through holds, off in faults."""

from __future__ import annotations

import itertools

import pytest
from support.machines.interrupted_runs import Items, rest_of
from support.machines.spindle_machine import SPINDLE, Mill, mill, text

from controller.machine import machine_file
from controller.machine.model import Machine
from controller.plan.restart.program_position import ENTRY_ID, Spot
from controller.program import blocks
from controller.program.program import ProgramError, Remark
from controller.runtime.events import Event
from controller.state.modes import Fault, Mode, Request, sentence

VACUUM, AIR = 4, 5  # bits of the node
WITH = """
[io]
bus = "can1"
node = 11
inputs = { estop = 0, door = 1, vacuum_there = 2 }
outputs = { coolant = 0, mist = 1, vacuum = 4, air = 5 }
digital_in = ["vacuum_there"]
digital_out = ["air", "vacuum"]
held = ["vacuum"]

[io.m_codes]
M10 = { output = "vacuum", on = true }
M11 = { output = "vacuum", on = false }
M121 = { output = "air" }
"""
THROUGH = "G21 G90 G54 G61\nG1 X10. F3000\nM62 P0\nG1 X20.\nM63 P0\nG1 X30.\nM30\n"


def machine() -> Machine:
    return mill(SPINDLE, WITH, "")


def on(outputs: int, bit: int) -> bool:
    return bool(outputs >> bit & 1)


def edges(made: Mill, bit: int) -> list[int]:
    """Ticks at which an output changes."""
    states = [on(now.outputs, bit) for now in made.seen]
    return [i for i, (a, b) in enumerate(itertools.pairwise(states), 1) if a != b]


def lines(made: Mill, ticks: list[int]) -> list[int]:
    return [made.seen[i].line for i in ticks]


@pytest.fixture(scope="module")
def whole() -> Mill:
    made = Mill(machine())
    assert made.run(THROUGH).result == "completed"
    return made


def test_a_synchronous_output_changes_in_the_tick_in_which_its_motion_begins_and_nothing_stops(
    whole: Mill,
) -> None:
    begins = [next(i for i, now in enumerate(whole.seen) if now.line == line) for line in (4, 6)]
    found = edges(whole, AIR)
    assert [tick - begin for tick, begin in zip(found, begins, strict=True)] == [
        1,
        1,
    ]  # told with the next SYNC
    speeds = [abs(b.joints[0] - a.joints[0]) for a, b in itertools.pairwise(whole.seen)]
    assert min(speeds[found[0] - 5 : found[1] + 5]) > 0.9 * max(speeds)


def test_the_nodes_terminals_show_it() -> None:
    made = Mill(machine())
    seen: list[int] = []
    made.io.watchers.append(lambda word, _: seen.append(word >> AIR & 1))
    made.run(THROUGH)
    assert [bit for i, bit in enumerate(seen) if i == 0 or seen[i - 1] != bit] in ([1, 0], [0, 1, 0])


def test_it_stays_through_hold_and_resume(whole: Mill) -> None:
    at = edges(whole, AIR)[0]
    made = Mill(machine())
    events = (Event(at + 5, Request.HOLD), Event(at + 400, Request.RESUME))
    assert made.run(THROUGH, *events).result == "completed"
    held = [now for now in made.seen if now.mode is Mode.HOLD]
    assert held and all(on(now.outputs, AIR) for now in held)
    assert lines(made, edges(made, AIR)) == [4, 6]


def test_a_hold_before_its_place_does_not_switch_it(whole: Mill) -> None:
    made = Mill(machine())
    made.run(THROUGH, Event(60, Request.HOLD), Event(500, Request.STOP))
    assert edges(made, AIR) == []


def test_at_a_fault_and_a_stop_it_goes_off_but_for_what_is_held(whole: Mill) -> None:
    program = "G21 G90 G54\nM64 P1\nM64 P0\nG1 X60. F2000\nM30\n"
    for request in (Request.STOP, Request.ESTOP):
        made = Mill(machine())
        made.run(program, Event(400, request))
        at = made.seen[395]
        assert on(at.outputs, AIR) and on(at.outputs, VACUUM)
        now = made.ticks(200)
        assert not on(now.outputs, AIR) and on(now.outputs, VACUUM), request


def test_immediate_outputs_and_the_machines_own_codes_switch_at_rest() -> None:
    made = Mill(machine())
    made.run("G21 G90 G54\nG1 X10. F2000\nM10\nG1 X20.\nM121\nG1 X30.\nM11 M65 P0\nG1 X40.\nM30\n")
    found = [tick for bit in (VACUUM, AIR) for tick in edges(made, bit)]
    assert len(found) == 4
    for tick in found:
        assert made.seen[tick].joints == made.seen[tick - 1].joints


def test_what_is_held_stays_for_the_next_program() -> None:
    made = Mill(machine())
    made.run("G21 G90 G54\nM10\nG1 X10. F2000\nM30\n")
    made.ticks(50)
    assert on(made.seen[-1].outputs, VACUUM)
    made.run("G21 G90 G54\nG1 X0 F2000\nM30\n")
    assert all(on(now.outputs, VACUUM) for now in made.seen[-200:])


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ('"vacuum"]\nheld', '"vacuum", "coolant"]\nheld', "is no output that programs may have"),
        ('held = ["vacuum"]', 'held = ["mist"]', "is not in digital_out"),
        ('held = ["vacuum"]', 'held = ["vacuum"]\nread_off = ["mist"]', "is not in digital_in"),
        ("M121", "M3", "is no code that a machine may have"),
        ('digital_out = ["air", "vacuum"]', 'digital_out = ["air", "air", "vacuum"]', "has a name twice"),
    ],
)
def test_a_machine_file_that_errs_is_refused(old: str, new: str, why: str) -> None:
    made = text(SPINDLE, WITH.replace(old, new), "")
    with pytest.raises(machine_file.ConfigError, match=why):
        machine_file.read(made, "mill.toml")


# ---- M66 ---------------------------------------------------------------------------

THERE = 2  # bit of the input
WAITS = "G21 G90 G54\nG1 X10. F3000\nM66 P0 L{} Q2\nG1 X20.\nM30\n"


@pytest.mark.parametrize(("level", "comes"), [(3, True), (4, False), (1, True), (2, False)])
def test_motion_waits_for_an_input(level: int, comes: bool) -> None:
    made = Mill(machine())
    before, after = made.input(THERE, not comes), made.input(THERE, comes)
    before()
    made.at[600] = after
    assert made.run(WAITS.format(level)).result == "completed"
    assert 600 <= first_tick(made, 4) < 620
    assert made.seen[500].waiting and made.seen[500].mode is Mode.RUNNING


def first_tick(made: Mill, line: int) -> int:
    """In which a line moves."""
    pairs = enumerate(itertools.pairwise(made.seen), 1)
    return next(i for i, (a, b) in pairs if b.line == line and a.joints != b.joints)


def test_a_rise_must_be_seen_while_it_is_waited_for() -> None:
    made = Mill(machine())
    made.input(THERE, True)()
    made.at[700] = made.input(THERE, False)
    made.at[800] = made.input(THERE, True)
    assert made.run(WAITS.format(1)).result == "completed"
    assert 800 <= first_tick(made, 4) < 820


def test_what_does_not_come_holds_the_program_with_a_sentence_and_resume_waits_again() -> None:
    made = Mill(machine())
    made.input(THERE, False)()
    made.at[2000] = made.input(THERE, True)
    run = made.run(WAITS.format(3), Event(1900, Request.RESUME))
    assert run.result == "completed"
    held = [now for now in made.seen if now.mode is Mode.HOLD]
    assert held and {now.fault for now in held} == {Fault.INPUT_MISSING}
    assert "M66" in sentence(Fault.INPUT_MISSING) and "M66" in sentence(Fault.INPUT_MISSING, language="de")
    assert all(now.joints == held[0].joints for now in held)


# ---- in the middle of a program ------------------------------------------------------


def test_a_restart_switches_what_was_on_before_it_moves_into_the_part() -> None:
    made = Mill(machine())
    rest = rest_of(THROUGH.replace("M63 P0", "M10"), Spot(6, 0.0), made.machine)
    made.bench.run(Items(rest.entered(made.bench.joints, 1)))
    for bit in (AIR, VACUUM):
        (on_at, *_) = edges(made, bit)
        assert made.seen[on_at].joints == made.seen[on_at - 1].joints
        cutting = [now for now in made.seen if 0 <= now.motion_id < ENTRY_ID]
        assert cutting and all(on(now.outputs, bit) for now in cutting if now.mode is Mode.RUNNING)


# ---- refused, and noted ----------------------------------------------------------------


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("M62 P2", "names nothing: digital_out in [io] of the machine file has P0 air, P1 vacuum"),
        ("M64", "does not say which one"),
        ("M66 P1 L3 Q1", "names nothing: digital_in"),
        ("M66 P0 L3", "has no time: write Q"),
        ("M66 P0 L5 Q1", "is nothing that M66 waits for"),
        ("#1=#5399", "is what M66 finds when the program runs"),
    ],
)
def test_what_cannot_be_switched_is_refused(line: str, why: str) -> None:
    with pytest.raises(ProgramError) as error:
        blocks.read(f"{line}\nG0 X1\n".encode(), machine(), "p.ngc")
    assert why in error.value.sentence


def test_a_machine_without_them_says_what_its_file_lacks() -> None:
    for line, key in (("M62 P0", "digital_out"), ("M66 P0 L3 Q1", "digital_in")):
        with pytest.raises(ProgramError, match=f"no {key} in .io."):
            blocks.read(f"{line}\nG0 X1\n".encode(), mill(SPINDLE, "", ""), "p.ngc")
    (noted, *_) = blocks.read(b"M10\nG0 X1\n", mill(SPINDLE, "", ""), "p.ngc").blocks
    assert isinstance(noted, Remark) and "m_codes" in noted.sentence
