"""Lines typed by hand, one after the other, do what the same lines do as one program.

What that is, our own reader says of the joined text, and LinuxCNC's interpreter where it is installed: after
each line the same moves, places, codes, feed, speed, tool, spindle and coolant, or a reason that the README
of the programs tells.
"""

from __future__ import annotations

import random
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from support.machines.lines_by_hand import ByHand
from support.oracles import reference_interpreter as oracle
from support.parts.random_fanuc_lines import FanucLines
from support.parts.random_lines import ARCS, Lines
from support.suite import seed

from controller.machine import machine_file
from controller.machine.model import Machine
from controller.program import blocks
from controller.program.carried import InForce
from controller.program.modal import State
from controller.program.program import ProgramError
from controller.service.active_codes import active_codes

README = (Path(__file__).parents[3] / "config/programs/README.md").read_text(encoding="utf-8")
RUNS, LINES, SLOW_RUNS = 40, 10, 400
OF_FANUC, SLOW_OF_FANUC = 10, 400
BEGIN = ("G21 G98 F100 T1 M6",)  # as ours at power-on
DRILLS = (
    "G7",
    "G8",
    *(f"{letter}{sign}" for letter in "XYZA" for sign in "-0123456789[#"),
)  # while a cycle is on
PLACE = 2e-3  # of six decimals of inches, and their sums

# What leads elsewhere, or is refused by one of both, on purpose: where the README has the reason, and of
# which lines, in which state, that may be.
REASONS: dict[str, Callable[[str, State], bool]] = {
    "G41 and G42 by hand end with their line": lambda line, _: line[:3] in ("G41", "G42"),
    "M3 and M4 by hand while S is 0": lambda line, at: line in ("M3", "M4") and not at.speed_rev_min,
    "H0 is no length": lambda line, _: line == "G43 H0",
    "What M70 keeps by hand ends with its line": lambda line, _: line == "M72",
    "Feed a turn (G95) is refused while the spindle stands": lambda line, at: (
        at.per_turn and line not in ("G94", "G93")
    ),
    "goes on with lengths of a line in another unit": lambda line, at: (
        at.cycle is not None and at.cycle.mm_per_unit != at.mm_per_unit and line[:2] in DRILLS
    ),
    "G53 under G91 is a position as under G90": lambda line, at: "G53" in line and not at.absolute,
    "G10 L2 R, while a shift of G92 is in force": lambda line, at: (
        "L2 " in line and " R" in line and any(at.origins.shift.xyz)
    ),
    "G28 and G30 with X or Y alone move that axis": lambda line, _: line[:5] in ("G28 X", "G30 Z"),
    "The stand-alone `rs274` loses a tool length at each M6": lambda line, at: (
        "M6" in line and bool(at.modal.length_mm)
    ),
    "G43 and G49 behind a G20 or G21 that came after another G43": lambda line, at: (
        line[:3] in ("G43", "G49", "G20", "G21") and bool(at.modal.length_mm)
    ),
}


RISES = "Where R rises from one line of a cycle to the next under G99"
BEGAN_BELOW = "In a series of cycles that began below R"
TURN_IS_LOST = "the turn of an offset that no motion has followed yet"


def joined(text: str, machine: Machine) -> tuple[list[oracle.Move], State]:
    seen, moves = InForce(), oracle.ours(text, machine)
    for _ in blocks.stream(text.encode(), machine, "p", in_force=seen):
        pass
    assert seen.last is not None and not moves.refused, moves.refused
    return moves.moves, seen.last


def of_series(line: str, hand: ByHand) -> str:
    """Where R of a line that goes on with a series of cycles lies above its beginning, or above the axis."""
    at = hand.state
    if at.cycle is None or line[:2] not in DRILLS:
        return ""
    given = re.search(r"R(\S+)", line)
    r = at.cycle.clearance if given is None else float(given[1]) * at.mm_per_unit
    r += 0.0 if at.absolute else at.cycle.level
    z = hand.work[ARCS[at.modal.plane][4]]
    if z < r <= at.cycle.level and at.to_clearance:
        return RISES
    return BEGAN_BELOW if at.cycle.level < r < z else ""


def reason(line: str, hand: ByHand) -> str:
    """Where the README has why it may lead elsewhere; "" where it may not."""
    state = hand.state
    if "M6" in line and hand.machine.offset(state.modal.offset).frame.x[0] != 1.0:
        return TURN_IS_LOST
    return next((text for text, holds in REASONS.items() if holds(line, state)), of_series(line, hand))


@pytest.fixture(scope="module")
def machine() -> Machine:
    return oracle.machine()


def test_every_reason_is_told() -> None:
    assert [
        text
        for text in (*REASONS, RISES, BEGAN_BELOW, TURN_IS_LOST)
        if text not in README.replace("\n  ", " ")
    ] == []


