"""Every run can be made again from its record, on the stepped clock; one that comes out otherwise says so.

The live machine with its processes: tests/controller/service/test_replay.py.
"""

from __future__ import annotations

import json
import math
import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.live.recordings import MILLED
from support.live.replayed_runs import again, assert_same_setpoints
from support.machines import edited_records
from support.machines.planning_bench import PERIOD_S
from support.machines.recording_bench import RecordedBench, sent
from support.machines.spindle_machine import DOOR, mill
from support.machines.stepped_runs import shipped
from typer.testing import CliRunner

from controller import __main__ as command_line
from controller.cli import recorded_runs
from controller.cli import replay as command
from controller.ipc.handoff import COLUMN, Jog
from controller.runtime import checked, events
from controller.runtime.comparison import Comparison, Difference
from controller.state import setpoints
from controller.state.modes import Fault, Mode, Request
from controller.state.setpoints import SETPOINTS

TEXT = """G21 G90 G55 T2 M6
G43.4
G0 X0 Y0 Z60 A0 C0
G1 Z40 F3000
G1 X20 Y6 A4
G1 X-10 A2 F2000
G49
G0 Z70
M30
"""
# A plan that is killed on line 5 has not planned all of it.
LONG = TEXT.replace("X20 Y6 A4", "X30 Y8 A6").replace("F2000", "F500")
UP = Jog((0.0, 0.0, 1.0, 0.0, 0.0), 20.0, 4.0)
ASIDE = Jog((1.0, 0.0, 0.0, 0.0, 0.0), 15.0, 6.0)
BACK = Jog((0.0, 0.0, -1.0, 0.0, 0.0), 20.0, 4.0)


@pytest.fixture
def bench(tmp_path: Path) -> RecordedBench:
    return RecordedBench(tmp_path, shipped(period_s=0.008))


def assert_comes_again(folder: Path, ended: str = "completed", itself: bool = True, text: str = TEXT) -> None:
    done = again(folder, text)
    assert done.run.result == ended
    assert_same_setpoints(done, itself)


def disturbed(bench: RecordedBench, rng: random.Random, aside: Jog | None = None) -> None:
    """The run goes on to its end: overrides, a hold, off the path (``aside``: and a jog), and back."""
    bench.until_line(4)
    for share in (0.4, 1.7, 0.9):
        bench.request(Request.OVERRIDE, share)
        bench.rows.append(bench.stepped.go(rng.randrange(20, 80)))
    bench.held(5)
    bench.led("retract", distance_mm=5.0)
    if aside is not None:
        bench.jogged_to_rest(aside)
    bench.led("return")
    bench.request(Request.RESUME)
    bench.until(Mode.READY)


def test_overrides_and_switches_that_were_set_before_the_start(bench: RecordedBench) -> None:
    bench.request(Request.RAPID_OVERRIDE, 0.5)
    bench.request(Request.OVERRIDE, 1.0 / 3.0)
    bench.request(Request.SINGLE_BLOCK, 1.0)
    bench.started(TEXT)
    for _ in range(6):
        bench.go(lambda: bench.snapshot().at_rest and bench.snapshot().mode is not Mode.RUNNING)
        if bench.snapshot().mode is Mode.READY:
            break
        bench.request(Request.RESUME)
    bench.request(Request.SINGLE_BLOCK, 0.0)
    if bench.snapshot().mode is not Mode.READY:
        bench.request(Request.RESUME)
        bench.until(Mode.READY)
    assert_comes_again(bench.ended())


def test_an_override_between_the_plan_and_the_start_and_some_on_the_way(bench: RecordedBench) -> None:
    bench.armed(TEXT)
    bench.request(Request.RAPID_OVERRIDE, 0.25)
    bench.request(Request.START)
    bench.until_line(4)
    for share in (0.4, 1.7, 0.123456789, 1.0):
        bench.request(Request.OVERRIDE, share)
        bench.rows.append(bench.stepped.go(60))
    bench.until(Mode.READY)
    assert_comes_again(bench.ended())


