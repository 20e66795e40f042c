"""The one modal state of the machine: what each line and each end leaves to what comes next."""

from __future__ import annotations

import json
import pickle
from dataclasses import replace

import pytest
from support.machines.lines_by_hand import ByHand

from controller.ipc.handoff import Snapshot, blank
from controller.machine import machine_file
from controller.machine.model import Machine
from controller.program import blocks, carried, modal
from controller.program.carried import InForce
from controller.program.modal import State
from controller.program.program import ProgramError
from controller.runtime.plan_messages import Program
from controller.service import jobs
from controller.service.active_codes import active_codes
from controller.service.modal_state import ModalState

BY_WORDS = "G80 G17 G21 G90 G94 G40 G43.1 Z20.5 G54 G61 G98 G69 M5 M9 M48 T1 D0 F0 S0"
USUAL = "G80 G17 G21 G90 G94 G40 G49 G54 G61 G98 G69 M5 M9 M48 T1 H0 D0 F0 S0"


@pytest.fixture(scope="module")
def machine() -> Machine:
    return replace(machine_file.load("machining_centre"), unset=())


def after(text: str, machine: Machine, begin: State | None = None) -> State:
    """The state after a line."""
    seen = InForce()
    for _ in blocks.stream(text.encode(), machine, "MDI", begin=begin, in_force=seen):
        pass
    assert seen.last is not None
    return seen.last


def lines(machine: Machine, *typed: str) -> State:
    """The state after lines by hand, one after the other."""
    state = carried.after_line(modal.begun(machine), machine)
    for line in typed:
        state = carried.after_line(after(line, machine, state), machine)
    return state


@pytest.mark.parametrize(
    ("typed", "codes"),
    [
        ((), USUAL),
        (("G91", "G0 X1"), USUAL.replace("G80", "G0").replace("G90", "G91")),
        (("G43 H2", "G0 Z60"), USUAL.replace("G80", "G0").replace("G49", "G43").replace("H0", "H2")),
        (("G43.1 Z20.5", "G91"), BY_WORDS.replace("G90", "G91")),
        (("G43.1 Z25.4", "G20"), BY_WORDS.replace("G21", "G20").replace("Z20.5", "Z1")),
        (("G43 H2", "G43.2 H2"), BY_WORDS.replace("Z20.5", "Z110")),
        (("G43.1 Z20", "G43 H2"), USUAL.replace("G49", "G43").replace("H0", "H2")),
        (("G43.1 Z20", "G49"), USUAL),
        (("G20 G1 X1 F10",), USUAL.replace("G80", "G1").replace("G21", "G20").replace("F0", "F10")),
        (
            ("G55", "G18 G64 P0.01"),
            USUAL.replace("G17", "G18").replace("G54", "G55").replace("G61", "G64 P0.01"),
        ),
        (("S800 M3", "M8"), USUAL.replace("M5", "M3").replace("M9", "M8").replace("S0", "S800")),
        (("S800 M4", "M5"), USUAL.replace("S0", "S800")),
        (("T2 M6",), USUAL.replace("T1", "T2")),
        (("G81 X1 Y1 Z-1 R1 F100",), USUAL.replace("G80", "G81").replace("F0", "F100")),
        (("G68.2 X1 Y2 Z3 I10 J20 K30\nG53.1", "G91"), USUAL.replace("G69", "G68.2").replace("G90", "G91")),
        (("F100\nG93", "G94"), USUAL),
    ],
)
def test_a_line_by_hand_goes_on_from_the_one_before(
    typed: tuple[str, ...], codes: str, machine: Machine
) -> None:
    state = lines(machine, *typed)
    shown = " ".join(active_codes(state))
    assert shown == codes
    assert (
        carried.from_json(json.loads(json.dumps(carried.to_json(state))))
        .with_origins(state.origins, machine)
        ._replace(cleared=state.cleared)
        == state
    ), "a record has it without loss"
    assert pickle.loads(pickle.dumps(state)) == state


POINTS = ("G68.2 P2 Q1 X1. Y0. Z0.", "G68.2 P2 Q2 X5. Y0. Z1.", "G68.2 P2 Q3 X0. Y5. Z0.")
VECTORS = ("G68.2 P3 Q1 X1. Y0. Z0. I1. J0. K0.", "G68.2 P3 Q2 I0. J1. K4.")


