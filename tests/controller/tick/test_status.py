"""What a tick tells of itself: what is under the clock, how far a stopped axis is off, how full a bus is."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest
from support.machines.shipped_kinds import machine
from support.machines.tick_bench import Bench, s_curve, stops, straight

from controller.ipc.handoff import COLUMN, Jog, dwell
from controller.motion.pieces import STANDSTILL
from controller.state.modes import Fault, Mode, Request
from controller.tick.status_publisher import StatusPublisher, _timed
from drives.cyclic.drive import DriveFault

HERE = (0.0, 0.0, 0.0, 0.0, 0.0)
THERE = (100.0, 60.0, -80.0, 1.0, 2.0)


def started(cutting: bool) -> Bench:
    bench = Bench()
    bench.enable()
    piece, move = straight(HERE, THERE, lambda n: s_curve(n, 170.0, 1900.0, 48000.0), 7, cutting=cutting)
    bench.send([piece, dwell(0.0, end=True)], {7: move}, stops=stops(1900.0, 48000.0))
    bench.tick()
    bench.ask(Request.START)
    bench.tick(50)
    return bench


def test_before_anything_is_planned_nothing_is_cut_and_nothing_is_under_the_clock() -> None:
    bench = Bench()
    bench.tick()
    told = bench.snapshot
    assert (told.motion_id, told.cutting, told.fault_off, told.bus_share) == (STANDSTILL, 0, 0.0, 0.0)
    bench.close()


def test_before_the_first_tick_it_tells_of_nothing() -> None:
    bench = Bench()
    status: StatusPublisher = bench.cycle._status
    assert (status.motion_id, status.cutting, status.fault_off, status.bus_share) == (
        -1,
        False,
        0.0,
        0.0,
    )
    bench.close()


@pytest.mark.parametrize("cutting", [False, True])
def test_what_is_under_the_clock_is_told_with_whether_it_cuts(cutting: bool) -> None:
    bench = started(cutting)
    assert bench.snapshot.motion_id == 7 and bool(bench.snapshot.cutting) is cutting
    bench.close()


def test_a_jog_out_of_a_cut_does_not_cut() -> None:
    bench = started(cutting=True)
    bench.ask(Request.HOLD)
    bench.until_rest()
    bench.tick(2)
    assert bench.snapshot.cutting
    bench.jog(Jog((1.0, 0.0, 0.0, 0.0, 0.0), 5.0, 1.0))
    bench.until(Mode.JOG, 5)
    bench.tick(2)
    assert bench.cycle.jogging.active and not bench.snapshot.cutting
    bench.close()


# ---- how far a stopped axis is off


@pytest.mark.parametrize("axis", [0, 3])
def test_an_axis_that_left_its_command_is_told_with_how_far_it_is_off_it(axis: int) -> None:
    bench = started(cutting=True)
    per_unit = bench.machine.axes[axis].counts_per_unit
    bench.group.drives[axis].following_error = SimpleNamespace(actual=round(0.25 * per_unit), early=False)
    bench.group.failure = (DriveFault.FOLLOWING_ERROR, axis)
    bench.tick()
    assert (bench.snapshot.fault, bench.snapshot.fault_axis) == (Fault.FOLLOWING_ERROR, axis)
    assert bench.snapshot.fault_off == pytest.approx(0.25, rel=1e-4)
    bench.close()


def test_for_another_fault_and_for_no_axis_nothing_is_off() -> None:
    bench = started(cutting=True)
    for drive in bench.group.drives:
        drive.following_error = SimpleNamespace(actual=1000, early=False)
    bench.tick()
    assert bench.snapshot.fault_off == 0.0
    bench.group.failure = (DriveFault.FEEDBACK_LOST, 1)
    bench.tick()
    assert bench.snapshot.fault is not Fault.NONE and bench.snapshot.fault_axis == 1
    assert bench.snapshot.fault_off == 0.0
    bench.close()


# ---- how full the buses are


def buses(bench: Bench, *rates: int) -> list[SimpleNamespace]:
    """Buses of these bit rates (0: frames take no time), in the order of the machine file."""
    plain = bench.machine.buses[0]
    made = replace(
        bench.machine, buses=tuple(replace(plain, name=f"b{i}", bit_rate=r) for i, r in enumerate(rates))
    )
    lines = [SimpleNamespace(bus=bus.name, bits=0, lost=0) for bus in made.buses]
    bench.cycle._status._buses = _timed(made, lines)
    return lines


def test_the_fullest_bus_is_told_as_a_share_of_the_period_and_counted_anew_with_each_row() -> None:
    bench = Bench(machine(period_s=0.002))
    slow, fast = buses(bench, 500_000, 1_000_000)
    for bits, told in (((250, 100), 0.25), ((100, 900), 0.45), ((0, 0), 0.0), ((0, 1), 0.0005)):
        slow.bits, fast.bits = bits
        bench.tick()
        assert bench.snapshot.bus_share == pytest.approx(told)
        assert bench.rows()[-1, COLUMN["bus_share"]] == pytest.approx(told)
        assert slow.bits == fast.bits == 0
    bench.close()


def test_a_bus_without_bit_timing_is_never_full() -> None:
    bench = Bench(machine(period_s=0.002))
    virtual, real = buses(bench, 0, 1_000_000)
    virtual.bits, real.bits = 10**6, 200
    bench.tick()
    assert bench.snapshot.bus_share == pytest.approx(0.1)
    bench.close()
