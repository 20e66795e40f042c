"""Ticks that miss so many SYNCs that the drives stand meanwhile: what comes after begins from rest."""

from __future__ import annotations

import math

import numpy as np
import pytest
from support.machines.shipped_kinds import machine
from support.machines.tick_bench import Bench, rest_of, s_curve, stops, straight
from support.oracles import latched_setpoints

from controller.ipc.handoff import COLUMN, STOOD, Jog, dwell, send_jog
from controller.machine.model import Joints
from controller.state.modes import Fault, Mode, Request
from controller.tick.sync_watch import LONG_GAP
from drives.cyclic.drive import DriveFault

HERE: Joints = (0.0, 0.0, 0.0, 0.0, 0.0)
THERE: Joints = (100.0, 60.0, -80.0, 1.0, 2.0)
T = 0.002
AT = 80  # the wait that ends late
GAPS_S = [0.0113, 0.05, 0.5]  # X does 120 mm/s there: half of that is lost after 10 ms


def late(seconds: float, **changes: object) -> tuple[Bench, list[float]]:
    left = [seconds]
    bench = Bench(machine(skip_limit_per_s=1e9, **changes), lateness=lambda n: left.pop() if n == AT else 0.0)
    return bench, left


def gapped(seconds: float, **changes: object) -> tuple[Bench, object, object]:
    """A move with a gap in its middle; the bench, its piece and its motion."""
    bench, left = late(seconds, **changes)
    bench.enable()
    piece, move = straight(HERE, THERE, lambda n: s_curve(n, 170.0, 1900.0, 48000.0))
    bench.send([piece, dwell(0.0, end=True)], {0: move}, stops=stops(1900.0, 48000.0))
    bench.tick()
    bench.ask(Request.START)
    while left:
        bench.tick()
    return bench, piece, move


@pytest.mark.parametrize("gap_s", GAPS_S)
def test_after_a_long_gap_the_path_stands_where_the_drives_stand(gap_s: float) -> None:
    bench, _, _ = gapped(gap_s)
    stood_at = tuple(drive.position for drive in bench.group.drives)
    epoch = bench.snapshot.epoch
    bench.tick(3)
    rows = bench.rows()
    assert tuple(bench.group.commands[-1][1]) == stood_at
    assert tuple(drive.position for drive in bench.group.drives) == stood_at
    assert np.count_nonzero(rows[:, COLUMN["switches"]] == STOOD) == 1
    assert bench.snapshot.at_rest and bench.snapshot.epoch == epoch + 1
    assert (bench.snapshot.mode, bench.snapshot.fault) == (Mode.RUNNING, Fault.NONE)
    bench.close()


@pytest.mark.parametrize("gap_s", GAPS_S)
def test_what_is_planned_from_there_begins_from_rest_and_comes_to_the_end(gap_s: float) -> None:
    bench, piece, move = gapped(gap_s)
    bench.tick(3)
    rest = rest_of(piece, bench.snapshot.s, 170.0, 1900.0, 48000.0)
    bench.send([rest, dwell(0.0, end=True)], {0: move}, stops=stops(1900.0, 48000.0))
    bench.until(Mode.READY)
    rows = bench.rows()
    assert bench.snapshot.joints == pytest.approx(THERE)
    assert len(latched_setpoints.parts(rows)) == 2
    assert max(latched_setpoints.most(rows, bench.machine)) <= 1.02
    bench.close()


@pytest.mark.parametrize("skipped", [LONG_GAP - 1, LONG_GAP])
def test_a_shorter_gap_goes_on_where_it_was(skipped: int) -> None:
    bench, _, _ = gapped(skipped * T)
    epoch = bench.snapshot.epoch
    bench.until(Mode.READY)
    assert bench.snapshot.epoch == epoch and not (bench.rows()[:, COLUMN["switches"]] == STOOD).any()
    bench.close()


@pytest.mark.parametrize("after", range(1, 40, 6))
def test_a_gap_within_a_stop_ends_the_stop(after: int) -> None:
    left = [0.05]
    bench = Bench(machine(), lateness=lambda n: left.pop() if n == AT and left else 0.0)
    bench.enable()
    piece, move = straight(HERE, THERE, lambda n: s_curve(n, 170.0, 1900.0, 48000.0))
    bench.send([piece, dwell(0.0, end=True)], {0: move}, stops=stops(1900.0, 48000.0))
    bench.tick()
    bench.ask(Request.START)
    bench.tick(AT - after - bench.clock.waits)
    bench.ask(Request.HOLD)
    while left:
        bench.tick()
    stood_at = tuple(drive.position for drive in bench.group.drives)
    bench.tick(3)
    assert (bench.snapshot.mode, bench.snapshot.at_rest) == (Mode.HOLD, True)
    assert tuple(drive.position for drive in bench.group.drives) == stood_at
    assert not bench.snapshot.stopping and bench.snapshot.motion_id == 0
    rest = rest_of(piece, bench.snapshot.s, 170.0, 1900.0, 48000.0)
    bench.send([rest, dwell(0.0, end=True)], {0: move}, stops=stops(1900.0, 48000.0))
    bench.ask(Request.RESUME)
    bench.until(Mode.READY)
    assert bench.snapshot.joints == pytest.approx(THERE)
    assert max(latched_setpoints.most(bench.rows(), bench.machine)) <= 1.02
    bench.close()


def test_a_gap_at_rest_changes_nothing() -> None:
    bench, left = late(0.05)
    bench.enable()
    while left:
        bench.tick()
    bench.tick(3)
    assert (bench.snapshot.mode, bench.snapshot.epoch) == (Mode.READY, 0)
    assert not (bench.rows()[:, COLUMN["switches"]] == STOOD).any()
    bench.close()


def test_a_jog_goes_on_from_rest_to_where_it_was_to_end() -> None:
    bench, left = late(0.05)
    bench.cycle.modes.homed = 0x1F
    bench.enable()
    bench.tick(AT - 20 - bench.clock.waits)
    send_jog(bench.requests, Jog((0.0, 1.0, 0.0, 0.0, 0.0), 100.0, 12.0))
    while left:
        bench.tick()
    stood_at = bench.group.drives[1].position
    assert stood_at
    bench.tick()
    assert bench.group.drives[1].position == stood_at
    bench.until(Mode.READY)
    assert bench.snapshot.joints[1] == pytest.approx(12.0)
    rows = bench.rows()
    assert (
        len(latched_setpoints.parts(rows)) == 2 and max(latched_setpoints.most(rows, bench.machine)) <= 1.02
    )
    bench.close()


def test_a_jog_without_end_is_over_when_its_order_is_too_old() -> None:
    bench, left = late(0.5)
    bench.cycle.modes.homed = 0x1F
    bench.enable()
    bench.tick(AT - 20 - bench.clock.waits)
    send_jog(bench.requests, Jog((0.0, 1.0, 0.0, 0.0, 0.0), 100.0, math.inf))
    while left:
        bench.tick()
    bench.until(Mode.READY, 10)
    bench.close()


@pytest.mark.parametrize("silent_s", [0.05, 0.5])
def test_drives_that_missed_our_heartbeat_are_not_what_is_at_fault(silent_s: float) -> None:
    bench, left = late(silent_s)
    bench.enable()
    while len(left):
        bench.tick()
        if bench.clock.waits == AT:
            bench.group.failure = (DriveFault.EMCY, 2)
    named = Fault.TOO_MANY_SKIPS if silent_s > 0.2 else Fault.EMCY
    assert (bench.snapshot.mode, bench.snapshot.fault) == (Mode.FAULT, named)
    assert bench.snapshot.untrusted == 1 << 2
    bench.close()
