"""The whole tick: enabling, homing, faults, lateness, and the same again bit for bit."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from support.machines.shipped_kinds import machine
from support.machines.tick_bench import Bench, FakeDrive, commands, excess, s_curve, stops, straight
from support.oracles import latched_setpoints

from controller.ipc.handoff import COLUMN, PLANNER_SILENCE_S, STOOD, Arrangement, Law, dwell, send_arrangement
from controller.machine.model import Joints
from controller.state.modes import Fault, Mode, Request
from controller.tick.loop import Loop
from controller.tick.sync_watch import LONG_GAP
from drives.cia402 import Wanted
from drives.cyclic.drive import DriveFault

SILENT = round(PLANNER_SILENCE_S / machine().period_s)  # ticks
HERE: Joints = (0.0, 0.0, 0.0, 0.0, 0.0)
THERE: Joints = (100.0, 60.0, -80.0, 1.0, 2.0)
QUICK = (170.0, 1900.0, 48000.0)  # mm/s ... mm/s^3: there in 0.9 s
SLOW = (25.0, 500.0, 48000.0)  # in 5.7 s


def moving(
    lateness: Callable[[int], float] | None = None,
    ticks: int = 100,
    law: tuple[float, float, float] = QUICK,
    whole: bool = True,
    **changes: object,
) -> Bench:
    """``whole``: the queue has the program's end; else a planner was to go on with it."""
    bench = Bench(machine(**changes), lateness=lateness)
    bench.enable()
    piece, move = straight(HERE, THERE, lambda n: s_curve(n, *law))
    bench.send([piece, dwell(0.0, end=whole)], {0: move}, stops=stops(1900.0, 48000.0))
    bench.tick()
    bench.ask(Request.START)
    bench.tick(ticks)
    return bench


def on_the_line(joints: np.ndarray) -> bool:
    share = joints / np.array(THERE)
    return bool(np.ptp(share, axis=1).max() < 1e-12)


def test_frames_of_a_wrong_length_are_counted_by_drive_in_the_snapshot() -> None:
    bench = Bench()
    bench.enable()
    bench.group.drives[3].malformed = 2
    bench.tick()
    assert bench.snapshot.malformed == (0, 0, 0, 2, 0)
    bench.close()


def test_enabling_takes_the_drives_positions_over_without_a_jump() -> None:
    start = (12.3456, -7.0, 250.0, 0.3, -1.0)
    bench = Bench(start=start)
    bench.enable()
    bench.tick(5)
    assert {setpoints for _, setpoints in bench.group.commands} == {tuple(bench.group.positions)}
    assert bench.cycle.follow.joints == pytest.approx(start, abs=1e-5)
    bench.close()


def test_what_commissioning_found_reaches_drives_spindle_and_the_stop() -> None:
    """A path whose drives take half a second for their own ramp: their torque stays as long."""
    bench = moving()
    bench.group.spindle = FakeDrive()
    units = (1.0, 0.5, 60 / 4096, 2.0, 1e-6)
    send_arrangement(bench.requests, Arrangement(0.5, 60 / 4000, units))
    bench.tick()
    assert tuple(drive.velocity_units for drive in bench.group.drives) == units
    assert bench.group.spindle.velocity_units == 60 / 4000
    bench.group.spindle = None
    bench.cycle.modes.fail(Fault.ESTOP_INPUT, -1)
    bench.tick(249)
    assert bench.group.wanted is Wanted.QUICK_STOP
    bench.tick(3)
    assert bench.group.wanted is Wanted.OFF
    bench.close()


def test_homing_drives_the_bits_and_takes_the_new_position_over() -> None:
    bench = Bench()
    bench.group.drives[1].homing_to = 4000
    bench.ask(Request.HOME, 0b00010)
    bench.until(Mode.HOMING, 2)
    bench.until(Mode.OFF, 20)
    assert bench.snapshot.homed == 0b00010
    bench.enable()
    assert bench.cycle.follow.joints[1] == pytest.approx(4000 / 200_000)
    assert bench.group.drives[1].cyclic
    bench.close()