def test_hold_retract_jog_return_and_resume(bench: RecordedBench) -> None:
    bench.started(TEXT)
    bench.held(5)
    bench.led("retract", distance_mm=5.0)
    bench.jogged_to_rest(ASIDE)
    bench.jogged_to_rest(UP)
    bench.led("return")
    bench.request(Request.OVERRIDE, 0.6)
    bench.request(Request.RESUME)
    bench.until(Mode.READY)
    assert_comes_again(bench.ended())


def test_a_jog_out_of_a_hold_and_its_return(bench: RecordedBench) -> None:
    bench.started(TEXT)
    bench.held(5)
    bench.jogged_to_rest(UP)
    bench.jogged_to_rest(ASIDE)
    bench.led("return")
    bench.request(Request.RESUME)
    bench.until(Mode.READY)
    assert_comes_again(bench.ended())


@pytest.mark.parametrize("late_s", [0.12, 0.0036])
def test_a_key_that_nobody_presses_any_more_where_ticks_come_late(tmp_path: Path, late_s: float) -> None:
    """Ticks that were missed count for the one who asks, too: the jog ends sooner by them."""
    late = set[int]()

    def lateness(n: int) -> float:
        return late_s if n in late else 0.0

    bench = RecordedBench(tmp_path, shipped(period_s=0.008), lateness)
    bench.started(TEXT)
    bench.held(5)
    for _ in range(3):
        bench.jog(ASIDE._replace(length=math.inf))
    first = bench.stepped.clock.waits + 2
    late |= {first} if late_s > 0.01 else set(range(first, first + 60, 3))
    bench.jog(ASIDE._replace(length=math.inf))
    bench.until(Mode.HOLD)
    bench.led("return")
    bench.request(Request.RESUME)
    bench.until(Mode.READY)
    assert_comes_again(bench.ended())


def test_a_key_held_down_while_the_tool_is_aside(bench: RecordedBench) -> None:
    bench.started(TEXT)
    bench.held(5)
    bench.led("retract", distance_mm=5.0)
    for _ in range(20):
        bench.jog(ASIDE._replace(length=math.inf))
    bench.request(Request.JOG_STOP)
    bench.until(Mode.HOLD)
    bench.led("return")
    bench.request(Request.RESUME)
    bench.until(Mode.READY)
    assert_comes_again(bench.ended())


def test_a_longer_tool_that_was_fitted_while_the_program_was_held(bench: RecordedBench) -> None:
    bench.started(TEXT)
    bench.held(5)
    bench.led("retract", distance_mm=20.0)
    bench.led("return", program=bench.refitted(length_mm=8.0))
    bench.request(Request.RESUME)
    bench.until(Mode.READY)
    assert_comes_again(bench.ended())


def test_a_stop_and_an_emergency_stop(bench: RecordedBench) -> None:
    bench.started(TEXT)
    bench.until_line(5)
    bench.request(Request.STOP)
    bench.until(Mode.READY)
    assert_comes_again(bench.ended("stopped"), "stopped")
    bench.started(TEXT)
    bench.until_line(5)
    bench.request(Request.ESTOP)
    bench.until(Mode.FAULT)
    folder = bench.ended("fault")
    assert_comes_again(folder, "fault", itself=False)


def test_a_drive_that_is_lost_and_the_stop_of_the_others_on_the_path(bench: RecordedBench) -> None:
    bench.started(TEXT)
    bench.until_line(5)
    cycle = bench.stepped.cycle
    supervise = cycle._supervise

    def lost(now_s: float, ticks: int) -> None:
        supervise(now_s, ticks)
        cycle._supervise = supervise  # type: ignore[method-assign]
        cycle.modes.fail(Fault.FOLLOWING_ERROR, 1)

    cycle._supervise = lost  # type: ignore[method-assign]
    bench.until(Mode.FAULT)
    folder = bench.ended("fault")
    assert_comes_again(folder, "fault", itself=False)
    lines = events.recorded(folder / "events.jsonl")
    assert lines is not None
    (fault,) = [line for line in lines.lines if line.kind == events.FAULT]
    (off,) = [line for line in lines.lines if line.kind == events.OFF_PATH]
    assert off.tick > fault.tick + 3, "its stop on the path was compared"


