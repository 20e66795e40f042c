"""Lines typed by hand, one after the other, do what the same lines do as one program.

What that is, our own reader says of the joined text, and LinuxCNC's interpreter where it is installed.
"""

from __future__ import annotations

import random
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from support.oracles import reference_interpreter as oracle

from controller.machine import setup_data
from controller.machine.changes import laid
from controller.machine.model import Joints, Machine
from controller.plan.report import explained
from controller.program import blocks, carried, modal
from controller.program.carried import InForce
from controller.program.modal import State
from controller.program.position import homed
from controller.program.program import Block, ProgramError, Setting
from controller.service.active_codes import active_codes

RUNS, LINES = 20, 10
# Codes that say how later words are meant, and what moves; all of them both interpreters know.
_SETS = (
    *("G90", "G91", "G17", "G18", "G19", "G54", "G55", "G59.3", "G49", "G43 H1", "G43 H2"),
    *("G61", "G64 P0.01", "G98", "G99", "G94", "M8", "M7", "M9", "M3 S800", "M4 S300", "M5", "S1200"),
    *("G92 X1 Z-2", "G92.1", "G92.2", "G10 L2 P2 X4 Y-3 Z1", "G10 L2 P1 R15", "G10 L20 P1 X7", "M48", "M49"),
    *("G90.1", "G91.1", "F200", "F35.5", "G40", "G80", "T2", "G43.1 Z3"),
)
_UNITS = ("G20", "G21")  # with tool lengths and F the stand-alone reference counts them in its own way
_MOVES = ("G0 {X}", "G1 {X}", "{X}", "{X} {Y}", "G1 {Y} {Z} F{F}", "G90 G53 G0 {Z}", "G0 {A}", "{A} {X}")


def number(rng: random.Random) -> str:
    return f"{rng.uniform(-9.0, 9.0):.2f}"


def line(rng: random.Random, units: bool) -> str:
    """One that sets, moves, or both."""
    words = {letter: letter + number(rng) for letter in "XYZA"}
    moves = rng.choice(_MOVES).format(**words, F=rng.randrange(50, 900))
    said = rng.choice(_SETS + _UNITS * units)
    return {0: said, 1: moves, 2: said}.get(rng.randrange(4), f"{rng.choice(_SETS[:11])} {moves}")


@dataclass
class ByHand:
    """What the service does with such lines, without a machine that moves."""

    file: Machine
    fitted: dict[str, Any] = field(default_factory=dict)
    axes: Joints = ()
    state: State | None = None
    moves: list[oracle.Move] = field(default_factory=list)

    def type(self, text: str) -> None:
        """Raises ProgramError, and has then done nothing."""
        machine = setup_data.applied(self.file, self.fitted)
        state = modal.begun(machine, self.state or carried.after_line(modal.begun(machine), machine))
        seen, here = InForce(), self.axes or homed(machine)
        before = machine.shown(here)
        read = list(blocks.stream(text.encode(), machine, "MDI", start=here, begin=state, in_force=seen))
        for step in explained.steps(iter(read), machine, "MDI", here):
            if step.kind in ("rapid", "line", "arc"):
                values = tuple(0.0 if q is None else q for q in step.axes.values())
                self.moves.append(oracle.Move(step.kind, values, oracle._a_minute(step, before, values)))
                before = values
                here = tuple(q / axis.shown_per_unit for q, axis in zip(values, machine.axes, strict=True))
        self.fitted, self.axes = laid(self.fitted, machine, _changes(read)), here
        assert seen.last is not None
        self.state = carried.after_line(seen.last, setup_data.applied(self.file, self.fitted))


def _changes(read: list[Block]) -> list[Any]:
    return [change for block in read if isinstance(block, Setting) for change in block.changes]


def joined(text: str, machine: Machine) -> tuple[list[oracle.Move], State]:
    seen, moves = InForce(), oracle.ours(text, machine)
    for _ in blocks.stream(text.encode(), machine, "p", in_force=seen):
        pass
    assert seen.last is not None and not moves.refused, moves.refused
    return moves.moves, seen.last


def drawn(seed: int, machine: Machine, units: bool = True) -> tuple[ByHand, str]:
    """Ten lines, those that are refused left out, as typed and as one program."""
    rng, hand, text = random.Random(seed), ByHand(machine), ""
    while text.count("\n") < LINES:
        one = line(rng, units)
        try:
            oracle_text = text + one + "\n"
            list(blocks.stream(oracle_text.encode(), machine, "p"))
        except ProgramError:
            with pytest.raises(ProgramError):
                hand.type(one)
            continue
        hand.type(one)
        text = oracle_text
        moves, state = joined(text, machine)
        ours = oracle._moving(hand.moves)
        assert len(ours) == len(moves), text
        assert all(a.near(b, 1e-9) for a, b in zip(ours, moves, strict=True)), text
        assert hand.state is not None and active_codes(hand.state) == active_codes(state), text
    return hand, text


@pytest.fixture(scope="module")
def machine() -> Machine:
    return oracle.machine()


@pytest.mark.parametrize("seed", range(RUNS))
def test_lines_by_hand_are_the_program_of_these_lines(seed: int, machine: Machine) -> None:
    drawn(seed, machine)


@pytest.mark.skipif(oracle.program() is None, reason="LinuxCNC's interpreter is not installed")
@pytest.mark.parametrize("seed", range(RUNS))
def test_so_they_are_for_the_reference_interpreter(seed: int, machine: Machine, tmp_path: Path) -> None:
    hand, text = drawn(seed, machine, units=False)
    reference = oracle.reference(text + "M2\n", tmp_path, machine)
    ours = oracle._moving(hand.moves)
    assert not reference.refused, (text, reference.refused)
    assert len(ours) == len(reference.moves), text
    assert all(a.near(b) for a, b in zip(ours, reference.moves, strict=True)), text
    calls = oracle.with_tools(text + "G4 P0.123\nM2\n", tmp_path, machine).stdout
    calls, found, _ = calls.partition("DWELL(0.123")
    assert hand.state is not None and found
    assert (hand.state.turning, hand.state.modal.coolant) == _switched(calls), text


def _switched(calls: str) -> tuple[int, int]:
    """Sense of the spindle and coolant (1 mist, 2 flood), as canonical calls have left them."""
    turning = coolant = 0
    for call in re.findall(r"[A-Z_]{6,}(?=\()", calls):
        turning = {"START_SPINDLE_CLOCKWISE": 1, "START_SPINDLE_COUNTERCLOCKWISE": -1}.get(call, turning)
        turning = 0 if call == "STOP_SPINDLE_TURNING" else turning
        coolant |= {"MIST_ON": 1, "FLOOD_ON": 2}.get(call, 0)
        coolant &= ~{"MIST_OFF": 1, "FLOOD_OFF": 2}.get(call, 0)
    return turning, coolant