def test_a_homing_error_names_its_axis() -> None:
    bench = Bench()
    bench.ask(Request.HOME, 0b01100)
    bench.until(Mode.HOMING, 2)
    bench.group.drives[3].homing_error = True
    bench.tick()
    assert (bench.snapshot.fault, bench.snapshot.fault_axis) == (Fault.HOMING_FAILED, 3)
    bench.close()


def ends(bench: Bench, how: str) -> None:
    if how == "silent":
        bench.planner_alive = False
    elif how == "ended":
        bench.end_planner()
    else:  # its socket stays open in the service, which says so
        bench.ask(Request.PLAN_LOST)


ENDS = ("silent", "ended", "told")


@pytest.mark.parametrize("how", ENDS)
def test_without_a_planner_the_queue_is_run_to_its_end_and_the_fault_comes_there(how: str) -> None:
    seed = random.randrange(2**32)
    for at in random.Random(seed).sample(range(5, 1500), 5):
        bench = moving(ticks=at, law=SLOW, whole=False)
        ends(bench, how)
        while not bench.cycle.follow.at_rest:
            assert bench.snapshot.mode is Mode.RUNNING, f"seed {seed} at {at}"
            bench.tick()
        bench.tick(2)
        rows = commands(bench.rows())
        assert (bench.snapshot.mode, bench.snapshot.fault) == (Mode.FAULT, Fault.PLANNER_GONE)
        assert bench.cycle.follow.joints == pytest.approx(THERE) and bench.snapshot.untrusted == 0
        assert on_the_line(rows[5:]), f"seed {seed} at {at}"
        velocity, acceleration, jerk = excess(bench.machine, rows)
        assert velocity <= 1.0 and acceleration <= 1.0 and jerk <= 1.02, f"seed {seed} at {at}"
        bench.close()


@pytest.mark.parametrize("how", ENDS)
def test_a_program_that_is_queued_whole_comes_to_its_end_without_a_planner(how: str) -> None:
    bench = moving(law=SLOW)
    ends(bench, how)
    bench.until(Mode.READY)
    assert bench.snapshot.fault is Fault.NONE and bench.cycle.follow.joints == pytest.approx(THERE)
    bench.close()


@pytest.mark.parametrize("how", ENDS)
def test_hold_and_stop_are_obeyed_on_the_way_to_the_end_of_a_queue_that_nobody_goes_on_with(how: str) -> None:
    for request in (Request.HOLD, Request.STOP):
        bench = moving(law=SLOW, whole=False)
        ends(bench, how)
        bench.tick(50)
        bench.ask(request)
        bench.until_rest()
        assert on_the_line(commands(bench.rows())[5:])
        bench.tick(5)
        wanted = {Request.STOP: Mode.READY, Request.HOLD: Mode.FAULT if how == "told" else Mode.HOLD}
        assert bench.snapshot.mode is wanted[request]
        if request is Request.HOLD:
            bench.ask(Request.RESUME)
            bench.tick(SILENT + 5)
            assert (bench.snapshot.mode, bench.snapshot.fault) == (Mode.FAULT, Fault.PLANNER_GONE)
        bench.close()


def test_a_planner_that_was_silent_in_mid_cut_goes_on_as_if_nothing_had_been() -> None:
    """It hung for longer than the patience, but not for longer than the queue."""
    bench = moving(ticks=10, law=SLOW, whole=False)
    bench.planner_alive = False
    bench.tick(SILENT + 200)
    bench.planner_alive = True
    bench.send([dwell(0.0, end=True)], {})
    bench.until(Mode.READY)
    assert bench.snapshot.fault is Fault.NONE and bench.snapshot.rejected == 0
    bench.close()


def test_a_plan_that_was_lost_in_one_program_is_not_missed_in_the_next() -> None:
    bench = moving(law=SLOW)
    ends(bench, "told")
    bench.until(Mode.READY)
    piece, move = straight(THERE, HERE, lambda n: s_curve(n, *SLOW))
    bench.send([piece, dwell(0.0)], {0: move}, stops=stops(1900.0, 48000.0))
    bench.tick()
    bench.ask(Request.START)
    bench.until_rest()
    bench.tick(SILENT)
    assert bench.snapshot.mode is Mode.RUNNING, "it waits for what comes next"
    bench.close()