@pytest.mark.parametrize(
    ("typed", "joined", "has"),
    [
        (("G0 X10. Y0.", "G16", "G0 X20. Y30.", "Y60."), "G0 X10. Y0.\nG16\nG0 X20. Y60.", "G16"),
        (("G51.1 X10. Z2.5", "G0 X3."), "G51.1 X10. Z2.5\nG0 X3.", "G51.1 X10 Z2.5"),
        (("G51.1 X25.4", "G20"), "G51.1 X25.4\nG20", "G51.1 X1"),
        (POINTS, "\n".join(POINTS), "G68.2"),
        ((POINTS[0], "G69", *VECTORS, "G0 X1."), "\n".join((*VECTORS, "G0 X1.")), "G68.2"),
        (("H2", "G43"), "G43 H2", "H2"),
        (("D3", "G0 X1.", "G91"), "D3\nG0 X1.\nG91", "G91"),
    ],
)
def test_so_it_does_on_a_control_as_fanucs(
    typed: tuple[str, ...], joined: str, has: str, machine: Machine
) -> None:
    fanuc = replace(machine, dialect="fanuc", without_point="unit")
    state = lines(fanuc, *typed)
    kept = carried.from_json(json.loads(json.dumps(carried.to_json(state))))
    assert has in active_codes(state) and active_codes(state) == active_codes(lines(fanuc, joined))
    assert kept.with_origins(state.origins, fanuc)._replace(cleared=state.cleared) == state


def test_half_a_plane_is_gone_on_with_or_given_up(machine: Machine) -> None:
    fanuc = replace(machine, dialect="fanuc", without_point="unit")
    state = lines(fanuc, POINTS[0])
    with pytest.raises(ProgramError, match="G69, which gives it up"):
        after("G0 X1.", fanuc, state)
    for left in (carried.after_stop(state, fanuc), lines(fanuc, POINTS[0], "G69")):
        assert "G0" in active_codes(after("G0 X1.", fanuc, left))
    keeps, hand = replace(fanuc, start_state="keep"), ByHand(fanuc)
    hand.type(POINTS[0])
    program, line = (replace(jobs.mdi("G0 X1.", keeps), program=p) for p in _programs(keeps))
    begun = [hand.modal.begin_of(job, hand.now, keeps, 1) for job in (program, line)]
    assert [state is not None and state.begun is not None for state in begun] == [False, True]


def test_a_curve_goes_on_from_the_one_of_the_line_before(machine: Machine) -> None:
    hand = ByHand(machine)
    for line in ("G0 X0 Y0 Z0", "F100 G5 X10 Y5 I2 J3 P-4 Q1", "G5 X20 Y0 P-1 Q2"):
        hand.type(line)
    assert (hand.work["X"], hand.work["Y"]) == pytest.approx((20.0, 0.0))


def test_the_end_of_a_program_leaves_what_rs274_says(machine: Machine) -> None:
    state = lines(machine, "G91 G18 G55 G43 H2 S500 M3", "M8", "G20 G2 X1 Z1 I0.5 K0.5 F10", "M49")
    left = carried.after_program(state, machine)
    expected = USUAL.replace("G80", "G1").replace("G21", "G20").replace("G49", "G43").replace("H0", "H2")
    assert " ".join(active_codes(left)) == expected.replace("S0", "S500")


def test_the_end_of_a_program_clears_the_state_of_a_fanuc(machine: Machine) -> None:
    fanuc = replace(machine, dialect="fanuc", without_point="unit")
    state = lines(fanuc, "G91 G18 G55 G43 H2 S500 M3", "G20")
    left = carried.after_program(state, fanuc)
    assert " ".join(active_codes(left)) == USUAL.replace("G21", "G20")


def test_a_stop_leaves_the_codes_and_nothing_that_turns_or_flows(machine: Machine) -> None:
    left = carried.after_stop(lines(machine, "G91 G55 S500 M3", "M8"), machine)
    assert {"G91", "G55", "M5", "M9", "S500"} <= set(active_codes(left))


def now(**values: object) -> Snapshot:
    return blank()._replace(**values)  # type: ignore[arg-type]


