"""The rooms of a tick as they are put together: each is told what it needs of the others; the row."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest
from support.machines.shipped_kinds import machine as make_machine
from support.machines.tick_bench import Bench, s_curve, straight

from controller.commands.table import SWITCHED
from controller.ipc.handoff import (
    COLUMN,
    OFF_PATH,
    Jog,
    Outcome,
    Piece,
    dwell,
)
from controller.machine.model import Clamp, Io, Machine, Spindle
from controller.state.modes import Fault, Mode, Request

HERE = (0.0, 0.0, 0.0, 0.0, 0.0)
THERE = (100.0, 60.0, -80.0, 1.0, 2.0)
AIR = 1 << 1


class Turning:
    """At speed at once, until the test says otherwise; noted is every speed it was told."""

    def __init__(self) -> None:
        self.rev_min, self.at_speed, self.turns, self.unheard, self.load = 0.0, True, 0.0, 0, 0.0
        self.told: list[float] = []

    def want_speed(self, rev_min: float) -> None:
        self.rev_min = rev_min
        self.told.append(rev_min)


class Node:
    """Of a machine whose clamp of the first axis never opens."""

    inputs, outputs = 1, 0

    def fresh(self, now_s: float, consumer_s: float) -> bool:
        return True

    def write(self, outputs: int) -> None:
        self.outputs = outputs


def equipped() -> Machine:
    """A spindle, an output of programs and a clamp on X."""
    built = make_machine()
    axes = (replace(built.axes[0], clamp=Clamp("x_open", "x_closed", 0.05)), *built.axes[1:])
    io = Io("main", 11, "", (("x_closed", 0),), (("x_open", 0), ("air", 1)), digital_out=("air",))
    spindle = Spindle(24000.0, "drive", bus="main", node=10, counts_per_rev=4096.0, spin_up_s=0.2)
    return replace(built, axes=axes, io=io, spindle=spindle)


class Shop(Bench):
    def __init__(self) -> None:
        self.turning, self.node = Turning(), Node()
        super().__init__(equipped(), spindle=self.turning, io=(self.node,))

    def start(self, *pieces: Piece) -> None:
        _, move = straight(HERE, THERE, lambda n: s_curve(n, 170.0, 1900.0, 48000.0))
        self.enable()
        self.send([*pieces, dwell(0.0, end=True)], {0: move})
        self.tick()
        self.ask(Request.START)
        self.tick()


def piece_of(**more: object) -> Piece:
    return straight(HERE, THERE, lambda n: s_curve(n, 170.0, 1900.0, 48000.0), **more)[0]


# ---- who knows whom


def test_one_tie_to_the_spindle_is_the_paths_the_peripherals_and_the_ticks() -> None:
    shop = Shop()
    tie = shop.cycle.coupling
    assert shop.cycle.follow.coupling is tie
    shop.turning.at_speed = False
    assert not shop.cycle.peripherals.at_speed
    tie.active = True
    assert shop.cycle.peripherals.at_speed, "the path leads it"
    shop.close()


def test_the_tie_goes_by_the_lag_that_the_drives_of_its_axes_show() -> None:
    """Along Z by that of Z alone."""
    shop = Shop()
    for drive, lag_s in zip(shop.group.drives, (0.5, 0.5, 0.01, 0.5, 0.5), strict=True):
        drive.following_error = SimpleNamespace(lag_s=lag_s, actual=0, early=False)  # type: ignore[assignment]
    along_z = SimpleNamespace(direction=(0.0, 0.0, -1.0))
    assert shop.cycle.coupling._axes_lag_s(along_z) == 0.01  # type: ignore[arg-type]
    shop.close()


# ---- the row


@pytest.mark.parametrize("single", [False, True])
@pytest.mark.parametrize("optional", [False, True])
@pytest.mark.parametrize("adaptive", [False, True])
def test_the_row_has_the_operators_switches_bit_by_bit(single: bool, optional: bool, adaptive: bool) -> None:
    bench = Bench()
    bench.enable()
    modes = bench.cycle.modes
    for request, on in zip(SWITCHED, (single, optional, adaptive), strict=True):
        assert modes.request(request, float(on), standing=True)
    assert (modes.single_block, modes.optional_stop, modes.adaptive_feed) == (single, optional, adaptive)
    bench.rows()
    bench.tick()
    told = 1 * single + 2 * optional + 64 * adaptive  # as recordings of years ago have them
    assert bench.rows()[-1, COLUMN["switches"]] == told
    bench.ask(Request.ESTOP)
    bench.tick(400)
    assert int(bench.rows()[-1, COLUMN["switches"]]) == told + OFF_PATH
    bench.close()


def test_the_row_has_the_number_of_a_request_in_the_tick_that_took_it_and_in_no_other() -> None:
    bench = Bench()
    bench.tick(3)
    assert bench.cycle.taken == 0
    bench.ask(Request.ENABLE)
    bench.tick()
    assert bench.cycle.taken == bench.asked
    bench.tick()
    assert bench.cycle.taken == 0
    bench.close()


def test_a_commissioning_that_says_nothing_is_refused() -> None:
    bench = Bench()
    bench.enable()
    assert bench.cycle._arrange(None) is False
    bench.close()


# ---- the program


def test_an_override_of_the_spindle_does_not_count_under_m49() -> None:
    told = []
    for own in (False, True):
        shop = Shop()
        speed = Piece(-1, 1, dwell(0.0).law, 0.0, sets=True, spindle_rev_min=6000.0)
        shop.start(speed, piece_of(own_feed=own))
        shop.tick(20)
        shop.ask(Request.SPINDLE_OVERRIDE, 1.2)
        shop.tick(3)
        assert shop.snapshot.mode is Mode.RUNNING
        told.append(shop.turning.rev_min)
        shop.close()
    assert told == [7200.0, 6000.0]


def test_outputs_at_a_place_in_the_path_change_while_the_program_runs_and_not_before() -> None:
    shop = Shop()
    shop.enable()
    piece, move = straight(HERE, THERE, lambda n: s_curve(n, 170.0, 1900.0, 48000.0), outputs=(1, 0, ()))
    shop.send([piece, dwell(0.0, end=True)], {0: move})
    shop.tick(5)
    assert not shop.node.outputs & AIR
    shop.ask(Request.START)
    shop.tick(15)
    assert shop.node.outputs & AIR
    shop.close()


def test_a_block_ends_without_a_halt_unless_the_operator_asks_for_one_or_the_planner_is_to_end() -> None:
    for single in (False, True):
        shop = Shop()
        shop.start(dwell(0.02)._replace(block_end=True), dwell(1.0))
        shop.ask(Request.SINGLE_BLOCK, float(single))
        shop.tick(30)
        assert shop.snapshot.mode is (Mode.HOLD if single else Mode.RUNNING)
        shop.close()


# ---- a clamp that does not open, of the first axis


def outcome(shop: Shop) -> Outcome:
    return shop.snapshot.came_of(shop.asked)[0]


def test_homing_under_a_clamp_that_does_not_open_is_a_fault_of_its_axis() -> None:
    shop = Shop()
    shop.ask(Request.HOME, 1)
    shop.tick(20)
    assert outcome(shop) is Outcome.NONE and shop.snapshot.fault is Fault.NONE, "it is waited for"
    shop.tick(20)
    assert (shop.snapshot.fault, shop.snapshot.fault_axis) == (Fault.CLAMP, 0)
    assert outcome(shop) is Outcome.REFUSED and shop.snapshot.homed == 0
    shop.close()


def test_a_jog_under_a_clamp_that_does_not_open_is_a_fault_of_its_axis() -> None:
    shop = Shop()
    shop.enable()
    shop.jog(Jog((1.0, 0.0, 0.0, 0.0, 0.0), 20.0, 2.0))
    shop.tick(20)
    assert shop.snapshot.fault is Fault.NONE and shop.cycle.follow.joints[0] == 0.0
    shop.tick(20)
    assert (shop.snapshot.fault, shop.snapshot.fault_axis) == (Fault.CLAMP, 0)
    shop.close()