def test_a_planner_that_wakes_up_after_the_fault_is_not_listened_to() -> None:
    bench = moving(law=SLOW, whole=False)
    bench.planner_alive = False
    bench.until(Mode.FAULT)
    bench.send([dwell(1.0)], {})
    bench.planner_alive = True
    bench.tick(5)
    assert bench.snapshot.rejected == bench.sequence and bench.snapshot.mode is Mode.FAULT
    bench.close()


def test_a_computer_that_kept_everybody_waiting_is_no_silence_of_the_planner() -> None:
    bench = moving(skip_limit_per_s=1e6)
    late = bench.clock.now_s() + 0.5
    bench.cycle.run(late, 0.0, missed=249)
    assert bench.snapshot.fault is Fault.NONE
    bench.close()


def test_a_queue_outlasts_a_planner_that_is_silent_for_a_second() -> None:
    """What is planned ends at rest by itself: a computer with other work to do loses no cut."""
    bench = moving()
    bench.planner_alive = False
    bench.until(Mode.READY)
    assert bench.snapshot.fault is Fault.NONE and on_the_line(commands(bench.rows())[5:])
    assert bench.cycle.follow.joints == pytest.approx(THERE)
    bench.close()


def test_a_queue_that_ran_dry_waits_for_a_planner_that_lives_only() -> None:
    bench = Bench()
    bench.enable()
    bench.ask(Request.START)
    bench.tick(2 * SILENT)
    assert bench.snapshot.mode is Mode.RUNNING
    bench.planner_alive = False
    bench.until(Mode.FAULT, SILENT + 10)
    assert bench.snapshot.fault is Fault.PLANNER_GONE
    bench.close()


def test_planner_silence_outside_of_a_run_is_no_fault() -> None:
    bench = Bench()
    bench.enable()
    bench.planner_alive = False
    bench.tick(2 * SILENT)
    assert bench.snapshot.fault is Fault.NONE
    bench.close()


@pytest.mark.parametrize(
    ("drive_fault", "fault"),
    (
        (DriveFault.FEEDBACK_LOST, Fault.FEEDBACK_LOST),
        (DriveFault.STATE_LOST, Fault.STATE_LOST),
        (DriveFault.EMCY, Fault.EMCY),
        (DriveFault.HEARTBEAT_LOST, Fault.HEARTBEAT_LOST),
    ),
)
def test_a_lost_drive_stops_the_others_on_the_path_and_then_the_group(
    drive_fault: DriveFault, fault: Fault
) -> None:
    bench = moving()
    bench.rows()
    bench.group.failure = (drive_fault, 2)
    bench.tick()
    assert (bench.snapshot.fault, bench.snapshot.fault_axis) == (fault, 2)
    assert bench.group.drives[2].wanted is Wanted.QUICK_STOP
    assert bench.group.drives[0].wanted is Wanted.ENABLED
    while bench.group.wanted is not Wanted.QUICK_STOP:
        bench.tick()
    rows = commands(bench.rows())[:-1]  # from the quick stop on, commands follow the drives
    assert on_the_line(rows) and max(excess(bench.machine, rows)) <= 1.02
    bench.close()


@pytest.mark.parametrize("drive_fault", (DriveFault.BUS_ERROR, DriveFault.SEND_FAILED))
def test_a_lost_bus_quick_stops_the_group_at_once(drive_fault: DriveFault) -> None:
    bench = moving()
    bench.group.failure = (drive_fault, 0)
    bench.tick()
    assert bench.group.wanted is Wanted.QUICK_STOP and bench.snapshot.mode is Mode.FAULT
    bench.close()