def test_what_turns_and_flows_is_what_the_tick_says(machine: Machine) -> None:
    state = ModalState(machine)
    state.see(lines(machine, "S500 M3"))
    off = state.at(now(), machine, 1)  # the door was opened
    assert (off.turning, off.modal.spindle_rev_min, off.speed_rev_min) == (0, 0.0, 500.0)
    slow = state.at(now(spindle_rev_min=250.0, spindle_override=0.5, coolant=2), machine, 1)
    assert (slow.modal.spindle_rev_min, slow.modal.coolant) == (500.0, 2)
    by_hand = ModalState(machine).at(now(spindle_rev_min=-900.0), machine, 1)
    assert (by_hand.turning, by_hand.modal.spindle_rev_min, by_hand.speed_rev_min) == (-1, -900.0, 900.0)


def test_a_length_that_was_touched_off_is_in_force_where_its_tool_is_named(machine: Machine) -> None:
    state = ModalState(machine)
    state.see(lines(machine, "G43 H2"))
    longer = replace(machine, tools=tuple(replace(t, length_mm=t.length_mm + 5.0) for t in machine.tools))
    before, after_it = (state.at(now(), one, 2).modal.length_mm for one in (machine, longer))
    assert after_it == before + 5.0 > 5.0


@pytest.mark.parametrize("program", ["G0 X1\nG1 X2 F100\nX3\nG0 X4\nM3 S100\nG1 X5 F50\nM5\nX6\n"])
def test_the_state_of_every_common_line_is_noted(program: str, machine: Machine) -> None:
    seen, read = InForce(), []
    for block in blocks.stream(program.encode(), machine, "p", in_force=seen):
        read.append(block)
    shown = [(state.motion, state.modal) for block in read if (state := seen.at(block.place.order))]
    motions = {1: "G0", 2: "G1", 3: "G1", 4: "G0", 5: "G0", 6: "G1", 7: "G1", 8: "G1"}
    assert [m for m, _ in shown] == [motions[block.place.line] for block in read]
    assert [m for _, m in shown] == [block.modal for block in read]


def test_a_length_that_a_line_writes_to_the_table_is_in_force_from_the_next_g43_on(machine: Machine) -> None:
    hand = ByHand(machine)
    for line in ("G43 H2", "G0 Z5", "G10 L1 P2 Z70"):
        hand.type(line)
    before = hand.state.modal.length_mm
    assert before == machine.tools[1].length_mm and hand.machine.tools[1].length_mm == 70.0
    hand.type("G43 H2")
    assert hand.state.modal.length_mm == 70.0


def test_the_length_of_the_sister_that_is_in_the_spindle_is_in_force_for_the_next_line(
    machine: Machine,
) -> None:
    """T2 is worn, and T3 comes in its place."""
    hand = ByHand(replace(machine, sisters=((2, 3),)))
    for line in ("T2 M6", "G43 H2", "G91"):
        hand.type(line)
    lengths = [tool.length_mm for tool in machine.tools[1:3]]
    assert (hand.tool, hand.state.modal.length_mm) == (3, lengths[1]) and lengths[0] != lengths[1]


def test_parameters_hold_for_the_lines_that_follow_and_for_no_program(machine: Machine) -> None:
    hand = ByHand(machine)
    for line in ("#1=5", "#<_far>=#1 #2=[#1*2]", "G0 X#1 Y#<_far>", "G0 X[#1+#2]"):
        hand.type(line)
    assert (hand.work["X"], hand.work["Y"]) == (15.0, 5.0)
    keeps = replace(hand.machine, start_state="keep")
    program, line = (replace(jobs.mdi("G0 X#1", keeps), program=p) for p in _programs(keeps))
    begun = [hand.modal.begin_of(job, hand.now, keeps, 1) for job in (program, line)]
    assert [state is not None and len(state.parameters) for state in begun] == [0, 3]
    assert begun[1] is not None
    plain = json.loads(json.dumps(carried.to_json(begun[1])))
    assert carried.from_json(plain).parameters == begun[1].parameters, "a record has them"
    del plain["parameters"]
    assert carried.from_json(plain).parameters == (), "an earlier version has written none"


def _programs(machine: Machine) -> tuple[Program, Program]:
    return Program(b"G0 X#1", "p", machine), Program(b"G0 X#1", "MDI", machine, typed=True)