def test_a_plan_that_was_killed(bench: RecordedBench) -> None:
    bench.started(LONG)
    bench.until_line(5)
    bench.kill()
    bench.request(Request.PLAN_LOST)
    bench.until(Mode.FAULT)
    assert_comes_again(bench.ended("fault"), "fault", itself=False, text=LONG)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_late_ticks_at_whatever_moment(tmp_path: Path, seed: int) -> None:
    """Without a stock a third of the ticks send no SYNC, and requests come in those, too."""
    rng = random.Random(seed)
    late = [False]
    alone = shipped(period_s=PERIOD_S, stock_s=0.0)
    bench = RecordedBench(tmp_path, alone, lambda _: 0.0007 * (late[0] and rng.random() < 0.33))
    bench.stepped.cycle.sync._skip_limit = math.inf
    late[0] = True
    bench.request(Request.OVERRIDE, 0.7)
    bench.started(TEXT)
    disturbed(bench, rng)
    assert_comes_again(bench.ended())


@pytest.mark.parametrize("longest_s", [0.012, 0.1])
def test_ticks_that_come_late_within_the_stock_and_beyond_it(tmp_path: Path, longest_s: float) -> None:
    """What the pump has played meanwhile stands in the record, the stops at the end of the stock among it."""
    rng = random.Random(round(1000 * longest_s))
    late = [False]
    bench = RecordedBench(
        tmp_path, None, lambda _: rng.uniform(0.0, longest_s) * (late[0] and rng.random() < 0.05)
    )
    bench.request(Request.OVERRIDE, 0.7)
    bench.started(TEXT)
    late[0] = True
    disturbed(bench, rng)
    sync = bench.stepped.cycle.sync
    assert sync.played > 20 and bool(sync.braked) is (longest_s > 0.05)
    assert_comes_again(bench.ended())


@pytest.mark.parametrize("longest_s", [0.006, 0.03])
def test_ticks_whose_plan_came_too_late_and_was_refused(tmp_path: Path, longest_s: float) -> None:
    """Their own step was not sent: the record says so, and how the pump has gone on instead."""
    rng = random.Random(round(1000 * longest_s))
    late = [False]
    bench = RecordedBench(
        tmp_path, None, lambda _: rng.uniform(0.0, longest_s) * (late[0] and rng.random() < 0.05)
    )
    cycle, clock = bench.stepped.cycle, bench.stepped.clock
    stock, refused = cycle.stock, [0]
    assert stock is not None
    publish, take_back = stock.publish, cycle._take_back

    def published(anew: bool) -> None:
        clock._now_s += rng.uniform(0.0, 0.014) * (late[0] and rng.random() < 0.2)
        for step in clock.steppers:
            step(clock._now_s)
        publish(anew)

    def taken_back(played: int) -> None:
        refused[0] += 1
        take_back(played)

    stock.publish, cycle._take_back = published, taken_back  # type: ignore[method-assign]
    bench.request(Request.OVERRIDE, 0.7)
    bench.started(TEXT)
    late[0] = True
    disturbed(bench, rng, ASIDE)
    assert refused[0] > 2
    assert_comes_again(bench.ended())


def test_waits_for_the_spindle_and_an_open_door_with_a_resume_that_was_refused(tmp_path: Path) -> None:
    """The spindle of the run took longer than that of the bench on which it is made again."""
    bench = RecordedBench(tmp_path, mill())
    rig, peripherals = bench.stepped.rig, bench.stepped.cycle.peripherals
    natural, since = peripherals._await, [0]

    def slowly(modes: Any, ticks: int) -> None:
        since[0] += 1
        if since[0] % 150 > 60:
            natural(modes, ticks)

    peripherals._await = slowly  # type: ignore[method-assign]
    bench.started(MILLED)
    bench.until_line(4)
    rig.io["io"].set_input(DOOR, False, rig.now_s)
    bench.until(Mode.HOLD)
    bench.request(Request.RESUME)
    assert bench.snapshot().mode is Mode.HOLD, "the door is open"
    rig.io["io"].set_input(DOOR, True, rig.now_s)
    bench.rows.append(bench.stepped.go(50))
    bench.request(Request.RESUME)
    bench.until(Mode.READY)
    folder = bench.ended()
    done = again(folder, MILLED, mill())
    assert done.run.result == "completed"
    assert_same_setpoints(done)
    assert '"request": "wait", "value": 1' in (folder / "events.jsonl").read_text()