@pytest.mark.parametrize("run", range(RUNS // 2))
def test_lines_by_hand_are_the_program_of_these_lines(run: int, machine: Machine) -> None:
    rng, hand, text = random.Random(f"{seed.SEED} {run}"), ByHand(machine), ""
    print(f"seed {seed.SEED}")
    lines = Lines(rng)
    while text.count("\n") < LINES:
        one = lines.line(hand.state, hand.work)
        # A program reads the line behind G52 with it, which may be the first point of a ruled surface:
        # positions of before the shift; and axis words alone are refused, for they could be meant so.
        if reason(one, hand) or (
            text.split("\n")[-2:][0].startswith("G52") and ("#" in one or one[0] in "XYZ")
        ):
            continue
        if oracle.ours(f"{text}{one}\n", machine).refused:
            with pytest.raises(ProgramError):
                hand.type(one)
            continue
        text = typed_alike(hand, one, text, machine)


def typed_alike(hand: ByHand, one: str, text: str, machine: Machine) -> str:
    """The program with a further line; typed, it has moved as the program does and leaves the same codes."""
    hand.type(one)
    text += f"{one}\n"
    moves, state = joined(text, machine)
    ours = oracle._moving(hand.moves)
    assert len(ours) == len(moves), text
    assert all(a.near(b, 1e-9) for a, b in zip(ours, moves, strict=True)), text
    assert hand.codes == active_codes(state), text
    return text


FANUCS = ("shop", "machining_centre", "xyzac_linuxcnc")


@pytest.fixture(scope="module")
def fanucs() -> list[Machine]:
    loaded = [machine_file.load(name) for name in FANUCS]
    return [
        replace(one, dialect="fanuc", without_point="unit", unset=(), changer=None, probe=None)
        for one in loaded
    ]


@pytest.mark.parametrize(
    "run",
    [*range(OF_FANUC), *(pytest.param(n, marks=pytest.mark.slow) for n in range(OF_FANUC, SLOW_OF_FANUC))],
)
def test_so_they_are_on_a_control_as_fanucs(run: int, fanucs: list[Machine]) -> None:
    """With radius and angle, mirrors, carried origins, planes that take several lines, H and D alone."""
    print(f"seed {seed.SEED}")
    rng, machine = random.Random(f"{seed.SEED} fanuc {run}"), fanucs[run % len(fanucs)]
    hand, text = ByHand(machine), ""
    lines, tries = FanucLines(rng, "".join(machine.axes[i].name for i in machine.rotary())), 0
    while text.count("\n") < LINES:
        assert (tries := tries + 1) < 30 * LINES, text
        one = lines.line(hand.state)
        if oracle.ours(f"{text}{one}\n", machine).refused:
            with pytest.raises(ProgramError):
                hand.type(one)
            continue
        if ",R" in one or ",C" in one:
            continue
        text = typed_alike(hand, one, text, machine)


@pytest.mark.skipif(oracle.program() is None, reason="LinuxCNC's interpreter is not installed")
@pytest.mark.parametrize(
    "run", [*range(RUNS), *(pytest.param(n, marks=pytest.mark.slow) for n in range(RUNS, SLOW_RUNS))]
)
def test_so_they_are_for_the_reference_interpreter_after_each(
    run: int, machine: Machine, tmp_path: Path
) -> None:
    print(f"seed {seed.SEED}")
    rng, hand, typed = random.Random(f"{seed.SEED} {run}"), ByHand(machine), list[str]()
    lines, ours = Lines(rng), list[tuple[State, dict[str, float], int]]()
    while len(typed) < len(BEGIN) + LINES:
        one = BEGIN[len(typed)] if len(typed) < len(BEGIN) else lines.line(hand.state, hand.work)
        if reason(one, hand):
            continue
        try:
            hand.type(one)
        except ProgramError as error:
            _, refused = oracle.after_each([*typed, one], tmp_path, machine)
            assert refused, (typed, one, str(error))
            continue
        typed.append(one)
        ours.append((hand.state, hand.work, len(oracle._moving(hand.moves))))
    theirs, refused = oracle.after_each(typed, tmp_path, machine)
    assert not refused and len(theirs) == len(typed), (typed, refused)
    moves = oracle._moving(hand.moves)
    for i, ((state, work, made), left) in enumerate(zip(ours, theirs, strict=True)):
        until = typed[: i + 1]
        assert made == len(left.moves), until
        assert all(a.near(b) for a, b in zip(moves, left.moves, strict=False)), until
        places = [work[name] / (1.0 if name in "AC" else state.mm_per_unit) for name in "XYZAC"]
        assert places == pytest.approx(left.places, abs=PLACE), until
        codes = {"G43" if code.startswith("G43.1 ") else code for code in active_codes(state)}
        assert left.codes <= codes, (until, left.codes - codes)
        assert state.speed_rev_min == pytest.approx(left.speed), until
        assert state.modal.tool == left.tool, until
        if left.feed is not None and not state.per_turn:
            feed = state.modal.feed_mm_s
            assert feed is not None and feed * 60.0 == pytest.approx(left.feed, rel=1e-4), until
