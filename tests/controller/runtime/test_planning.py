"""The plan's orders carried out on the stepped clock: starts, rests, ways aside, with answers and news."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.machines import changer_bench
from support.machines.interrupted_runs import with_tool
from support.machines.planning_bench import Bench
from support.machines.stepped_runs import program

from controller import memory, messages
from controller.ipc import control_socket
from controller.ipc.handoff import COLUMN, Jog
from controller.machine import machine_file
from controller.machine.model import Joints
from controller.messages import message
from controller.plan.restart.program_position import Spot
from controller.plan.segment import Note
from controller.program import linked
from controller.program.program import Place
from controller.runtime.events import Event
from controller.runtime.plan_messages import Answer, Order, Program
from controller.state.modes import Fault, Mode, Request, sentence

SAME = 1e-6
LONGEST = 20_000  # ticks
TEXT = """G21 G90 G55 T2 M6
G43.4
G0 X0 Y0 Z60 A0 C0
G1 Z40 F3000
G1 X30 Y8 A6
G1 X-10 A2
G49
G0 Z120
M30
"""


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


def armed(bench: Bench, **more: Any) -> Answer:
    return bench.armed(TEXT, **more)


def held(bench: Bench, line: int) -> tuple[float, ...]:
    bench.until_line(line)
    bench.request(Request.HOLD)
    bench.until(Mode.HOLD)
    return bench.stepped.joints


def led(bench: Bench, verb: str, **more: Any) -> None:
    answer = bench.order(verb, **more)
    assert answer.error is None, answer.error
    bench.request(Request.RESUME)
    bench.until(Mode.HOLD)


def test_a_start_tells_tool_offset_and_place_on_the_way(bench: Bench) -> None:
    answer = armed(bench, in_spindle=1)
    bench.until(Mode.HOLD)
    assert [news.changes for news in bench.news if news.changes] == [{1: (2,)}]
    assert not bench.program_rows().size, "nothing moves before the tool is in"
    bench.request(Request.RESUME)
    assert answer.facts["start"].joints == pytest.approx(bench.snapshot().joints, abs=1.0)
    bench.until(Mode.READY)
    ways = {name: way for news in bench.news for name, way in news.ways.items()}
    assert {(way.tool, way.state.modal.offset) for way in ways.values()} == {(2, 1)}, "T2 and G55"
    assert bench.news[-1].finished and bench.news[-1].whole and bench.news[-1].tool == 2
    bench.assert_cut(TEXT, bench.machine, Spot(1, 0.0, 0, 0.0))


def test_what_was_remembered_of_a_program_is_forgotten_with_another_one_and_not_with_a_line_by_hand(
    bench: Bench,
) -> None:
    """Or a service that meets new programs for a day fills every cache, with surfaces and tables in it."""
    first = Program(TEXT.encode(), "part.ngc", bench.machine)
    other = Program(TEXT.replace("X30", "X20").encode(), "other.ngc", bench.machine)

    @memory.remembered(1)
    def look(of: str) -> object:
        return object()

    bench.order("check", program=first)
    seen = look("first")
    bench.order("check", program=Program(b"G21 G0 X1\n", "MDI", bench.machine, typed=True))
    assert bench.order("arm", program=replace(first, in_spindle=2)).error is None
    assert look("first") is seen
    bench.order("check", program=other)
    assert look("first") is not seen


def test_a_program_of_which_much_is_to_be_noted_leaves_room_for_the_status(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = Program(TEXT.encode(), "part.ngc", bench.machine)
    kept = bench.planning._checks.stored(program)
    long = message("row.departs", line=99999, why=message("row.turns", turn=1 / 3, mm=1 / 3, degrees=1 / 3))
    much = replace(kept, notes=(Note(Place(1, 1), long),) * 5000)
    monkeypatch.setattr(bench.planning._checks, "stored", lambda _: much)
    assert len(control_socket.packed(bench.order("check", program=program).facts)) < control_socket.MAX_BYTES


def test_a_rest_begins_in_the_middle_of_a_line_from_wherever_the_machine_stands(bench: Bench) -> None:
    armed(bench, spot=Spot(5, 0.5), in_spindle=2)
    bench.until(Mode.READY)
    rows = np.concatenate(bench.rows)
    assert rows[rows[:, COLUMN["line"]] > 0][:, COLUMN["line"]].min() == 5
    bench.rows.clear()
    armed(bench, spot=Spot(6, 0.25), in_spindle=2)
    bench.until(Mode.READY)
    first = bench.program_rows()
    assert first[first[:, COLUMN["motion_id"]] < 1 << 24][0, COLUMN["line"]] == 6


def test_a_resume_right_behind_the_way_back_goes_on_although_the_plan_has_not_seen_its_end(
    bench: Bench,
) -> None:
    armed(bench)
    held(bench, 5)
    led(bench, "retract", distance_mm=5.0)
    assert bench.order("return").error is None
    assert bench.planner.aside is not None and bench.planner.aside.returning
    bench.request(Request.RESUME)
    modes, follow = bench.stepped.cycle.modes, bench.stepped.cycle.follow
    bench.go(lambda: modes.mode is Mode.HOLD and follow.at_rest)
    bench.stepped.request(Request.RESUME)
    for _ in range(5):  # no turn of the plan
        bench.stepped.tick()
    assert modes.mode is Mode.RUNNING and bench.planner.aside is not None
    bench.until(Mode.READY)
    bench.assert_cut(TEXT, bench.machine, Spot(1, 0.0, 0, 0.0))


def assert_waits_over(bench: Bench, held: Joints) -> None:
    """Above the lines that are cut, a little before the place, where the way in begins."""
    kinematics = bench.stepped.kinematics
    here, there = (kinematics.forward(q, 0.0).tip for q in (bench.stepped.joints, held))
    assert here[2] > there[2] + 1.0 and np.hypot(*np.subtract(here, there)[:2]) < 11.0


def test_off_the_path_and_back_with_the_same_tool_is_told_and_goes_on(bench: Bench) -> None:
    armed(bench)
    joints = held(bench, 5)
    led(bench, "retract", distance_mm=5.0)
    assert bench.news[-1].aside
    led(bench, "return")
    assert not bench.news[-1].aside
    assert_waits_over(bench, joints)
    bench.request(Request.RESUME)
    bench.until(Mode.READY)
    bench.assert_cut(TEXT, bench.machine, Spot(1, 0.0, 0, 0.0))


@pytest.mark.parametrize("line", [1, 5])
def test_a_jog_before_the_plan_has_looked_at_the_hold_is_led_back(bench: Bench, line: int) -> None:
    """It was busy with what comes next: the path knows by itself where it goes on, before any motion, too."""
    armed(bench, in_spindle=1 if line == 1 else 2)
    modes, follow = bench.stepped.cycle.modes, bench.stepped.cycle.follow

    def busy(until: Mode) -> None:
        for _ in range(LONGEST):
            if modes.mode is until and follow.at_rest and not follow.stopping:
                break
            bench.stepped.tick()
        bench.rows.append(bench.stepped.recorder.drain())

    if line == 1:  # held before the tool is in
        bench.stepped._plan = lambda: None  # type: ignore[method-assign]
        bench.until(Mode.HOLD)
    else:
        bench.until_line(line)
        bench.stepped.request(Request.HOLD)
        busy(Mode.HOLD)
    held = bench.stepped.joints
    for axis, by_mm in ((0, -2.2), (1, -1.2), (2, 2.6)):
        way = tuple(float(i == axis) * by_mm / abs(by_mm) for i in range(5))
        bench.stepped.send(Event(0, Request.JOG, jog=Jog(way, 50.0, abs(by_mm))))
        bench.stepped.tick()
        busy(Mode.HOLD)
    assert np.abs(np.subtract(bench.stepped.joints, held))[:3] == pytest.approx((2.2, 1.2, 2.6))
    assert bench.order("retract", distance_mm=5.0).error is not None
    bench.stepped._plan = bench._turn  # type: ignore[method-assign]
    bench.rows.append(bench.stepped.go(20))
    assert bench.news[-1].aside
    led(bench, "retract", distance_mm=5.0)
    led(bench, "return")
    assert not bench.news[-1].aside
    if line == 1:
        assert bench.stepped.joints == pytest.approx(held, abs=1e-9)
    else:
        assert_waits_over(bench, held)
    spot, before = bench.planner.spot(bench.snapshot()), len(bench.rows)
    assert spot is not None and (line == 1 or 0.0 < spot.fraction < 1.0)
    while modes.mode is Mode.HOLD:  # a stop for a tool stands again
        bench.request(Request.RESUME)
        bench.go(lambda: modes.mode is not Mode.RUNNING and follow.at_rest)
    assert modes.mode is Mode.READY
    begin = Spot(1, 0.0, 0, 0.0) if line == 1 else spot._replace(s=spot.s + 0.05)
    bench.assert_cut(TEXT, bench.machine, begin, before)


@pytest.mark.slow
def test_another_tool_that_was_fitted_meanwhile_cuts_the_rest(bench: Bench) -> None:
    answer = armed(bench)
    joints = held(bench, 5)
    spot = bench.planner.spot(bench.snapshot())
    assert spot is not None and 0.0 < spot.fraction < 1.0
    led(bench, "retract", distance_mm=20.0)
    other = with_tool(bench.machine, 2, length_mm=8.0)
    start = answer.facts["start"].joints
    led(bench, "return", program=Program(TEXT.encode(), "part.ngc", other, start=start))
    assert bench.stepped.joints[2] - joints[2] > 8.0
    before = len(bench.rows)
    bench.request(Request.RESUME)
    bench.until(Mode.READY)
    bench.assert_cut(TEXT, other, spot._replace(s=spot.s + 0.05), before)


def test_how_far_the_drives_stopped_beside_the_path_is_told(bench: Bench) -> None:
    armed(bench)
    held(bench, 5)
    spot = bench.planner.spot(bench.snapshot())
    program = Program(TEXT.encode(), "part.ngc", bench.machine, spot=spot)
    on_path = messages.text(bench.order("beside", program=program).facts["said"])
    assert "0.000 mm beside the path near line 5" in on_path
    led(bench, "retract", distance_mm=3.0)
    off = messages.text(bench.order("beside", program=program).facts["said"])
    assert 2.0 < float(off.split("rest ")[1].split(" mm")[0]) <= 3.0005


def test_a_load_tells_whether_the_surfaces_keep_their_form_tolerance(bench: Bench) -> None:
    before, _, first = program("example2_ready").replace("R1.", "P3").partition("N50")
    wall = f"{before}N130 F100.{first.partition('N130')[2]}"  # the second surface of Example 2
    cone = "S500 M3\nG42\nG51 X9. Y0. Z0. I0. J0. K0. H10. R9. D90. F900.\n"
    for tolerance_mm, gouge, within in ((0.02, "refuse", True), (0.001, "warn", False), (None, "warn", None)):
        machine = replace(bench.machine, tolerance_mm=tolerance_mm, gouge=gouge)
        text = cone if within else wall
        facts = bench.order("check", program=Program(text.encode(), "part.ngc", machine)).facts
        assert (facts["verdict"] and facts["verdict"]["within"]) == within
    machine = replace(bench.machine, tolerance_mm=0.001, gouge="refuse")
    error = bench.order("check", program=Program(text.encode(), "part.ngc", machine)).error
    assert error is not None and "exceeds its form tolerance" in messages.text(error[1])


def test_an_order_that_fails_is_answered_with_its_sentence(bench: Bench) -> None:
    refused = bench.order("retract", distance_mm=1.0).error
    assert refused is not None and refused[0] == "refused" and "needs HOLD" in messages.text(refused[1])
    bad = Program(b"G0 X1\nG999\n", "bad.ngc", bench.machine)
    error = bench.order("check", program=bad).error
    assert error is not None and error[0] == "bad" and error[1]["values"]["place"] == "bad.ngc:2:1"
    assert bench.stepped.joints == bench.snapshot().joints


def _asked(bench: Bench, verb: str, **more: Any) -> None:
    """Ordered, and nothing of it has reached the tick yet."""
    bench.planning.carry_out(Order(1000, verb, **more))


@pytest.mark.parametrize(
    ("request_", "why"),
    [(Request.STOP, "stopped before it began"), (Request.ESTOP, sentence(Fault.EMERGENCY_STOP))],
)
def test_a_start_that_is_void_before_it_is_taken_is_answered_at_once(
    bench: Bench, request_: Request, why: str
) -> None:
    """And the next one is not kept waiting."""
    armed(bench)
    bench.until(Mode.READY)
    _asked(bench, "arm", program=Program(TEXT.encode(), "part.ngc", bench.machine, in_spindle=2))
    bench.stepped.request(request_)
    bench.go(lambda: bench.answers[-1].number == 1000)
    error = bench.answers[-1].error
    assert error is not None and error[0] == "refused" and why in messages.text(error[1])


def test_a_way_off_that_is_void_before_it_is_taken_is_answered_at_once(bench: Bench) -> None:
    armed(bench)
    held(bench, 5)
    _asked(bench, "retract", distance_mm=5.0)
    bench.stepped.request(Request.STOP)
    bench.go(lambda: bench.answers[-1].number == 1000)
    error = bench.answers[-1].error
    assert error is not None and "by now" in messages.text(error[1])
    bench.until(Mode.READY)
    armed(bench)
    bench.until(Mode.READY)


SAYS = """G21 G90 G61 G54
(MSG, begin)
G0 X0 Y0 Z100
#1=2 (DEBUG, one is %d#1)
o100 repeat [2]
(PRINT, turn the part)
M0
G1 F2000 X[5 * #1]
#1=[#1 - 1]
o100 endrepeat
(LOG, done)
M30
"""


def test_what_a_program_says_is_told_with_the_motion_or_the_stop_that_it_stands_before(bench: Bench) -> None:
    bench.armed(SAYS, in_spindle=1)
    for _ in range(2):
        bench.until(Mode.HOLD)
        bench.request(Request.RESUME)
    bench.until(Mode.READY)
    said = [(one.text, one.motion_id, one.line) for news in bench.news for one in news.messages]
    first = said[0][1]
    assert said == [
        ("begin", first, None),
        ("one is 2", first + 1, 7),
        ("turn the part", first + 1, 7),
        ("turn the part", first + 2, 7),
        ("done", first + 3, 12),
    ]
    assert first == 0


def test_t_is_told_with_the_motion_that_it_stands_before_where_a_changer_prepares(tmp_path: Path) -> None:
    bench = Bench(tmp_path, changer_bench.machine(changer_bench.BESIDE))
    bench.armed("G21\nG0 X1\nT2\nG1 X9 F600\nT3 G0 X2\nM30\n", in_spindle=1)
    bench.until(Mode.READY)
    said = [(one.tool, one.motion_id) for news in bench.news for one in news.messages]
    assert said == [(2, 1), (3, 2)]


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("G0 X1", ""),
        ("o<probe_top> call [20]", ""),  # asks what touches
        ("o<probe_tool_length> call [30] [0] [0]", "does not stand above it"),
    ],
)
def test_a_typed_line_is_checked_with_the_tool_of_the_changer_and_from_where_it_stands(
    tmp_path: Path, line: str, why: str
) -> None:
    """Else it is checked with T1, from where the axes were homed."""
    bench = Bench(tmp_path, machine_file.load("machining_centre"))
    text = linked.linked(f"G21 G90 G54 G43 H99\n{line}\n".encode(), lambda _: None)
    program = Program(text, "MDI", bench.machine, typed=True, in_spindle=99)
    error = bench.order("check", program=program).error
    assert (error is None) if not why else error is not None and why in messages.text(error[1]), error


def test_in_a_row_of_lines_the_modal_state_is_that_of_the_line_under_way(bench: Bench) -> None:
    """G64 P makes one motion of them; F and the motion's code are of each."""
    cut = "G1 X10 F3000\nG2 X20 Y10 I0 J10 F2000\nG1 Y20 F1000\nG1 X0\n"
    text = f"G21 G90 G55 G64 P0.02\nG0 X0 Y0 Z60\n{cut}M30\n"
    program = Program(text.encode(), "part.ngc", bench.machine, in_spindle=1)
    assert bench.order("arm", program=program).error is None
    bench.request(Request.START)
    ways, seen = {}, {}
    codes = {3: ("G1", 3000.0), 4: ("G2", 2000.0), 5: ("G1", 1000.0), 6: ("G1", 1000.0)}

    def over() -> bool:
        for news in bench.news:
            ways.update(news.ways)
        now = bench.snapshot()
        if now.line in codes and now.motion_id in ways:
            state = ways[now.motion_id].state_at(now.s)
            feed = round(60.0 * (state.modal.feed_mm_s or 0.0), 6)
            seen.setdefault(now.line, set()).add((state.motion, feed))
        return now.mode is Mode.READY and bool(seen)

    bench.go(over)
    assert any(len(way.states) > 1 for way in ways.values()), "no row of lines"
    assert seen == {line: {wanted} for line, wanted in codes.items()}