# -- what a loss of power leaves


def test_what_was_written_before_a_loss_is_whole_wherever_it_was_torn(bench: RecordedBench) -> None:
    """The service was killed: every whole row and line counts, and comes again."""
    bench.request(Request.OVERRIDE, 0.8)
    bench.started(TEXT)
    bench.until_line(5)
    bench.request(Request.OVERRIDE, 0.3)
    bench.rows.append(bench.stepped.go(100))
    folder = bench.record.folder  # nobody ends it
    whole = (folder / "setpoints.part").read_bytes()
    told = (folder / "events.jsonl").read_bytes()
    assert len(whole) >= 20 * (bench.record.last_tick - bench.record.first_tick)
    assert_comes_again(folder, "lost", itself=False)
    for rows, torn in ((17, 0), (24 * 40 + 5, 0), (24 * 100, 7)):
        (folder / "setpoints.part").write_bytes(whole[: len(whole) - rows])
        (folder / "events.jsonl").write_bytes(told[: len(told) - torn])
        assert_comes_again(folder, "lost", itself=False)


def test_a_record_whose_planner_was_killed_before_its_last_turn_was_written_ends_there(
    bench: RecordedBench,
) -> None:
    """What it had sent came to the tick, when it had made that is nowhere: up to there it comes again."""
    bench.started(LONG)
    bench.until_line(5)
    bench.rows.append(bench.stepped.go(300))
    folder = bench.record.folder
    file = folder / "events.jsonl"
    lines = edited_records.lines_of(file)
    last = max(n for n, line in enumerate(lines) if line["request"] == "plan")
    taken = [n for n, line in enumerate(lines) if line["request"] == "pieces" and n > last]
    assert taken, "the last turn made nothing"
    edited_records.rewrite(file, lines[:last] + lines[last + 1 :])
    done = again(folder, LONG)
    assert done.run.lacks_from == lines[taken[0]]["tick"]
    assert len(done.setpoints) > 300
    assert_same_setpoints(done, ended_itself=False)
    code, told = simulated(folder, LONG)
    assert code == 0 and told["compared_ticks"] == done.run.lacks_from, told


# -- segments


def replayed(folder: Path) -> tuple[int, dict[str, Any]]:
    done = CliRunner().invoke(command_line.app, ["replay", str(folder), "--json"])
    return done.exit_code, json.loads(done.stdout)