@pytest.mark.parametrize("first", [DriveFault.FEEDBACK_LOST, DriveFault.SEND_FAILED])
def test_a_bus_that_takes_no_sync_comes_to_rest_whatever_was_noticed_first(first: DriveFault) -> None:
    bench = moving()
    bench.group.failure = (first, 0)
    bench.group.sync = lambda now_s: False  # type: ignore[method-assign]
    bench.until(Mode.FAULT, 60)
    bench.until_rest(60)
    bench.tick(3)
    assert bench.snapshot.fault.name == first.name
    assert bench.snapshot.at_rest
    assert bench.group.wanted is Wanted.QUICK_STOP
    bench.close()


def test_a_program_without_motion_waits_for_the_start_and_then_ends() -> None:
    bench = Bench()
    bench.enable()
    bench.send([dwell(0.0)], {})
    bench.tick(3)
    bench.send([dwell(0.0, end=True)], {})
    bench.tick(3)
    bench.ask(Request.START)
    bench.rows()
    bench.tick(2)
    assert bench.snapshot.mode is Mode.READY
    assert bench.rows()[0, COLUMN["rate"]] == 1.0  # all of it in one tick
    bench.ask(Request.START)  # nothing is left: it runs, and waits for pieces
    bench.tick(5)
    assert bench.snapshot.mode is Mode.RUNNING
    bench.close()


@pytest.mark.parametrize(("stop", "then"), [(True, Mode.HOLD), (False, Mode.READY)])
def test_a_mark_reached_while_held_is_still_there_after_resume(stop: bool, then: Mode) -> None:
    bench = Bench()
    bench.enable()
    bench.send([dwell(0.010), dwell(0.0, stop=stop, end=not stop)], {})
    bench.ask(Request.START)
    bench.tick()
    bench.ask(Request.HOLD)
    bench.tick(20)
    assert bench.snapshot.mode is Mode.HOLD
    bench.ask(Request.RESUME)
    bench.until(then, 20)
    bench.close()


def test_a_setpoint_outside_of_travel_is_not_sent() -> None:
    built = machine()
    x = replace(built.axes[0], travel_max=50.0)
    bench = moving(ticks=400, axes=(x, *built.axes[1:]))
    bench.until_rest()
    sent = [setpoints[0] for _, setpoints in bench.group.commands]
    assert bench.snapshot.fault is Fault.TRAVEL and bench.snapshot.fault_axis == 0
    assert max(sent) <= 50.0 * x.counts_per_unit + 1
    bench.close()


def test_a_plan_that_asks_too_much_is_stopped_on_the_path_and_named() -> None:
    bench = Bench()
    bench.enable()
    # A law with a jump of the speed at half way: no axis can do that.
    law = Law((0.0, 0.501, 1.0), ((0, 0, 40.0, 0, 0, 0), (10.0, 200.0, -100.0, 0, 0, 0)))
    piece, move = straight(HERE, THERE, lambda _: law)
    bench.send([piece], {0: move}, stops=stops(1900.0, 48000.0))
    bench.tick()
    bench.ask(Request.START)
    bench.until(Mode.FAULT)
    bench.until_rest()
    rows = commands(bench.rows())
    assert bench.snapshot.fault is Fault.ACCELERATION
    velocity, acceleration, _ = excess(bench.machine, rows)
    assert on_the_line(rows[4:]) and velocity <= 1.0 and acceleration <= 1.001
    bench.close()


def test_an_emergency_stop_wants_a_quick_stop_in_the_next_tick() -> None:
    bench = moving()
    bench.ask(Request.ESTOP)
    bench.tick()
    assert bench.group.wanted is Wanted.QUICK_STOP and bench.snapshot.fault is Fault.EMERGENCY_STOP
    bench.ask(Request.RESET)
    bench.tick()
    assert bench.snapshot.mode is Mode.OFF
    bench.group.failure = (DriveFault.NONE, -1)
    bench.enable()
    bench.close()


def late_once(at: int, seconds: float) -> Callable[[int], float]:
    return lambda n: seconds if n == at else 0.0