def test_a_record_of_a_hundred_segments_comes_again_and_a_spoilt_one_costs_its_own_ticks(
    bench: RecordedBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Across every seam bit for bit; what is behind the spoilt one is compared as all else is."""
    monkeypatch.setattr(setpoints, "SEGMENT_BYTES", 4 * SETPOINTS.row_bytes)
    bench.request(Request.OVERRIDE, 0.8)
    bench.started(TEXT)
    bench.until(Mode.READY)
    folder = bench.ended()
    segments, live = SETPOINTS.segments(folder), np.array(sent(folder))
    assert len(segments) >= 100 and not list(folder.glob("*.part"))
    code, told = replayed(folder)
    assert (code, told["compared_ticks"], told["spoilt"]) == (0, len(live), [])

    spoilt, late = segments[50], segments[90]
    spoilt.file.write_bytes(spoilt.file.read_bytes()[:-40])
    code, told = replayed(folder)
    assert (code, told["recorded_ticks"], told["compared_ticks"]) == (0, len(live), len(live) - 4)
    (found,) = told["spoilt"]
    assert (found["file"], found["first_tick"], found["end_tick"]) == (spoilt.file.name, 200, 204)
    assert found["at_s"] == 200 * bench.machine.period_s
    said = command.in_words(told)
    assert f"bit for bit: {len(live) - 4} of {len(live)} ticks" in said
    assert f"The segment {spoilt.file.name} cannot be read" in said

    live[late.first + 2, 1] += 1
    edited_records.rewrite_setpoints(folder, live[late.first : late.first + 4], late.first)
    code, told = replayed(folder)
    assert (code, told["tick"], told["axis"]) == (1, late.first + 2, "Y")


def test_a_repetition_keeps_no_more_of_its_rows_than_the_last(bench: RecordedBench) -> None:
    bench.started(TEXT)
    bench.until(Mode.READY)
    record = recorded_runs.whole(bench.ended(), None, None)
    task = checked.task(record.text, record.name, record.machine)
    stepped, run = record.repeat(task, lambda _: None, keep=False)
    assert len(run.rows) == 1 and not stepped.planner.segments
    assert record.judge(run)["compared_ticks"] == len(sent(bench.record.folder))


# -- a record that is not the run


def test_a_setpoint_that_differs_is_told_by_tick_and_axis(bench: RecordedBench) -> None:
    bench.started(TEXT)
    bench.until(Mode.READY)
    folder = bench.ended()
    record, live = events.recorded(folder / "events.jsonl"), SETPOINTS.read(folder)
    assert record is not None and live is not None
    rows = again(folder, TEXT).run.rows
    other = np.array(live)
    other[301, 2] += 3
    other[400, 0] -= 1
    edited_records.rewrite_setpoints(folder, other)
    compared = Comparison(folder, record)
    compared.take(rows)
    line = int(rows[301, COLUMN["line"]])
    assert compared.difference == Difference(301, 2, int(other[301, 2]), int(live[301, 2]), line)


def test_a_record_without_the_overrides_before_the_start_is_another_run(bench: RecordedBench) -> None:
    bench.request(Request.RAPID_OVERRIDE, 0.5)
    bench.started(TEXT)
    bench.until(Mode.READY)
    folder = bench.ended()
    file = folder / "events.jsonl"
    lines = edited_records.lines_of(file)
    others = [line for line in lines if line["request"] != "rapid_override"]
    assert len(others) == len(lines) - 1
    edited_records.rewrite(file, others)
    with pytest.raises(AssertionError):
        again(folder, TEXT)


def simulated(folder: Path, text: str = TEXT) -> tuple[int, dict[str, Any]]:
    """Exit code and figures of ``directrix simulate`` with the record."""
    part = folder.parent / "part.ngc"
    part.write_text(text)
    words = ["simulate", str(part), "--events", str(folder / "events.jsonl"), "--json"]
    done = CliRunner().invoke(command_line.app, words)
    return done.exit_code, json.loads(done.stdout)


def test_the_command_makes_a_faulted_run_again_and_fails_where_the_record_is_of_another_one(
    bench: RecordedBench,
) -> None:
    bench.request(Request.RAPID_OVERRIDE, 0.5)
    bench.started(LONG)
    bench.until_line(5)
    bench.kill()
    bench.request(Request.PLAN_LOST)
    bench.until(Mode.FAULT)
    folder = bench.ended("fault")
    code, told = simulated(folder, LONG)
    assert (code, told["result"], told["fault"]) == (0, "fault", "PLANNER_GONE")
    assert told["recorded_ticks"] == len(sent(folder))
    rows = np.array(sent(folder))
    rows[250, 2] += 2
    edited_records.rewrite_setpoints(folder, rows)
    code, told = simulated(folder, LONG)
    assert (code, told["ok"], told["tick"], told["axis"]) == (1, False, 250, "Z")
    assert "made again the run differs from the recorded one in tick 250 (line" in told["error"]
    assert "mm apart" in told["error"]


def test_a_run_at_another_period_than_the_machine_files_comes_again_at_its_own(tmp_path: Path) -> None:
    bench = RecordedBench(tmp_path, shipped(period_s=0.005))
    bench.started(TEXT)
    bench.until(Mode.READY)
    folder = bench.ended()
    code, told = simulated(folder)
    assert (code, told["period_s"], told["recorded_ticks"]) == (0, 0.005, len(sent(folder)))