@pytest.mark.parametrize("share", (0.1, 0.2, 0.25, 0.3, 0.5, 0.75, 0.9, 1.0, 1.1, 1.3, 2.0, 2.9, 3.5, 5.0))
def test_a_late_tick_never_brings_syncs_closer_nor_doubles_a_step(share: float) -> None:
    T = 0.002
    bench = moving(late_once(60, share * T), ticks=200)
    intervals = np.diff(bench.group.syncs)
    assert intervals.min() >= 0.75 * T - 1e-9
    rows = bench.rows()
    assert max(latched_setpoints.most(rows, bench.machine)[:2]) <= 1.0 + 1e-9
    assert len(bench.group.syncs) == np.count_nonzero(rows[:, COLUMN["sync_sent"]])
    assert bench.snapshot.fault is Fault.NONE
    skipped = 0 if share < 0.25 else int(share) + (share % 1.0 >= 0.25)
    stood = rows[:, COLUMN["switches"]] == STOOD
    assert stood.any() == (skipped >= LONG_GAP)
    # The tick that has the path stand sends no SYNC either.
    assert bench.snapshot.skips == skipped + stood.any()
    bench.close()


def test_setpoints_leave_only_in_ticks_that_sent_a_sync_or_took_the_last_ones_back() -> None:
    rng = random.Random(5)
    delays = [rng.choice((0.0, 0.0, 0.0, rng.uniform(0.0, 0.01))) for _ in range(500)]
    bench = moving(lambda n: delays[n % 500], ticks=300, skip_limit_per_s=1e9)
    rows = bench.rows()
    stood = int(np.count_nonzero(rows[:, COLUMN["switches"]] == STOOD))
    assert stood and len(bench.group.commands) == len(bench.group.syncs) + stood
    assert {at for at, _ in bench.group.commands} > set(bench.group.syncs)
    assert np.diff(bench.group.syncs).min() >= 0.75 * 0.002 - 1e-9
    assert max(latched_setpoints.most(rows, bench.machine)[:2]) <= 1.0 + 1e-9
    bench.close()


def test_too_many_skips_stop_the_tool_on_the_path() -> None:
    bench = moving(lambda n: 0.001 if n > 60 and n % 5 == 0 else 0.0, ticks=200)
    bench.until_rest()
    rows = commands(bench.rows())
    assert bench.snapshot.fault is Fault.TOO_MANY_SKIPS
    assert on_the_line(rows[5:]) and max(excess(bench.machine, rows)) <= 1.02
    bench.close()


def test_late_ticks_that_are_only_counted_stop_nothing() -> None:
    bench = moving(lambda n: 0.001 if n > 60 and n % 5 == 0 else 0.0, ticks=200, late="count")
    bench.until(Mode.READY)
    assert bench.snapshot.fault is Fault.NONE and bench.snapshot.skips > 25
    assert bench.cycle.follow.joints == pytest.approx(THERE)
    bench.close()


def test_the_same_events_give_the_same_setpoints_bit_for_bit() -> None:
    def once() -> bytes:
        bench = moving(lambda n: 0.0012 if n == 77 else 0.0, ticks=120)
        bench.ask(Request.OVERRIDE, 0.37)
        bench.tick(60)
        bench.ask(Request.HOLD)
        bench.tick(80)
        bench.ask(Request.STOP)
        bench.until(Mode.READY)
        rows: bytes = bench.rows().tobytes()
        bench.close()
        return rows

    assert once() == once()


def test_an_error_of_our_own_stops_the_drives_and_is_named() -> None:
    bench = moving()

    def broken() -> None:
        raise ZeroDivisionError

    bench.clock.steppers.append(lambda now: None)
    bench.cycle._requests.take = broken  # type: ignore[assignment]
    assert bench.loop.run(lambda: True) is Fault.INTERNAL
    assert bench.group.wanted is Wanted.QUICK_STOP and bench.snapshot.fault is Fault.INTERNAL
    assert bench.loop.error is not None  # kept, so that the process can say what it was
    bench.close()


@pytest.mark.parametrize(
    "eased, period_s, spins_at_rest",
    [(True, 0.002, False), (True, 0.001, True), (False, 0.002, True)],
    ids=["simulated drives", "at a period in which a late wake-up would cost SYNCs", "drives on a real bus"],
)
def test_only_at_rest_and_before_simulated_drives_the_deadline_is_slept_up_to(
    eased: bool, period_s: float, spins_at_rest: bool
) -> None:
    bench = Bench(machine(period_s=period_s))
    bench.loop = Loop(bench.cycle, bench.clock, eased=eased)
    early_s: list[float] = []
    wake = bench.clock.wake

    def woken(deadline_s: float, before_s: float) -> None:
        early_s.append(before_s)
        wake(deadline_s, before_s)

    bench.clock.wake = woken  # type: ignore[method-assign]
    bench.enable()
    piece, move = straight(HERE, THERE, lambda n: s_curve(n, *QUICK))
    bench.send([piece, dwell(0.0, end=True)], {0: move}, stops=stops(1900.0, 48000.0))
    bench.tick(2)
    assert (early_s[-1] > 0.0) is spins_at_rest
    bench.ask(Request.START)
    bench.tick(2)
    assert early_s[-1] > 0.0, "on the path SYNC is spun for"
    bench.tick(100)
    bench.ask(Request.HOLD)
    bench.tick(2)
    assert early_s[-1] > 0.0, "it is not at rest yet"
    bench.tick(round(2.0 / period_s))
    assert bench.snapshot.mode is Mode.HOLD and (early_s[-1] > 0.0) is spins_at_rest
    bench.close()


def test_a_tick_that_is_said_again_sends_and_leaves_what_the_last_one_did() -> None:
    bench = Bench(machine())
    bench.enable()
    bench.tick(3)
    assert bench.cycle.idle
    before, n = bench.snapshot, len(bench.group.commands)
    bench.rows()
    for k in range(1, 5):
        bench.cycle.repeat(bench.clock.now_s() + k * 0.002)
    assert bench.group.commands[n:] == [
        (pytest.approx(bench.clock.now_s() + k * 0.002), bench.group.commands[n - 1][1]) for k in range(1, 5)
    ]
    rows = bench.rows()
    assert rows[:, COLUMN["tick"]].tolist() == [before.tick + k for k in range(1, 5)]
    assert (rows[:, 1:] == rows[0, 1:]).all() and rows[0, COLUMN["sync_sent"]] == 1.0
    assert bench.snapshot == before._replace(tick=before.tick + 4)
    bench.tick()
    assert bench.snapshot.tick == before.tick + 5 and bench.snapshot.skips == before.skips
    bench.close()


def test_a_sync_that_the_bus_does_not_take_ahead_is_told_as_any_other() -> None:
    bench = Bench(machine())
    bench.enable()
    bench.tick(3)
    skips, sync = bench.snapshot.skips, bench.group.sync
    bench.rows()
    for taken in (True, False, False, True, True):
        bench.group.sync = sync if taken else lambda now_s: False  # type: ignore[method-assign]
        bench.cycle.repeat(bench.clock.now_s() + 0.002)
    rows = bench.rows()
    assert rows[:, COLUMN["sync_sent"]].tolist() == [1.0, 0.0, 0.0, 1.0, 1.0]
    assert bench.snapshot.skips == skips + 2
    bench.close()


def test_time_that_was_only_said_again_counts_for_what_waits() -> None:
    bench, seen = Bench(machine()), []
    bench.enable()
    progress = bench.cycle.modes.progress
    bench.cycle.modes.progress = lambda ticks, rests: seen.append(ticks) or progress(ticks, rests)  # type: ignore[method-assign,func-returns-value]
    for repeats in (0, 4, 0):
        bench.tick()
        for k in range(1, repeats + 1):
            bench.cycle.repeat(bench.clock.now_s() + k * 0.002)
    assert seen == [1, 1, 5]
    bench.close()


@pytest.mark.parametrize("asked", [Request.START, Request.OVERRIDE, Request.OPTIONAL_STOP, Request.ESTOP])
def test_a_tick_in_which_something_is_asked_is_not_idle(asked: Request) -> None:
    bench = Bench(machine())
    bench.tick()
    assert bench.cycle.idle, "off, and nothing to do"
    bench.enable()
    bench.tick(3)
    assert bench.cycle.idle
    bench.ask(asked, 1.0)
    bench.tick()
    assert not bench.cycle.idle
    bench.close()
